"""Programs that do one stage of a step at a time, on inputs made before: where the time goes.

The stages are those of `jaxenstein.engine.render`. What is cheap alone can be dear in the whole
and the other way around, since the compiler fuses what stands together; they need not add up.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from jaxenstein.engine import columns, pixels, raycast, sprites
from jaxenstein.engine.scene import Scene

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
    stages = _Stages(env, params)
    keys = jax.random.split(jax.random.key(0), batch)
    _, state = jax.jit(jax.vmap(env.reset, (0, None)))(keys, params)
    ready: dict[str, Any] = {"key": keys, "state": state}
    if name == "keys":
        return jax.jit(partial(jax.random.split, num=batch)), (jax.random.key(0),)
    # Each stage with what it takes, in an order in which that is there.
    takes = {
        "rules": ("key", "state"),
        "aim": ("state",),
        "march": ("aim",),
        "look-up": ("aim", "march", "state"),
        "sprites": ("state",),
        "columns": ("state", "look-up", "sprites"),
        "words": ("state", "columns"),
        "bytes": ("words",),
        "pixels": ("state", "columns"),
    }
    for stage, names in takes.items():
        function = getattr(stages, stage.replace("-", "_"))
        program, given = jax.jit(jax.vmap(function)), tuple(ready[each] for each in names)
        if stage == name:
            return program, given
        ready[stage] = program(*given)
    raise AssertionError("every stage is above")


@dataclasses.dataclass(frozen=True)
class _Stages:
    """The stages of one environment, each of which takes what the ones before it gave."""

    env: Any
    params: Any

    def scene(self, state: Any) -> Scene:
        return self.env.scene(state, self.params)

    def rules(self, key: jax.Array, state: Any) -> Any:
        return self.env.advance(key, state, jnp.int32(self.env.num_actions - 1), self.params)

    def aim(self, state: Any) -> Any:
        scene = self.scene(state)
        return raycast.aim(
            scene.position, scene.heading, scene.closed, scene.level, self.env.camera.widened()
        )

    def march(self, aims: Any) -> Any:
        return raycast.march(aims)

    def look_up(self, aims: Any, marched: Any, state: Any) -> Any:
        return raycast.look_up(aims, marched, self.scene(state).level)

    def sprites(self, state: Any) -> Any:
        scene = self.scene(state)
        if not scene.sprites.look.shape[0]:
            return None
        return sprites.choose(
            scene.position, scene.heading, scene.sprites, scene.theme,
            self.env.camera.widened(), self.env.sprite_layers,
        )  # fmt: skip

    def columns(self, state: Any, hits: Any, spots: Any) -> Any:
        scene = self.scene(state)
        return columns.prepare(
            scene.heading, hits, spots,
            theme=scene.theme, camera=self.env.camera.widened(), kind="rgb",
        )  # fmt: skip

    def words(self, state: Any, prepared: Any) -> Any:
        scene = self.scene(state)
        return pixels.paint_words(
            scene.position, prepared,
            theme=scene.theme, camera=self.env.camera.widened(), kind="rgb",
        )  # fmt: skip

    def bytes(self, words: jax.Array) -> jax.Array:
        return lax.bitcast_convert_type(words, jnp.uint8)[..., :3]

    def pixels(self, state: Any, prepared: Any) -> Any:
        return pixels.paint(prepared, self.scene(state), self.env.camera.widened(), "rgb")
