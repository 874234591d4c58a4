"""Tensors of torch that are JAX's memory, and the steps behind them."""

import importlib
import sys
from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein

torch = pytest.importorskip("torch")

from jaxenstein.adapters.batch import Batch  # noqa: E402
from jaxenstein.adapters.torch import TorchBatch  # noqa: E402
from tests.adapters.corridor import FORWARD, MAP, SIZE, STAY, N, make_corridor  # noqa: E402


@pytest.fixture(scope="module")
def made():
    return make_corridor()


@pytest.fixture
def batch(made):
    return TorchBatch(made[0], made[1], N)


def plain(value):
    """What `jax.tree` knows: tuples and dictionaries."""
    if isinstance(value, Mapping):
        return {name: plain(entry) for name, entry in value.items()}
    return tuple(map(plain, value)) if isinstance(value, tuple) else value


def test_info_becomes_tensors_when_it_is_read(batch):
    """An entry that nobody reads is not handed over; one that is read twice is, once."""
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


def leaves(stepped):
    values = [*stepped[:4], *stepped.info.values()]
    if stepped.ended is not None:
        values += [*stepped.ended[:2], *stepped.ended.info.values()]
    return values


@pytest.mark.parametrize("kind", ["rgb", "dict"])
def test_observations_lie_where_jax_drew_them(kind):
    env, params = jaxenstein.from_ascii(MAP, heading=0.0, observation=kind, **SIZE)
    batch = TorchBatch(env, params, N)
    # What the batch underneath gives is caught on its way.
    caught = []
    under = batch.batch.step
    batch.batch.step = lambda actions: caught.append(under(actions)) or caught[-1]  # type: ignore[method-assign]
    batch.reset(0)
    stepped = batch.step(torch.zeros(N, dtype=torch.int64))
    drawn = jax.tree.leaves(plain(caught[0][:5]))
    given = jax.tree.leaves(plain(stepped[:5]))
    assert len(drawn) == len(given)
    for array, tensor in zip(drawn, given, strict=True):
        assert array.unsafe_buffer_pointer() == tensor.data_ptr()
        assert tuple(tensor.shape) == array.shape
        assert str(tensor.dtype) == f"torch.{array.dtype}"
        np.testing.assert_array_equal(tensor.numpy(), np.asarray(array))


def test_actions_lie_where_torch_wrote_them(batch):
    actions = batch._to_jax(torch.tensor([3, 0, 1]))
    assert actions.dtype == jnp.int32
    assert torch.from_dlpack(actions).data_ptr() == actions.unsafe_buffer_pointer()
    np.testing.assert_array_equal(actions, [3, 0, 1])


@pytest.mark.parametrize("autoreset", ["same-step", "next-step", None])
def test_steps_are_those_of_the_batch(made, autoreset):
    ours = TorchBatch(made[0], made[1], N, autoreset=autoreset)
    theirs = Batch(made[0], made[1], N, autoreset=autoreset)
    rng = np.random.default_rng(0)
    pairs: list[tuple] = [(ours.reset(5), theirs.reset(5))]
    endings = 0
    for _ in range(20):
        actions = rng.integers(-1, 6, N)
        pairs.append((ours.step(torch.from_numpy(actions)), theirs.step(actions)))
        endings += pairs[-1][1][-1] is not None
    for mine, other in pairs:
        assert jax.tree.structure(plain(mine)) == jax.tree.structure(plain(other))
        for a, b in zip(jax.tree.leaves(plain(mine)), jax.tree.leaves(plain(other)), strict=True):
            np.testing.assert_array_equal(a.numpy(), np.asarray(b))
    assert bool(endings) == (autoreset == "same-step")


def test_ends_are_those_of_the_environment(made):
    """Environment 0 walks to the goal, the others stand still until time is up."""
    env, params = made
    params = params.replace(max_steps_in_episode=4)
    batch = TorchBatch(env, params, N)
    first = batch.reset(0)[0]
    key = jax.random.key(0)
    _, state = env.reset(key, params)
    walked = []
    for _ in range(3):
        state, *_ = env.advance(key, state, FORWARD, params)
        walked.append(np.asarray(env.observe(state, params)))
    assert state.done
    for t in range(4):
        stepped = batch.step(torch.tensor([FORWARD, STAY, STAY]))
        assert stepped.terminated.tolist() == [t == 2, False, False]
        assert stepped.truncated.tolist() == [False, t == 3, t == 3]
        assert stepped.reward.tolist() == [float(t == 2), 0.0, 0.0]
        if t == 2:
            assert stepped.ended is not None
            assert stepped.ended.indices.tolist() == [0]
            np.testing.assert_array_equal(stepped.ended.observation[0], walked[2])
            assert stepped.ended.info["episode_return"].tolist() == [1.0]
            assert torch.equal(stepped.observation[0], first[0])
            assert stepped.info["episode_length"].tolist() == [0, 3, 3]
        elif t == 3:
            assert stepped.ended is not None
            assert stepped.ended.indices.tolist() == [1, 2]
            assert torch.equal(stepped.ended.observation, first[1:])
        else:
            assert stepped.ended is None


def test_what_was_handed_out_never_changes(batch):
    held, copies = [], []
    observation, _ = batch.reset(0)
    held.append(observation)
    copies.append(observation.clone())
    generator = torch.Generator().manual_seed(0)
    endings = 0
    for _ in range(50):
        stepped = batch.step(torch.randint(0, 5, (N,), generator=generator))
        endings += stepped.ended is not None
        held += leaves(stepped)
        copies += [tensor.clone() for tensor in leaves(stepped)]
    assert endings >= 5
    assert all(torch.equal(a, b) for a, b in zip(held, copies, strict=True))


def test_writing_into_tensors_changes_no_later_step(made):
    written, clean = TorchBatch(made[0], made[1], N), TorchBatch(made[0], made[1], N)
    written.reset(3)[0].zero_()
    clean.reset(3)
    actions = torch.empty(N, dtype=torch.int32)
    generator = torch.Generator().manual_seed(1)
    for _ in range(30):
        actions.random_(0, 5, generator=generator)
        expected = clean.step(actions.clone())
        stepped = written.step(actions)
        actions.fill_(-7)
        for a, b in zip(leaves(stepped), leaves(expected), strict=True):
            assert torch.equal(a, b)
            a.fill_(1)


@pytest.mark.parametrize("autoreset", ["same-step", "next-step", None])
def test_the_memory_outlives_the_batch(made, autoreset):
    batch = TorchBatch(made[0], made[1], N, autoreset=autoreset)
    batch.reset(0)
    stepped = batch.step(torch.full((N,), STAY))
    copy = stepped.observation.clone()
    del batch
    junk = [jnp.ones(stepped.observation.shape, jnp.uint8) for _ in range(20)]
    assert torch.equal(stepped.observation, copy)
    del junk


def test_masked_reset(batch):
    batch.reset(0)
    stepped = batch.step(torch.full((N,), FORWARD))
    mask = torch.tensor([False, True, False])
    observation, info = batch.reset(mask=mask)
    assert info["episode_length"].tolist() == [1, 0, 1]
    assert torch.equal(observation[::2], stepped.observation[::2])


@pytest.mark.parametrize("dtype", ["int64", "int32", "int16", "int8", "uint8"])
def test_types_of_actions(batch, dtype):
    batch.reset(0)
    stepped = batch.step(torch.tensor([0, 2, 4]).to(getattr(torch, dtype)))
    assert stepped.reward.shape == (N,)


def test_actions_beyond_32_bits_do_nothing(made):
    env, params = made
    batch, still = TorchBatch(env, params, N), TorchBatch(env, params, N)
    batch.reset(0)
    still.reset(0)
    far = batch.step(torch.tensor([2**32 + FORWARD, -(2**32), 2**62]))
    assert torch.equal(far.observation, still.step(torch.full((N,), -1)).observation)


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        (torch.zeros(N), "3 integers, not torch.float32"),
        (torch.zeros(N, dtype=torch.bool), "3 integers, not torch.bool"),
        ([0, 0, 0], "torch tensor of 3 integers, not list"),
        (torch.zeros(N + 1, dtype=torch.int64), r"3 integers.*\[4\]"),
        (torch.zeros((N, 1), dtype=torch.int64), r"3 integers.*\[3, 1\]"),
    ],
)
def test_wrong_actions(batch, actions, message):
    batch.reset(0)
    with pytest.raises(jaxenstein.SettingError, match=message):
        batch.step(actions)


def test_wrong_calls(made, batch):
    with pytest.raises(jaxenstein.SettingError, match="call reset before step"):
        batch.step(torch.zeros(N, dtype=torch.int64))
    with pytest.raises(jaxenstein.SettingError, match="num_envs must be a whole number"):
        TorchBatch(made[0], made[1], 0)
    batch.reset(0)
    with pytest.raises(jaxenstein.SettingError, match=r"bool\[3\]"):
        batch.reset(mask=torch.zeros(N))
    with pytest.raises(jaxenstein.SettingError, match="one seed for each of 3"):
        batch.reset([1, 2])


def test_where_the_tensors_are(batch):
    assert batch.device == torch.from_dlpack(jnp.zeros(1)).device
    assert batch.num_actions == 5
    observation, info = batch.reset(0)
    assert {tensor.device for tensor in (observation, *info.values())} == {batch.device}


def test_without_the_partner(monkeypatch):
    monkeypatch.setitem(sys.modules, "torch", None)
    monkeypatch.delitem(sys.modules, "jaxenstein.adapters.torch")
    with pytest.raises(ImportError, match=r"pip install 'jaxenstein\[torch\]'"):
        importlib.import_module("jaxenstein.adapters.torch")
