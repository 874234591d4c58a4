"""A task with rules of your own: a T-maze in which a memory is needed.

    python examples/custom_task.py

A key is in sight for the first steps. Where it was red, the western arm pays; where it was blue,
the eastern one. An agent that remembers it plays beside one that always goes west.
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
from jaxenstein.maps.things import KEY
from jaxenstein.tasks.appearance import build_theme
from jaxenstein.tasks.first_person import FirstPerson
from jaxenstein.tasks.steering import ACTION_NAMES, SteeringParams, centres, steer

MAP = parse_ascii("#########\n#G.....G#\n####.####\n####.####\n####S####\n#########", "t-maze")
LEVEL = compile_level(MAP.walls, MAP.door_tiles)
THEME = build_theme((KEY.labels[0], KEY.labels[2]), doors=False)  # red and blue


class TMazeParams(SteeringParams):
    """Numbers, which may differ within a batch: for how many steps the key is in sight."""

    max_steps_in_episode: Any = 100
    cue_steps: Any = 10


class TMazeState(jaxenstein.State):
    """What the task keeps beside position, heading and time: the arm that pays, int32[]."""

    arm: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class TMaze(FirstPerson[TMazeState, TMazeParams]):
    """Go where the key told you to go: +1 at the end of that arm, -1 at the other end."""

    name: str = "t-maze"
    params_class: ClassVar[type[jaxenstein.Params]] = TMazeParams
    action_names: ClassVar[tuple[str, ...]] = ACTION_NAMES[:3]

    def init_state(self, key: jax.Array, params: TMazeParams) -> TMazeState:
        """Stand in the south, look north, and draw the arm."""
        north, arm = jnp.float32(1.5 * math.pi), jax.random.randint(key, (), 0, 2, jnp.int32)
        return TMazeState(position=centres(MAP.spawns)[0], heading=north, arm=arm)

    def transition(self, key: jax.Array, state: TMazeState, action: jax.Array, params: TMazeParams):
        """Move, and look whether an end is reached: next state, reward, terminated, events."""
        pose = state.position, state.heading
        position, heading = steer(LEVEL, jnp.zeros(0, bool), *pose, action, params)
        there = jnp.sum((centres(MAP.goals) - position[None]) ** 2, axis=-1) < 0.25
        reward = jnp.where(jnp.any(there), jnp.where(there[state.arm], 1.0, -1.0), 0.0)
        return state.replace(position=position, heading=heading), reward, jnp.any(there), {}

    def scene(self, state: TMazeState, params: TMazeParams) -> Scene:
        """The maze, and the key while it is in sight."""
        seen = state.time < params.cue_steps
        key = Sprites(jnp.array([[4.5, 2.5]], jnp.float32), state.arm[None], seen[None])
        return Scene(LEVEL, jnp.zeros(0, bool), state.position, state.heading, key, THEME)

    def tilemap_of(self, state: TMazeState):
        """The map, for pictures from above."""
        return MAP


def play(key: jax.Array, env: TMaze, remembers: bool) -> jax.Array:
    """The return of an episode: north, a turn, and along the arm."""
    obs, state = env.reset(key)
    red, _, blue = jnp.moveaxis(obs.astype(jnp.int32), -1, 0)
    turn = jnp.where(remembers & jnp.any(blue > red + 60), jnp.int32(1), jnp.int32(0))
    ahead = jnp.full(19, 2, jnp.int32)
    actions = jnp.concatenate([ahead, jnp.full(6, turn), ahead])
    return jax.lax.scan(lambda s, a: env.step(key, s, a)[1:3], state, actions)[1].sum()


if __name__ == "__main__":
    for remembers in (True, False):
        keys = jax.random.split(jax.random.key(0), 64)
        returns = jax.vmap(play, (0, None, None))(keys, TMaze(), remembers)
        print(f"mean return {'with' if remembers else 'without'} memory: {returns.mean():+.2f}")
