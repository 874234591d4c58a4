"""The configurations that come with this package, in `jaxenstein/configs`, by name."""

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
    """What a configuration trains, for people.

    Attributes:
        name: what `--config` takes.
        environment: its id, or "a map".
        algo: the algorithm.
        frame_skip: steps of the world in a decision.
        decisions: of each run, over all its environments.
        about: one sentence.
    """

    name: str
    environment: str
    algo: str
    frame_skip: int
    decisions: int
    about: str


def configs() -> dict[str, Path]:
    """The files of the configurations by name, such as `room` or `figure3/simple`."""
    files = sorted(FOLDER.rglob(f"*{SUFFIX}"), key=lambda file: (len(file.parts), file))
    return {file.relative_to(FOLDER).with_suffix("").as_posix(): file for file in files}


def find_config(given: str | PurePath, folder: Path = Path()) -> Path:
    """The file that `--config` names.

    Args:
        given: a path, or else the name of a configuration of this package.
        folder: what a path is relative to.

    Raises:
        SettingError: there is neither such a file nor such a configuration.
    """
    path, known = folder / given, configs()
    try:
        # Not `is_file`: a pipe can be read, too.
        if not stat.S_ISDIR(os.stat(path).st_mode):
            return path
    except (FileNotFoundError, NotADirectoryError, ValueError):
        pass
    except OSError:
        return path  # Who reads it tells why that cannot be.
    name = PurePath(given).as_posix()
    if name in known:
        return known[name]
    bare = PurePath(given).with_suffix("") if PurePath(given).suffix == SUFFIX else PurePath(given)
    near = nearest(bare.as_posix(), known) or nearest(bare.name, known)
    raise SettingError(
        f"cannot read {path}: no such file, and this package has no configuration "
        f"{quoted(name)}{near}; "
        "'jaxenstein list --configs' names them"
    )


def listed() -> list[Listed]:
    """The configurations of this package, in the order of `configs`."""
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
