"""The program of the page "Many devices" in two processes, as on two machines."""

from __future__ import annotations

import subprocess

import jax
import pytest

from tests.devices import free_port, started
from tests.docs.samples import ROOT, samples

PAGE = ROOT / "docs" / "devices.md"
METHOD = ROOT / "docs" / "benchmarks" / "method.md"

# One line for each environment of this process, in the order of all environments.
DIGESTS = """
import hashlib
import numpy as np
for shard in sorted(carry[0].addressable_shards, key=lambda shard: shard.index[0].start or 0):
    for frame in np.asarray(shard.data):
        print("frame", hashlib.sha256(frame.tobytes()).hexdigest())
"""


def frames(process: subprocess.Popen[str]) -> list[str]:
    """The digests that a process printed."""
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    return [line for line in out.splitlines() if line.startswith("frame")]


# Starts three processes: only this shows that no step of the program needs other devices.
@pytest.mark.slow
def test_two_processes_give_the_rollout_of_one() -> None:
    code = samples(PAGE)[0].code + DIGESTS
    alone = frames(started(code, 2))
    port = free_port()
    join = "import jax\njax.distributed.initialize('127.0.0.1:{}', 2, {})\n"
    both = [started(join.format(port, i) + code, 1) for i in range(2)]
    first, second = map(frames, both)
    assert first + second == alone
    assert len(set(alone)) > len(alone) // 2


def test_exchanged_bytes_are_computed_from_the_networks() -> None:
    pytest.importorskip("flax")
    from jaxenstein.baselines.runs.options import resolve

    for name in ("paper", "small", "tiny"):
        experiment = resolve({"env": "my-way-home", "network": name})
        config = experiment.config
        shapes = jax.eval_shape(experiment.learner.network.init, jax.random.key(0))
        sizes = jax.tree.map(lambda leaf: leaf.size, shapes)
        total = sum(jax.tree.leaves(sizes))
        core = sizes["core"]["params"]
        recurrent = core["recurrent"] + core["candidate_bias"]
        minibatches = config.epochs * config.minibatches
        sent = 4e-6 * minibatches * (total - recurrent + config.rollout * recurrent)
        ring = [2 * (devices - 1) / devices * sent for devices in (8, 64)]
        row = [f"{total:,}", f"{recurrent:,}", str(minibatches)]
        row += [f"{size:,.0f} MB" for size in (sent, *ring)]
        assert f"| {' | '.join([name, *row])} |" in METHOD.read_text("utf-8").splitlines()
