"""Settings shared by all tests."""

import functools
import os
import shutil
import tempfile
from collections.abc import Iterator
from unittest import mock

import jax
import pytest

from tests.reference.frames import plain_frame

jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")


CACHE = "JAX_COMPILATION_CACHE_DIR"


def pytest_configure(config: pytest.Config) -> None:
    """Let the files that one process tests, and programs that they start, share what they compile.

    Each worker has a folder of its own, since JAX may read what another process is still writing.
    """
    in_charge = config.getoption("numprocesses", None) and "PYTEST_XDIST_WORKER" not in os.environ
    if in_charge or os.environ.get(CACHE):
        return
    folder = tempfile.mkdtemp(prefix="jaxenstein-tests-")
    config.add_cleanup(functools.partial(shutil.rmtree, folder, ignore_errors=True))
    os.environ |= {CACHE: folder, "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0"}
    jax.config.update("jax_compilation_cache_dir", folder)
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)


@pytest.fixture(autouse=True, scope="module")
def _forget_compiled_programs() -> Iterator[None]:
    """Files share hardly any programs; kept to the end, those of all files take gigabytes."""
    yield
    jax.clear_caches()


@pytest.fixture(scope="module")
def plain_frames() -> Iterator[None]:
    """Frames without rays, for tests of what is done with frames rather than of what they show.

    They depend on all that a scene shows, and compile in a moment; the engine's take seconds.
    """
    with mock.patch("jaxenstein.tasks.first_person.render", plain_frame):
        yield
