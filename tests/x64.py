"""64-bit numbers in any version of JAX, whose switch has moved."""

from __future__ import annotations

from typing import Any

import jax


def enable_x64(on: bool) -> Any:
    """A context with 64-bit numbers enabled or disabled, in any version of JAX."""
    try:
        switch: Any = jax.enable_x64
    except AttributeError:
        import jax.experimental as older

        switch = getattr(older, "enable_x64")  # noqa: B009
    return switch(on)
