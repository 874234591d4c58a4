"""Programs that show where the time of a step goes: frames alone, and frames kept."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxenstein.speed.random_rollout import make_random_rollout


def make_frames(env: Any, params: Any, steps: int) -> jax.stages.Wrapped:
    """A program that draws `steps` frames of each state of a batch, and does nothing else.

    One pixel of each frame turns and moves the next one's eye a little, so that nothing can be
    computed once for all frames, and no frame be left out. The carry is a batch of states, their
    observations, and their positions.
    """
    draw = jax.vmap(lambda state: env.observe(state, params))

    def turn(carry: Any, _: None) -> tuple[Any, None]:
        state, obs, place = carry
        pixel = jnp.stack([_middle(leaf) for leaf in jax.tree.leaves(obs)]).sum(0) / 255
        heading = (state.heading + 0.1 + 0.01 * pixel) % (2 * np.float32(np.pi))
        state = state.replace(heading=heading, position=place + 1e-4 * pixel[:, None])
        return (state, draw(state), place), None

    def frames(carry: Any) -> Any:
        return jax.lax.scan(turn, carry, length=steps)[0]

    return jax.jit(frames, donate_argnums=0)


def _middle(leaf: jax.Array) -> jax.Array:
    return leaf[:, *(size // 2 for size in leaf.shape[1:])].astype(jnp.float32)


def make_keeping_rollout(
    env: Any, params: Any, batch: int, steps: int
) -> tuple[jax.stages.Wrapped, Any]:
    """The rollout of `make_random_rollout` that also keeps every frame, as training does.

    Frames go into a buffer that the program is given, writes into and gives back. The policy reads
    them there: a frame that is carried as well would be painted twice, once for each place.

    Returns:
        `(rollout, start)`: of a carry, and of a random key. The carry is a `RolloutCarry` without
        observations and the buffer of them, with leading axes [steps, batch].
    """
    once, first = make_random_rollout(env, params, batch, 1)

    def start(key: jax.Array) -> Any:
        carry = first(key)
        room = jax.tree.map(
            lambda obs: jnp.zeros((steps, *obs.shape), obs.dtype).at[-1].set(obs), carry.obs
        )
        return carry.replace(obs=None), room

    def step(carry: Any, index: jax.Array) -> tuple[Any, None]:
        inner, kept = carry
        latest = jax.tree.map(
            lambda room: jax.lax.dynamic_index_in_dim(room, (index - 1) % steps, keepdims=False),
            kept,
        )
        inner = once(inner.replace(obs=latest))
        kept = jax.tree.map(
            lambda room, obs: jax.lax.dynamic_update_index_in_dim(room, obs, index, 0),
            kept,
            inner.obs,
        )
        return (inner.replace(obs=None), kept), None

    def rollout(carry: Any) -> Any:
        return jax.lax.scan(step, carry, jnp.arange(steps, dtype=jnp.int32))[0]

    return jax.jit(rollout, donate_argnums=0), start
