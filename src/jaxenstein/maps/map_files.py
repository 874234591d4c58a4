"""Files of text maps: `maze.txt` with regions or faces beside it, and the sample maps."""

from __future__ import annotations

import importlib.resources
import os
from pathlib import Path

from .. import files
from ..errors import MapError, nearest, quoted

# The most characters in a map.
LONGEST = 2**24
SAMPLES = {
    "corridor": "straight ahead",
    "rooms": "four rooms in a ring, starts everywhere",
    "spiral": "one long way in",
    "pillars": "an open hall, the goal in its middle, pillars of nine colours",
    "maze": "a maze with two starts",
    "keys": "a key opens the way to another key, which opens the way to the goal",
}


def read_map(given: Path, folder: Path = Path()) -> dict[str, str]:
    """Read the settings of `from_ascii` from a map file.

    Returns `name`, `text`, and `regions` or `faces` if there is such a file: beside `maze.txt`,
    the file `maze.regions.txt` or `maze.faces.txt`. `samples/NAME` is a map of `sample_map`,
    unless a file of that name exists.

    Args:
        given: the path of the map.
        folder: where a relative path begins.

    Raises:
        MapError: a file cannot be read, both other files exist, or the sample does not exist.
    """
    path = folder / given
    sample = given.parent == Path("samples") and not given.suffix
    if sample and not os.path.exists(path):
        return {"name": given.name, "text": sample_map(given.name)}
    texts = {"name": path.stem, "text": read_text(path, "map")}
    for kind in ("regions", "faces"):
        if os.path.isfile(beside(path, kind)):
            texts[kind] = read_text(beside(path, kind), f"{kind} text")
    if {"regions", "faces"} <= {*texts}:
        both = " and ".join(str(beside(path, kind)) for kind in ("regions", "faces"))
        raise MapError(f"{both} exist; both say how the walls of {path} look: remove one")
    return texts


def beside(path: Path, kind: str) -> Path:
    """The regions or faces file that belongs to a map file."""
    return path.with_name(f"{path.stem}.{kind}.txt")


def read_text(path: Path, what: str) -> str:
    """Read a text file.

    Raises:
        MapError: the file cannot be read.
    """
    try:
        return files.read_text(path, LONGEST)
    except UnicodeDecodeError as error:
        raise MapError(f"cannot read the {what} {path}: it is not text") from error
    except (OSError, ValueError) as error:  # ValueError for an impossible file name
        raise MapError(f"cannot read the {what} {path}: {files.reason_of(error)}") from error


def sample_map(name: str) -> str:
    """The text of a small map to try or to change, for `from_ascii`.

    Args:
        name: `corridor`, `rooms`, `spiral`, `pillars`, `maze` or `keys`. Commands take it as
            `--map-file samples/rooms`.

    Raises:
        MapError: the map does not exist.

    Examples:
        >>> print(sample_map("corridor"))
        ########
        #S....G#
        ########
    """
    name = name.removeprefix("samples/") if isinstance(name, str) else name
    if name not in SAMPLES:
        known = ", ".join(SAMPLES)
        raise MapError(
            f"unknown sample map {quoted(name)}{nearest(str(name), SAMPLES)}; known: {known}"
        )
    folder = importlib.resources.files("jaxenstein.maps") / "samples"
    return (folder / f"{name}.txt").read_text("ascii").rstrip()
