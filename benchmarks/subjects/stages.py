"""Programs that do one stage of a step at a time, on inputs made before: where the time goes.

The stages are those of `jaxenstein.engine.render`. What is cheap alone can be dear in the whole
and the other way around, since the compiler fuses what stands together; they need not add up.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from jaxenstein.engine import image_columns, pixels, raycast, sprites
from jaxenstein.engine.lines import fixed_lines

# In the order of a step, with what each is.
STAGES: Mapping[str, str] = {
    "keys": "random keys of all environments",
    "rules": "rules, without a reset",
    "aim": "rays: aimed at the grid's lines",
    "march": "rays: marched",
    "look-up": "rays: what they hit",
    "sprites": "sprites: the nearest of each column",
    "columns": "columns: colours, light, the sprites' words",
    "words": "pixels: painted, four bytes each",
    "bytes": "pixels: the fourth byte dropped",
    "pixels": "pixels: painted and dropped at once",
}


def make_stage(env: Any, params: Any, batch: int, name: str) -> tuple[Any, tuple[Any, ...]]:
    """One stage of a step of a batch of environments.

    Args:
        env: an environment with rgb images.
        params: its params.
        batch: how many side by side.
        name: one of `STAGES`.

    Returns:
        The jitted stage, and its arguments.

    Raises:
        ValueError: there is no such stage.
    """
    if name not in STAGES:
        raise ValueError(f"unknown stage: {name!r}; known: {', '.join(STAGES)}")
    keys = jax.random.split(jax.random.key(0), batch)
    _, state = jax.jit(jax.vmap(env.reset, (0, None)))(keys, params)
    ready: dict[str, Any] = {"key": keys, "state": state}
    if name == "keys":
        return jax.jit(partial(jax.random.split, num=batch)), (jax.random.key(0),)
    for stage, (function, takes) in _stages(env, params).items():
        program, given = jax.jit(jax.vmap(function)), tuple(ready[each] for each in takes)
        if stage == name:
            return program, given
        ready[stage] = program(*given)
    raise AssertionError("every stage is above")


def _stages(env: Any, params: Any) -> Mapping[str, tuple[Callable[..., Any], tuple[str, ...]]]:
    """The stages of one environment and what each takes, in an order in which that is there."""
    camera, last = env.camera.widened(), jnp.int32(env.num_actions - 1)

    def scene(state: Any) -> Any:
        return env.scene(state, params)

    def aim(state: Any) -> Any:
        seen = scene(state)
        pose = seen.position, seen.heading, seen.closed, seen.level
        return raycast.aim(*pose, camera, fixed_lines(seen.level))

    def choose(state: Any) -> Any:
        seen = scene(state)
        if not seen.sprites.look.shape[0]:
            return None
        return sprites.choose(
            seen.position, seen.heading, seen.sprites, seen.theme, camera, env.sprite_layers
        )

    def prepare(state: Any, hits: Any, spots: Any) -> Any:
        seen = scene(state)
        return image_columns.prepare(
            seen.heading, hits, spots, theme=seen.theme, camera=camera, kind="rgb"
        )

    def rows(seen: Any) -> pixels.Rows:
        return pixels.paint_rows(seen.theme, camera, "rgb", seen.lift)

    def paint_words(state: Any, prepared: Any) -> Any:
        seen = scene(state)
        return pixels.paint_words(
            seen.position, prepared, rows=rows(seen), theme=seen.theme, camera=camera, kind="rgb"
        )

    def paint(state: Any, prepared: Any) -> Any:
        seen = scene(state)
        return pixels.paint(prepared, rows(seen), seen, camera, "rgb")

    return {
        "rules": (lambda key, state: env.advance(key, state, last, params), ("key", "state")),
        "aim": (aim, ("state",)),
        "march": (raycast.march, ("aim",)),
        "look-up": (
            lambda aims, hits, state: raycast.look_up(aims, hits, scene(state).level),
            ("aim", "march", "state"),
        ),
        "sprites": (choose, ("state",)),
        "columns": (prepare, ("state", "look-up", "sprites")),
        "words": (paint_words, ("state", "columns")),
        "bytes": (
            lambda words: lax.bitcast_convert_type(words, jnp.uint8)[..., :3], ("words",)
        ),
        "pixels": (paint, ("state", "columns")),
    }  # fmt: skip
