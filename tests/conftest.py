"""Settings shared by all tests."""

from collections.abc import Iterator
from unittest import mock

import jax
import pytest

from tests.reference.frames import plain_frame

jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")


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
