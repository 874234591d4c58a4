"""Checkpoints: whole states of a run on disk, each complete or not there at all.

Orbax writes the arrays. A checkpoint is written under another name, checked in as a whole by one
rename, and carries a digest of its arrays, so that a damaged one is not taken for a whole one.
"""

from __future__ import annotations

import contextlib
import dataclasses
import errno
import hashlib
import json
import logging
import os
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import jax
import numpy as np

from ...errors import SettingError
from ...files import OutputError, make_folder

FORMAT = 1
KEEP = 2
_PART = ".part"


class CheckpointError(SettingError):
    """A checkpoint that cannot be read, or is of another state."""


@dataclasses.dataclass(frozen=True)
class Restored:
    """A checkpoint that was read.

    Attributes:
        update: updates up to it.
        state: the state, with the structure and dtypes of the one asked for.
        about: what `save` was given beside it.
        damaged: newer checkpoints that were passed over, each with the reason.
    """

    update: int
    state: Any
    about: Mapping[str, Any]
    damaged: tuple[str, ...] = ()


class Checkpoints:
    """The checkpoints in a folder, named by their update."""

    def __init__(self, folder: str | Path, keep: int = KEEP) -> None:
        """Take the folder, which need not exist, and how many checkpoints to keep."""
        self.folder = Path(folder).absolute()
        self._keep = keep

    def updates(self) -> list[int]:
        """The updates of the checkpoints, ascending."""
        if not self.folder.is_dir():
            return []
        names = [path.name for path in self.folder.iterdir() if path.is_dir()]
        return sorted(int(name) for name in names if name.isdecimal())

    def save(self, update: int, state: Any, about: Mapping[str, Any] | None = None) -> None:
        """Write a checkpoint, then remove the oldest ones.

        Args:
            update: updates so far; a checkpoint of that update is replaced.
            state: any pytree of arrays; typed keys are kept as their data.
            about: JSON values to keep beside it.

        Raises:
            OutputError: it cannot be written; those before it stay what they were.
        """
        make_folder(self.folder)
        self._sweep()
        target, part = self.folder / str(update), self.folder / f"{update}{_PART}"
        arrays, described = _pack(state)
        note: dict[str, Any] = {
            "format": FORMAT,
            "update": update,
            "digest": _digest(arrays),
            "leaves": described,
            "about": dict(about or {}),
        }
        try:
            part.mkdir()
            _write_arrays(part / "state", arrays)
            note["files"] = _file_digests(part / "state")
            (part / "checkpoint.json").write_text(json.dumps(note), encoding="utf-8")
            _sync(part)
            if target.exists():
                shutil.rmtree(target)
            part.rename(target)
            _sync_one(self.folder)
        except Exception as error:
            shutil.rmtree(part, ignore_errors=True)
            raise OutputError(target, _reason(error)) from error
        for old in self.updates()[: -self._keep]:
            shutil.rmtree(self.folder / str(old), ignore_errors=True)

    def restore(self, like: Any) -> Restored | None:
        """Read the newest checkpoint that is whole; None if there is none at all.

        Args:
            like: a pytree with the structure, shapes and dtypes of the state, of arrays or of
                `jax.ShapeDtypeStruct`.

        Raises:
            CheckpointError: none can be read, or they are of another state.
        """
        damaged: list[str] = []
        for update in reversed(self.updates()):
            folder = self.folder / str(update)
            try:
                state, about = _read(folder, like)
            except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
                if isinstance(error, CheckpointError):
                    raise
                damaged.append(f"{folder}: {_reason(error)}")
            else:
                return Restored(update, state, about, tuple(damaged))
        if damaged:
            raise CheckpointError(f"no checkpoint can be read: {'; '.join(damaged)}")
        return None

    def _sweep(self) -> None:
        """Remove what interrupted writers left."""
        for path in self.folder.glob(f"*{_PART}"):
            shutil.rmtree(path, ignore_errors=True)


def size_of(state: Any) -> int:
    """Bytes of a state's arrays, or of their `jax.ShapeDtypeStruct`."""
    return sum(
        leaf.size * (leaf.dtype.itemsize if hasattr(leaf.dtype, "itemsize") else 8)
        for leaf in jax.tree.leaves(state)
    )


def check_space(folder: Path, state: Any, keep: int = KEEP) -> None:
    """Find out early whether the checkpoints of a state fit on the disk.

    Raises:
        OutputError: they do not.
    """
    needed = (keep + 1) * size_of(state)
    free = shutil.disk_usage(folder).free
    if free < needed:
        raise OutputError(
            folder,
            f"{keep + 1} checkpoints need about {needed / 1e6:.3g} MB, "
            f"{free / 1e6:.3g} MB are free",
        )


def _pack(state: Any) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """The arrays of a state by their number, and what each is."""
    arrays, described = {}, {}
    for number, (path, leaf) in enumerate(jax.tree_util.tree_flatten_with_path(state)[0]):
        key = _is_key(leaf)
        array = np.asarray(jax.random.key_data(leaf) if key else leaf)
        name = f"{number:05}"
        described[name] = {
            "path": jax.tree_util.keystr(path),
            "shape": list(array.shape),
            "dtype": str(array.dtype),
            "key": str(jax.random.key_impl(leaf)) if key else None,
        }
        # Orbax does not write arrays without elements.
        if array.size:
            arrays[name] = array
    return arrays, described


def _read(folder: Path, like: Any) -> tuple[Any, dict[str, Any]]:
    note = json.loads((folder / "checkpoint.json").read_text(encoding="utf-8"))
    if note["format"] != FORMAT:
        raise CheckpointError(f"{folder} has format {note['format']!r}, not {FORMAT}")
    leaves, structure = jax.tree_util.tree_flatten_with_path(like)
    described = [note["leaves"][name] for name in sorted(note["leaves"])]
    _check_same(folder, described, leaves)
    # Orbax fails noisily on damaged files, with tracebacks of its threads.
    files = _file_digests(folder / "state")
    if note.get("files", files) != files:
        raise ValueError("its files are not those that were written")
    arrays = _read_arrays(folder / "state", note["leaves"])
    if _digest(arrays) != note["digest"]:
        raise ValueError("its arrays are not those that were written")
    filled = []
    for number, entry in enumerate(described):
        array = arrays.get(f"{number:05}")
        if array is None:
            array = np.zeros(entry["shape"], entry["dtype"])
        leaf = jax.numpy.asarray(array)
        if entry["key"] is not None:
            leaf = jax.random.wrap_key_data(leaf, impl=entry["key"])
        filled.append(leaf)
    return jax.tree.unflatten(structure, filled), note["about"]


def _check_same(folder: Path, described: list[Any], leaves: list[Any]) -> None:
    """Compare what was saved with what is asked for."""
    saved = {entry["path"]: _kind(entry) for entry in described}
    wanted = {jax.tree_util.keystr(path): _kind_of(leaf) for path, leaf in leaves}
    for path in {**saved, **wanted}:
        if saved.get(path) != wanted.get(path):
            raise CheckpointError(
                f"{folder} is of another state: {path} is {saved.get(path, 'missing')}, not "
                f"{wanted.get(path, 'missing')}"
            )


def _kind(entry: Mapping[str, Any]) -> str:
    # The data of a key has one axis more than the key.
    if entry["key"] is not None:
        return f"key{entry['shape'][:-1]}"
    return f"{entry['dtype']}{entry['shape']}"


def _kind_of(leaf: Any) -> str:
    shape = list(np.shape(leaf))
    return f"key{shape}" if _is_key(leaf) else f"{np.dtype(leaf.dtype)}{shape}"


def _is_key(leaf: Any) -> bool:
    return hasattr(leaf, "dtype") and jax.numpy.issubdtype(leaf.dtype, jax.dtypes.prng_key)


def _checkpointer() -> Any:
    import orbax.checkpoint as ocp

    return ocp.Checkpointer(ocp.StandardCheckpointHandler())


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Keep Orbax from logging the errors that it raises as well."""
    logger = logging.getLogger("absl")
    before, logger.disabled = logger.disabled, True
    try:
        yield
    finally:
        logger.disabled = before


def _write_arrays(folder: Path, arrays: dict[str, np.ndarray]) -> None:
    import orbax.checkpoint as ocp

    with _silence(), contextlib.closing(_checkpointer()) as checkpointer:
        checkpointer.save(folder, args=ocp.args.StandardSave(arrays))


def _read_arrays(folder: Path, described: Mapping[str, Any]) -> dict[str, np.ndarray]:
    import orbax.checkpoint as ocp

    like = {
        name: np.zeros(entry["shape"], entry["dtype"])
        for name, entry in described.items()
        if np.prod(entry["shape"], dtype=int)
    }
    with _silence(), contextlib.closing(_checkpointer()) as checkpointer:
        return checkpointer.restore(folder, args=ocp.args.StandardRestore(like))


def _digest(arrays: Mapping[str, np.ndarray]) -> str:
    """One number for all bits of all arrays."""
    total = hashlib.sha256()
    for name in sorted(arrays):
        total.update(name.encode())
        total.update(np.ascontiguousarray(arrays[name]).view(np.uint8).data)
    return total.hexdigest()


def _file_digests(folder: Path) -> dict[str, str]:
    """A digest of every file below a folder, by its path there."""
    found = {}
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        with path.open("rb") as file:
            name = path.relative_to(folder).as_posix()
            found[name] = hashlib.file_digest(file, "sha256").hexdigest()
    return found


def _sync(folder: Path) -> None:
    """Bring everything below a folder to the disk."""
    for path in [*folder.rglob("*"), folder]:
        _sync_one(path)


def _sync_one(path: Path) -> None:
    # Some systems cannot open a folder; then there is nothing to be done.
    if path.is_dir() and os.name == "nt":
        return
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _reason(error: BaseException) -> str:
    """Why, in one line; the writers below Python put the system's reason into long texts."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror.lower()
    text = " ".join(str(error).split())
    for number in (errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EACCES, errno.EROFS, errno.EIO):
        if os.strerror(number).lower() in text.lower():
            return os.strerror(number).lower()
    return text[:200] or type(error).__name__
