"""Tensors of torch that are JAX's memory, and the steps behind them."""

from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein

torch = pytest.importorskip("torch")
pytestmark = pytest.mark.usefixtures("plain_frames")

from jaxenstein.adapters.batch import Batch  # noqa: E402
from jaxenstein.adapters.torch import TorchBatch  # noqa: E402
from tests.adapters.corridor import MAP, SIZE, STAY, N, make_corridor  # noqa: E402


@pytest.fixture(scope="module")
def made():
    return make_corridor()


@pytest.fixture
def batch(made):
    return TorchBatch(made[0], made[1], N)


def plain(value):
    """Containers of `jax.tree`: tuples and dictionaries."""
    if isinstance(value, Mapping):
        return {name: plain(entry) for name, entry in value.items()}
    return tuple(map(plain, value)) if isinstance(value, tuple) else value


def test_info_becomes_tensors_on_access(batch):
    """An entry that is never read is not converted; one that is read twice is converted once."""
    handed = []
    batch._tensor = lambda value, under=batch._tensor: handed.append(value) or under(value)
    batch.reset(0)
    stepped = batch.step(torch.tensor([STAY, STAY, STAY]))
    before = len(handed)
    assert stepped.info["episode_length"].tolist() == [1, 1, 1]
    assert stepped.info["episode_length"] is stepped.info["episode_length"]
    assert len(handed) == before + 1
    assert len(stepped.info) == len(list(stepped.info)) == len(dict(stepped.info))
    assert "episode_return" in stepped.info
    assert "episode_gain" not in stepped.info
    with pytest.raises(KeyError, match="episode_gain"):
        stepped.info["episode_gain"]


@pytest.mark.parametrize("kind", ["rgb", "dict"])
def test_observations_share_memory_with_jax(kind):
    env, params = jaxenstein.from_ascii(MAP, heading=0.0, observation=kind, **SIZE)
    batch = TorchBatch(env, params, N)
    # Record the results of the batch underneath.
    caught = []
    under = batch.batch.step
    batch.batch.step = lambda actions: caught.append(under(actions)) or caught[-1]  # type: ignore[method-assign]
    batch.reset(0)
    stepped = batch.step(torch.zeros(N, dtype=torch.int64))
    drawn = jax.tree.leaves(plain(caught[0][:5]))
    given = jax.tree.leaves(plain(stepped[:5]))
    assert len(drawn) == len(given)
    for array, tensor in zip(drawn, given, strict=True):
        host = isinstance(array, np.ndarray)
        place = array.ctypes.data if host else array.unsafe_buffer_pointer()
        assert place == tensor.data_ptr()
        assert tuple(tensor.shape) == array.shape
        assert str(tensor.dtype) == f"torch.{array.dtype}"
        np.testing.assert_array_equal(tensor.numpy(), np.asarray(array))


def test_actions_share_memory_with_torch(batch):
    actions = batch._to_jax(torch.tensor([3, 0, 1]))
    assert actions.dtype == jnp.int32
    assert torch.from_dlpack(actions).data_ptr() == actions.unsafe_buffer_pointer()
    np.testing.assert_array_equal(actions, [3, 0, 1])


@pytest.mark.parametrize("autoreset", ["same-step", "next-step", None])
def test_steps_match_the_batch(made, autoreset):
    ours = TorchBatch(made[0], made[1], N, autoreset=autoreset)
    theirs = Batch(made[0], made[1], N, autoreset=autoreset)
    rng = np.random.default_rng(0)
    pairs: list[tuple] = [(ours.reset(5), theirs.reset(5))]
    endings = 0
    for t in range(20):
        # All types of integers that torch has.
        actions = rng.integers(0, 6, N).astype(("u1", "i1", "i2", "i4", "i8")[t % 5])
        pairs.append((ours.step(torch.from_numpy(actions)), theirs.step(actions)))
        endings += pairs[-1][1][-1] is not None
        if t == 10:
            mask = np.array([False, True, False])
            pairs.append((ours.reset(mask=torch.from_numpy(mask)), theirs.reset(mask=mask)))
    for mine, other in pairs:
        assert jax.tree.structure(plain(mine)) == jax.tree.structure(plain(other))
        for a, b in zip(jax.tree.leaves(plain(mine)), jax.tree.leaves(plain(other)), strict=True):
            np.testing.assert_array_equal(a.numpy(), np.asarray(b))
    assert bool(endings) == (autoreset == "same-step")


@pytest.mark.parametrize("autoreset", ["same-step", "next-step", None])
def test_memory_outlives_the_batch(made, autoreset):
    batch = TorchBatch(made[0], made[1], N, autoreset=autoreset)
    batch.reset(0)
    stepped = batch.step(torch.full((N,), STAY))
    copy = stepped.observation.clone()
    del batch
    junk = [jnp.ones(stepped.observation.shape, jnp.uint8) for _ in range(20)]
    assert torch.equal(stepped.observation, copy)
    del junk


def test_non_tensor_actions(batch):
    batch.reset(0)
    with pytest.raises(jaxenstein.SettingError, match="torch tensor of 3 integers, not list"):
        batch.step([0, 0, 0])


def test_tensors_are_on_the_batch_device(batch):
    assert batch.device == torch.from_dlpack(jnp.zeros(1)).device
    assert batch.num_actions == 5
    observation, info = batch.reset(0)
    assert {tensor.device for tensor in (observation, *info.values())} == {batch.device}
