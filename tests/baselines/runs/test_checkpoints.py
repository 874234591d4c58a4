"""Checkpoints: exact, whole or not there, and clear about why not."""

from __future__ import annotations

import errno
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("orbax.checkpoint")
pytest.importorskip("flax")

from jaxenstein.baselines.runs import checkpoints
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


def test_state_comes_back_bit_for_bit(store: Checkpoints) -> None:
    assert store.restore(state_of(0)) is None
    store.save(7, state_of(3), {"note": [1, 2]})
    restored = store.restore(jax.eval_shape(lambda: state_of(0)))
    assert restored is not None
    assert (restored.update, restored.about, restored.damaged) == (7, {"note": [1, 2]}, ())
    assert_same(restored.state, state_of(3))
    # A typed key is a key again and draws what it would have drawn.
    drawn = jax.random.normal(restored.state["key"][1])
    assert drawn == jax.random.normal(state_of(3)["key"][1])


def test_the_newest_two_are_kept(store: Checkpoints) -> None:
    for update in (2, 10, 9, 11):
        store.save(update, state_of(update))
    assert store.updates() == [10, 11]
    store.save(11, state_of(5))
    restored = store.restore(state_of(0))
    assert restored is not None
    assert (restored.update, int(restored.state["count"])) == (11, 5)


@pytest.mark.parametrize("victim", ["checkpoint.json", "state"])
def test_a_damaged_checkpoint_is_passed_over(store: Checkpoints, victim: str) -> None:
    store.save(1, state_of(1))
    store.save(2, state_of(2))
    path = store.folder / "2" / victim
    files = [path] if path.is_file() else [p for p in path.rglob("*") if p.is_file()]
    for file in files:
        file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    restored = store.restore(state_of(0))
    assert restored is not None
    assert restored.update == 1
    assert len(restored.damaged) == 1
    assert_same(restored.state, state_of(1))
    shutil.rmtree(store.folder / "1")
    with pytest.raises(CheckpointError, match="no checkpoint can be read"):
        store.restore(state_of(0))


def test_a_note_of_brackets_without_end_is_a_damaged_one(store: Checkpoints) -> None:
    store.save(1, state_of(1))
    (store.folder / "1" / "checkpoint.json").write_text("[" * 200_000, encoding="utf-8")
    with pytest.raises(CheckpointError, match="no checkpoint can be read"):
        store.restore(state_of(0))


def test_changed_bits_are_noticed(store: Checkpoints, monkeypatch: pytest.MonkeyPatch) -> None:
    store.save(1, state_of(1))
    read = checkpoints._read_arrays

    def flip(*args: Any) -> dict[str, np.ndarray]:
        arrays = read(*args)
        name = next(iter(arrays))
        changed = np.array(arrays[name])
        changed.reshape(-1).view(np.uint8)[0] ^= 1
        return {**arrays, name: changed}

    monkeypatch.setattr(checkpoints, "_read_arrays", flip)
    with pytest.raises(CheckpointError, match="not those that were written"):
        store.restore(state_of(0))


def test_another_state_is_refused_with_the_leaf_that_differs(store: Checkpoints) -> None:
    store.save(1, state_of(1))
    other = state_of(1) | {"flags": jnp.zeros(3, bool)}
    with pytest.raises(CheckpointError, match=r"\['flags'\] is bool\[2\], not bool\[3\]"):
        store.restore(other)
    del other["flags"]
    with pytest.raises(CheckpointError, match=r"\['flags'\] is bool\[2\], not missing"):
        store.restore(other)


def test_an_interrupted_write_is_no_checkpoint(
    store: Checkpoints, monkeypatch: pytest.MonkeyPatch
) -> None:
    store.save(1, state_of(1))

    def killed(*_: Any) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(checkpoints, "_sync", killed)
        with pytest.raises(KeyboardInterrupt):
            store.save(2, state_of(2))
    assert store.updates() == [1]
    restored = store.restore(state_of(0))
    assert restored is not None
    assert restored.update == 1
    # The next one sweeps up what was left.
    store.save(3, state_of(3))
    assert sorted(path.name for path in store.folder.iterdir()) == ["1", "3"]


def test_full_disk_is_told_and_leaves_the_old_ones(
    store: Checkpoints, monkeypatch: pytest.MonkeyPatch
) -> None:
    store.save(1, state_of(1))

    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(checkpoints, "_write_arrays", full)
    with pytest.raises(OutputError, match="no space left on device"):
        store.save(2, state_of(2))
    assert [path.name for path in store.folder.iterdir()] == ["1"]


def test_the_system_refusing_to_write_is_told(tmp_path: Path) -> None:
    """A limit of the system on the size of files, which the writer below Python meets."""
    code = f"""
import resource
import numpy as np
from jaxenstein.baselines.runs.checkpoints import Checkpoints
from jaxenstein.files import OutputError
store = Checkpoints({str(tmp_path)!r})
store.save(1, {{"a": np.arange(9, dtype=np.int32)}})
resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, resource.RLIM_INFINITY))
noise = np.random.default_rng(0).integers(0, 256, 10**6).astype(np.uint8)
try:
    store.save(2, {{"a": noise}})
except OutputError as error:
    print(error)
assert store.updates() == [1]
assert np.array_equal(store.restore({{"a": np.zeros(9, np.int32)}}).state["a"], range(9))
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.strip() == f"cannot write {tmp_path / '2'}: file too large"
    assert sorted(os.listdir(tmp_path)) == ["1"]


def test_a_folder_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"not a directory|exists and is not a folder"):
        Checkpoints(tmp_path / "file").save(1, state_of(1))


def test_too_little_space_is_told_early(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    state = {"a": jax.ShapeDtypeStruct((1000, 1000), jnp.float32)}
    assert size_of(state) == 4_000_000
    check_space(tmp_path, {"a": jnp.zeros(10)})
    free = shutil.disk_usage(tmp_path)._replace(free=11_999_999)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: free)
    with pytest.raises(OutputError, match="3 checkpoints need about 12 MB, 12 MB are free"):
        check_space(tmp_path, state)


def test_checkpoints_of_another_format_are_refused(store: Checkpoints) -> None:
    store.save(1, state_of(1))
    path = store.folder / "1" / "checkpoint.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"format": 99}))
    with pytest.raises(CheckpointError, match="format 99, not 1"):
        store.restore(state_of(0))
