"""Checkpoints are exact, complete or absent, and errors say why."""

from __future__ import annotations

import io
import shutil
import signal
import subprocess
import sys
import tracemalloc
import zipfile
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")

from jaxenstein.baselines.runs.checkpoints import CheckpointError, Checkpoints, check_space, size_of
from jaxenstein.files import OutputError


def state_of(seed: int) -> dict[str, Any]:
    """Leaves of every kind that a state of training may have."""
    rng = np.random.default_rng(seed)
    return {
        "params": {"kernel": jnp.asarray(rng.normal(size=(3, 5)), jnp.float32)},
        "half": jnp.asarray(rng.normal(size=7), jnp.bfloat16),
        "frames": jnp.asarray(rng.integers(0, 256, (2, 4, 4, 3)), jnp.uint8),
        "flags": jnp.asarray([True, False]),
        "count": jnp.int32(seed),
        "none": jnp.zeros((2, 0, 2), jnp.float32),
        "strange": jnp.asarray([np.nan, -0.0, np.inf, 1e-45], jnp.float32),
        "data": jax.random.key_data(jax.random.key(seed)),
        "key": jax.random.split(jax.random.key(seed), 3),
    }


def assert_same(a: Any, b: Any) -> None:
    assert jax.tree.structure(a) == jax.tree.structure(b)
    for one, other in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True):
        assert one.dtype == other.dtype
        if jnp.issubdtype(one.dtype, jax.dtypes.prng_key):
            one, other = jax.random.key_data(one), jax.random.key_data(other)
        assert one.shape == other.shape
        assert np.asarray(one).tobytes() == np.asarray(other).tobytes()


@pytest.fixture
def store(tmp_path: Path) -> Checkpoints:
    return Checkpoints(tmp_path / "checkpoints")


def test_state_round_trips_bit_for_bit(store: Checkpoints) -> None:
    assert store.restore(state_of(0)) is None
    store.save(7, state_of(3))
    restored = store.restore(jax.eval_shape(lambda: state_of(0)))
    assert restored is not None
    assert (restored.update, restored.damaged) == (7, ())
    assert_same(restored.state, state_of(3))
    # A typed key is restored as a key and draws the same numbers.
    drawn = jax.random.normal(restored.state["key"][1])
    assert drawn == jax.random.normal(state_of(3)["key"][1])


def test_newest_two_checkpoints_are_kept(store: Checkpoints) -> None:
    for update in (2, 9, 10, 11):
        store.save(update, state_of(update))
    assert store.updates() == [10, 11]
    store.save(11, state_of(5))
    restored = store.restore(state_of(0))
    assert restored is not None
    assert (restored.update, int(restored.state["count"])) == (11, 5)


@pytest.mark.parametrize("damaged", [b"", b"[" * 9999, None])
def test_damaged_checkpoint_is_skipped(store: Checkpoints, damaged: bytes | None) -> None:
    store.save(1, state_of(1))
    store.save(2, state_of(2))
    path = store.folder / "2.npz"
    path.write_bytes(path.read_bytes()[:999] if damaged is None else damaged)
    restored = store.restore(state_of(0))
    assert restored is not None
    assert restored.update == 1
    assert len(restored.damaged) == 1
    assert_same(restored.state, state_of(1))
    (store.folder / "1.npz").unlink()
    with pytest.raises(CheckpointError, match="no checkpoint can be read"):
        store.restore(state_of(0))


def test_training_can_replace_checkpoints_during_a_read(
    store: Checkpoints, monkeypatch: pytest.MonkeyPatch
) -> None:
    for update in (3, 4):
        store.save(update, state_of(update))
    # A reader that has just listed two earlier ones.
    lists = iter([[1, 2]])
    there = store.updates
    monkeypatch.setattr(store, "updates", lambda: next(lists, None) or there())
    restored = store.restore(state_of(0))
    assert restored is not None
    assert (restored.update, restored.damaged) == (4, ())


def test_dangling_link_is_a_damaged_checkpoint(store: Checkpoints) -> None:
    store.save(1, state_of(1))
    (store.folder / "2.npz").symlink_to("nothing")
    restored = store.restore(state_of(0))
    assert restored is not None
    assert restored.update == 1
    assert restored.damaged == (f"{store.folder / '2.npz'}: no such file or directory",)


def test_every_single_damaged_byte_is_noticed_or_harmless(store: Checkpoints) -> None:
    store.save(1, {"a": np.arange(5, dtype=np.int32)})
    path, like = store.folder / "1.npz", {"a": np.zeros(5, np.int32)}
    whole, told = path.read_bytes(), 0
    for place in range(len(whole)):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0x41]) + whole[place + 1 :])
        try:
            restored = store.restore(like)
        except CheckpointError:
            told += 1
        else:
            assert restored is not None
            assert restored.state["a"].tolist() == [0, 1, 2, 3, 4]
    assert told > len(whole) / 2


def test_damaged_name_is_not_mistaken_for_another_state(store: Checkpoints) -> None:
    """The directory at the end of the file repeats every name."""
    like = {"kernel": np.zeros(5, np.int32)}
    for update in (1, 2):
        store.save(update, like)
    path = store.folder / "2.npz"
    whole = path.read_bytes()
    place = whole.rindex(b"kernel")
    path.write_bytes(whole[:place] + b"l" + whole[place + 1 :])
    restored = store.restore(like)
    assert restored is not None
    assert restored.update == 1
    assert "2.npz" in restored.damaged[0]


def test_damaged_checkpoints_of_later_updates_are_removed(store: Checkpoints) -> None:
    """They would replace complete checkpoints."""
    like = {"a": np.arange(5)}
    for update in (1, 2):
        store.save(update, like)
    for update in (97, 98, 99):
        (store.folder / f"{update}.npz").write_bytes(b"")
    store.save(3, like)
    assert store.updates() == [2, 3]
    restored = store.restore(like)
    assert restored is not None
    assert (restored.update, restored.damaged) == (3, ())


def test_oversized_header_allocates_nothing(store: Checkpoints) -> None:
    """A header that claims a petabyte, and a zip bomb."""
    store.folder.mkdir()
    header = io.BytesIO()
    huge = {"descr": "<i4", "fortran_order": False, "shape": (10**15,)}
    np.lib.format.write_array_header_1_0(header, huge)
    with zipfile.ZipFile(store.folder / "1.npz", "w") as archive:
        archive.writestr("['a'].npy", header.getvalue())
    with pytest.raises(CheckpointError, match=r"belongs to another state: .* int32"):
        store.restore({"a": np.zeros(5, np.int32)})
    swollen = io.BytesIO()
    np.save(swollen, np.zeros(5, np.int32))
    with zipfile.ZipFile(store.folder / "1.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("['a'].npy", swollen.getvalue() + b"\0" * 10**8)
    tracemalloc.start()
    with pytest.raises(CheckpointError, match="21 bytes, not 20"):
        store.restore({"a": np.zeros(5, np.int32)})
    assert tracemalloc.get_traced_memory()[1] < 10**6
    tracemalloc.stop()


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_only_stored_or_deflated_entries_are_read(store: Checkpoints, method: int) -> None:
    """Four hundred bytes of bzip2 expand to four megabytes even for a short read."""
    store.folder.mkdir()
    swollen = io.BytesIO()
    np.save(swollen, np.zeros(5, np.int32))
    with zipfile.ZipFile(store.folder / "1.npz", "w", method) as archive:
        archive.writestr("['a'].npy", swollen.getvalue() + b"\0" * 2**22)
    tracemalloc.start()
    with pytest.raises(CheckpointError, match="must be stored or deflated"):
        store.restore({"a": np.zeros(5, np.int32)})
    assert tracemalloc.get_traced_memory()[1] < 2**20
    tracemalloc.stop()


def test_error_names_differing_leaf_of_another_state(store: Checkpoints) -> None:
    store.save(1, state_of(1))
    other = state_of(1) | {"flags": jnp.zeros(3, bool)}
    with pytest.raises(CheckpointError, match=r"\['flags'\] is bool\[2\], not bool\[3\]"):
        store.restore(other)
    del other["flags"]
    with pytest.raises(CheckpointError, match=r"\['flags'\] is unexpected"):
        store.restore(other)
    with pytest.raises(CheckpointError, match=r"\['more'\] is missing"):
        store.restore(state_of(1) | {"more": jnp.zeros(3)})
    # A part of a state is not another state.
    part = store.restore({"flags": state_of(1)["flags"]}, whole=False)
    assert part is not None
    np.testing.assert_array_equal(part.state["flags"], state_of(1)["flags"])
    with pytest.raises(CheckpointError, match=r"\['more'\] is missing"):
        store.restore({"more": jnp.zeros(3)}, whole=False)


def test_killed_write_leaves_no_checkpoint(store: Checkpoints) -> None:
    """A process that is killed while it writes leaves a file that the next one sweeps up."""
    code = f"""
import os, signal
import numpy as np
from jaxenstein.baselines.runs.checkpoints import Checkpoints
store = Checkpoints({str(store.folder)!r})
store.save(1, {{"a": np.arange(9, dtype=np.int32)}})
os.fsync = lambda _: os.kill(os.getpid(), signal.SIGKILL)
store.save(2, {{"a": np.arange(9, dtype=np.int32)}})
"""
    done = subprocess.run([sys.executable, "-c", code], timeout=120, check=False)
    assert done.returncode == -signal.SIGKILL
    assert store.updates() == [1]
    assert len(list(store.folder.iterdir())) == 2
    store.save(3, {"a": np.arange(9, dtype=np.int32)})
    assert sorted(path.name for path in store.folder.iterdir()) == ["1.npz", "3.npz"]


def test_too_little_space_is_reported_early(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    state = {"a": jax.ShapeDtypeStruct((1000, 1000), jnp.float32)}
    assert size_of(state) == 4_000_000
    check_space(tmp_path, {"a": jnp.zeros(10)})
    free = shutil.disk_usage(tmp_path)._replace(free=11_999_999)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: free)
    with pytest.raises(OutputError, match="3 checkpoints need about 12 MB, but only 12 MB are"):
        check_space(tmp_path, state)
    # Existing checkpoints already have their space.
    check_space(tmp_path, state, there=1)
    free = free._replace(free=3_999_999)
    with pytest.raises(OutputError, match="1 checkpoint needs about 4 MB, but only 4 MB"):
        check_space(tmp_path, state, there=2)
