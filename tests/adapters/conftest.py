"""Fixtures for the tests of several adapters."""

from collections.abc import Iterator

import jax
import pytest


@pytest.fixture
def partner_promotion() -> Iterator[None]:
    """JAX's own promotion of dtypes and ranks, which partners rely on; ours keeps to strict."""
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        yield
