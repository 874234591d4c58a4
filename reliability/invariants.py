"""Invariants of all states and steps of every environment, for any actions."""

from __future__ import annotations

import math
from typing import Any

import jax
import jax.numpy as jnp

# Tolerance for float32 sums of thousands of rewards, relative and absolute.
_CLOSE = 1e-4

Checks = dict[str, jax.Array]


def of_state(env: Any, state: Any, params: Any) -> Checks:
    """The invariants of a state, bool[] by name."""
    scene = env.scene(state, params)
    checks = {
        "every number is finite": _finite(state),
        "the position is inside the map, on an open tile": _on_open_tile(scene, state.position),
        "the heading is from 0 to 2 pi": (state.heading >= 0) & (state.heading < 2 * math.pi),
        "time is from 0 to the limit": (state.time >= 0)
        & (state.time < params.max_steps_in_episode),
        "the episode is not over": ~state.done,
        "sprites have an existing look": _in_range(
            scene.sprites.picture, len(scene.theme.sprite_art)
        ),
    }
    for words, holds in env.about().holds.items():
        checks[words] = holds(state)
    variables, spaces = env.variables(state), env.variable_spaces()
    for name, space in spaces.items():
        value = variables[name]
        checks[f"{name} is in its space"] = jnp.all((value >= space.low) & (value <= space.high))
    return checks


def of_step(env: Any, before: Any, after: Any, outcome: Any, params: Any) -> Checks:
    """The invariants of a step, bool[] by name.

    Args:
        env: the environment, with resets in the same step.
        before: the state before the step.
        after: the state after the step, perhaps of a new episode.
        outcome: reward, terminated, truncated and info of the step.
        params: the params.
    """
    reward, terminated, truncated, info = outcome
    ended = terminated | truncated
    elsewhere = ended | info.get("respawned", jnp.bool_(False))
    walked = jnp.linalg.norm(info["position"] - before.position)
    total = before.episode_return + reward
    checks = {
        "reward and info are finite": _finite((reward, info)),
        "returns add up": jnp.abs(info["episode_return"] - total)
        <= _CLOSE * jnp.maximum(1, jnp.abs(total)),
        "the clock advances by one": info["episode_length"] == before.time + 1,
        "the clock is 0 in a new episode and continues in an old one": after.time
        == jnp.where(ended, 0, before.time + 1),
        "the time limit truncates": truncated
        == (info["episode_length"] >= params.max_steps_in_episode),
        "a step is no longer than the distance": (walked <= env.stride(params) + 1e-4) | elsewhere,
    }
    for name in env.about().lasting:
        lost = jnp.any(getattr(before, name) & ~getattr(after, name))
        checks[f"{name} things stay {name}"] = ~lost | elsewhere
    return checks


def of_observation(obs: Any) -> Checks:
    """The invariants of a depth image, bool[] by name."""
    if obs.dtype != jnp.float32:
        return {}
    return {"depths are finite and above 0": jnp.all(jnp.isfinite(obs) & (obs > 0))}


def _finite(tree: Any) -> jax.Array:
    floats = [x for x in jax.tree.leaves(tree) if jnp.issubdtype(x.dtype, jnp.floating)]
    return jnp.stack([jnp.all(jnp.isfinite(leaf)) for leaf in floats]).all()


def _in_range(values: jax.Array, count: int) -> jax.Array:
    return jnp.all((values >= 0) & (values < count))


def _on_open_tile(scene: Any, position: jax.Array) -> jax.Array:
    """Whether a position is on an open tile, by tile labels and doors, not by occupancy words."""
    level = scene.level
    tiles = jnp.asarray(level.walls)[0]
    doors = jnp.asarray(level.doors)
    column, row = jnp.floor(position).astype(jnp.int32) + level.margin
    inside = (column >= 0) & (column < tiles.shape[1]) & (row >= 0) & (row < tiles.shape[0])
    there = tiles[jnp.clip(row, 0, tiles.shape[0] - 1), jnp.clip(column, 0, tiles.shape[1] - 1)]
    here = (doors[:, 0] == column) & (doors[:, 1] == row)
    shut = jnp.any(here & scene.closed)
    return inside & ~shut & ((there == 0) | jnp.any(here))
