"""The base class of all environments.

A task implements `init_state`, `transition`, `observe` and, for the entries of `info` that depend
on the state, `describe`. From these the base class builds `reset`, `step` and `advance`, which add
time limits, automatic resets, and one observation per step.

The order of arguments and the six return values of `step` follow gymnax 1.0.
"""

from __future__ import annotations

import abc
import dataclasses
from typing import Any, ClassVar, Generic, Literal, TypeVar, cast, get_args

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from ._jax.batching import select, where_any
from .about import About
from .calls import as_kind, as_static, checked_action, compiled
from .errors import SettingError, nearest, quoted
from .fields import check, choice, number
from .params import Params as Params
from .params import Scalar as Scalar
from .params import check_single
from .spaces import Discrete, Space
from .state import Advanced, Outcome, S, repeated
from .state import Info as Info
from .state import State as State

Autoreset = Literal["same-step", "next-step"]
MOST_FRAME_SKIP = 64


P = TypeVar("P", bound=Params)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Environment(abc.ABC, Generic[S, P]):
    """Base of all environments: frozen and hashable, so equal settings share one compilation.

    Methods are pure and take unbatched arguments; those that return arrays work under `jax.jit`,
    `jax.vmap` and `jax.lax.scan`. Random keys may be typed (`jax.random.key`) or raw
    (`jax.random.PRNGKey`). Without `params`, methods use `default_params`. An action outside the
    action space does nothing, but the step still takes its time.

    Attributes:
        name: the id, or the name of a custom map.
        version: increases when the behaviour of the environment changes.
        autoreset: `"same-step"`: the step that ends an episode returns the next episode's first
            observation and state. `"next-step"`: it returns the last observation, and the step
            after it ignores its action, resets, and returns reward 0. `None`: no resets; a step
            after the end continues the old episode.
        final_observation: with `"same-step"`, add `info["final_observation"]`, the observation
            before the reset, at every step. This renders a second image per step.
        frame_skip: how many world steps one step takes. The action is repeated, rewards add up,
            `info` has the events of all world steps, and only the last one is rendered. A step
            stops early when the episode ends. `time`, `max_steps_in_episode` and
            `episode_length` count world steps. With 2 or more, the key of the step is split into
            one key per world step.
    """

    name: str = "custom"
    version: int = 0
    autoreset: Autoreset | None = choice("same-step", (*get_args(Autoreset), None))
    final_observation: bool = False
    frame_skip: int = number(1, 1, MOST_FRAME_SKIP)

    params_class: ClassVar[type[Params]] = Params
    action_names: ClassVar[tuple[str, ...]] = ()
    # The event that means success; "" if there is none.
    success_event: ClassVar[str] = ""
    # Without such an event, success is to reach the time limit if this is true, and otherwise to
    # terminate with a positive reward.
    survival: ClassVar[bool] = False

    def __init_subclass__(cls, **kwargs: Any) -> None:
        """Keep the `dataclass` decorator from writing a longer `__repr__`."""
        super().__init_subclass__(**kwargs)
        if "__repr__" not in vars(cls):
            cls.__repr__ = Environment.__repr__

    def __repr__(self) -> str:
        """One line: the name, and the changed settings that are numbers or strings."""
        shown = [repr(self.name)]
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            plain = field.repr and (value is None or isinstance(value, int | float | str))
            if plain and field.name not in ("name", "version") and value != field.default:
                shown.append(f"{field.name}={value!r}")
        return f"{type(self).__name__}({', '.join(shown)})"

    def __post_init__(self) -> None:
        """Check the settings; subclasses extend this."""
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            object.__setattr__(self, field.name, as_static(field.name, value))
        if not isinstance(self.name, str) or not self.name.isprintable():
            raise SettingError(f"name must be one line of text, not {quoted(self.name)}")
        check(self)
        if self.final_observation and self.autoreset != "same-step":
            raise SettingError(
                "final_observation=True needs autoreset='same-step': with "
                f"{quoted(self.autoreset)}, `step` already returns the final observation"
            )

    # Methods that a task implements.

    @property
    def default_params(self) -> P:
        """The params used for `params=None`; by default `params_class()`."""
        return cast(P, self.params_class())

    @abc.abstractmethod
    def init_state(self, key: jax.Array, params: P) -> S:
        """Sample the first state of an episode."""

    @abc.abstractmethod
    def transition(
        self, key: jax.Array, state: S, action: jax.Array, params: P
    ) -> tuple[S, jax.Array, jax.Array, Info]:
        """Apply an action: next state, float32[] reward, bool[] terminated, events.

        The base class sets `time`, `episode_return` and `done`. Events are small scalars for
        `info` that are false or zero when nothing happens.
        """

    @abc.abstractmethod
    def observe(self, state: S, params: P) -> Any:
        """The observation of a state."""

    @abc.abstractmethod
    def observation_space(self, params: P | None = None) -> Space:
        """The space of observations."""

    def describe(self, state: S, params: P) -> Info:
        """The entries of `info` that depend on the state; tasks add their own."""
        del params
        return {
            "position": state.position,
            "heading": state.heading,
            "cell": jnp.floor(state.position).astype(jnp.int32),
            "episode_return": state.episode_return,
            "episode_length": state.time,
        }

    def about(self) -> About:
        """Descriptions of the task for people and players; each part is optional."""
        return About()

    def instruction(self, state: S) -> str:
        """The instruction of one state (not a batch) in words; "" if the task has none."""
        del state
        return ""

    def succeeded(
        self, state: S, reward: jax.Array, terminated: jax.Array, events: Info, params: P
    ) -> jax.Array:
        """bool[]: whether a step reached the aim of the task; `info["success"]` holds it.

        True if `success_event` happened; in a class without one, if the step terminated with a
        positive reward or, with `survival`, reached the time limit. Tasks with another aim override
        this.

        Args:
            state: the state after the step, with `time`, `episode_return` and `done` updated.
            reward: float32[], the reward of the step.
            terminated: bool[], as `transition` returned it.
            events: as `transition` returned them.
            params: the params.
        """
        del params
        if self.success_event:
            return events[self.success_event].astype(bool)
        return state.done & ~terminated if self.survival else terminated & (reward > 0)

    def first_state(self, key: jax.Array, params: P) -> S:
        """The first state of an episode: the task's own, extended by what settings add."""
        return self.init_state(key, params)

    # Methods that a training loop calls.

    def action_space(self, params: P | None = None) -> Discrete:
        """The action space: indices into `action_names`."""
        del params
        return Discrete(self.num_actions)

    @property
    def num_actions(self) -> int:
        """The number of actions."""
        return len(self.action_names)

    @compiled
    def reset(self, key: jax.Array, params: P | None = None) -> tuple[Any, S]:
        """Start an episode; returns its first observation and state.

        Args:
            key: one random key.
            params: one set of params.

        Raises:
            SettingError: as `single_params`.
        """
        params = self.single_params(params)
        state = self.first_state(key, params)
        return self.observe(state, params), state

    @compiled
    def step(
        self, key: jax.Array, state: S, action: Any, params: P | None = None
    ) -> tuple[Any, S, jax.Array, jax.Array, jax.Array, Info]:
        """Take a step, then reset as `autoreset` says.

        Args:
            key: one random key.
            state: the state before the step.
            action: integer[].
            params: one set of params.

        Returns:
            observation; state; float32[] reward; bool[] terminated, whether the task ended the
            episode; bool[] truncated, whether the time limit did (both can be true); info.
            `info` describes the state before any reset, so where `terminated | truncated`,
            `episode_return` and `episode_length` cover the whole episode. With `"next-step"`, the
            step that resets describes the new state, without events. `success`, bool[], is
            true in a step that reached the aim of the task.

        Raises:
            SettingError: as `single_params`, or the action is not one integer.
        """
        params = self.single_params(params)
        step_key, reset_key = jax.random.split(key)
        out = outcome_of(self, step_key, reset_key, state, action, params)
        info = out.info
        if self.final_observation:
            info = info | {"final_observation": self.observe(out.final, params)}
        ends = out.terminated, out.truncated
        return self.observe(out.state, params), out.state, out.reward, *ends, info

    def reset_where(self, over: jax.Array, key: jax.Array, state: S, params: P) -> S:
        """The first state of an episode where bool[] `over`, else `state`.

        Gradients do not flow into first states.
        """
        fresh = where_any(self.first_state)(over, key, jax.lax.stop_gradient(params))
        return select(over, fresh, state)

    def time_is_up(self, state: S, params: P) -> jax.Array:
        """bool[]: whether the time limit ends the episode in this state."""
        return state.time >= params.max_steps_in_episode

    @compiled
    def advance(
        self, key: jax.Array, state: S, action: Any, params: P | None = None
    ) -> tuple[S, jax.Array, jax.Array, Info]:
        """Take a step without a reset and without an observation; arguments and errors as `step`.

        Returns:
            state; float32[] reward; bool[] terminated; info. For truncation, call
            `time_is_up(state, params)`; `state.done` covers both.
        """
        params = self.single_params(params)
        action = checked_action(action, self.num_actions)
        after, reward, terminated, events = repeated(
            self._world_step, self.frame_skip, key, state, action, params
        )
        return after, reward, terminated, events | self.describe(after, params)

    def _world_step(self, key: jax.Array, state: S, action: jax.Array, params: P) -> Advanced[S]:
        """Take one world step."""
        after, reward, terminated, events = self.transition(key, state, action, params)
        after = after.replace(time=state.time + 1, episode_return=state.episode_return + reward)
        after = after.replace(done=terminated | self.time_is_up(after, params))
        success = self.succeeded(after, reward, terminated, events, params)
        return after, reward, terminated, events | {"success": success}

    def most_steps(self, params: P) -> jax.Array | np.ndarray | np.int32:
        """int32[...]: the largest number of steps in an episode, each of `frame_skip` world steps.

        A NumPy number or array unless the params are traced, even inside compiled code, so you
        can use it as a shape or as the length of a `jax.lax.scan`.
        """
        limit: Any = self._own_params(params).max_steps_in_episode
        if isinstance(limit, Tracer):
            limit = limit.astype(jnp.int32)
        else:
            limit = np.asarray(limit).astype(np.int32)
        return -(-limit // self.frame_skip)

    def index_of(self, action: str) -> int:
        """The index of an action by its name.

        Raises:
            SettingError: there is no action of that name.
        """
        if action not in self.action_names:
            known = ", ".join(map(repr, self.action_names))
            raise SettingError(
                f"unknown action {quoted(action)}{nearest(action, self.action_names)}; known: "
                f"{known}"
            )
        return self.action_names.index(action)

    def check_params(self, params: P | None = None) -> P:
        """Convert params to arrays of the right dtypes; None gives the default params.

        A compiled call transfers Python numbers to the device each time; arrays stay there.

        Args:
            params: params with numbers of any type and shape.

        Returns:
            Params of float32, int32 and bool arrays.

        Raises:
            SettingError: the params belong to another kind of environment, or a value is out of
                range.
        """
        return jax.tree.map(as_kind, self._own_params(params), self.default_params)

    def _own_params(self, params: P | None) -> P:
        """The params, checked but not converted; the default params for None."""
        default = self.default_params
        if params is None:
            return default
        if type(params) is not type(default):
            raise SettingError(
                f"params of {quoted(self.name)} must be a {type(default).__name__}, as `make` "
                f"returns, not {type(params).__name__}"
            )
        params.check()
        return params

    def single_params(self, params: P | None = None) -> P:
        """As `check_params`, and also check that no param has a batch axis.

        `reset`, `step` and `advance` call this when they are traced.

        Raises:
            SettingError: as `check_params`, or a param has a batch axis. The message names the
                param, its shape, and the right `in_axes` for `jax.vmap`.
        """
        params = self.check_params(params)
        check_single(params, self.default_params, self.name)
        return params


AnyEnvironment = Environment[Any, Any]
"""An environment of any task."""


@compiled
def outcome_of(
    env: Environment[S, P],
    step_key: jax.Array,
    reset_key: jax.Array,
    state: S,
    action: Any,
    params: P | None = None,
    later: P | None = None,
) -> Outcome[S]:
    """`Environment.step` without an observation, but with the state before the reset.

    Args:
        env: the environment.
        step_key: the random key of the step.
        reset_key: the random key of the first state of the next episode.
        state: one state.
        action: an integer.
        params: the params of the environment.
        later: the params of the next episode; None for the same.
    """
    params = env.single_params(params)
    later = params if later is None else env.single_params(later)
    final, reward, terminated, info = env.advance(step_key, state, action, params)
    truncated = env.time_is_up(final, params)
    if env.autoreset is None:
        return Outcome(final, final, reward, terminated, truncated, info)
    if env.autoreset == "same-step":
        following = env.reset_where(final.done, reset_key, final, later)
        return Outcome(following, final, reward, terminated, truncated, info)
    over = state.done
    following = env.reset_where(over, reset_key, final, later)
    events = {name: jnp.zeros_like(value) for name, value in info.items()}
    info = select(over, events | env.describe(following, later), info)
    reward = jnp.where(over, 0, reward)
    return Outcome(following, final, reward, terminated & ~over, truncated & ~over, info)
