"""Spread over four simulated devices, a run is the same up to rounding."""

import os
import subprocess
import sys
from pathlib import Path

import jax
import pytest

pytest.importorskip("flax")

from jaxenstein.baselines import Config
from jaxenstein.baselines.learning.sharding import make_mesh, shard
from jaxenstein.errors import SettingError

ROOT = Path(__file__).parents[3]


def test_sharded_is_single_device():
    flags = f"{os.environ.get('XLA_FLAGS', '')} --xla_force_host_platform_device_count=4"
    path = os.pathsep.join([str(ROOT / "src"), str(ROOT)])
    done = subprocess.run(
        [sys.executable, "-W", "error", "-m", "tests.baselines.learning.sharded_run"],
        env={**os.environ, "XLA_FLAGS": flags, "PYTHONPATH": path, "JAX_PLATFORMS": "cpu"},
        cwd=ROOT, capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip().endswith("equal")


def test_shards_must_fit_the_mesh():
    mesh = make_mesh(jax.devices()[:1])
    assert dict(mesh.shape) == {"env": 1}
    other = jax.make_mesh(
        (1,), ("run",), axis_types=(jax.sharding.AxisType.Auto,), devices=jax.devices()[:1]
    )
    with pytest.raises(SettingError, match="shards must be the number of devices along"):
        shard(None, other, Config())
