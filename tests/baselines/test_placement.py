"""Several devices: runs, or the environments of a run, spread over them."""

from __future__ import annotations

from pathlib import Path

import jax
import pytest

pytest.importorskip("flax")

from jaxenstein.baselines.state import place
from tests.baselines.tiny import tiny
from tests.devices import run_with_devices

CODE = """
import sys
import jax, numpy as np
from pathlib import Path
from jaxenstein.baselines.runs.folder import RunFolder
from jaxenstein.baselines.runs.training import train
from jaxenstein.baselines.state import place
from tests.baselines.tiny import tiny
assert jax.device_count() == 2
for name, options in (("shards", {"seeds": 1, "shards": 2}), ("runs", {"seeds": 2})):
    folder = RunFolder.create(Path(sys.argv[1]) / name, tiny(epochs=1, **options))
    many, keys = folder.experiment.learner.many, folder.experiment.keys()
    alone, _ = many.train_chunk(many.init(keys), folder.experiment.numbers(), 1)
    placed = place(many.init(keys), folder.experiment.config)
    memory = placed.actors.memory.addressable_shards[0].data.shape
    assert memory == ((1, 4, 8) if name == "runs" else (1, 2, 8)), memory
    spread, _ = many.train_chunk(placed, folder.experiment.numbers(), 1)
    assert spread.actors.memory.sharding == placed.actors.memory.sharding
    for a, b in zip(jax.tree.leaves(alone), jax.tree.leaves(spread), strict=True):
        np.testing.assert_allclose(a, b, rtol=2e-4, atol=2e-5)
# The last folder's programs are compiled, so that this takes no time.
stopped = iter([False, False, True])
assert train(folder, stop=lambda: next(stopped)) == 2
assert train(folder) == 6
print("equal")
"""


def test_one_device_holds_everything() -> None:
    experiment = tiny()
    state = jax.eval_shape(experiment.learner.many.init, experiment.keys())
    assert place(state, experiment.config, jax.devices()[:1]) is state


@pytest.mark.parametrize("world", ["plain", pytest.param("rendered", marks=pytest.mark.slow)])
def test_four_devices_give_the_result_of_one(world: str) -> None:
    run_with_devices(4, "-m", "tests.baselines.spread_run", world)


@pytest.mark.slow
def test_two_devices_give_the_result_of_one(tmp_path: Path) -> None:
    run_with_devices(2, "-c", CODE, str(tmp_path))
