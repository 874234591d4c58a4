"""Writing files whole or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

from .errors import JAXensteinError, SettingError

# The most characters of a text: a device without end must not fill the memory.
LONGEST_TEXT = 2**26
# How the names of files end that are being written.
PART = ".part"


class OutputError(JAXensteinError, OSError):
    """A file or folder could not be written; the message names its path and the reason."""

    def __init__(self, path: str | Path, reason: str) -> None:
        """Say which path could not be written, and why."""
        super().__init__(f"cannot write {path}: {reason}")
        self._given = str(path), reason

    def __reduce__(self) -> tuple[type[OutputError], tuple[str, str]]:
        """What makes the error anew in another process."""
        return type(self), self._given

    def __str__(self) -> str:
        """The message alone; `OSError` would prefix an error number where it has one."""
        return str(self.args[0])


@contextlib.contextmanager
def writing(path: str | Path) -> Iterator[None]:
    """Turn what the system says against writing at `path` into an `OutputError`."""
    try:
        yield
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(path, reason_of(error)) from error


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
    with writing(path):
        # A name may be as long as the system allows, and the temporary one is longer.
        prefix = f".{path.name[:40]}."
        handle, name = tempfile.mkstemp(prefix=prefix, suffix=PART, dir=path.parent)
        os.close(handle)
        temporary = Path(name)
        try:
            yield temporary
            temporary.chmod(_default_mode())
            _bring_to_disk(temporary)
            os.replace(temporary, path)
        finally:
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)


def read_text(path: str | Path, most: int = LONGEST_TEXT) -> str:
    """The text of a file in UTF-8.

    Raises:
        OSError: it cannot be read, or has more than `most` characters.
        UnicodeDecodeError: it is not text.
    """
    with Path(path).open(encoding="utf-8") as file:
        text = file.read(most + 1)
    if len(text) > most:
        raise OSError(errno.EFBIG, f"it has more than {most} characters")
    return text


def append(path: Path, text: str) -> None:
    """Add a text to the end of a file, and bring it to the disk.

    Raises:
        OutputError: if it cannot be written; a part of it may have been.
    """
    with writing(path), path.open("a", encoding="utf-8", newline="") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


def check_links(folder: str | Path) -> None:
    """Find out before the first write whether what is written below a folder stays there.

    Raises:
        SettingError: something below it is a link that leads out of it, a file that has another
            name somewhere else, or neither file nor folder.
        OutputError: something below it is in a folder that is closed to this user.
    """
    root = Path(folder).resolve()
    for parent, names, files in os.walk(folder):
        for entry in (Path(parent) / name for name in (*names, *files)):
            try:
                about = entry.lstat()
            except FileNotFoundError:
                continue  # another process' temporary file
            except OSError as error:
                raise OutputError(entry, reason_of(error)) from error
            mode = about.st_mode
            inside = Path(os.path.realpath(entry)).is_relative_to(root)
            if (stat.S_ISLNK(mode) and not inside) or (stat.S_ISREG(mode) and about.st_nlink > 1):
                raise SettingError(
                    f"{entry} is a link out of {folder}: put what it leads to in its place"
                )
            if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode) or stat.S_ISLNK(mode)):
                raise SettingError(f"{entry} is neither a file nor a folder")


def check_writable(path: str | Path) -> None:
    """Find out early, before long work, whether a file can be written at `path`.

    Raises:
        OutputError: if `path` is a folder, a device, a pipe or no name for a file, or its own
            folder is missing or cannot be written to.
    """
    path = Path(path)
    folder = path.parent
    try:
        os.lstat(path)
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as error:  # Names may be too long even to look for.
        raise OutputError(path, reason_of(error)) from error
    if os.path.isdir(path):
        raise OutputError(path, "it is a folder")
    if os.path.exists(path) and not os.path.isfile(path):
        raise OutputError(path, "it is a device or a pipe, in whose place a file would be put")
    if not os.path.exists(folder):
        raise OutputError(path, f"there is no folder {folder}")
    if not os.path.isdir(folder):
        raise OutputError(path, f"{folder} is not a folder")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OutputError(path, f"no permission to write in {folder}")


def make_folder(path: str | Path) -> Path:
    """Create a folder and its parents if they are missing.

    Raises:
        OutputError: if that fails, or if something else has that name.
    """
    path = Path(path)
    with writing(path):
        try:
            path.mkdir(parents=True, exist_ok=True)
        except FileExistsError as error:
            raise OutputError(path, "it exists and is not a folder") from error
    return path


def _bring_to_disk(path: Path) -> None:
    with path.open("r+b") as file:
        os.fsync(file.fileno())


def reason_of(error: Exception) -> str:
    """What the system says, without number and path; of other errors the message."""
    return (getattr(error, "strerror", None) or str(error)).lower()


def _default_mode() -> int:
    """The permissions of a newly created file; temporary files start out private."""
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask
