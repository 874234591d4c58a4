"""Properties of steps in any environment, tested on one or two of them."""

import dataclasses
import inspect
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein.environment import Environment
from reliability.golden import SIZE
from tests.contract.played import Played, member
from tests.x64 import enable_x64


@pytest.mark.parametrize(
    "name", ["key-door", pytest.param("health-gathering", marks=pytest.mark.variant)]
)
def test_compilation_batches_and_scans_change_nothing(name: str) -> None:
    played = Played(name)
    first, out = member(played.first, 1, 0), member(member(played.steps, 1, 1), 0, 0)
    with jax.disable_jit():
        obs, state = played.env.reset(played.keys[0, 1], played.params)
        step = played.env.step(played.keys[1, 1], state, played.actions[0], played.params)
    assert_alike((obs, state), first)
    assert_alike(step, out)


def assert_alike(one: Any, other: Any) -> None:
    """Compare up to rounding; a few values of an image may differ, at edges of objects."""
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        a, b = np.asarray(a), np.asarray(b)
        assert a.dtype == b.dtype
        if a.dtype == np.uint8:
            assert (a != b).mean() < 0.02
        else:
            np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-6)


def test_old_and_typed_keys_agree() -> None:
    """With random starts and random medkits."""
    env, params = jaxenstein.make("health-gathering", **SIZE)
    start = env.init_state(jax.random.key(3), params)
    due = start.replace(time=jnp.int32(int(params.medkit_period) - 1))
    typed, old, other = (
        (env.init_state(first, params), env.advance(then, due, 2, params))
        for first, then in (
            (jax.random.key(3), jax.random.key(4)),
            (jax.random.PRNGKey(3), jax.random.PRNGKey(4)),
            (jax.random.key(5), jax.random.key(6)),
        )
    )
    jax.tree.map(np.testing.assert_array_equal, typed, old)
    for one, another in ((typed[0], other[0]), (typed[1][0], other[1][0])):
        assert (one.medkits != another.medkits).any()


def test_equal_environments_share_one_compilation() -> None:
    (one, params), (two, _) = (jaxenstein.make("key-door", **SIZE) for _ in range(2))
    key = jax.random.key(0)
    state = one.init_state(key, params)
    one.advance(key, state, np.int32(0), params)
    advance: Any = inspect.unwrap(Environment.advance, stop=lambda f: hasattr(f, "_cache_size"))
    before = advance._cache_size()
    two.advance(jax.random.key(1), state, np.int32(1), params)
    assert advance._cache_size() == before


@pytest.mark.parametrize("observation", ["rgb", "gray", "depth", "labels", "dict"])
def test_observation_kinds(observation):
    env, params = jaxenstein.make("key-door", observation=observation, **SIZE)
    obs, state = env.reset(jax.random.key(0), params)
    space = env.observation_space(params)
    assert space.contains(jax.tree.map(np.asarray, obs))
    assert space.contains(jax.tree.map(np.asarray, space.sample(jax.random.key(1))))
    after = env.step(jax.random.key(0), state, 2, params)[0]
    assert space.contains(jax.tree.map(np.asarray, after))


def test_step_renders_once():
    """Auto-reset selects a state, not a frame: `step` costs hardly more without resets."""
    env, params = jaxenstein.make("my-way-home")
    keys = jax.random.split(jax.random.key(0), 8)
    _, states = jax.vmap(env.reset, (0, None))(keys, params)
    actions = jnp.zeros(8, jnp.int32)

    def flops(step):
        lowered = jax.jit(jax.vmap(step, (0, 0, 0, None))).lower(keys, states, actions, params)
        return cast(dict, lowered.compile().cost_analysis())["flops"]

    once = flops(dataclasses.replace(env, autoreset=None).step)
    assert once < flops(env.step) <= 1.15 * once
    twice, _ = jaxenstein.make("my-way-home", final_observation=True)
    assert flops(twice.step) > 1.5 * once


@pytest.mark.parametrize(
    "drawn", ["my-way-home", pytest.param("doom-health-gathering", marks=pytest.mark.slow)]
)
def test_cond_with_batched_predicate(drawn) -> None:
    """A user's `lax.cond` around `reset` and `step`, which batches their arrays."""
    env, params = jaxenstein.make(drawn, height=6, width=6)

    def either(anew, key, state):
        step = lambda key, state: env.step(key, state, jnp.int32(0), params)[:2]  # noqa: E731
        return jax.lax.cond(anew, lambda key, _: env.reset(key, params), step, key, state)

    keys = jax.random.split(jax.random.key(3), 3)
    reset = jax.vmap(env.reset, (0, None))(keys, params)
    actions = jnp.zeros(3, jnp.int32)
    step = jax.vmap(env.step, (0, 0, 0, None))(keys, reset[1], actions, params)[:2]
    chosen = jnp.array([False, True, False])
    got = jax.jit(jax.vmap(either))(chosen, keys, reset[1])
    for i, anew in enumerate(chosen):
        assert_alike(member(got, i, 0), member(reset if anew else step, i, 0))


def test_empty_batch():
    env, params = jaxenstein.make("key-door", **SIZE)
    obs, states = jax.vmap(env.reset, (0, None))(jax.random.split(jax.random.key(0), 0), params)
    assert obs.shape == (0, 12, 16, 3)
    keys, actions = jax.random.split(jax.random.key(0), 0), jnp.zeros(0, jnp.int32)
    obs, _, reward, *_ = jax.vmap(env.step, (0, 0, 0, None))(keys, states, actions, params)
    assert (obs.shape, reward.shape) == ((0, 12, 16, 3), (0,))


def test_params_can_be_batched():
    env, params = jaxenstein.make("simple", **SIZE)
    batch = params.replace(
        move_distance=jnp.array([0.1, 0.2, 0.3]), max_steps_in_episode=jnp.array([1, 2, 3])
    )
    axes = jax.tree.map(lambda leaf: 0 if jnp.ndim(leaf) else None, batch)
    keys = jax.random.split(jax.random.key(0), 3)
    _, states = jax.vmap(env.reset, (0, axes))(keys, batch)
    out = jax.vmap(env.step, (0, 0, None, axes))(keys, states, 2, batch)
    moved = out[5]["position"] - states.position
    np.testing.assert_allclose(moved[:, 0], [0.1, 0.2, 0.3], rtol=1e-6)
    assert out[4].tolist() == [True, False, False]


def test_params_are_traced_not_compiled_in():
    env, params = jaxenstein.make("simple", **SIZE)
    traces = []

    @jax.jit
    def step(key, state, params):
        traces.append(1)
        return env.step(key, state, 2, params)

    _, state = env.reset(jax.random.key(0), params)
    for distance in (0.1, 0.2, 0.3):
        step(jax.random.key(0), state, params.replace(move_distance=distance))
    assert len(traces) == 1


@pytest.mark.parametrize("action", [-1, 5, 127, -(2**31), 2**31 - 1, np.int8(-3), np.uint32(2**31)])
def test_invalid_actions_do_nothing(action):
    env, params = jaxenstein.make("my-way-home", **SIZE)
    _, state = env.reset(jax.random.key(0), params)
    _, after, reward, terminated, truncated, _ = env.step(jax.random.key(1), state, action, params)
    np.testing.assert_array_equal(after.position, state.position)
    np.testing.assert_array_equal(after.heading, state.heading)
    assert after.time == 1
    assert reward == np.float32(-0.0001)
    assert not terminated
    assert not truncated


@pytest.mark.parametrize("action", [0.0, np.zeros(3, np.int32), True])
def test_actions_of_wrong_type_are_refused(action):
    env, params = jaxenstein.make("simple", **SIZE)
    _, state = env.reset(jax.random.key(0), params)
    with pytest.raises(jaxenstein.SettingError, match="one integer of shape"):
        env.step(jax.random.key(1), state, action, params)


def test_wrong_params_are_refused():
    env, _ = jaxenstein.make("simple", **SIZE)
    with pytest.raises(jaxenstein.SettingError, match="NavigationParams"):
        env.reset(jax.random.key(0), jaxenstein.Params())


def test_x64_changes_no_dtype():
    env, params = jaxenstein.make("health-gathering", **SIZE)
    key = jax.random.key(5)
    narrow = env.step(key, env.reset(key, params)[1], 2, params)
    with enable_x64(True):
        wide = env.step(key, env.reset(key, params)[1], 2, params)
    for a, b in zip(jax.tree.leaves(narrow), jax.tree.leaves(wide), strict=True):
        assert a.dtype == b.dtype
        if a.dtype != np.uint8:
            np.testing.assert_allclose(a, b, rtol=1e-6)
    assert (np.asarray(narrow[0]) != np.asarray(wide[0])).mean() < 0.01
