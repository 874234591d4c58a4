"""Agents as pure functions, and as programs that run without this package."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")

import jaxenstein
from jaxenstein import SettingError
from jaxenstein.baselines import export_policy, load_policy
from jaxenstein.baselines.runs import programs
from jaxenstein.baselines.runs.folder import RunFolder
from jaxenstein.cli import main
from jaxenstein.files import OutputError

EXAMPLE = Path(__file__).parents[3] / "examples" / "exported_agent.py"
# Runs the program that its first argument names, with the others, where no jaxenstein is found.
WITHOUT_PACKAGE = """
import runpy, sys
sys.modules["jaxenstein"] = None
del sys.argv[0]
runpy.run_path(sys.argv[0])
"""


def frames(agent: Any, count: int) -> np.ndarray:
    shape = (agent.env.height, agent.env.width, 3)
    return np.random.default_rng(0).integers(0, 256, (count, *shape)).astype(np.uint8)


@pytest.mark.parametrize("greedy", [True, False])
@pytest.mark.usefixtures("plain_frames")
def test_agent_is_a_policy_for_evaluate(folder: RunFolder, greedy: bool) -> None:
    agent = load_policy(folder.path, 0, greedy=greedy)
    carry, key = agent.initial_carry(), jax.random.key(3)
    session = jaxenstein.Session(agent.env, agent.params, seed=1)
    for _ in range(6):
        carry, own = agent.apply(carry, session.observation, session.policy_key())
        assert int(own) == agent(session)
        session.step(int(own))
    assert int(agent.apply(carry, session.observation, jax.random.key_data(key))[1]) == int(
        agent.apply(carry, session.observation, key)[1]
    )
    results = jaxenstein.evaluate(
        agent.env, agent.params, agent.apply, agent.initial_carry(), episodes=3, name=agent.name
    )
    assert results.returns.shape == (1, 3)


@pytest.fixture(scope="module")
def exported(plain_frames: None, folder: RunFolder) -> Path:
    """The first run of the folder, exported as a program with its .npz file."""
    pytest.importorskip("flatbuffers")
    path = folder.path.parent / "agent.jaxexport"
    out = str(path.with_suffix(".npz"))
    command = ["export", str(folder.path), "--out", out, "--run=0", "--episodes=1"]
    assert main([*command, "--program", str(path)]) == 0
    return path


def test_example_acts_without_this_package(exported: Path) -> None:
    command = [sys.executable, "-W", "error", "-c", WITHOUT_PACKAGE, str(EXAMPLE), str(exported)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    agent = load_policy(exported.with_suffix(".npz"))
    act = jax.vmap(agent.apply)
    obs = jnp.zeros_like(frames(agent, 2))
    carry = jax.tree.map(lambda leaf: jnp.stack([leaf] * 2), agent.initial_carry())
    expected = []
    for step in range(3):
        carry, actions = act(carry, obs, jax.random.split(jax.random.key(step), 2))
        expected.append(" ".join(map(str, actions.tolist())))
    assert done.stdout.splitlines() == expected


@pytest.mark.parametrize("count", [1, 5])
def test_program_matches_agent_for_any_batch_size(exported: Path, count: int) -> None:
    from jax import export

    program = export.deserialize(bytearray(exported.read_bytes()))
    assert program.platforms == ("cpu", "cuda")
    agent = load_policy(exported.with_suffix(".npz"))
    own = jax.tree.map(lambda leaf: jnp.stack([leaf] * count), agent.initial_carry())
    carry = {
        "memory": np.zeros((count, 8), np.float32),
        "previous": np.zeros(count, np.int32),
        "started": np.zeros(count, bool),
    }
    for step in range(4):
        obs = np.roll(frames(agent, count), step, axis=1)
        keys = jax.random.split(jax.random.key(step), count)
        carry, actions = program.call(carry, obs, jax.random.key_data(keys))
        own, expected = jax.vmap(agent.apply)(own, obs, keys)
        np.testing.assert_array_equal(actions, expected)
        np.testing.assert_allclose(carry["memory"], own.memory, atol=1e-5)
    assert np.all(carry["started"])


def test_greedy_program_ignores_keys(exported: Path, folder: RunFolder) -> None:
    from jax import export

    path = exported.with_name("greedy.jaxexport")
    agent = load_policy(folder.path, 0, greedy=True)
    programs.write_program(path, agent, ["cpu"])
    program = export.deserialize(bytearray(path.read_bytes()))
    (carry, _, _), _ = jax.tree.unflatten(program.in_tree, program.in_avals)
    carry = jax.tree.map(lambda leaf: np.zeros((40, *leaf.shape[1:]), leaf.dtype), carry)
    obs = np.repeat(frames(agent, 1), 40, axis=0)
    keys = jax.random.key_data(jax.random.split(jax.random.key(0), 40))
    _, actions = program.call(carry, obs, keys)
    assert set(np.asarray(actions).tolist()) == {
        int(agent.apply(agent.initial_carry(), obs[0], keys[0])[1])
    }


def test_non_programs_are_refused(
    folder: RunFolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    out = tmp_path / "agent.npz"

    def refused(program: Path, kind: type[Exception], message: str) -> None:
        with pytest.raises(kind, match=message):
            export_policy(folder.path, out, program=program)
        assert list(tmp_path.iterdir()) == []

    refused(tmp_path / "agent.bin", SettingError, r"agent\.bin should end in \.jaxexport")
    with monkeypatch.context() as patch:
        patch.setattr(programs.importlib.util, "find_spec", lambda name: None)
        refused(tmp_path / "a.jaxexport", SettingError, "pip install flatbuffers")
    assert main(["export", str(folder.path), "--out", str(out), "--greedy"]) == 2
    assert "--greedy needs --program" in capsys.readouterr().err
    pytest.importorskip("flatbuffers")
    refused(tmp_path / "no" / "a.jaxexport", OutputError, "there is no folder")
    agent = load_policy(folder.path, 0)
    with pytest.raises(SettingError, match=r"unknown platform 'gpu'.*cpu, cuda, rocm, tpu"):
        programs.write_program(tmp_path / "a.jaxexport", agent, ["gpu"])
    assert list(tmp_path.iterdir()) == []
