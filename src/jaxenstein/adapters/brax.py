"""Environments as Brax has them: one `State` in, one out, for Brax' PPO on pixels.

    env = jaxenstein.adapters.brax.make("my-way-home", height=64, width=64)
    ppo.train(env, episode_length=env.episode_length, wrap_env_fn=jaxenstein.adapters.brax.wrap,
              network_factory=make_ppo_networks_vision, vision=True, ...)

What fits and what does not:

- Brax' policies are continuous, ours choose one of a few actions. An action is a vector of
  `action_size` scores, one for each action, and the highest is taken. This choice is part of the
  environment, so the gradient of the policy stays right, but the noise of a policy over scores
  is not that of a categorical one. A loop with a categorical policy passes integers instead.
- Observations are dictionaries of float32, as Brax' vision networks expect them: images from 0 to 1
  under `pixels/view_0`, and numbers beside them (keys, health) under `state`. Brax' networks of
  vectors alone do not take them.
- Brax itself cuts episodes, in its `EpisodeWrapper`, and overwrites `info["truncation"]`. So `done`
  is the task's own end alone; give the wrapper `episode_length=env.episode_length`.
  With `action_repeat` it steps on after an end: nothing happens then, and nothing is paid.
- Brax' `AutoResetWrapper` begins every episode of an environment in the state of its first one.
  `wrap` draws a new one, and is passed as `wrap_env_fn`. Domain randomisation of Brax does not
  apply, as there is no `sys`; batches of params do the same in the environment itself.

Needs the extra `brax`.
"""

# The partner is an extra, which need not be there to check the types.
# pyright: reportMissingImports=false

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp

from .. import registry
from ..environment import AnyEnvironment
from ..errors import SettingError
from .functional import check_fit, event_names

try:
    from brax.envs import base
    from brax.envs.wrappers import training
except ImportError as error:
    raise ImportError(
        f"jaxenstein.adapters.brax needs brax ({error}): pip install 'jaxenstein[brax]'"
    ) from error

PIXELS = "pixels/view_0"
"""The entry of an observation that is the image: float32[height, width, channels]."""
NUMBERS = "state"
"""The entry of an observation with the numbers beside the image, if there are any: float32[n]."""


class BraxEnvironment(base.Env):
    """An environment of this package behind Brax' interface.

    `State.pipeline_state` is the state of the environment, `State.metrics` has its events of the
    step as float32[] (Brax sums them up over an episode), and `State.info` what it says of the
    state, besides `rng`, the stream's key, and float32[] `truncation`, 1 where time is up and the
    task has not ended. Keys may be typed or old, but for Brax' own wrappers, which need old ones.

    Attributes:
        env: the environment inside, without automatic resets.
        params: its params.
    """

    def __init__(self, env: AnyEnvironment, params: Any = None) -> None:
        """Wrap `env`.

        Args:
            env: the environment, with `autoreset=None`.
            params: its params; None for the default ones.

        Raises:
            SettingError: it is no environment or resets by itself, or the params are of another
                kind.
        """
        check_fit(env, (None,), "Brax")
        self.env = env
        self.params = env.check_params(params)

    @property
    def observation_size(self) -> Mapping[str, tuple[int, ...]]:
        """The shape of each entry of an observation."""
        shapes = jax.eval_shape(self.reset, jax.random.key(0)).obs
        return {name: leaf.shape for name, leaf in shapes.items()}

    @property
    def action_size(self) -> int:
        """Number of scores in an action, which is the number of actions."""
        return self.env.num_actions

    @property
    def backend(self) -> str:
        """The name of this package, in the place of a physics backend."""
        return "jaxenstein"

    @property
    def episode_length(self) -> int:
        """Steps of an episode, for Brax' `EpisodeWrapper`."""
        return int(self.env.most_steps(self.params))

    def reset(self, rng: jax.Array) -> base.State:
        """Begin an episode."""
        reset_key, key = jax.random.split(rng)
        seen, state = self.env.reset(reset_key, self.params)
        zero = jnp.float32(0.0)
        events = event_names(self.env, reset_key, state, self.params)
        info = self.env.describe(state, self.params)
        return base.State(
            pipeline_state=state,
            obs=_observation(seen),
            reward=zero,
            done=zero,
            metrics=dict.fromkeys(events, zero),
            info=info | {"rng": key, "truncation": zero},
        )

    def step(self, state: base.State, action: Any) -> base.State:
        """Take a step, without a reset; after the end of the task nothing changes.

        Args:
            state: as of `reset` or `step`; what wrappers put into its `info` is kept.
            action: float[action_size] scores, of which the highest is taken, or integer[].

        Raises:
            SettingError: the action has another shape or type.
        """
        key, step_key = jax.random.split(state.info["rng"])
        seen, after, reward, terminated, truncated, info = self.env.step(
            step_key, state.pipeline_state, self._choice(action), self.params
        )
        cut = (truncated & ~terminated).astype(jnp.float32)
        metrics = {
            name: info.pop(name).astype(jnp.float32) for name in state.metrics if name in info
        }
        moved = state.replace(
            pipeline_state=after,
            obs=_observation(seen),
            reward=reward,
            done=terminated.astype(jnp.float32),
            metrics={**state.metrics, **metrics},
            info={**state.info, **info, "rng": key, "truncation": cut},
        )
        stayed = state.replace(reward=jnp.zeros_like(reward))
        return jax.tree.map(functools.partial(jnp.where, state.done > 0), stayed, moved)

    def observe(self, state: Any) -> dict[str, jax.Array]:
        """The observation of a state of the environment inside, as Brax' networks want it."""
        return _observation(self.env.observe(state, self.params))

    def _choice(self, action: Any) -> jax.Array:
        """int32[]: the action that is meant."""
        action = jnp.asarray(action)
        if jnp.issubdtype(action.dtype, jnp.integer):
            return action  # checked by the environment
        if action.shape != (self.action_size,):
            raise SettingError(
                f"an action must be {self.action_size} scores or one integer, "
                f"not {action.dtype}{list(action.shape)}; for a batch use Brax' VmapWrapper"
            )
        return jnp.argmax(action).astype(jnp.int32)


class FreshResetWrapper(base.Wrapper):
    """Resets a batch in which episodes have ended, each to a new first state.

    It takes the place of Brax' `AutoResetWrapper` and goes around its `EpisodeWrapper`. States are
    reset before they are drawn, so a step draws one frame for each environment.
    """

    def __init__(self, env: base.Env) -> None:
        """Wrap a batched environment with a `BraxEnvironment` inside."""
        super().__init__(env)
        inner = self.unwrapped
        if not isinstance(inner, BraxEnvironment):
            raise SettingError(
                f"a BraxEnvironment of jaxenstein is needed, not {type(inner).__name__}"
            )
        self._inner = inner

    def step(self, state: base.State, action: jax.Array) -> base.State:
        """Take a step in all environments."""
        steps = jnp.where(state.done > 0, 0.0, state.info["steps"])
        state = state.replace(done=jnp.zeros_like(state.done), info={**state.info, "steps": steps})
        after = self.env.step(state, action)
        keys = jax.vmap(jax.random.split)(after.info["rng"])
        env, params = self._inner.env, self._inner.params
        reset_where = jax.vmap(env.reset_where, (0, 0, 0, None))
        states = reset_where(after.done > 0, keys[:, 1], after.pipeline_state, params)
        return after.replace(
            pipeline_state=states,
            # That of `after` is not used any more, and so is not drawn.
            obs=jax.vmap(self._inner.observe)(states),
            info={**after.info, "rng": keys[:, 0]},
        )


def wrap(
    env: base.Env,
    episode_length: int,
    action_repeat: int = 1,
    randomization_fn: Callable[..., Any] | None = None,
) -> base.Env:
    """Wrap an environment for training, as Brax' `wrap` but with new first states.

    For `wrap_env_fn` of Brax' trainers, whose arguments it takes.

    Args:
        env: a `BraxEnvironment`.
        episode_length: steps after which an episode is cut: `env.episode_length`.
        action_repeat: steps for which an action is repeated.
        randomization_fn: must be None.

    Raises:
        SettingError: it is another environment, or there is a `randomization_fn`.
    """
    if randomization_fn is not None:
        raise SettingError("randomization_fn must be None: jaxenstein has no Brax system")
    batched = training.VmapWrapper(env)
    return FreshResetWrapper(training.EpisodeWrapper(batched, episode_length, action_repeat))


def make(id: str, **settings: Any) -> BraxEnvironment:
    """Build an environment behind Brax' interface.

    Args:
        id: as of `jaxenstein.make`.
        **settings: those of `jaxenstein.make` but for the resets.

    Raises:
        UnknownEnvironmentError: there is no such id.
        SettingError: there is no such setting, its value is out of range, or `autoreset` is not
            None.
    """
    return BraxEnvironment(*registry.make(id, **{"autoreset": None, **settings}))


def _observation(seen: Any) -> dict[str, jax.Array]:
    """An image, or a dictionary of one and of numbers, under the names of Brax."""
    if not isinstance(seen, Mapping):
        return {PIXELS: _pixels(seen)}
    rest = [leaf for name, leaf in sorted(seen.items()) if name != "image"]
    observation = {PIXELS: _pixels(seen["image"])}
    if rest:
        numbers = [jnp.ravel(leaf).astype(jnp.float32) for leaf in rest]
        observation[NUMBERS] = jnp.concatenate(numbers)
    return observation


def _pixels(image: jax.Array) -> jax.Array:
    """float32[height, width, channels], bytes as fractions of 255."""
    if image.ndim == 2:
        image = image[..., None]
    scale = 255.0 if image.dtype == jnp.uint8 else 1.0
    return image.astype(jnp.float32) / scale
