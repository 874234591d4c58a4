"""A program that only draws frames, for `benchmarks.device`."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

# Doom's angles in a radian.
_ANGLES = np.float32(2**31 / np.pi)


def make_frames(env: Any, params: Any, steps: int) -> jax.stages.Wrapped:
    """A program that draws `steps` frames of each state of a batch, and does nothing else.

    A pixel of each frame turns and moves the eye of the next frame a little (in Doom it only
    turns), so that the compiler can neither share work between frames nor leave out a frame. The
    carry is a batch of states, their observations, and their positions.
    """
    draw = jax.vmap(lambda state: env.observe(state, params))

    def turn(carry: Any, _: None) -> tuple[Any, None]:
        state, obs, place = carry
        pixel = jnp.stack([_middle(leaf) for leaf in jax.tree.leaves(obs)]).sum(0) / 255
        heading = (state.heading + 0.1 + 0.01 * pixel) % (2 * np.float32(np.pi))
        state = state.replace(heading=heading, position=place + 1e-4 * pixel[:, None])
        if hasattr(state, "angle"):
            state = state.replace(angle=(heading * _ANGLES).astype(jnp.uint32))
        return (state, draw(state), place), None

    def frames(carry: Any) -> Any:
        return jax.lax.scan(turn, carry, length=steps)[0]

    return jax.jit(frames, donate_argnums=0)


def _middle(leaf: jax.Array) -> jax.Array:
    return leaf[:, *(size // 2 for size in leaf.shape[1:])].astype(jnp.float32)
