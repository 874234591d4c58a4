"""Params are checked on entry; errors for keys and actions are in words."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein import SettingError
from jaxenstein.params import differing

pytestmark = pytest.mark.usefixtures("plain_frames")

SIZE = {"height": 8, "width": 8}


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("move_distance", 4.0, "move_distance must be a finite number >= 0 and below 1, not 4.0"),
        ("turn_angle", jnp.array([0.1, -0.2]), "turn_angle must be .*-0.2"),
        ("max_steps_in_episode", -5, "a whole number from 1 to 2147483647, not -5"),
        (
            "speed",
            2,
            "NavigationParams has no 'speed'; the fields are: max_steps_in_episode, discount",
        ),
        ("move_distanc", 0.1, "no 'move_distanc', did you mean 'move_distance'"),
    ],
)
def test_wrong_numbers_are_refused_on_input(name, value, message):
    env, params = jaxenstein.make("simple", **SIZE)
    with pytest.raises(SettingError, match=message):
        params.replace(**{name: value})
    if name in {field.name for field in dataclasses.fields(params)}:
        wrong = dataclasses.replace(params, **{name: value})
        for enter in (env.check_params, lambda p: env.reset(jax.random.key(0), p)):
            with pytest.raises(SettingError, match=message):
                enter(wrong)


def test_numbers_keep_the_dtype_so_that_nothing_compiles_again():
    params = jaxenstein.make("simple", **SIZE)[1]
    step: Any = jax.jit(lambda params: (params.goal_radius, params.max_steps_in_episode))
    for changes in ({}, {"goal_radius": 0.3}, {"goal_radius": 1}, {"max_steps_in_episode": 5}):
        step(params.replace(**changes))
    assert step._cache_size() == 1


def test_tracers_and_placeholders_pass():
    env, params = jaxenstein.make("simple", **SIZE)
    far = jax.jit(lambda x: params.replace(move_distance=x).move_distance * 2)
    assert far(4.0) == 8
    axes = jax.tree.map(lambda _: None, params).replace(max_steps_in_episode=0)
    assert axes.max_steps_in_episode == 0
    shapes = jax.eval_shape(lambda: params)
    assert shapes.replace(discount=shapes.turn_angle).discount.dtype == np.float32
    many = params.replace(move_distance=jnp.array([0.1, 0.9]))
    assert env.check_params(many).move_distance.shape == (2,)


@pytest.mark.parametrize("name", ["turn_angle", "max_steps_in_episode"])
def test_batched_params_are_refused_for_one_environment(name):
    env, params = jaxenstein.make("simple", **SIZE)
    many = params.replace(**{name: jnp.stack([getattr(params, name)] * 4)})
    keys = jax.random.split(jax.random.key(0), 4)
    _, states = jax.vmap(env.reset, (0, None))(keys, params)
    one = jax.tree.map(lambda leaf: leaf[0], states)
    shapes = rf"{name} must have the shape \(\), not \(4,\)"
    remedy = rf"replace\({name}=0\) and jax.vmap\(env.reset, in_axes=\(0, axes\)\)"
    for enter in (
        lambda: jax.vmap(env.reset, (0, None))(keys, many),
        lambda: jax.vmap(env.step, (0, 0, None, None))(keys, states, 2, many),
        lambda: jax.vmap(env.advance, (0, 0, None, None))(keys, states, 2, many),
        lambda: env.step(keys[0], one, 2, many),
        lambda: env.single_params(many),
        lambda: jaxenstein.record(env, many, [2]),
    ):
        with pytest.raises(SettingError, match=f"params of 'simple'.*{shapes}.*{remedy}"):
            enter()


def test_params_of_another_number_of_environments_are_refused():
    _, params = jaxenstein.make("simple", **SIZE)
    three = params.replace(turn_angle=jnp.ones(3))
    names = [jax.tree_util.keystr(path) for path, _ in jax.tree_util.tree_leaves_with_path(params)]
    assert differing(three, params, 3, "simple") == [name == ".turn_angle" for name in names]
    told = r"params of 4 environments of 'simple': turn_angle .* \(\) .* \(4,\) .* not \(3,\)"
    with pytest.raises(SettingError, match=told):
        differing(three, params, 4, "simple")


def test_stacked_params_are_mapped():
    env, params = jaxenstein.make("simple", **SIZE)
    keys = jax.random.split(jax.random.key(0), 1)
    stacked = jax.tree.map(lambda leaf: leaf[None], params)
    with pytest.raises(SettingError, match=r"env.reset, in_axes=\(0, 0\)\)"):
        jax.vmap(env.reset, (0, None))(keys, stacked)
    _, states = jax.vmap(env.reset, (0, 0))(keys, stacked)
    assert states.time.shape == (1,)


def test_most_steps_in_compiled_code():
    env, params = jaxenstein.make("simple", frame_skip=3, **SIZE)
    params = params.replace(max_steps_in_episode=8)

    @jax.jit
    def played(known):
        length = int(env.most_steps(params))  # known while this is traced
        assert jnp.zeros(length).shape == (3,)
        return jax.lax.scan(lambda i, _: (i + 1, None), 0, length=length)[0], env.most_steps(known)

    assert [int(steps) for steps in played(params)] == [3, 3]
    many = params.replace(max_steps_in_episode=jnp.array([3, 4]))
    assert jax.jit(env.most_steps)(many).tolist() == env.most_steps(many).tolist() == [1, 2]
    assert env.most_steps(many).dtype == jax.jit(env.most_steps)(many).dtype == np.int32


def test_gymnasium_checks_params_too():
    gymnasium = pytest.importorskip("gymnasium")
    from jaxenstein.adapters.gymnasium import GymnasiumEnv

    env, params = jaxenstein.make("simple", **SIZE)
    many = params.replace(turn_angle=jnp.array([0.1, 0.2]))
    with pytest.raises(SettingError, match="turn_angle must have the shape"):
        GymnasiumEnv(env, many)
    with pytest.raises(SettingError, match=r"env.reset, in_axes=\(0, 0\)\)"):
        GymnasiumEnv(env, jax.tree.map(lambda leaf: leaf[None], params))
    with pytest.raises(SettingError, match="max_steps_in_episode must be"):
        gymnasium.make("jaxenstein/simple-v0", max_steps_in_episode=0)


def test_recordings_check_params_too():
    env, params = jaxenstein.make("simple", **SIZE)
    with pytest.raises(SettingError, match="move_distance must be"):
        jaxenstein.record(env, dataclasses.replace(params, move_distance=2.0), [2])


@pytest.mark.parametrize(
    ("key", "message"),
    [
        (0, r"random key such as jax.random.key\(0\), not 0"),
        (None, "a key must be"),
        (np.zeros(2, np.int32), r"not int32\[2\]"),
        (jnp.zeros((), jnp.uint32), r"not uint32\[\]"),
    ],
)
def test_invalid_keys_are_refused(key, message):
    env, params = jaxenstein.make("simple", **SIZE)
    with pytest.raises(SettingError, match=message):
        env.reset(key, params)
    _, state = env.reset(jax.random.key(0), params)
    with pytest.raises(SettingError, match=message):
        env.step(key, state, 0, params)
    with pytest.raises(SettingError, match=r"for a batch use jax\.vmap"):
        env.reset(key=jax.random.split(jax.random.key(0), 3))


def test_actions_by_name():
    env, params = jaxenstein.make("simple", **SIZE)
    key = jax.random.key(1)
    _, state = env.reset(jax.random.key(0), params)
    for action, name in enumerate(env.action_names):
        one, other = env.step(key, state, action, params), env.step(key, state, name, params)
        assert jax.tree.all(jax.tree.map(np.array_equal, one[:5], other[:5]))
    assert env.advance(key, state, action="forward")[0].time == 1
    with pytest.raises(
        SettingError, match=r"unknown action 'foward', did you mean 'forward'.*known"
    ):
        env.step(key, state, "foward", params)
