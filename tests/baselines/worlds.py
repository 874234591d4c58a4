"""Small environments whose right behaviour is known."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

import jaxenstein
from jaxenstein.environment import Environment, Info, Params, State
from jaxenstein.spaces import Box
from jaxenstein.tasks.navigation import Navigation, NavigationState

# Settings of small trainings, and sizes for each algorithm.
SMALL: dict[str, Any] = {
    "num_envs": 4, "rollout": 6, "minibatches": 2, "epochs": 2, "features": 8, "hidden": 8,
    "head": 8, "total_steps": 24 * 10,
}  # fmt: skip
BONUS_SIZES: dict[str, Any] = {
    "ppo": {},
    "rnd": {"rnd_hidden": 8, "rnd_output": 8},
    "icm": {"icm_latent": 8, "icm_hidden": 8},
    "e3b": {"e3b_latent": 8, "e3b_hidden": 8},
}


class CueState(State):
    """A state with a number that the agent should know."""

    cue: jax.Array


def _still(time: int, cue: jax.Array) -> CueState:
    return CueState(
        position=jnp.zeros(2, jnp.float32),
        heading=jnp.float32(0),
        time=jnp.int32(time),
        episode_return=jnp.float32(0),
        done=jnp.bool_(False),
        cue=cue,
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Memory(Environment[CueState, Params]):
    """An image shows a cue in the first step; the answer counts `delay` steps later."""

    delay: int = 8
    size: int = 8
    action_names: ClassVar[tuple[str, ...]] = ("zero", "one")

    @property
    def default_params(self) -> Params:
        return Params(max_steps_in_episode=100)

    def init_state(self, key: jax.Array, params: Params) -> CueState:
        return _still(0, jax.random.randint(key, (), 0, 2, jnp.int32))

    def transition(
        self, key: jax.Array, state: CueState, action: jax.Array, params: Params
    ) -> tuple[CueState, jax.Array, jax.Array, Info]:
        over = state.time >= self.delay
        right = over & (action == state.cue)
        return state, right.astype(jnp.float32), over, {}

    def observe(self, state: CueState, params: Params) -> jax.Array:
        half = jnp.arange(self.size) < self.size // 2
        shown = jnp.where(state.cue == 0, half, ~half) & (state.time == 0)
        image = jnp.broadcast_to(shown[None], (self.size, self.size))
        return image.astype(jnp.uint8) * jnp.uint8(255)

    def observation_space(self, params: Params | None = None) -> Box:
        return Box(0, 255, (self.size, self.size), np.dtype(np.uint8))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Countdown(Environment[CueState, Params]):
    """No image: the vector [time, cue]; the task ends after `cue` steps, unless the limit does.

    The reward is the time; action 1 adds a half.
    """

    longest: int = 8
    action_names: ClassVar[tuple[str, ...]] = ("nothing", "half")

    @property
    def default_params(self) -> Params:
        return Params(max_steps_in_episode=5, discount=0.9)

    def init_state(self, key: jax.Array, params: Params) -> CueState:
        return _still(0, jax.random.randint(key, (), 1, self.longest + 1, jnp.int32))

    def transition(
        self, key: jax.Array, state: CueState, action: jax.Array, params: Params
    ) -> tuple[CueState, jax.Array, jax.Array, Info]:
        time = state.time + 1
        reward = time.astype(jnp.float32) + jnp.where(action == 1, 0.5, 0.0)
        return state, reward, time >= state.cue, {}

    def observe(self, state: CueState, params: Params) -> jax.Array:
        return jnp.stack([state.time, state.cue]).astype(jnp.float32)

    def observation_space(self, params: Params | None = None) -> Box:
        return Box(-np.inf, np.inf, (2,))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Bandit(Navigation):
    """One step on a rendered frame: name the start cell by the colour of the wall in front."""

    def transition(
        self, key: jax.Array, state: NavigationState, action: jax.Array, params: Any
    ) -> tuple[NavigationState, jax.Array, jax.Array, Info]:
        row = jnp.floor(state.position[1]).astype(jnp.int32) // 2
        right = action == row
        return state, right.astype(jnp.float32), jnp.bool_(True), {"reached_goal": right}


BANDIT_MAP = """
#####
#.S1#
#.###
#.S2#
#.###
#.S3#
#.###
#GS4#
#####
""".strip()


def bandit() -> Bandit:
    """Four start cells, each in front of a wall of a different colour."""
    env, _ = jaxenstein.from_ascii(BANDIT_MAP, heading=0.0, height=16, width=16)
    fields = {field.name: getattr(env, field.name) for field in dataclasses.fields(env)}
    return Bandit(**fields)
