"""Settings shared by all tests."""

import jax
import pytest

jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")


@pytest.fixture(autouse=True, scope="module")
def forget_compiled_programs():
    """Files share few programs, and all of them together would need gigabytes."""
    yield
    jax.clear_caches()
