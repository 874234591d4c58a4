"""Checkpoints: states of a run on disk, each complete or absent.

A checkpoint is an .npz file with an array for every leaf, named by the leaf's path. It is written
under a temporary name and then renamed. Checksums reveal damage.
"""

from __future__ import annotations

import contextlib
import dataclasses
import shutil
import zipfile
from collections.abc import Collection
from pathlib import Path
from typing import IO, Any

import jax
import numpy as np

from ...errors import SettingError, one_line
from ...files import PART, OutputError, atomic, make_folder, reason_of

KEEP = 2
SUFFIX = ".npz"


class CheckpointError(SettingError):
    """A checkpoint cannot be read, or belongs to another state."""


@dataclasses.dataclass(frozen=True)
class Restored:
    """The content of a checkpoint.

    Attributes:
        update: number of updates before the checkpoint.
        state: the state, with the requested structure and dtypes.
        damaged: newer checkpoints that were skipped, each with the reason.
    """

    update: int
    state: Any
    damaged: tuple[str, ...] = ()


class Checkpoints:
    """The checkpoints in a folder, named by their update."""

    def __init__(self, folder: str | Path, keep: int = KEEP) -> None:
        """Take a folder, which need not exist, and the number of checkpoints to keep."""
        self.folder = Path(folder)
        self._keep = keep

    def updates(self) -> list[int]:
        """The updates of the checkpoints, in ascending order."""
        names = [path.stem for path in self.folder.glob(f"*{SUFFIX}")]
        return sorted(int(name) for name in names if name.isdecimal())

    def save(self, update: int, state: Any) -> None:
        """Write a checkpoint, then remove old checkpoints, later ones and temporary files.

        Args:
            update: number of updates so far; an existing checkpoint of this update is replaced.
            state: any pytree of arrays; typed keys are stored as raw data.

        Raises:
            OutputError: the checkpoint cannot be written; earlier checkpoints are unchanged.
        """
        make_folder(self.folder)
        for left in self.folder.glob(f".*{PART}"):
            left.unlink(missing_ok=True)
        leaves = jax.tree_util.tree_flatten_with_path(state)[0]
        arrays: dict[str, Any] = {
            jax.tree_util.keystr(path): np.asarray(raw(leaf), order="C") for path, leaf in leaves
        }
        with atomic(self._path(update)) as temporary, temporary.open("wb") as file:
            np.savez(file, **arrays)
        # Checkpoints of later updates were damaged: otherwise the run would have resumed from them.
        there = self.updates()
        kept = [one for one in there if one <= update][-self._keep :]
        for old in set(there) - set(kept):
            with contextlib.suppress(OSError):
                self._path(old).unlink()

    def restore(self, like: Any, whole: bool = True) -> Restored | None:
        """Read the newest complete checkpoint; None if there is no checkpoint.

        A training may replace checkpoints at the same time.

        Args:
            like: a pytree of arrays or `jax.ShapeDtypeStruct` with the structure, shapes and dtypes
                of the state.
            whole: whether `like` is the whole state; if false, other parts are skipped.

        Raises:
            CheckpointError: no checkpoint can be read, or they belong to another state.
        """
        listed = self.updates()
        damaged: list[str] = []
        for update in reversed(listed):
            path = self._path(update)
            try:
                with zipfile.ZipFile(path) as archive:
                    besides = () if whole else archive.namelist()
                    return Restored(update, read_tree(archive, like, besides), tuple(damaged))
            except CheckpointError:
                raise
            # On a damaged file, the readers can raise any error.
            except Exception as error:
                damaged.append(f"{path}: {reason_of_any(error)}")
                if isinstance(error, FileNotFoundError) and self.updates() != listed:
                    return self.restore(like, whole)
        if damaged:
            raise CheckpointError(f"no checkpoint can be read: {'; '.join(damaged)}")
        return None

    def _path(self, update: int) -> Path:
        return self.folder / f"{update}{SUFFIX}"


def reason_of_any(error: Exception) -> str:
    """The message of any error, as one short line."""
    text = str(error) if not isinstance(error, OSError) else reason_of(error)
    return one_line(text)[:200] or type(error).__name__


def size_of(state: Any) -> int:
    """The size in bytes of the arrays of a state, or of their `jax.ShapeDtypeStruct`."""
    return sum(leaf.size * leaf.dtype.itemsize for leaf in map(raw, jax.tree.leaves(state)))


def check_space(folder: Path, state: Any, there: int = 0, keep: int = KEEP) -> None:
    """Check early whether the checkpoints of a state fit on the disk; `there` of them exist.

    Raises:
        OutputError: there is not enough space.
    """
    # While a checkpoint is written, there is one more than are kept.
    number = keep + 1 - min(keep, there)
    needed = number * size_of(state)
    free = shutil.disk_usage(folder).free
    if free < needed:
        raise OutputError(
            folder,
            f"{number} checkpoint{'s' * (number > 1)} need{'s' * (number == 1)} about "
            f"{needed / 1e6:.3g} MB, but only {free / 1e6:.3g} MB are free",
        )


def _is_key(leaf: Any) -> bool:
    return hasattr(leaf, "dtype") and jax.numpy.issubdtype(leaf.dtype, jax.dtypes.prng_key)


def raw(leaf: Any) -> Any:
    """The raw data of a typed key; other leaves are returned unchanged."""
    if not _is_key(leaf):
        return leaf
    shapes = isinstance(leaf, jax.ShapeDtypeStruct)
    return jax.eval_shape(jax.random.key_data, leaf) if shapes else jax.random.key_data(leaf)


def typed(data: jax.Array, like: Any) -> jax.Array:
    """Turn data back into a typed key if `like` is a typed key."""
    if not _is_key(like):
        return data
    names: list[str] = []
    jax.eval_shape(lambda key: names.append(str(jax.random.key_impl(key))), like)
    return jax.random.wrap_key_data(data, impl=names[0])


def read_tree(archive: zipfile.ZipFile, like: Any, besides: Collection[str] = ()) -> Any:
    """Read a pytree from an archive, in which arrays are named by their paths.

    Args:
        archive: an open archive.
        like: as in `Checkpoints.restore`.
        besides: names of further entries that are allowed.

    Raises:
        CheckpointError: the archive has other arrays.
    """
    leaves, structure = jax.tree_util.tree_flatten_with_path(like)
    wanted = {jax.tree_util.keystr(where): leaf for where, leaf in leaves}
    found = {name.removesuffix(".npy") for name in archive.namelist()}
    passed_over = {name.removesuffix(".npy") for name in besides} - set(wanted)
    for name in sorted(found - passed_over ^ set(wanted)):
        _read_through(archive)
        what = "is missing" if name in wanted else "is unexpected"
        raise CheckpointError(f"{archive.filename} belongs to another state: {name} {what}")
    filled = [typed(_array(archive, name, leaf), leaf) for name, leaf in wanted.items()]
    return jax.tree.unflatten(structure, filled)


def open_entry(archive: zipfile.ZipFile, name: str) -> IO[bytes]:
    """Open an entry of an archive such that only the bytes that are read get unpacked.

    Raises:
        ValueError: its compression makes Python unpack the whole entry at once.
        KeyError: there is no such entry.
    """
    if archive.getinfo(name).compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError(f"{name} must be stored or deflated, not compressed in another way")
    return archive.open(name)


def _read_through(archive: zipfile.ZipFile) -> None:
    """Read all entries; a damaged file then raises an error of any kind."""
    for name in archive.namelist():
        with open_entry(archive, name) as file:
            while file.read(2**20):
                pass


def _array(archive: zipfile.ZipFile, name: str, like: Any) -> jax.Array:
    """Read one array with no more memory than `like` needs, whatever the file says."""
    like = raw(like)
    with open_entry(archive, f"{name}.npy") as file:
        version = np.lib.format.read_magic(file)
        if version != (1, 0):
            raise ValueError(f"{name} has format version {version}, not (1, 0)")
        shape, fortran, dtype = np.lib.format.read_array_header_1_0(file)
        # Dtypes that numpy lacks, such as bfloat16, are stored as bytes.
        if shape != like.shape or fortran or dtype != np.dtype(like.dtype.str):
            _read_through(archive)
            raise CheckpointError(
                f"{archive.filename} belongs to another state: {name} is {dtype}{list(shape)}, not "
                f"{like.dtype}{list(like.shape)}"
            )
        size = like.size * like.dtype.itemsize
        # Reading to the end of the file verifies the checksum.
        data = file.read(size + 1)
    if len(data) != size:
        raise ValueError(f"{name} has {len(data)} bytes, not {size}")
    return jax.numpy.asarray(np.frombuffer(data, like.dtype).reshape(shape))
