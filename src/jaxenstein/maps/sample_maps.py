"""Small maps to play with, as text."""

from __future__ import annotations

import importlib.resources

from ..errors import MapError, nearest

SAMPLES = {
    "corridor": "straight ahead",
    "rooms": "four rooms in a ring, starts everywhere",
    "spiral": "one long way in",
    "pillars": "an open hall, the goal in its middle, pillars of nine colours",
    "maze": "a maze with two starts",
    "keys": "a key opens the way to another key, which opens the way to the goal",
}


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
        raise MapError(f"unknown sample map {name!r}{nearest(str(name), SAMPLES)}; known: {known}")
    folder = importlib.resources.files("jaxenstein.maps") / "samples"
    return (folder / f"{name}.txt").read_text("ascii").rstrip()
