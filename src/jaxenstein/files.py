"""Reading and writing files; writes are atomic."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import stat
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NoReturn

from .errors import JAXensteinError, SettingError, quoted

# The most characters in a text: an endless device must not fill the memory.
LONGEST_TEXT = 2**26
# The suffix of temporary files.
PART = ".part"


class OutputError(JAXensteinError, OSError):
    """A file or folder could not be written; the message names its path and the reason."""

    def __init__(self, path: str | Path, reason: str) -> None:
        """Say which path could not be written, and why."""
        super().__init__(f"cannot write {path}: {reason}")
        self._given = str(path), reason

    def __reduce__(self) -> tuple[type[OutputError], tuple[str, str]]:
        """Support pickling."""
        return type(self), self._given

    def __str__(self) -> str:
        """The message alone; `OSError` would put an error number before it."""
        return str(self.args[0])


@contextlib.contextmanager
def writing(path: str | Path) -> Iterator[None]:
    """Turn system errors while writing to `path` into an `OutputError`."""
    try:
        yield
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(path, reason_of(error)) from error


@contextlib.contextmanager
def atomic(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path in the same folder, which is moved to `path` if the block succeeds.

    An existing file keeps its permissions; a link is replaced, not its target. If the block or the
    move fails, the temporary file is removed and `path` is unchanged.

    Args:
        path: the file to write; its folder must exist.

    Raises:
        OutputError: the file cannot be written: no such folder, no permission, or disk full.
    """
    path = Path(path)
    check_writable(path)
    with writing(path):
        old = os.path.isfile(path) and not os.path.islink(path)
        mode = stat.S_IMODE(path.stat().st_mode) if old else _default_mode()
        # The temporary name is longer than the name, which may be as long as the system allows.
        prefix = f".{path.name[:40]}."
        handle, name = tempfile.mkstemp(prefix=prefix, suffix=PART, dir=path.parent)
        os.close(handle)
        temporary = Path(name)
        try:
            yield temporary
            _fsync(temporary)
            temporary.chmod(mode)
            os.replace(temporary, path)
        finally:
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)


def read_text(path: str | Path, most: int = LONGEST_TEXT) -> str:
    """Read a UTF-8 text file.

    Raises:
        OSError: the file cannot be read, or has more than `most` characters.
        UnicodeDecodeError: the file is not UTF-8 text.
    """
    with Path(path).open(encoding="utf-8") as file:
        text = file.read(most + 1)
    if len(text) > most:
        raise OSError(errno.EFBIG, f"it has more than {most} characters")
    return text


def read_json(path: str | Path, what: str) -> Any:
    """Read a file of JSON.

    Args:
        path: the file.
        what: what the file should be, with an article, for the message.

    Raises:
        SettingError: the file cannot be read, is not JSON, has a number that is not finite, or has
            two entries of one name in an object; the message does not name the file.
    """
    try:
        return json.loads(
            read_text(path), parse_constant=_refuse, object_pairs_hook=without_repeats
        )
    except OSError as error:
        raise SettingError(f"cannot be read: {reason_of(error)}") from error
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise SettingError(f"not {what}, or only a part of it: {place}: {error.msg}") from error
    except JAXensteinError:
        raise
    except (ValueError, RecursionError) as error:
        raise SettingError(f"not {what}: {error}") from error


def without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """The entries of an object of JSON or YAML.

    Raises:
        SettingError: two of them have one name.
    """
    table = dict(pairs)
    if len(table) < len(pairs):
        twice = Counter(name for name, _ in pairs).most_common(1)[0][0]
        raise SettingError(f"two entries have the name {quoted(twice)}")
    return table


def _refuse(word: str) -> NoReturn:
    raise SettingError(f"it has a number that is {word}; all must be finite")


def append(path: Path, text: str) -> None:
    """Append text to a file, and flush it to the disk.

    Raises:
        OutputError: the file cannot be written; some of the text may have been.
    """
    with writing(path), path.open("a", encoding="utf-8", newline="") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


def check_apart(outputs: Sequence[Path | None], inputs: Sequence[str | Path | None] = ()) -> None:
    """Check that no output is an input or another output; None stands for no file.

    Raises:
        SettingError: two of the paths are one file.
    """
    files = [path for path in outputs if path is not None]
    for number, path in enumerate(files):
        for other in (*files[:number], *(path for path in inputs if path is not None)):
            if os.path.realpath(path) == os.path.realpath(other):
                raise SettingError(f"{path} would overwrite {other}: choose another name")


def check_links(folder: str | Path) -> None:
    """Check before the first write that everything below a folder stays inside it.

    Folders `wandb` are not searched: Weights & Biases links to its cache from there.

    Raises:
        SettingError: an entry is a link out of the folder, a file with another name elsewhere
            (a hard link), or neither a file nor a folder.
        OutputError: an entry is in a folder that this user may not search.
    """
    root = Path(folder).resolve()
    for parent, names, files in os.walk(folder):
        for entry in (Path(parent) / name for name in (*names, *files)):
            try:
                about = entry.lstat()
            except FileNotFoundError:
                continue  # the temporary file of another process
            except OSError as error:
                raise OutputError(entry, reason_of(error)) from error
            mode = about.st_mode
            inside = Path(os.path.realpath(entry)).is_relative_to(root)
            if (stat.S_ISLNK(mode) and not inside) or (stat.S_ISREG(mode) and about.st_nlink > 1):
                raise SettingError(
                    f"{entry} is a link out of {folder}: replace it by what it links to"
                )
            if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode) or stat.S_ISLNK(mode)):
                raise SettingError(f"{entry} is neither a file nor a folder")
        names[:] = [name for name in names if name != "wandb"]


def check_writable(path: str | Path) -> None:
    """Check early, before long work, that a file can be written to `path`.

    Raises:
        OutputError: `path` is a folder, a device, a pipe or not a valid name, or its folder is
            missing or not writable.
    """
    path = Path(path)
    folder = path.parent
    try:
        os.lstat(path)
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as error:  # A name may be too long even for a lookup.
        raise OutputError(path, reason_of(error)) from error
    if os.path.isdir(path):
        raise OutputError(path, "it is a folder")
    if os.path.exists(path) and not os.path.isfile(path):
        raise OutputError(path, "it is a device or a pipe, which a file would replace")
    if not os.path.exists(folder):
        raise OutputError(path, f"there is no folder {folder}")
    if not os.path.isdir(folder):
        raise OutputError(path, f"{folder} is not a folder")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OutputError(path, f"no permission to write in {folder}")


def name_of(path: str | Path) -> str:
    """The name of a file or folder, also of "." and ".."."""
    return os.path.basename(os.path.abspath(path))


def make_folder(path: str | Path) -> Path:
    """Create a folder and its parents if they are missing.

    Raises:
        OutputError: the folder cannot be created, or something else has its name.
    """
    path = Path(path)
    with writing(path):
        try:
            path.mkdir(parents=True, exist_ok=True)
        except FileExistsError as error:
            raise OutputError(path, "it exists and is not a folder") from error
    return path


def _fsync(path: Path) -> None:
    with path.open("r+b") as file:
        os.fsync(file.fileno())


def reason_of(error: Exception) -> str:
    """The reason of a system error, without number and path; otherwise the message of the error."""
    return (getattr(error, "strerror", None) or str(error)).lower()


def _default_mode() -> int:
    """The permissions of a newly created file; temporary files start out private."""
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask
