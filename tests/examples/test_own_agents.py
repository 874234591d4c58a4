"""The agents in flax and in equinox: rollouts, logs, saved files, and learning."""

from __future__ import annotations

import importlib.machinery
import sys
import types
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("optax")

import jaxenstein
from examples import recurrent_ppo
from examples.ppo import Settings
from jaxenstein import comparison, suite
from jaxenstein.cli import main

NAMES = ("flax_agent", "equinox_agent")
SMALL = ["--updates=3", "--every=1", "--envs=4", "--steps=6", "--size=8", "--hidden=8"]
SMALL += ["--episodes=3"]


@pytest.fixture
def loggers(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, Any]]:
    """Fakes of TensorBoard and Weights & Biases that record what they get."""
    told: list[tuple[str, Any]] = []

    class Writer:
        def __init__(self, path: str) -> None:
            told.append(("writer", path))

        def add_scalar(self, name: str, value: float, steps: int) -> None:
            told.append(("scalar", (name, value, steps)))

        def close(self) -> None:
            told.append(("closed", None))

    run = types.SimpleNamespace(
        log=lambda row, step: told.append(("row", (row, step))),
        finish=lambda: told.append(("finished", None)),
    )

    def init(**options: Any) -> Any:
        told.append(("run", options["mode"]))
        return run

    for name, content in (("tensorboardX", {"SummaryWriter": Writer}), ("wandb", {"init": init})):
        module = types.ModuleType(name)
        module.__spec__ = importlib.machinery.ModuleSpec(name, None)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    return told


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.usefixtures("plain_frames")
def test_short_training(name: str, tmp_path: Path, loggers: Any, capsys: Any) -> None:
    example = pytest.importorskip(f"examples.{name}")
    weights, results = example.main([*SMALL, "--out", str(tmp_path)])
    assert capsys.readouterr().out.count("steps: episodes") == 3
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(weights))
    file = f"{name}-miniworld-hallway-0"
    saved = example.load(tmp_path / file, jax.tree.map(jnp.zeros_like, weights))
    jax.tree.map(np.testing.assert_array_equal, saved, weights)
    (read,) = jaxenstein.read_results(tmp_path / f"{file}.json")
    assert (read.policy, read.environment.id) == (f"{name}-0", "miniworld-hallway")
    np.testing.assert_array_equal(read.lengths, results.lengths)
    assert main(["score", str(tmp_path / f"{file}.json")]) == 0
    assert name in capsys.readouterr().out
    assert [kind for kind, _ in loggers if kind in ("writer", "run", "closed", "finished")] == [
        "writer", "run", "finished", "closed"
    ]  # fmt: skip
    assert ("run", "offline") in loggers
    rows = [row for kind, row in loggers if kind == "row"]
    assert [steps for _, steps in rows] == [24, 48, 72]
    scalars = [scalar for kind, scalar in loggers if kind == "scalar"]
    assert scalars == [(key, value, steps) for row, steps in rows for key, value in row.items()]


def test_a_task_sets_the_number_of_decisions() -> None:
    own_training = pytest.importorskip("examples.own_training")
    for words, updates in (([], 60), (["--task=t-maze"], 1465), (["--task=simple", *SMALL], 3)):
        assert own_training.parse("", words).updates == updates


@pytest.mark.usefixtures("plain_frames", "loggers")
def test_an_agent_of_the_benchmark_is_tested_on_other_levels(tmp_path: Path) -> None:
    example = pytest.importorskip("examples.flax_agent")
    task = suite.task_of("key-corridor-s3r3")
    _, results = example.main([*SMALL, f"--task={task.id}", "--seed=1", "--out", str(tmp_path)])
    assert results.names == ("flax_agent-1",)
    assert (
        comparison.difference(suite.suite_of("small").spec(task, test=True), results.environment)
        is None
    )


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.usefixtures("plain_frames")
@pytest.mark.filterwarnings("ignore:::(wandb|tensorboardX|pydantic|google).*")
def test_both_loggers_write_their_files(name: str, tmp_path: Path) -> None:
    for logger in ("tensorboardX", "wandb"):
        pytest.importorskip(logger)
    example = pytest.importorskip(f"examples.{name}")
    example.main([*SMALL, "--out", str(tmp_path)])
    assert len([*tmp_path.glob("tensorboard/*/events.out.tfevents.*")]) == 1
    assert len([*tmp_path.glob("wandb/offline-run-*/run-*.wandb")]) == 1


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.usefixtures("plain_frames")
def test_rollout_matches_sequence_computation(name: str) -> None:
    """Acting keeps the memory step by step, learning goes through all steps at once."""
    example = pytest.importorskip(f"examples.{name}")
    env, params = jaxenstein.make("miniworld-hallway", height=8, width=8, autoreset="next-step")
    params = params.replace(max_steps_in_episode=5)
    network, weights = example.make_network(env, params, 8, jax.random.key(0))
    weights = jax.tree.map(lambda leaf: 2 * leaf, weights)
    settings = Settings(envs=3, steps=14)
    trainer = recurrent_ppo.Trainer(env, params, network, recurrent_ppo.optax.sgd(0.1), settings)
    start = trainer.begin(jax.random.key(1), weights, 8)
    # The memory before an episode's first frame must not matter.
    start = start._replace(memory=start.memory + 1)
    _, (past, info) = jax.jit(lambda t: jax.lax.scan(trainer.act, t, None, settings.steps))(start)
    assert past.ended.sum() >= 6
    np.testing.assert_array_equal(past.chosen[1:], ~past.ended[:-1])
    np.testing.assert_array_equal(past.first[2:], past.ended[:-2])
    assert past.first[0].all()
    assert not past.first[1].any()
    np.testing.assert_array_equal(info["episode_length"][past.ended], 5)
    network = jax.jit(network)
    _, logits, values = network(weights, 0 * start.memory, past.observation, past.first)
    log_prob = jnp.take_along_axis(jax.nn.log_softmax(logits), past.action[..., None], -1)[..., 0]
    np.testing.assert_allclose(log_prob, past.log_prob, atol=1e-4)
    np.testing.assert_allclose(values, past.value, atol=1e-4)
    without = jnp.zeros_like(past.first)
    assert not np.allclose(
        network(weights, start.memory, past.observation, without)[2], past.value, atol=1e-4
    )


@pytest.mark.training
@pytest.mark.parametrize("name", NAMES)
def test_agent_learns(name: str, tmp_path: Path) -> None:
    example = pytest.importorskip(f"examples.{name}")
    _, results = example.main(["--out", str(tmp_path)])
    assert results.successes.mean() > 0.95
