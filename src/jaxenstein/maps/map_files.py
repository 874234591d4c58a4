"""Files of text maps: `maze.txt`, and beside it what says how its walls look; maps to play with."""

from __future__ import annotations

import importlib.resources
import os
from pathlib import Path

from .. import files
from ..errors import MapError, nearest, quoted

# The most characters of a map.
LONGEST = 2**24
SAMPLES = {
    "corridor": "straight ahead",
    "rooms": "four rooms in a ring, starts everywhere",
    "spiral": "one long way in",
    "pillars": "an open hall, the goal in its middle, pillars of nine colours",
    "maze": "a maze with two starts",
    "keys": "a key opens the way to another key, which opens the way to the goal",
}


def read_map(path: Path) -> dict[str, str]:
    """The settings of `from_ascii` that a map file gives.

    They are `text`, and `regions` or `faces` where there is such a file beside it: of `maze.txt`,
    `maze.regions.txt` or `maze.faces.txt`.

    `samples/NAME` is a map of `sample_map` where there is no such file.

    Raises:
        MapError: a file cannot be read, or there is no such sample.
    """
    if path.parent.name == "samples" and not path.suffix and not os.path.exists(path):
        return {"text": sample_map(path.name)}
    texts = {"text": read_text(path, "map")}
    for kind in ("regions", "faces"):
        if os.path.isfile(beside(path, kind)):
            texts[kind] = read_text(beside(path, kind), f"{kind} text")
    return texts


def beside(path: Path, kind: str) -> Path:
    """The file that goes with a map file and says how its walls look."""
    return path.with_name(f"{path.stem}.{kind}.txt")


def read_text(path: Path, what: str) -> str:
    """The text of a file.

    Raises:
        MapError: it cannot be read.
    """
    try:
        return files.read_text(path, LONGEST)
    except UnicodeDecodeError as error:
        raise MapError(f"cannot read the {what} {path}: it is not text") from error
    except (OSError, ValueError) as error:  # the latter for a name that none can have
        raise MapError(f"cannot read the {what} {path}: {files.reason_of(error)}") from error


def sample_map(name: str) -> str:
    """The text of a small map to play with, for `from_ascii`, or to be changed.

    Args:
        name: `corridor`, `rooms`, `spiral`, `pillars`, `maze` or `keys`. A command takes it as
            `--map-file samples/rooms`.

    Raises:
        MapError: there is no such map.

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
