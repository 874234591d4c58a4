"""Evaluation of a fixed policy on whole episodes, in parallel in one compiled loop."""

from __future__ import annotations

import dataclasses
import functools
import inspect
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from . import ranged
from .environment import AnyEnvironment, Environment
from .errors import SettingError, quoted
from .fields import check_seed, check_whole
from .params import split_ranges
from .players import play, player_of
from .pytree import PyTreeNode
from .ranged import Drawn
from .results import Results, check_text
from .seeds import key_of
from .spec import Spec, described

# The errors that JAX raises if a function needs the value of a traced array.
_NOT_IN_JAX = (
    jax.errors.ConcretizationTypeError,
    jax.errors.TracerArrayConversionError,
    jax.errors.TracerIntegerConversionError,
)
# Steps per call; progress is reported between calls.
SLICE = 16


class Evaluation(PyTreeNode):
    """The results of whole episodes; long episodes count as much as short ones.

    Attributes:
        episode_return: float32[E], undiscounted.
        episode_length: int32[E], steps.
        success: bool[E], whether the aim of the task was reached.
    """

    episode_return: jax.Array
    episode_length: jax.Array
    success: jax.Array


class Playing(PyTreeNode):
    """Unfinished episodes: [E] for one agent, [R, E] for R runs.

    Attributes:
        steps: int32[], the steps taken so far.
        actors: what acts, and where: environment states, observations, carries.
        running: bool[...], whether the episode has not ended.
        result: [...], the results so far.
    """

    steps: jax.Array
    actors: Any
    running: jax.Array
    result: Evaluation


class Taken(NamedTuple):
    """One step of all episodes, including those that have ended.

    Attributes:
        actors: the actors after the step.
        reward: float32[...].
        reached: bool[...], whether the step reached the aim of the task.
        over: bool[...], terminated or truncated.
    """

    actors: Any
    reward: jax.Array
    reached: jax.Array
    over: jax.Array


def unstarted(actors: Any, shape: tuple[int, ...]) -> Playing:
    """All episodes before their first step; `shape` is the shape of `Playing.running`."""
    nothing = Evaluation(
        episode_return=jnp.zeros(shape, jnp.float32),
        episode_length=jnp.zeros(shape, jnp.int32),
        success=jnp.zeros(shape, bool),
    )
    return Playing(jnp.int32(0), actors, jnp.ones(shape, bool), nothing)


def advance(step: Callable[[jax.Array, Any], Taken], playing: Playing, until: jax.Array) -> Playing:
    """Play until all episodes have ended, or until `until` (int32[]) steps have been taken.

    `step` takes the number of the step (int32[]) and the actors.
    """

    def body(before: Playing) -> Playing:
        running, result = before.running, before.result
        taken = step(before.steps, before.actors)
        result = Evaluation(
            episode_return=result.episode_return + jnp.where(running, taken.reward, 0),
            episode_length=result.episode_length + running.astype(jnp.int32),
            success=result.success | (running & taken.reached),
        )
        return Playing(before.steps + 1, taken.actors, running & ~taken.over, result)

    return jax.lax.while_loop(lambda p: jnp.any(p.running) & (p.steps < until), body, playing)


def play_out(
    advance: Callable[[Playing, Any], Playing],
    playing: Playing,
    notify: Callable[[np.ndarray, np.ndarray], object] = lambda running, length: None,
) -> Evaluation:
    """Play all episodes to their end.

    Args:
        advance: a compiled function of the episodes and `until`, such as `advance`.
        playing: the episodes before their first step.
        notify: called now and then with bool[...], whether each episode is unfinished, and
            int32[...], the lengths so far.
    """
    until, running = 0, np.True_
    while np.any(running):
        until += SLICE
        playing = advance(playing, np.int32(until))
        running, length = jax.device_get((playing.running, playing.result.episode_length))
        notify(running, length)
    return playing.result


def episodes_done(running: np.ndarray, length: np.ndarray, longest: Any) -> float:
    """The number of episodes played; an unfinished one counts as a fraction of the longest."""
    return float(np.where(running, length / longest, 1).sum())


def evaluate(
    env: AnyEnvironment,
    params: Any,
    policy: Callable[..., Any],
    carry: Any = None,
    episodes: int = 100,
    seed: int = 0,
    name: str | None = None,
    *,
    notify: Callable[[float], object] = lambda done: None,
) -> Results:
    r"""Evaluate any policy written in JAX on whole episodes, in parallel on the device.

    Each episode has its own random key, so episode n does not depend on `episodes`.

    Args:
        env: the environment; its `autoreset` and `final_observation` do not matter.
        params: the params of one environment; None for the default params. Each episode draws its
            own numbers from ranges.
        policy: a function for one environment; `jax.vmap` maps it over all of them. Without a
            carry it is called as `policy(obs, key)` and returns the action, one whole number.
            With a carry it is called as `policy(carry, obs, key)` and returns the next carry and
            the action. `obs` is one observation, `key` a typed random key for this step. Weights
            in a `jax.tree_util.Partial` are arguments of the compiled program, and later calls
            with the same function reuse it; nothing else that the function reads may change
            between them. For other policies, weights are constants in the program, so each call
            compiles it again.
        carry: the memory of one environment at the start of every episode: a pytree of arrays
            whose structure, shapes and dtypes must not change. None: the policy has no memory.
        episodes: the number of episodes, at least 1.
        seed: the seed of all random choices, 0 to 2**32 - 1.
        name: the name of the policy; None for `module:function`.
        notify: called now and then with the number of episodes played so far; an unfinished
            episode counts as a fraction, its length over the time limit.

    Returns:
        Returns, lengths and successes [1, episodes], and a description of the environment, the
        policy and the machine.

    Raises:
        SettingError: `env` is not an environment, the params have a batch axis, a number is out
            of range, or the policy takes or returns the wrong values.

    Examples:
        >>> import jaxenstein
        >>> env, params = jaxenstein.from_ascii("####\n#SG#\n####", heading=0, height=8, width=8)
        >>> forward = env.action_names.index("forward")
        >>> results = jaxenstein.evaluate(env, params, lambda obs, key: forward, episodes=3)
        >>> results.returns.tolist(), results.successes.tolist()
        ([[1.0, 1.0, 1.0]], [[True, True, True]])
    """
    env = _without_autoreset(env)
    given = ranged.single_params(env, params)
    numbers = split_ranges(given)[0]
    episodes, seed = check_whole("episodes", episodes, 1), check_seed(seed)
    key = key_of(seed)
    name = name_of(policy) if name is None else name
    check_text("name", name)
    carry = check_policy(env, numbers, policy, carry)
    play_on = _compiled(policy, carry is not None)
    longest = np.asarray(env.most_steps(numbers))
    played = play_out(
        lambda playing, until: play_on(env, given, playing, until),
        _begin(env, given, carry, key, episodes=episodes),
        lambda running, length: notify(episodes_done(running, length, longest)),
    )
    told = played.episode_return, played.episode_length, played.success
    return _results(described(env, params), name, seed, *told)


def evaluate_player(
    env: AnyEnvironment, params: Any, name: str = "expert", episodes: int = 100, seed: int = 0
) -> Results:
    """Evaluate a scripted player, which sees the whole state.

    Args:
        env: as in `evaluate`.
        params: as in `evaluate`.
        name: "random", "idle", "expert", or a player of this task.
        episodes: the number of episodes, at least 1.
        seed: the seed of all random choices, 0 to 2**32 - 1.

    Returns:
        As `evaluate`.

    Raises:
        SettingError: `env` is not an environment, the params have a batch axis, a number is out
            of range, or the task has no such player.
    """
    env = _without_autoreset(env)
    given = ranged.single_params(env, params)
    episodes, seed = check_whole("episodes", episodes, 1), check_seed(seed)
    player = player_of(env, name)
    reset_key, key = jax.random.split(key_of(seed))
    first = _first(env, given, reset_key, episodes)
    played = play(env, player, split_ranges(given)[0], key, first.state, first.numbers)
    told = played.returned, played.length, played.successes > 0
    return _results(described(env, params), name, seed, *told)


def _without_autoreset(env: AnyEnvironment) -> AnyEnvironment:
    if not isinstance(env, Environment):
        shown = f"{type(env).__module__}.{type(env).__qualname__}"
        pair = "; jaxenstein.make returns (env, params)" if isinstance(env, tuple) else ""
        raise SettingError(f"env must be an environment from jaxenstein.make, not a {shown}{pair}")
    return dataclasses.replace(env, autoreset=None, final_observation=False)


def _results(
    environment: Spec,
    name: str,
    seed: int,
    returns: jax.Array,
    lengths: jax.Array,
    successes: jax.Array,
) -> Results:
    """The results of one policy that chooses its own actions, from arrays [episodes]."""
    arrays: list[np.ndarray] = jax.device_get([returns, lengths, successes])
    return Results(
        environment=environment,
        policy=name,
        seed=seed,
        names=(name,),
        returns=arrays[0][None],
        lengths=arrays[1][None],
        successes=arrays[2][None],
    )


@functools.partial(jax.jit, static_argnums=(0, 3))
def _first(env: AnyEnvironment, params: Any, key: jax.Array, episodes: int) -> Drawn:
    """The first states of the episodes, and the params that they draw."""
    keys = jax.random.split(key, episodes)
    return jax.vmap(lambda key: ranged.first_state(env, key, params))(keys)


def name_of(policy: Any) -> str:
    """A name for a policy: `module:function`, or `module:Class`."""
    while isinstance(policy, functools.partial):
        policy = policy.func
    shown = policy if hasattr(policy, "__qualname__") else type(policy)
    return f"{shown.__module__}:{shown.__qualname__}"


class _Actors(PyTreeNode):
    """Episodes between two steps, with the leading axis [E].

    Attributes:
        key: the random keys of all later steps.
        drawn: the environment states, and the params that each episode drew.
        obs: the observations to act on next.
        carry: the carries of the policy, or None.
    """

    key: jax.Array
    drawn: Drawn
    obs: Any
    carry: Any


@functools.partial(jax.jit, static_argnums=0, static_argnames="episodes")
def _begin(env: AnyEnvironment, params: Any, carry: Any, key: jax.Array, episodes: int) -> Playing:
    """All episodes before their first step; each key depends only on the episode's number."""

    def first(number: jax.Array) -> _Actors:
        reset_key, key_of_steps = jax.random.split(jax.random.fold_in(key, number))
        drawn = ranged.first_state(env, reset_key, params)
        return _Actors(key_of_steps, drawn, ranged.observe(env, drawn, params), carry)

    return unstarted(jax.vmap(first)(jnp.arange(episodes)), (episodes,))


def _compiled(policy: Callable[..., Any], remembers: bool) -> Callable[..., Playing]:
    """`_advance` with a policy, as a function of the other arguments."""
    if isinstance(policy, jax.tree_util.Partial) and _is_fixed(policy.func):
        return functools.partial(_shared, policy, remembers)
    # A program of its own, which is freed with the policy: JAX would reuse the program of an
    # equal function, whose weights may have changed, such as those of an object or of a global.
    return jax.jit(functools.partial(_advance, policy, remembers), static_argnums=0)


def _is_fixed(function: Any) -> bool:
    """Whether it is a function, or a method of an object that compares by value, as flax modules.

    The attributes of other objects may change without notice.
    """
    owner = getattr(function, "__self__", None) if hasattr(function, "__qualname__") else function
    return owner is None or type(owner).__hash__ not in (None, object.__hash__)


def _advance(
    policy: Any, remembers: bool, env: AnyEnvironment, params: Any, playing: Playing, until: Any
) -> Playing:
    """As `advance`, with a policy."""

    def step(number: jax.Array, actors: _Actors) -> Taken:
        policy_key, step_key = jax.random.split(jax.random.fold_in(actors.key, number))
        carry, action = _acted(policy, actors.carry, actors.obs, policy_key, remembers)
        before = actors.drawn
        obs, state, reward, terminated, truncated, info = env.step(
            step_key, before.state, action, before.params(params)
        )
        after = _Actors(actors.key, before.replace(state=state), obs, carry)
        return Taken(after, reward.astype(jnp.float32), info["success"], terminated | truncated)

    return advance(jax.vmap(step, in_axes=(None, 0)), playing, until)


_shared = jax.jit(_advance, static_argnums=(1, 2))


def _acted(policy: Any, carry: Any, obs: Any, key: jax.Array, remembers: bool) -> tuple[Any, Any]:
    """The next carry and the action, as the policy returns them."""
    return policy(carry, obs, key) if remembers else (carry, policy(obs, key))


def check_policy(env: AnyEnvironment, params: Any, policy: Callable[..., Any], carry: Any) -> Any:
    """Trace a policy in one environment, and return its carry as arrays; see `evaluate`.

    Raises:
        SettingError: the policy is not a function, takes other arguments, is not written in JAX,
            or returns the wrong values.
    """
    if not callable(policy):
        raise SettingError(f"policy must be a function, not {quoted(policy)}")
    key = key_of(0)
    obs, _ = jax.eval_shape(env.reset, key, params)
    remembers = carry is not None
    if remembers:
        try:
            carry = jax.tree.map(jnp.asarray, carry)
        except TypeError as error:
            raise SettingError(f"carry must be a pytree of arrays, not {quoted(carry)}") from error
    call = "policy(carry, obs, key)" if remembers else "policy(obs, key)"
    given = (carry, obs, key) if remembers else (obs, key)
    _check_arguments(policy, given, call, remembers)
    try:
        returned = jax.eval_shape(policy, *given)
    except _NOT_IN_JAX as error:
        raise SettingError(
            "the policy cannot be compiled: it needs the values of arrays, as NumPy, PyTorch and "
            "Python's `if` do; write it in jax.numpy, or run it through an adapter "
            "(docs/adapters.md)"
        ) from error
    hint = ", such as jnp.argmax(logits)"
    if remembers:
        if not isinstance(returned, tuple) or len(returned) != 2:
            raise SettingError(f"{call} must return (carry, action), not {_shapes_of(returned)}")
        after, returned = returned
        _check_carry(carry, after)
    elif isinstance(returned, tuple):
        hint = "; a policy that returns (carry, action) needs carry=, its initial memory"
    leaf = returned if isinstance(returned, jax.ShapeDtypeStruct) else None
    if leaf is None or leaf.shape != () or not jnp.issubdtype(leaf.dtype, jnp.integer):
        raise SettingError(
            f"the action of {call} must be one whole number of shape (){hint}, "
            f"not {_shapes_of(returned)}"
        )
    return carry


def _check_arguments(
    policy: Callable[..., Any], given: tuple[Any, ...], call: str, remembers: bool
) -> None:
    try:
        signature = inspect.signature(policy)
    except (TypeError, ValueError):
        return  # Some callables have no signature.
    try:
        signature.bind(*given)
    except TypeError as error:
        other = (
            "without carry=, it is called as policy(obs, key)"
            if remembers
            else "with carry=, its initial memory, it is called as policy(carry, obs, key)"
        )
        raise SettingError(
            f"the policy takes {signature}, but is called as {call}; {other}"
        ) from error


def _check_carry(carry: Any, after: Any) -> None:
    """Raise if one step changes the structure, shapes or dtypes of the carry."""
    before = jax.tree.map(lambda leaf: jax.ShapeDtypeStruct(leaf.shape, leaf.dtype), carry)
    one, other = jax.tree.structure(before), jax.tree.structure(after)
    if one != other:
        raise SettingError(
            f"the carry must keep its structure: it starts as {one}, but the policy returns {other}"
        )
    named = jax.tree_util.tree_leaves_with_path(before)
    for (path, leaf), new in zip(named, jax.tree.leaves(after), strict=True):
        if (leaf.shape, leaf.dtype) != (new.shape, new.dtype):
            raise SettingError(
                f"the carry must keep its shapes and dtypes: carry{jax.tree_util.keystr(path)} "
                f"starts as {_shapes_of(leaf)}, but the policy returns {_shapes_of(new)}"
            )


def _shapes_of(tree: Any) -> str:
    """The shapes and dtypes of a pytree in words, such as `float32[3]`."""
    if isinstance(tree, jax.ShapeDtypeStruct):
        return f"{tree.dtype}{list(tree.shape)}"
    if isinstance(tree, tuple | list):
        return f"({', '.join(map(_shapes_of, tree))})"
    return repr(tree) if tree is None else f"a {type(tree).__name__}"
