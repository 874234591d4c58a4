"""The named configs of this package, in `jaxenstein/configs`."""

from __future__ import annotations

import dataclasses
import itertools
import os
import stat
from pathlib import Path, PurePath

from ...errors import SettingError, nearest, quoted
from ..config import Config
from .options import read_file

FOLDER, SUFFIX = Path(__file__).parents[2] / "configs", ".toml"


@dataclasses.dataclass(frozen=True)
class Listed:
    """A description of a config for `jaxenstein list --configs`.

    Attributes:
        name: the name that `--config` takes.
        environment: id of the environment, or "a map".
        algo: the algorithm.
        frame_skip: world steps per decision.
        decisions: decisions of each run, over all its environments.
        about: one sentence.
    """

    name: str
    environment: str
    algo: str
    frame_skip: int
    decisions: int
    about: str


def configs() -> dict[str, Path]:
    """The files of the configs by name, such as `room` or `figure3/simple`."""
    files = sorted(FOLDER.rglob(f"*{SUFFIX}"), key=lambda file: (len(file.parts), file))
    return {file.relative_to(FOLDER).with_suffix("").as_posix(): file for file in files}


def find_config(given: str | PurePath, folder: Path = Path()) -> Path:
    """The file that `--config` names.

    Args:
        given: a path, or else the name of a config of this package.
        folder: the folder that a relative path starts from.

    Raises:
        SettingError: there is neither such a file nor such a config.
    """
    path, known = folder / given, configs()
    try:
        # Not `is_file`, since a pipe can be read, too.
        if not stat.S_ISDIR(os.stat(path).st_mode):
            return path
    except (FileNotFoundError, NotADirectoryError, ValueError):
        pass
    except OSError:
        return path  # The reader reports why it cannot be read.
    name = PurePath(given).as_posix()
    if name in known:
        return known[name]
    bare = PurePath(given).with_suffix("") if PurePath(given).suffix == SUFFIX else PurePath(given)
    near = nearest(bare.as_posix(), known) or nearest(bare.name, known)
    raise SettingError(
        f"cannot read {path}: no such file, and this package has no config "
        f"{quoted(name)}{near}; 'jaxenstein list --configs' shows all configs"
    )


def listed() -> list[Listed]:
    """The configs of this package, in the order of `configs`."""
    return [_listed(name, file) for name, file in configs().items()]


def _listed(name: str, file: Path) -> Listed:
    given = read_file(file)
    lines = itertools.takewhile(lambda line: line[:1] == "#", file.read_text("utf-8").splitlines())
    return Listed(
        name,
        given.get("env", "a map"),
        given.get("algo", Config.algo),
        given.get("frame_skip", 1),
        given.get("total_steps", Config.total_steps),
        next(lines, "").lstrip("# "),
    )
