"""Numbers of an environment are checked where they come in; keys and actions are told in words."""

import dataclasses
from typing import Any

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein import SettingError
from jaxenstein.params import Params, number
from jaxenstein.tasks.navigation import Navigation

SIZE = {"height": 8, "width": 8}


class OwnParams(Params):
    """Numbers of a task of one's own, one of them with another default than its base."""

    max_steps_in_episode: Any = 7
    bold: Any = False
    share: Any = number(0.5, 0, 1)
    anything: Any = 0.0


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("move_distance", 4.0, "move_distance must be a finite number from 0 to below 1, not 4.0"),
        ("move_distance", np.float32(1), "move_distance must be"),
        (
            "turn_angle",
            float("nan"),
            "turn_angle must be a finite number from 0 to 6.28.*, not nan",
        ),
        ("turn_angle", jnp.array([0.1, -0.2]), "turn_angle must be .*-0.2"),
        ("goal_reward", float("inf"), "goal_reward must be a finite number, not inf"),
        ("goal_reward", 1e300, "goal_reward must be a finite number"),
        ("goal_reward", "much", "goal_reward must be a number"),
        ("goal_reward", [1, 2], "goal_reward must be a number or an array"),
        ("goal_reward", True, "goal_reward must be"),
        ("max_steps_in_episode", -5, "a whole number from 1 on, at most 2147483647, not -5"),
        ("max_steps_in_episode", np.int64(10**12), "at most 2147483647, not"),
        ("max_steps_in_episode", 10**30, "max_steps_in_episode must be"),
        ("max_steps_in_episode", 2.5, "max_steps_in_episode must be a whole number"),
        ("max_steps_in_episode", float("nan"), "max_steps_in_episode must be a whole number"),
        ("discount", 1.5, "discount must be a finite number from 0 to 1"),
        ("speed", 2, "NavigationParams has no 'speed'; it has: max_steps_in_episode, discount"),
        ("move_distanc", 0.1, "no 'move_distanc', did you mean 'move_distance'"),
    ],
)
def test_wrong_numbers_are_refused_where_they_come_in(name, value, message):
    env, params = jaxenstein.make("simple", **SIZE)
    with pytest.raises(SettingError, match=message):
        params.replace(**{name: value})
    if name in {field.name for field in dataclasses.fields(params)}:
        wrong = dataclasses.replace(params, **{name: value})
        for enter in (env.check_params, lambda p: env.reset(jax.random.key(0), p)):
            with pytest.raises(SettingError, match=message):
                enter(wrong)


def test_ranges_hold_for_subclasses_with_other_defaults():
    params = OwnParams().replace(bold=True, share=1, anything=-3e38, max_steps_in_episode=9.0)
    assert params == OwnParams(9.0, bold=True, share=1, anything=-3e38)
    for changes in ({"max_steps_in_episode": 0}, {"bold": 1}, {"share": 1.1}, {"share": -0.1}):
        with pytest.raises(SettingError, match=f"{next(iter(changes))} must be"):
            params.replace(**changes)


def test_what_is_traced_or_no_number_passes():
    env, params = jaxenstein.make("simple", **SIZE)
    far = jax.jit(lambda x: params.replace(move_distance=x).move_distance * 2)
    assert far(4.0) == 8
    axes = jax.tree.map(lambda _: None, params).replace(max_steps_in_episode=0)
    assert axes.max_steps_in_episode == 0
    shapes = jax.eval_shape(lambda: params)
    assert shapes.replace(discount=shapes.turn_angle).discount.dtype == np.float32
    many = params.replace(move_distance=jnp.array([0.1, 0.9]))
    assert env.check_params(many).move_distance.shape == (2,)


def test_adapters_and_files_check_them_too():
    with pytest.raises(SettingError, match="max_steps_in_episode must be"):
        gymnasium.make("jaxenstein/simple-v0", max_steps_in_episode=0)
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
def test_keys_that_are_none(key, message):
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


def test_settings_have_ranges_too():
    @dataclasses.dataclass(frozen=True, kw_only=True)
    class Sized(Navigation):
        rooms: int = number(4, 3)

    @dataclasses.dataclass(frozen=True, kw_only=True)
    class Larger(Sized):
        rooms: int = 9

    env: Any = jaxenstein.make("simple")[0]
    tilemap = env.tilemap
    assert Larger(tilemap=tilemap).rooms == 9
    for kind in (Sized, Larger):
        refused: tuple[Any, ...] = (2, 4.0, True, "4")
        for wrong in refused:
            with pytest.raises(
                SettingError, match=r"rooms must be a whole number from 3 on, .*not"
            ):
                kind(tilemap=tilemap, rooms=wrong)
