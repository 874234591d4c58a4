"""Episodes that draw some of their params from ranges, in compiled code.

`Params.replace(turn_angle=(0.1, 0.4))` replaces a number by a range. The functions here do what
`Environment` does, for params that may hold ranges, and their states keep the drawn numbers. The
key of a reset decides which. Without ranges, the results are those of the environment.
"""

from __future__ import annotations

from typing import Any, TypeVar

import jax

from ._jax.batching import select
from .environment import AnyEnvironment, Info, outcome_of
from .params import draw_numbers, ranges_of, split_ranges, with_numbers
from .pytree import PyTreeNode
from .state import Outcome

P = TypeVar("P")


class Drawn(PyTreeNode):
    """A state with the numbers that its episode drew.

    Attributes:
        state: the state of the environment.
        numbers: the drawn params by name, float32[] each; empty without ranges.
    """

    state: Any
    numbers: dict[str, jax.Array]

    @property
    def time(self) -> jax.Array:
        """The time of the state."""
        return self.state.time

    @property
    def done(self) -> jax.Array:
        """Whether the episode of the state has ended."""
        return self.state.done

    def params(self, params: P) -> P:
        """The params of this episode."""
        return with_numbers(params, self.numbers)


def check_params(env: AnyEnvironment, params: Any = None) -> Any:
    """Like `Environment.check_params`, for params that may hold ranges."""
    plain, ranges = split_ranges(params)
    return with_numbers(env.check_params(plain), ranges)


def single_params(env: AnyEnvironment, params: Any = None) -> Any:
    """Like `Environment.single_params`, for params that may hold ranges."""
    env.single_params(split_ranges(params)[0])
    return check_params(env, params)


def undrawn(state: Any, params: P) -> tuple[Any, P]:
    """The state of the environment for a state that may be `Drawn`, and the episode's params."""
    return (state.state, state.params(params)) if isinstance(state, Drawn) else (state, params)


def reset(env: AnyEnvironment, key: jax.Array, params: Any) -> tuple[Any, Any]:
    """Like `Environment.reset`; the state is `Drawn` if there are ranges."""
    if not ranges_of(params):
        return env.reset(key, params)
    drawn = first_state(env, key, params)
    return observe(env, drawn, params), drawn


def step(
    env: AnyEnvironment, key: jax.Array, state: Any, action: Any, params: Any
) -> tuple[Any, Any, jax.Array, jax.Array, jax.Array, Info]:
    """Like `Environment.step`; the state is `Drawn` if there are ranges."""
    if not ranges_of(params):
        return env.step(key, state, action, params)
    step_key, reset_key = jax.random.split(key)
    out = outcome(env, step_key, reset_key, state, action, params)
    info = out.info
    if env.final_observation:
        info = info | {"final_observation": observe(env, out.final, params)}
    ends = out.terminated, out.truncated
    return observe(env, out.state, params), out.state, out.reward, *ends, info


def advance(
    env: AnyEnvironment, key: jax.Array, state: Any, action: Any, params: Any
) -> tuple[Any, jax.Array, jax.Array, Info]:
    """Like `Environment.advance`; the state is `Drawn` if there are ranges."""
    before, own = undrawn(state, params)
    after, reward, terminated, info = env.advance(key, before, action, own)
    if isinstance(state, Drawn):
        after = state.replace(state=after)
    return after, reward, terminated, info


def first_state(env: AnyEnvironment, key: jax.Array, params: Any) -> Drawn:
    """Draw the numbers of an episode and its first state."""
    plain, ranges = split_ranges(params)
    numbers, key = draw_numbers(ranges, key)
    return Drawn(env.first_state(key, with_numbers(plain, numbers)), numbers)


def observe(env: AnyEnvironment, drawn: Drawn, params: Any) -> Any:
    """The observation of a state."""
    return env.observe(drawn.state, drawn.params(params))


def describe(env: AnyEnvironment, drawn: Drawn, params: Any) -> Info:
    """The entries of `info` for a state."""
    return env.describe(drawn.state, drawn.params(params))


def outcome(
    env: AnyEnvironment,
    step_key: jax.Array,
    reset_key: jax.Array,
    drawn: Drawn,
    action: Any,
    params: Any,
) -> Outcome[Any]:
    """Like `outcome_of`; both states of the outcome are `Drawn`."""
    plain, ranges = split_ranges(params)
    if not ranges or env.autoreset is None:
        out = outcome_of(env, step_key, reset_key, drawn.state, action, drawn.params(plain))
        following, final = (Drawn(state, drawn.numbers) for state in (out.state, out.final))
        return out._replace(state=following, final=final)
    new, reset_key = draw_numbers(ranges, reset_key)
    now, later = drawn.params(plain), with_numbers(plain, new)
    out = outcome_of(env, step_key, reset_key, drawn.state, action, now, later)
    over = out.final.done if env.autoreset == "same-step" else drawn.state.done
    following = Drawn(out.state, select(over, new, drawn.numbers))
    return out._replace(state=following, final=Drawn(out.final, drawn.numbers))
