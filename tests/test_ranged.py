"""Params as ranges: errors, draws, and files."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein import SettingError
from jaxenstein.cli import main
from jaxenstein.evaluation import evaluate_player
from jaxenstein.params import Range, draw_numbers, drawn, ranges_of
from jaxenstein.settings import given_by, spec_from
from jaxenstein.spec import Spec

pytestmark = pytest.mark.usefixtures("plain_frames")

SIZE = {"height": 8, "width": 8}
# Nothing but time passes where the agent turns.
WAITING = {**SIZE, "heading": 0}


def waiting():
    env, params = jaxenstein.from_ascii("####\n#SG#\n####", **WAITING)
    return env, params.replace(max_steps_in_episode=4, living_reward=(-2, -1))


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("turn_angle", (0.4, 0.1), "must be a range from a lower to a higher number, not 0.4:0.1"),
        ("turn_angle", (0.2, 0.2), "turn_angle must be a range from a lower"),
        ("turn_angle", (0.1, 40), "turn_angle must be .* not 40.0"),
        ("turn_angle", ("a", 1), "turn_angle must be a finite number"),
        ("turn_angle", (0.1, np.nan), "turn_angle must be a finite"),
        ("turn_angle", (0.1, None), "turn_angle must be a finite"),
        ("turn_angle", (0.1, 0.2, 0.3), "turn_angle must be one number, or a range"),
        ("max_steps_in_episode", (1, 5), "must be a whole number >= 1, not the range"),
        ("discount", (0.1, 0.9), "discount must be the same in all episodes, not the range"),
        ("turn_angel", (0.1, 0.9), "no 'turn_angel', did you mean 'turn_angle'"),
    ],
)
def test_wrong_ranges_are_refused(name, value, message):
    _, params = jaxenstein.make("simple", **SIZE)
    with pytest.raises(SettingError, match=message):
        params.replace(**{name: value})


def test_other_params_are_still_checked_beside_a_range():
    _, params = waiting()
    with pytest.raises(SettingError, match="move_distance must be a finite number"):
        params.replace(move_distance=4.0)
    assert ranges_of(params) == {"living_reward": (-2.0, -1.0)}
    assert ranges_of(params.replace(living_reward=-1.0)) == {}


def test_single_environment_refuses_ranges():
    env, params = waiting()
    message = r"living_reward must be one number here, not the range -2:-1: .*drawn\(params, seed\)"
    for call in (env.check_params, env.single_params, lambda p: env.reset(jax.random.key(0), p)):
        with pytest.raises(SettingError, match=message):
            call(params)
    with pytest.raises(SettingError, match="living_reward must be one number here"):
        jax.jit(env.reset)(jax.random.key(0), params)


def test_params_are_drawn_uniformly_and_independently():
    env, params = jaxenstein.make("simple", **SIZE)
    assert drawn(params, 0) is params
    wide = params.replace(turn_angle=(0.1, 0.5), living_reward=(-3, 1))
    many = drawn(wide, 5, 20_000)
    assert many.goal_radius == params.goal_radius
    angles, rewards = np.asarray(many.turn_angle), np.asarray(many.living_reward)
    for values, (low, high) in ((angles, (0.1, 0.5)), (rewards, (-3, 1))):
        assert values.dtype == np.float32
        # A tenth of all numbers in each tenth of the range, within five standard deviations.
        counts, _ = np.histogram(values, 10, (low, high))
        assert counts.sum() == 20_000
        np.testing.assert_allclose(counts, 2000, atol=5 * np.sqrt(2000 * 0.9))
    assert abs(np.corrcoef(angles, rewards)[0, 1]) < 5 / np.sqrt(20_000)
    one, again, other = drawn(wide, 5), drawn(wide, jax.random.key(5)), drawn(wide, 6)
    assert one.turn_angle == again.turn_angle != other.turn_angle
    assert env.single_params(one).turn_angle == one.turn_angle
    with pytest.raises(SettingError, match="seed must be a whole number from 0"):
        drawn(wide, -1)


def test_each_environment_of_an_adapter_has_its_own_params():
    pytest.importorskip("gymnasium")
    from jaxenstein.adapters.gymnasium_vector import GymnasiumVectorEnv

    env, params = waiting()
    numbers = drawn(params, 0, 3)
    envs = GymnasiumVectorEnv(env, numbers, num_envs=3)
    np.testing.assert_array_equal(envs.params.living_reward, numbers.living_reward)
    assert len(np.unique(numbers.living_reward)) == 3


def test_each_episode_of_an_evaluation_draws():
    env, params = waiting()
    turn = env.index_of("turn left")
    results = jaxenstein.evaluate(env, params, lambda obs, key: jnp.int32(turn), episodes=64)
    rewards = results.returns[0] / 4
    assert len(np.unique(rewards)) == 64
    assert -2 <= rewards.min() < -1.9
    assert -1.1 < rewards.max() <= -1
    few = jaxenstein.evaluate(env, params, lambda obs, key: jnp.int32(turn), episodes=3)
    np.testing.assert_array_equal(few.returns[0], results.returns[0, :3])
    other = jaxenstein.evaluate(env, params, lambda obs, key: jnp.int32(turn), episodes=3, seed=1)
    assert np.all(other.returns != few.returns)
    assert results.environment.params["living_reward"] == (-2, -1)


def test_each_episode_of_a_scripted_player_draws():
    env, params = waiting()
    results = evaluate_player(env, params, "idle", episodes=8, seed=3)
    keys = jax.random.split(jax.random.split(jax.random.key(3, impl="threefry2x32"))[0], 8)
    ranges = ranges_of(params)
    wanted = [4 * float(draw_numbers(ranges, key)[0]["living_reward"]) for key in keys]
    np.testing.assert_allclose(results.returns[0], wanted, rtol=1e-6)
    assert results.environment.params["living_reward"] == (-2, -1)
    # A player knows the params of its episode: larger turns take fewer steps.
    env, params = jaxenstein.from_ascii("####\n#SG#\n####", **SIZE, heading=180)
    turns = evaluate_player(env, params.replace(turn_angle=(0.1, 0.6)), "expert", episodes=8)
    assert turns.successes.all()
    assert len(np.unique(turns.lengths)) > 3


def test_files_store_ranges_as_lists_and_old_files_stay_readable():
    spec = spec_from({"env": "simple", "params": {"turn_angle": [0.1, 0.4], "goal_reward": 2}})
    plain = spec.to_json()
    assert plain["params"] == {"turn_angle": [0.1, 0.4], "goal_reward": 2}
    assert Spec.from_json(plain) == spec
    assert spec_from(given_by(spec)) == spec
    _, params = spec.try_out()
    assert params.turn_angle == Range(0.1, 0.4)
    assert Spec.from_json({**plain, "params": {"turn_angle": 0.1}}).build()[1].turn_angle < 0.11
    for value in ([0.4, 0.1], [0.1], [], [0.1, 0.2, 0.3]):
        with pytest.raises(SettingError, match="turn_angle"):
            Spec.from_json({**plain, "params": {"turn_angle": value}}).try_out()
    for value in (["a", 1], [[0.1, 0.2], 1], [None, 1], "0.1:0.4"):
        with pytest.raises(
            SettingError, match=r"environment\.params\.turn_angle' must be a finite"
        ):
            Spec.from_json({**plain, "params": {"turn_angle": value}})


def test_playing_commands_print_the_drawn_params(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "map.txt").write_text("####\n#SG#\n####\n")
    place = ["--map-file=map.txt", "--horizon=3", "--height=8", "--width=8"]
    flags = [*place, "--param=living_reward=-2:-1", "--seed=4"]
    assert main(["record", *flags, "--save=a.json", "--policy=random"]) == 0
    lines = capsys.readouterr().out.splitlines()
    name, number, *rest = lines[0].split()
    assert (name, " ".join(rest)) == ("living_reward", "drawn from -2:-1 by --seed 4")
    assert -2 <= float(number.rstrip(",")) <= -1
    assert main(["replay", "a.json"]) == 0
    assert "the same bit for bit" in capsys.readouterr().out
    flags = ["--map-file=map.txt", "--param=max_steps_in_episode=3", *flags[-2:]]
    assert main(["evaluate", *flags, "--policy=random", "--episodes=3", "--gif=a.gif"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in lines if "drawn" in line] == [
        f"living_reward {number} drawn from -2:-1 by --seed 4",
        "living_reward from -2:-1, drawn for each episode",
    ]
    assert main(["rollout", *place, "--param=turn_angle=0.1:0.2"]) == 2
    assert "--param turn_angle must be one number in this command" in capsys.readouterr().err
    flags = [*place, "--param=turn_angle=0.1:", "--save=b.json"]
    assert main(["record", *flags]) == 2
    assert "turn_angle must be a finite" in capsys.readouterr().err
