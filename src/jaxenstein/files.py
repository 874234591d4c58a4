"""Writing files whole or not at all."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from .errors import JAXensteinError


class OutputError(JAXensteinError, OSError):
    """A file or folder could not be written; the message names its path and the reason."""

    def __init__(self, path: str | Path, reason: str) -> None:
        """Say which path could not be written, and why."""
        super().__init__(f"cannot write {path}: {reason}")

    def __str__(self) -> str:
        """The message alone; `OSError` would prefix an error number where it has one."""
        return str(self.args[0])


@contextlib.contextmanager
def atomic(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path in the same folder, moved to `path` when the block succeeds.

    If the block or the move fails, the temporary file is removed and `path` stays what it was.

    Args:
        path: the file to write; its folder must exist.

    Raises:
        OutputError: if the file cannot be written: no such folder, no permission, disk full.
    """
    path = Path(path)
    check_writable(path)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
        os.close(handle)
    except OSError as error:
        raise OutputError(path, _reason(error)) from error
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(_default_mode())
        os.replace(temporary, path)
    except OSError as error:
        raise OutputError(path, _reason(error)) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def check_writable(path: str | Path) -> None:
    """Find out early, before long work, whether a file can be written at `path`.

    Raises:
        OutputError: if `path` is a folder or no name for a file, or its own folder is missing or
            cannot be written to.
    """
    path = Path(path)
    folder = path.parent
    try:
        os.lstat(path)
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as error:  # Names may be too long even to look for.
        raise OutputError(path, _reason(error)) from error
    if path.is_dir():
        raise OutputError(path, "it is a folder")
    if not folder.exists():
        raise OutputError(path, f"there is no folder {folder}")
    if not folder.is_dir():
        raise OutputError(path, f"{folder} is not a folder")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OutputError(path, f"no permission to write in {folder}")


def make_folder(path: str | Path) -> Path:
    """Create a folder and its parents if they are missing.

    Raises:
        OutputError: if that fails, or if something else has that name.
    """
    path = Path(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except FileExistsError as error:
        raise OutputError(path, "it exists and is not a folder") from error
    except OSError as error:
        raise OutputError(path, _reason(error)) from error
    return path


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()


def _default_mode() -> int:
    """The permissions of a newly created file; temporary files start out private."""
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask
