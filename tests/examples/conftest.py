"""Examples run with JAX's default settings."""

from collections.abc import Iterator

import jax
import pytest


@pytest.fixture(autouse=True)
def default_jax_settings() -> Iterator[None]:
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        yield
    jax.config.update("jax_cpu_enable_async_dispatch", True)
