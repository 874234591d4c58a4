"""Settings shared by all tests."""

from collections.abc import Iterator

import jax
import pytest

jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")


@pytest.fixture(autouse=True, scope="module")
def _forget_compiled_programs() -> Iterator[None]:
    """Files share hardly any programs; kept to the end, those of all files take gigabytes."""
    yield
    jax.clear_caches()
