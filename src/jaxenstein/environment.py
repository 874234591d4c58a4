"""The contract that every environment keeps.

A task supplies functions of its states: `init_state`, `transition` and `observe`, and `describe`
for what `info` says of a state. The base class builds from them what a training loop calls:
`reset`, `step` and `advance`, with time limits, automatic resets, and one observation a step.

Argument order and the six values of `step` are those of gymnax 1.0.
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

    All functions are pure, take unbatched arguments and compose with `jax.jit`, `jax.vmap` and
    `jax.lax.scan`. Keys may be typed (`jax.random.key`) or old (`jax.random.PRNGKey`). `params`
    may be left out, which means `default_params`. Actions outside the action space do nothing
    (the step still takes its time).

    Attributes:
        name: the id, or the name of a custom map.
        version: grows when the behaviour of the environment changes.
        autoreset: `"same-step"`: the step that ends an episode returns the next episode's first
            observation and state. `"next-step"`: it returns the last observation, and the step
            after it ignores its action, resets, and returns reward 0. `None`: never; stepping on
            after the end goes on with the old episode.
        final_observation: with `"same-step"`, add `info["final_observation"]`, the observation
            before the reset, at every step. It costs a second render a step.
        frame_skip: steps of the world in one step: the action is repeated, rewards add
            up, `info` has the events of all of them, and only the last one is drawn. The end of
            the episode, by the task or the time limit, ends the step as well. `time`,
            `max_steps_in_episode` and `episode_length` count steps of the world. From 2 on, the
            step's key is split into one for each of them.
    """

    name: str = "custom"
    version: int = 0
    autoreset: Autoreset | None = choice("same-step", (*get_args(Autoreset), None))
    final_observation: bool = False
    frame_skip: int = number(1, 1, MOST_FRAME_SKIP)

    params_class: ClassVar[type[Params]] = Params
    action_names: ClassVar[tuple[str, ...]] = ()
    # The event that is the task's aim; "": to terminate with a positive reward.
    success_event: ClassVar[str] = ""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        """Keep the decorator `dataclass` from writing a longer `__repr__`."""
        super().__init_subclass__(**kwargs)
        if "__repr__" not in vars(cls):
            cls.__repr__ = Environment.__repr__

    def __repr__(self) -> str:
        """One line: the name, and the numbers and words among the settings that were changed."""
        shown = [repr(self.name)]
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            plain = field.repr and (value is None or isinstance(value, int | float | str))
            if plain and field.name not in ("name", "version") and value != field.default:
                shown.append(f"{field.name}={value!r}")
        return f"{type(self).__name__}({', '.join(shown)})"

    def __post_init__(self) -> None:
        """Check the settings; subclasses extend it."""
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            object.__setattr__(self, field.name, as_static(field.name, value))
        if not isinstance(self.name, str) or not self.name.isprintable():
            raise SettingError(f"name must be a text of one line, not {quoted(self.name)}")
        check(self)
        if self.final_observation and self.autoreset != "same-step":
            raise SettingError(
                "final_observation=True needs autoreset='same-step': with "
                f"{quoted(self.autoreset)} the observation that `step` returns is already the "
                "final one"
            )

    # What a task supplies.

    @property
    def default_params(self) -> P:
        """The params that `params=None` stands for; here the usual ones of `params_class`."""
        return cast(P, self.params_class())

    @abc.abstractmethod
    def init_state(self, key: jax.Array, params: P) -> S:
        """Sample the first state of an episode."""

    @abc.abstractmethod
    def transition(
        self, key: jax.Array, state: S, action: jax.Array, params: P
    ) -> tuple[S, jax.Array, jax.Array, Info]:
        """Apply an action: next state, float32[] reward, bool[] terminated, events.

        `time`, `episode_return` and `done` are kept by the base. Events are small scalars for
        `info` that are false or zero when nothing happens.
        """

    @abc.abstractmethod
    def observe(self, state: S, params: P) -> Any:
        """The observation of a state."""

    @abc.abstractmethod
    def observation_space(self, params: P | None = None) -> Space:
        """The space of observations."""

    def describe(self, state: S, params: P) -> Info:
        """What `info` says of a state; tasks add to it."""
        del params
        return {
            "position": state.position,
            "heading": state.heading,
            "cell": jnp.floor(state.position).astype(jnp.int32),
            "episode_return": state.episode_return,
            "episode_length": state.time,
        }

    def about(self) -> About:
        """What the task says of itself to people and players; every part may be left out."""
        return About()

    def instruction(self, state: S) -> str:
        """What one state (not a batch) asks for, in words for people; "" where nothing is."""
        del state
        return ""

    def succeeded(
        self, state: S, reward: jax.Array, terminated: jax.Array, events: Info, params: P
    ) -> jax.Array:
        """bool[]: whether a step reached the task's aim, which `info` tells as `success`.

        It did if `success_event` happened, or, where a class names none, if the step terminated
        with a positive reward; tasks with another aim override this.

        Args:
            state: after the step; its `time`, `episode_return` and `done` count it in.
            reward: float32[], of the step.
            terminated: bool[], as `transition` gave it.
            events: as `transition` gave them.
            params: the params.
        """
        del state, params
        if self.success_event:
            return events[self.success_event].astype(bool)
        return terminated & (reward > 0)

    def first_state(self, key: jax.Array, params: P) -> S:
        """The first state of an episode: that of the task, with what settings add to it."""
        return self.init_state(key, params)

    # What a training loop calls.

    def action_space(self, params: P | None = None) -> Discrete:
        """The space of actions: one of `action_names` by its index."""
        del params
        return Discrete(self.num_actions)

    @property
    def num_actions(self) -> int:
        """Number of actions."""
        return len(self.action_names)

    @compiled
    def reset(self, key: jax.Array, params: P | None = None) -> tuple[Any, S]:
        """Begin an episode: observation and state."""
        params = self.single_params(params)
        state = self.first_state(key, params)
        return self.observe(state, params), state

    @compiled
    def step(
        self, key: jax.Array, state: S, action: Any, params: P | None = None
    ) -> tuple[Any, S, jax.Array, jax.Array, jax.Array, Info]:
        """Take a step, then reset as `autoreset` says.

        Returns:
            observation; state; float32[] reward; bool[] terminated, the task's own end; bool[]
            truncated, the time limit (both can be true); info. `info` tells of the state that
            the action led to, so `episode_return` and `episode_length` are those of the whole
            episode where `terminated | truncated`; `success`, bool[], is true in a step that
            reached the task's aim.
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

        To automatic differentiation first states are constants.
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
        """Take a step without a reset and without an observation: the rules alone.

        Returns:
            state; float32[] reward; bool[] terminated; info. Truncation is
            `time_is_up(state, params)`; `state.done` covers both ends.
        """
        params = self.single_params(params)
        action = checked_action(action, self.num_actions)
        after, reward, terminated, events = repeated(
            self._world_step, self.frame_skip, key, state, action, params
        )
        return after, reward, terminated, events | self.describe(after, params)

    def _world_step(self, key: jax.Array, state: S, action: jax.Array, params: P) -> Advanced[S]:
        """One step of the world."""
        after, reward, terminated, events = self.transition(key, state, action, params)
        after = after.replace(time=state.time + 1, episode_return=state.episode_return + reward)
        after = after.replace(done=terminated | self.time_is_up(after, params))
        success = self.succeeded(after, reward, terminated, events, params)
        return after, reward, terminated, events | {"success": success}

    def most_steps(self, params: P) -> jax.Array | np.ndarray | np.int32:
        """int32[...]: the most steps an episode can have, each `frame_skip` of the world.

        A NumPy number or array unless the params are traced, also inside compiled code: it may be
        a shape or the length of a `jax.lax.scan`.
        """
        limit: Any = self._own_params(params).max_steps_in_episode
        if isinstance(limit, Tracer):
            limit = limit.astype(jnp.int32)
        else:
            limit = np.asarray(limit).astype(np.int32)
        return -(-limit // self.frame_skip)

    def index_of(self, action: str) -> int:
        """The number of an action.

        Raises:
            SettingError: there is none of that name.
        """
        if action not in self.action_names:
            known = ", ".join(map(repr, self.action_names))
            raise SettingError(
                f"unknown action {quoted(action)}{nearest(action, self.action_names)}; known: "
                f"{known}"
            )
        return self.action_names.index(action)

    def check_params(self, params: P | None = None) -> P:
        """The params as arrays of the default's kinds, the default ones for None.

        A compiled call that is given Python's numbers transfers each of them anew; arrays stay
        where they are.

        Args:
            params: numbers of any type and shape.

        Returns:
            Params of float32, int32 and bool arrays.

        Raises:
            SettingError: they are of another kind of environment, or one has a value that it
                cannot have.
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
                f"returns it, not {type(params).__name__}"
            )
        params.check()
        return params

    def single_params(self, params: P | None = None) -> P:
        """As `check_params`, without a batch axis: each param has the axes of its default.

        `reset`, `step` and `advance` check this when they are traced.

        Raises:
            SettingError: as `check_params`; or a param has a batch axis. The message names the
                param, its shape, and the right `in_axes` of `jax.vmap`.
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
    """`Environment.step` without an observation, and with the state before the reset.

    Args:
        env: the environment.
        step_key: of what happens in the step.
        reset_key: of the first state of the next episode.
        state: one state.
        action: an integer.
        params: of the environment.
        later: those of the next episode; None for the same.
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
