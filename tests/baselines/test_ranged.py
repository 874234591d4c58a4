"""Training episodes with drawn params, compared with steps of the environment."""

from __future__ import annotations

from pathlib import Path

import jax
import numpy as np
import pytest

pytest.importorskip("flax")

import jaxenstein
from jaxenstein import SettingError
from jaxenstein.baselines.rollout import start
from jaxenstein.baselines.runs.agents import evaluate, load_policy
from jaxenstein.baselines.runs.folder import RunFolder
from jaxenstein.baselines.runs.options import resolve
from jaxenstein.baselines.runs.policies import TrainedPolicy
from jaxenstein.baselines.runs.programs import write_program
from jaxenstein.baselines.runs.trained import Trained, load_trained, write_trained
from jaxenstein.baselines.runs.training import train
from jaxenstein.baselines.simulator import OwnSimulator, RangedSimulator, make_simulator
from tests.baselines.tiny import OPTIONS, same_checkpoints, tiny

pytestmark = pytest.mark.usefixtures("plain_frames")

KEY = jax.random.key(0)
RANGES = {"turn_angle": (0.1, 0.4), "living_reward": (-2.0, -1.0)}


def test_each_episode_uses_the_params_it_drew() -> None:
    env, usual = jaxenstein.from_ascii("#####\n#S.G#\n#####", height=8, width=8, autoreset=None)
    params = usual.replace(max_steps_in_episode=5, **RANGES)
    simulator = make_simulator(env, params)
    assert isinstance(simulator, RangedSimulator)
    assert isinstance(make_simulator(env, usual), OwnSimulator)
    count = 8
    reset, step = jax.jit(simulator.reset), jax.jit(simulator.step)
    key = jax.random.key(0)
    _, state = reset(jax.random.split(key, count))
    drawn = [{name: np.asarray(of) for name, of in state.numbers.items()}]
    for number in range(1, 12):
        keys = jax.random.split(jax.random.fold_in(key, number), count)
        actions = jax.random.randint(keys[0], (count,), 0, 3)
        before, numbers = state, drawn[-1]
        out = step(keys, before, actions)
        own = usual.replace(max_steps_in_episode=5, **numbers)
        axes = jax.tree.map(lambda _: None, usual).replace(**dict.fromkeys(numbers, 0))
        told = jax.vmap(env.step, (0, 0, 0, axes))(keys, before.state, actions, own)
        over = np.asarray(told[3] | told[4])
        np.testing.assert_array_equal(out.reward, told[2])
        np.testing.assert_array_equal(out.terminated | out.truncated, over)
        for here, there in zip(
            jax.tree.leaves(out.final.state), jax.tree.leaves(told[1]), strict=True
        ):
            np.testing.assert_array_equal(here, there)
        np.testing.assert_array_equal(np.asarray(out.obs)[~over], np.asarray(told[0])[~over])
        np.testing.assert_array_equal(simulator.final_observation(out.final), told[0])
        state = out.state
        drawn.append({name: np.asarray(of) for name, of in state.numbers.items()})
        np.testing.assert_array_equal(state.state.time, np.where(over, 0, told[1].time))
        for name, (low, high) in RANGES.items():
            values = drawn[-1][name]
            np.testing.assert_array_equal(values == numbers[name], ~over)
            np.testing.assert_array_equal(out.final.numbers[name], numbers[name])
            assert np.all((low <= values) & (values <= high))
            assert len(np.unique(values)) == count


def test_random_clocks_work_with_drawn_params() -> None:
    env, usual = jaxenstein.from_ascii("####\n#SG#\n####", height=8, width=8)
    simulator = make_simulator(env, usual.replace(**RANGES))
    network = resolve(OPTIONS).learner.network
    actors = start(simulator, network, jax.random.key(1), 64, (100, 1))
    times = np.asarray(actors.env_state.state.time)
    assert 0 <= times.min() < 20
    assert 80 < times.max() < 100


def test_files_describe_agents_of_ranges(tmp_path: Path) -> None:
    ranges = {name: list(ends) for name, ends in RANGES.items()}
    experiment, path = tiny(params=ranges, seeds=1), tmp_path / "agent.npz"
    params = jax.tree.map(lambda leaf: leaf[None], experiment.learner.network.init(KEY))
    trained = Trained("x", experiment, params, 0)
    write_trained(path, trained, "float32", {})
    assert load_policy(path).params.turn_angle == (0.1, 0.4)
    pytest.importorskip("flatbuffers")
    write_program(tmp_path / "agent.jaxexport", TrainedPolicy(trained, 0, True))
    assert (tmp_path / "agent.jaxexport").stat().st_size > 1000


@pytest.mark.slow
def test_training_with_ranges_resumes_and_evaluates(tmp_path: Path) -> None:
    ranges = {name: list(ends) for name, ends in RANGES.items()}
    experiment = tiny(params=ranges, seeds=1)
    whole, parts = (RunFolder.create(tmp_path / name, experiment) for name in ("a", "b"))
    train(whole, chunk=2)
    asked = iter([False, True])
    train(parts, chunk=2, stop=lambda: next(asked, True))
    again = RunFolder.open(parts.path)
    assert again.experiment == experiment
    train(again, chunk=2)
    assert same_checkpoints(whole, again, 6)
    other = resolve({**OPTIONS, "seeds": 1, "params": {**ranges, "turn_angle": 0.1}})
    assert experiment.differences(other) == ["environment.params.turn_angle ([0.1, 0.4], not 0.1)"]
    results = evaluate(load_trained(whole.path), episodes=32)
    # Every episode has its own living reward, plus 1 for the goal in the last step.
    rewards = (results.returns - results.successes) / np.maximum(results.lengths, 1)
    assert len(np.unique(rewards)) > 16
    assert results.environment.params == {"max_steps_in_episode": 10, **RANGES}
    policy = load_policy(whole.path)
    with pytest.raises(SettingError, match="turn_angle must be one number here"):
        jaxenstein.record(policy.env, policy.params, policy)
