"""Subjects do what their names say, and the other commands run at tiny sizes."""

import json
import os
import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from benchmarks import device
from benchmarks.measure import Subject, Worker
from benchmarks.spread import make_mesh, make_spread_rollout
from benchmarks.subjects import own
from benchmarks.subjects.__main__ import prepare
from benchmarks.subjects.frames import make_frames
from jaxenstein.errors import SettingError

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("name", ["simple", "doom-my-way-home"])
def test_frames_are_drawn_from_the_states(name):
    env, params = jaxenstein.make(name, height=6, width=8)
    obs, state = jax.vmap(env.reset, (0, None))(jax.random.split(jax.random.key(0), 3), params)
    first, place = np.asarray(obs), np.asarray(state.position)
    state, obs, _ = make_frames(env, params, 5)((state, obs, jnp.copy(state.position)))
    assert (np.asarray(obs) != first).any()
    assert np.abs(np.asarray(state.position) - place).max() <= 1.0001e-4
    seen = jax.jit(jax.vmap(lambda s: env.observe(s, params)))(state)
    np.testing.assert_array_equal(seen, obs)


@pytest.mark.parametrize("kind", ["scan-2", "loop"])
@pytest.mark.usefixtures("plain_frames")
def test_own_subjects(monkeypatch, kind):
    monkeypatch.setattr(own, "STEPS_A_CALL", 32)
    chunk = prepare(f"{kind} id=simple size=8x6")
    assert chunk() == chunk() > 0


@pytest.mark.slow
@pytest.mark.parametrize("adapter", ["loop-2", "gymnasium-same-step-2", "gymnasium-single"])
@pytest.mark.usefixtures("plain_frames")
def test_adapters(monkeypatch, adapter):
    pytest.importorskip("gymnasium")
    assert prepare(f"adapter-{adapter} id=simple")() > 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gymnasium id=simple size=8x6 busy=1", "start id=simple",
                                  "compile id=simple size=8x6 of=observe"])  # fmt: skip
def test_subjects_with_default_settings(name):
    """In processes of their own: only this test runs the real protocol of subjects."""
    pytest.importorskip("gymnasium")
    worker = Worker(Subject(name, "", flags=""), None)
    try:
        assert worker.measure(0.01) > 0
    finally:
        worker.close()


@pytest.mark.slow
@pytest.mark.parametrize("layer", ["flax", "patches"])
def test_convolutions(layer):
    pytest.importorskip("flax")
    chunk = prepare(f"convolution-3 layer={layer} network=small size=12x10")
    assert chunk() == chunk() == 12


def run(module, *words):
    """Run a command in a separate interpreter; return its output."""
    paths = os.pathsep.join([str(ROOT / "src"), str(ROOT)])
    environment = {**os.environ, "PYTHONPATH": paths, "JAX_PLATFORMS": "cpu"}
    command = [sys.executable, "-W", "error", "-m", module, *map(str, words)]
    done = subprocess.run(
        command, env=environment, cwd=ROOT, text=True, capture_output=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_eight_devices_give_the_result_of_one():
    assert run("tests.benchmarks.spread_run", 8).endswith("equal\n")


@pytest.mark.slow
def test_several_devices(tmp_path):
    file = tmp_path / "spread.json"
    words = "--id simple --batch 2 --size 6x8 --steps 2 --repeats 2 --cpu-devices 2"
    out = run("benchmarks.spread", *words.split(), "--json", file)
    rows = json.loads(file.read_text())["rows"]
    assert [(row["devices"], row["batch"]) for row in rows] == [(1, 2), (2, 4)]
    assert out.count("\n| ") == 4


def test_environments_must_divide_evenly():
    mesh = make_mesh(jax.devices()[:1])
    env, params = jaxenstein.make("simple", height=4, width=4)
    with pytest.raises(SettingError, match="multiple of the 1 devices"):
        make_spread_rollout(env, params, 0, 1, mesh)


@pytest.mark.parametrize("words", ["--copy-bytes 1", "--seconds -1"])
def test_wrong_arguments_are_told(words, capsys):
    with pytest.raises(SystemExit):
        device.main(words.split())
    assert "must be a" in capsys.readouterr().err


@pytest.mark.slow
def test_accelerator_benchmark_writes_a_report(tmp_path, monkeypatch, capsys):
    file = tmp_path / "device.json"
    words = ["--ids", "simple", "--batches", "2", "--sizes", "8x6", "--seconds", "0.01"]
    words += ["--repeats", "2", "--steps", "2", "--copy-bytes", "4096", "--json", str(file)]
    device.main(words)
    told = json.loads(file.read_text())
    assert (told["settings"]["repeats"], told["settings"]["sizes"]) == (2, [[6, 8]])
    (row,) = told["rows"]
    assert (row["id"], row["batch"], row["image"], row["frame_bytes"]) == ("simple", 2, "8x6", 144)
    assert min(row["limit"], row["steps_per_second"]["median"]) > 0

    def fail(*_):
        raise jax.errors.JaxRuntimeError("RESOURCE_EXHAUSTED: Out of memory\nmore")

    monkeypatch.setattr(device, "make_random_rollout", fail)
    device.main(words)
    assert "| RESOURCE_EXHAUSTED: Out of memory |" in capsys.readouterr().out
