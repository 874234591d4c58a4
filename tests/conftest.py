"""Settings shared by all tests."""

import gc
import os
from collections.abc import Iterator
from unittest import mock

import jax
import pytest

from tests.compiled import Programs
from tests.reference.frames import plain_frame

jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")

PROGRAMS = pytest.StashKey[Programs]()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--quick", action="store_true", help="leave out slow tests, and compile without optimising"
    )


def pytest_configure(config: pytest.Config) -> None:
    """Set up JAX's compiler and its cache, for this process and the programs that it starts."""
    if config.getoption("quick"):
        config.option.markexpr = config.option.markexpr or "not (slow or variant or training)"
        compile_quickly()
    # Tracing makes millions of objects, few of them in cycles: a tenth of the time is saved.
    gc.set_threshold(100_000, 50, 50)
    in_charge = config.getoption("numprocesses", None) and "PYTEST_XDIST_WORKER" not in os.environ
    if not in_charge and not os.environ.get("JAX_COMPILATION_CACHE_DIR"):
        config.stash[PROGRAMS] = Programs()
        config.add_cleanup(config.stash[PROGRAMS].close)


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """In each file, run the tests with plain frames last: such frames stay until its end."""
    files = {path: number for number, path in enumerate(dict.fromkeys(item.path for item in items))}
    items.sort(key=lambda item: (files[item.path], _has_plain_frames(item)))


def _has_plain_frames(item: pytest.Item) -> bool:
    return isinstance(item, pytest.Function) and "plain_frames" in item.fixturenames


def compile_quickly() -> None:
    """Compile with few optimisations, which takes half the time."""
    jax.config.update("jax_disable_most_optimizations", True)
    os.environ["JAX_DISABLE_MOST_OPTIMIZATIONS"] = "1"
    # Later versions of JAX do not know this flag, and stop the process.
    if jax.__version_info__ < (0, 11):
        flags = os.environ.get("XLA_FLAGS", "")
        os.environ["XLA_FLAGS"] = f"{flags} --xla_cpu_use_fusion_emitters=false"


@pytest.fixture(autouse=True, scope="module")
def _programs(pytestconfig: pytest.Config) -> Iterator[None]:
    """Share the compiled programs of a file, then drop them: all files together take gigabytes."""
    yield
    jax.clear_caches()
    if PROGRAMS in pytestconfig.stash:
        pytestconfig.stash[PROGRAMS].exchange()


@pytest.fixture(scope="module")
def plain_frames() -> Iterator[None]:
    """Cheap frames, for tests in which the content of frames does not matter.

    They depend on the whole scene and compile at once; frames of the engine take seconds.
    """
    with mock.patch("jaxenstein.tasks.first_person.render", plain_frame):
        yield
