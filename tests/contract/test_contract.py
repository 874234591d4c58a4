"""What every environment keeps, tried on every id."""

import functools
import importlib
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein.environment import Environment

SIZE = {"height": 12, "width": 16}
IDS = jaxenstein.environment_ids()
# What every task tells; events and variables of its own come besides.
INFO = {
    "position": ((2,), np.float32),
    "heading": ((), np.float32),
    "cell": ((2,), np.int32),
    "episode_return": ((), np.float32),
    "episode_length": ((), np.int32),
}


def build(name: str, **settings: Any) -> tuple[Environment[Any, Any], Any]:
    """A small environment of any id."""
    return jaxenstein.make(cast(jaxenstein.EnvironmentId, name), **SIZE, **settings)


@functools.cache
def rollout(name: str, steps: int = 120, old_keys: bool = False):
    """Everything that a scan of random actions returns, stacked over time, as numpy."""
    env, params = build(name)
    params = params.replace(max_steps_in_episode=50)

    def body(carry, action):
        key, state = carry
        key, step_key = jax.random.split(key)
        out = env.step(step_key, state, action, params)
        return (key, out[1]), out

    @jax.jit
    def play(key, actions):
        obs, state = env.reset(key, params)
        return obs, state, jax.lax.scan(body, (key, state), actions)[1]

    key = jax.random.PRNGKey(3) if old_keys else jax.random.key(3)
    actions = np.random.default_rng(0).integers(0, env.num_actions, steps, np.int32)
    return jax.tree.map(np.asarray, play(key, jnp.asarray(actions)))


@pytest.mark.parametrize("name", IDS)
def test_shapes_and_types(name):
    env, params = jaxenstein.make(name, **SIZE)
    first, _, (obs, state, reward, terminated, truncated, info) = rollout(name)
    space = env.observation_space(params)
    assert space.contains(first)
    assert all(space.contains(frame) for frame in obs)
    assert reward.dtype == np.float32
    assert terminated.dtype == truncated.dtype == np.bool_
    kinds = {k: (v.shape[1:], v.dtype.type) for k, v in info.items()}
    assert kinds.items() >= INFO.items()
    own = [kind for name, kind in kinds.items() if name not in INFO]
    assert all(shape == () and kind in (np.float32, np.int32, np.bool_) for shape, kind in own)
    for leaf in jax.tree.leaves((state, reward, info)):
        if leaf.dtype == np.float32:
            assert np.isfinite(leaf).all()
    assert ((state.heading >= 0) & (state.heading < 2 * np.pi)).all()
    assert env.action_space(params).n == env.num_actions == len(env.action_names)


@pytest.mark.parametrize("name", IDS)
def test_time_limit_truncates_and_resets(name):
    _, _, (_, state, _, terminated, truncated, info) = rollout(name)
    done = terminated | truncated
    assert done.any()
    assert (truncated == (info["episode_length"] == 50)).all()
    assert (state.time[done] == 0).all()
    assert not state.done.any()
    assert (state.time[~done] == info["episode_length"][~done]).all()


@pytest.mark.parametrize("name", IDS)
def test_returns_add_up(name):
    _, _, (_, _, reward, terminated, truncated, info) = rollout(name)
    total = 0.0
    for t in range(len(reward)):
        total += float(reward[t])
        assert info["episode_return"][t] == pytest.approx(total, abs=1e-6)
        if terminated[t] or truncated[t]:
            total = 0.0


@pytest.mark.parametrize("name", IDS)
def test_seeds_decide_and_vmap_changes_nothing(name):
    """The scan of `rollout`, played again in a batch of two seeds, gives the same states."""
    env, params = build(name)
    params = params.replace(max_steps_in_episode=50)
    keys = jnp.stack([jax.random.key(3), jax.random.key(4)])
    first = jax.vmap(env.init_state, (0, None))(jax.vmap(jax.random.key)(jnp.arange(8)), params)
    again = jax.vmap(env.init_state, (0, None))(jax.vmap(jax.random.key)(jnp.arange(8)), params)
    jax.tree.map(np.testing.assert_array_equal, first, again)
    _, states = jax.jit(jax.vmap(env.reset, (0, None)))(keys, params)
    _, alone, _ = rollout(name)
    for batched, single in zip(jax.tree.leaves(states), jax.tree.leaves(alone), strict=True):
        np.testing.assert_allclose(np.asarray(batched[0]), single, rtol=1e-6)
    with jax.disable_jit():
        plain = env.init_state(keys[0], jax.tree.map(jnp.asarray, params))
    for eager, single in zip(jax.tree.leaves(plain), jax.tree.leaves(alone), strict=True):
        np.testing.assert_allclose(np.asarray(eager), single, rtol=1e-6)


def test_old_and_typed_keys_agree():
    typed, old = rollout("key-door"), rollout("key-door", old_keys=True)
    jax.tree.map(np.testing.assert_array_equal, typed, old)


@pytest.mark.parametrize("name", IDS)
def test_equal_settings_share_one_compilation(name):
    one, params = jaxenstein.make(name, **SIZE)
    two, _ = jaxenstein.make(name, **SIZE)
    other, _ = jaxenstein.make(name, **SIZE, sprite_layers=5)
    assert one == two
    assert hash(one) == hash(two)
    assert one != other
    key = jax.random.key(0)
    one.reset(key, params)
    cache_size = getattr(Environment.reset, "_cache_size")  # noqa: B009
    compiled = cache_size()
    two.reset(key, params)
    assert cache_size() == compiled


@pytest.mark.parametrize("name", IDS)
def test_environments_are_frozen(name):
    env, params = jaxenstein.make(name)
    with pytest.raises(AttributeError):
        env.height = 3  # pyright: ignore[reportAttributeAccessIssue]
    with pytest.raises(AttributeError):
        params.discount = 0.5


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
    """Auto-reset selects a state, not a frame: `step` costs hardly more than `step_env`."""
    env, params = jaxenstein.make("my-way-home")
    keys = jax.random.split(jax.random.key(0), 8)
    _, states = jax.vmap(env.reset, (0, None))(keys, params)
    actions = jnp.zeros(8, jnp.int32)

    def flops(step):
        lowered = jax.jit(jax.vmap(step, (0, 0, 0, None))).lower(keys, states, actions, params)
        return cast(dict, lowered.compile().cost_analysis())["flops"]

    once = flops(env.step_env)
    assert once < flops(env.step) <= 1.15 * once
    twice, _ = jaxenstein.make("my-way-home", final_observation=True)
    assert flops(twice.step) > 1.5 * once


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


def test_jit_and_vmap_change_nothing():
    env, params = jaxenstein.make("key-door", **SIZE)
    keys = jax.random.split(jax.random.key(1), 3)
    batch_obs, batch_states = jax.vmap(env.reset, (0, None))(keys, params)
    for i, key in enumerate(keys):
        obs, state = env.reset(key, params)
        np.testing.assert_array_equal(obs, batch_obs[i])
        np.testing.assert_array_equal(state.heading, batch_states.heading[i])
        with jax.disable_jit():
            plain, _ = env.reset(key, params)
        assert (np.asarray(plain) != np.asarray(obs)).mean() < 0.01


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
def test_wrong_kinds_of_action_are_refused(action):
    env, params = jaxenstein.make("simple", **SIZE)
    _, state = env.reset(jax.random.key(0), params)
    with pytest.raises(jaxenstein.SettingError, match="one integer of shape"):
        env.step(jax.random.key(1), state, action, params)


def test_wrong_params_are_refused():
    env, _ = jaxenstein.make("simple", **SIZE)
    with pytest.raises(jaxenstein.SettingError, match="NavigationParams"):
        env.reset(jax.random.key(0), jaxenstein.Params())


def test_x64_changes_no_type():
    env, params = jaxenstein.make("my-way-home", **SIZE)
    key = jax.random.key(5)
    narrow = env.step(key, env.reset(key, params)[1], 2, params)
    # Older versions of JAX have it among the experiments, newer ones only at the top.
    home = jax if hasattr(jax, "enable_x64") else importlib.import_module("jax.experimental")
    with home.enable_x64(True):
        wide = env.step(key, env.reset(key, params)[1], 2, params)
    for a, b in zip(jax.tree.leaves(narrow), jax.tree.leaves(wide), strict=True):
        assert a.dtype == b.dtype
        if a.dtype != np.uint8:
            np.testing.assert_allclose(a, b, rtol=1e-6)
    assert (np.asarray(narrow[0]) != np.asarray(wide[0])).mean() < 0.01
