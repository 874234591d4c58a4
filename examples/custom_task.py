"""A task with your own rules: walk to the apple, not to the key.

    python examples/custom_task.py

plays many episodes with an agent that always walks to the western place.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any, ClassVar

import jax
import jax.numpy as jnp

import jaxenstein
from jaxenstein.engine.level import compile_level
from jaxenstein.engine.scene import Scene, Sprites
from jaxenstein.maps.ascii import parse_ascii
from jaxenstein.maps.things import APPLE, KEY
from jaxenstein.tasks.appearance import build_theme
from jaxenstein.tasks.first_person import FirstPerson
from jaxenstein.tasks.steering import ACTION_NAMES, SteeringParams, centres, steer

MAP = parse_ascii("#######\n#.G.G.#\n#.....#\n#.....#\n#..S..#\n#######", "fruit")
LEVEL = compile_level(MAP.walls, MAP.door_tiles)
THEME = build_theme((APPLE.label, KEY.labels[0]), doors=False)
NO_DOORS = jnp.zeros(0, bool)


class FruitParams(SteeringParams):
    """Params, which may differ within a batch; `reach` is the distance that counts, in tiles."""

    max_steps_in_episode: Any = 100
    reach: Any = 0.5


class FruitState(jaxenstein.State):
    """The state, with the place of the apple, int32[]."""

    apple: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class Fruit(FirstPerson[FruitState, FruitParams]):
    """Two things lie in a room: +1 at the apple, -1 at the key."""

    name: str = "fruit"
    params_class: ClassVar[type[jaxenstein.Params]] = FruitParams
    action_names: ClassVar[tuple[str, ...]] = ACTION_NAMES[:3]

    def init_state(self, key: jax.Array, params: FruitParams) -> FruitState:
        """Stand in the south, look north, and sample the apple's place."""
        north, apple = jnp.float32(1.5 * math.pi), jax.random.randint(key, (), 0, 2, jnp.int32)
        return FruitState(position=centres(MAP.spawns)[0], heading=north, apple=apple)

    def transition(self, key: jax.Array, state: FruitState, action: jax.Array, params: FruitParams):
        """Move and check the places; return next state, reward, terminated and events."""
        position, heading = steer(LEVEL, NO_DOORS, state.position, state.heading, action, params)
        there = jnp.hypot(*(centres(MAP.goals) - position[None]).T) < params.reach
        reward = jnp.where(jnp.any(there), jnp.where(there[state.apple], 1.0, -1.0), 0.0)
        return state.replace(position=position, heading=heading), reward, jnp.any(there), {}

    def scene(self, state: FruitState, params: FruitParams) -> Scene:
        """The room with both things."""
        pictures = (jnp.arange(2, dtype=jnp.int32) != state.apple).astype(jnp.int32)
        things = Sprites(centres(MAP.goals), pictures, jnp.ones(2, bool))
        return Scene(LEVEL, NO_DOORS, state.position, state.heading, things, THEME)

    def tilemap_of(self, state: FruitState):
        """Return the map, for pictures from above."""
        return MAP


if __name__ == "__main__":
    env, west = Fruit(), jnp.array([2] * 19 + [0] * 6 + [2] * 19, jnp.int32)
    _, states = jax.vmap(env.reset)(jax.random.split(jax.random.key(0), 64))
    walk = jax.vmap(lambda state: jax.lax.scan(lambda s, a: env.step(jax.random.key(1), s, a)[1:3],
                                               state, west)[1].sum())  # fmt: skip
    print(f"mean return of always going west: {walk(states).mean():+.2f}")
