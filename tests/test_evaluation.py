"""Evaluation of any policy, against a loop on the host that plays one episode after another."""

from __future__ import annotations

import dataclasses
import gc
import weakref
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from examples.custom_task import Fruit
from jaxenstein import SettingError
from jaxenstein.evaluation import evaluate

pytestmark = pytest.mark.usefixtures("plain_frames")

MAP = "######\n#S..G#\n######\n"
SEED = 7


@pytest.fixture(scope="module")
def world() -> tuple[Any, Any]:
    look = {"height": 8, "width": 12, "frame_skip": 3}
    env, params = jaxenstein.from_ascii(MAP, heading=(-3, 3), **look)
    return env, params.replace(max_steps_in_episode=40, living_reward=-0.01, move_distance=0.3)


def plain(obs: jax.Array, key: jax.Array) -> jax.Array:
    """Mostly forward; sometimes an action that depends on the image."""
    seen = jnp.sum(obs.astype(jnp.int32)) % 5
    return jnp.where(jax.random.bernoulli(key, 0.8), 2, seen)


def recurrent(carry: Any, obs: jax.Array, key: jax.Array) -> tuple[Any, jax.Array]:
    """An untrained Elman network that also gets the last action."""
    weights = jnp.sin(jnp.arange(24.0, dtype=jnp.float32)).reshape(6, 4)
    seen = obs[0, :2].astype(jnp.float32).ravel() / np.float32(255)
    hidden = jnp.tanh(seen @ weights + carry["hidden"])
    hidden = hidden.at[2].add(0.5)
    logits = jnp.concatenate([hidden, carry["last"].astype(jnp.float32)[None] / np.float32(4)])
    action = jax.random.categorical(key, 3 * logits).astype(jnp.int32)
    return {"hidden": hidden, "last": action}, action


MEMORY = {"hidden": np.full(4, 0.5, np.float32), "last": np.int32(-1)}


def played(
    env: Any, params: Any, act: Callable[..., Any], carry: Any, number: int
) -> tuple[float, int, bool]:
    """Return, length and success of one episode: the keys are as documented, the rest is plain."""
    key = jax.random.fold_in(jax.random.key(SEED, impl="threefry2x32"), number)
    reset_key, key = jax.random.split(key)
    env = dataclasses.replace(env, autoreset=None)
    obs, state = env.reset(reset_key, params)
    total, steps, success, over = np.float32(0), 0, False, False
    while not over:
        policy_key, step_key = jax.random.split(jax.random.fold_in(key, steps))
        if carry is None:
            action = act(obs, policy_key)
        else:
            carry, action = act(carry, obs, policy_key)
        obs, state, reward, terminated, truncated, info = env.step(step_key, state, action, params)
        total, steps = total + np.float32(reward), steps + 1
        success, over = success or bool(info["success"]), bool(terminated | truncated)
    return float(total), steps, success


@pytest.mark.parametrize(("policy", "carry"), [(plain, None), (recurrent, MEMORY)])
def test_episodes_match_a_loop_over_single_environments(
    world: tuple[Any, Any], policy: Any, carry: Any
) -> None:
    results = evaluate(*world, policy, carry, episodes=12, seed=SEED)
    act = jax.jit(policy)
    expected = [played(*world, act, carry, number) for number in range(12)]
    returns, lengths, successes = map(list, zip(*expected, strict=True))
    np.testing.assert_allclose(results.returns[0], returns, rtol=1e-6)
    np.testing.assert_array_equal(results.lengths[0], lengths)
    np.testing.assert_array_equal(results.successes[0], successes)
    # Both ends are among them, in episodes of several lengths.
    assert 0 < sum(successes) < 12
    assert len(set(lengths)) > 2
    # An episode does not depend on the number of other episodes.
    fewer = evaluate(*world, policy, carry, episodes=5, seed=SEED)
    np.testing.assert_array_equal(fewer.returns, results.returns[:, :5])
    np.testing.assert_array_equal(fewer.lengths, results.lengths[:, :5])
    other = evaluate(*world, policy, carry, episodes=12, seed=SEED + 1)
    assert other.lengths.tolist() != results.lengths.tolist()


def test_results_describe_the_environment(world: tuple[Any, Any]) -> None:
    done: list[float] = []
    env, params = world
    results = evaluate(env, params, plain, episodes=3, seed=SEED, notify=done.append)
    name = f"{__name__}:plain"
    assert (results.policy, results.names, results.actions) == (name, (name,), None)
    assert (results.seed, results.episodes) == (SEED, 3)
    built, numbers = results.environment.build()
    assert built == dataclasses.replace(env, autoreset=None)
    same = jax.tree.map(lambda one, other: bool(one == other), numbers, env.check_params(params))
    assert jax.tree.all(same)
    assert done[-1] == 3
    assert done == sorted(done)
    assert evaluate(env, params, plain, episodes=1, name="mine").names == ("mine",)


def test_task_without_an_id_is_named_by_its_class() -> None:
    env = Fruit(height=8, width=12)
    params = env.default_params.replace(max_steps_in_episode=3)
    results = evaluate(env, params, lambda obs, key: 0, episodes=2)
    np.testing.assert_array_equal(results.lengths, 3)
    assert results.environment.id == "examples.custom_task:Fruit"
    built, numbers = results.environment.build()
    assert type(built) is Fruit
    assert (built.height, built.width, int(numbers.max_steps_in_episode)) == (8, 12, 3)


def test_weights_in_a_partial_are_not_compiled_in(world: tuple[Any, Any]) -> None:
    traced: list[int] = []

    def act(weights: jax.Array, obs: jax.Array, key: jax.Array) -> jax.Array:
        traced.append(1)
        return jnp.argmax(weights)

    def lengths(weights: Any) -> list[list[int]]:
        policy = jax.tree_util.Partial(act, jnp.asarray(weights, jnp.float32))
        return evaluate(*world, policy, episodes=4).lengths.tolist()

    first = lengths([0, 0, 1, 0, 0])
    before = len(traced)
    assert lengths([1, 0, 0, 0, 0]) != first
    # Traced only for its output shapes.
    assert len(traced) == before + 1


def test_changed_weights_are_used(world: tuple[Any, Any]) -> None:
    """JAX knows a compiled program by its function, which stays the same."""

    class Agent:
        action = 0

        def __call__(self, obs: Any, key: Any) -> Any:
            return self.action

    agent = Agent()
    for policy in (agent, agent.__call__, *map(jax.tree_util.Partial, (agent, agent.__call__))):
        lengths = []
        for action in (0, world[0].index_of("forward")):
            agent.action = action
            lengths.append(int(evaluate(*world, policy, episodes=1).lengths[0, 0]))
        assert lengths[1] < lengths[0]


def test_the_program_of_a_policy_is_freed_with_it(world: tuple[Any, Any]) -> None:
    def act(obs: Any, key: Any) -> Any:
        return 0

    evaluate(*world, act, episodes=1)
    left = weakref.ref(act)
    del act
    gc.collect()
    assert left() is None


def test_unhashable_callables_are_policies(world: tuple[Any, Any]) -> None:
    @dataclasses.dataclass
    class Constant:
        action: Any

        def __call__(self, obs: Any, key: Any) -> Any:
            return self.action

    results = evaluate(*world, Constant(jnp.int32(0)), episodes=2)
    assert results.policy.endswith("Constant")
    np.testing.assert_array_equal(results.lengths, 14)


WRONG: dict[str, tuple[Any, Any, str]] = {
    "no function": (3, None, "policy must be a function, not 3"),
    "arity": (lambda obs: 0, None, r"takes \(obs\), but is called as policy\(obs, key\); with"),
    "a carry left out": (
        recurrent,
        None,
        r"called as policy\(obs, key\); with carry=, its initial memory",
    ),
    "a carry too many": (plain, 0, r"called as policy\(carry, obs, key\); without carry="),
    "a number": (lambda o, k: 0.5, None, r"one whole number of shape \(\).*not float32\[\]"),
    "logits": (lambda o, k: jnp.zeros(5), None, r"jnp.argmax\(logits\), not float32\[5\]"),
    "nothing": (lambda o, k: None, None, "not None"),
    "a pair": (lambda o, k: (k, 0), None, "returns .carry, action. needs carry="),
    "no pair": (lambda c, o, k: 0, 0, r"must return \(carry, action\), not int32\[\]"),
    "dtype": (lambda c, o, k: (c + 0.5, 0), 0, r"carry starts as int32\[\], .* float32\[\]"),
    "shape": (
        lambda c, o, k: ({"a": jnp.zeros(4)}, 0),
        {"a": jnp.zeros(3)},
        r"carry\['a'\] starts as float32\[3\], but the policy returns float32\[4\]",
    ),
    "structure": (lambda c, o, k: ((c, c), 0), 0, "must keep its structure"),
    "no arrays": (lambda c, o, k: (c, 0), "abc", "carry must be a pytree of arrays, not 'abc'"),
    "numpy": (lambda o, k: int(np.asarray(o).sum()), None, "needs the values of arrays"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_policies_are_refused(world: tuple[Any, Any], name: str) -> None:
    policy, carry, message = WRONG[name]
    with jax.numpy_dtype_promotion("standard"), pytest.raises(SettingError, match=message):
        evaluate(*world, policy, carry)


def test_wrong_environments_and_numbers_are_refused(world: tuple[Any, Any]) -> None:
    env, params = world
    several = params.replace(living_reward=jnp.zeros(3))
    cases: list[tuple[Any, Any, str]] = [
        ((world, params), {}, r"not a builtins.tuple; jaxenstein.make returns \(env, params\)"),
        (("simple", params), {}, "env must be an environment from jaxenstein.make, not a builtins"),
        ((env, several), {}, r"living_reward must have the shape \(\), not \(3,\)"),
        (world, {"episodes": 0}, "episodes must be a whole number >= 1, not 0"),
        (world, {"episodes": 2.5}, "episodes must be a whole number"),
        (world, {"seed": -1}, "a seed must be a whole number from 0"),
        (world, {"name": "two\nlines"}, "name must be one line of text"),
    ]
    for (env, params), settings, message in cases:
        with pytest.raises(SettingError, match=message):
            evaluate(env, params, plain, **settings)
