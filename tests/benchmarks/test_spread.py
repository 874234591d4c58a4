"""A rollout over simulated devices and over processes is that of one device."""

import json
import os
import socket
import subprocess
import sys
from pathlib import Path

import jax
import pytest

import jaxenstein
from benchmarks import spread
from benchmarks.spread import make_mesh, make_spread_rollout
from jaxenstein.errors import SettingError

ROOT = Path(__file__).parents[2]


def start(*words):
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(ROOT / "src"), str(ROOT)]),
        "JAX_PLATFORMS": "cpu",
    }
    return subprocess.Popen(
        [sys.executable, "-W", "error", "-m", *map(str, words)],
        env=environment, cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


def finish(process):
    try:
        out, err = process.communicate(timeout=300)
    finally:
        process.kill()
    assert process.returncode == 0, err
    return out


def test_eight_devices_are_one():
    assert finish(start("tests.benchmarks.spread_run", 8)).endswith("equal\n")


@pytest.mark.slow
def test_two_processes_are_one():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    runs = [start("tests.benchmarks.spread_run", 2, address, 2, index) for index in range(2)]
    try:
        for run in runs:
            assert finish(run).endswith("equal\n")
    finally:
        for run in runs:
            run.kill()
            run.communicate()


@pytest.mark.slow
def test_the_command(tmp_path):
    file = tmp_path / "spread.json"
    words = "--id simple --batch 2 --size 6x8 --steps 2 --calls 1 --repeats 2 --cpu-devices 2"
    out = finish(start("benchmarks.spread", *words.split(), "--json", file))
    report = json.loads(file.read_text())
    assert [(row["devices"], row["batch"]) for row in report["rows"]] == [(1, 2), (2, 4)]
    assert all(len(row["steps_per_second"]["repeats"]) == 2 for row in report["rows"])
    assert out.count("\n| ") == 3


def test_half_told_processes_are_refused(capsys):
    with pytest.raises(SystemExit):
        spread.main(["--processes", "2"])
    assert "belong together" in capsys.readouterr().err


def test_environments_must_divide_evenly():
    mesh = make_mesh(jax.devices()[:1])
    env, params = jaxenstein.make("simple", height=4, width=4)
    for batch, steps in ((0, 1), (1, 0)):
        with pytest.raises(SettingError, match="multiple of the 1 devices"):
            make_spread_rollout(env, params, batch, steps, mesh)
    env, params = jaxenstein.make("simple", autoreset=None)
    with pytest.raises(SettingError, match="autoreset"):
        make_spread_rollout(env, params, 1, 1, mesh)
