"""Environments from your own maps, as text or in files."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import MapError, MapWarning, quoted
from .fields import names_of
from .registry import check_settings

if TYPE_CHECKING:
    from .tasks.goals import NavigationParams
    from .tasks.navigation import Navigation


def from_ascii(text: str, **settings: Any) -> tuple[Navigation, NavigationParams]:
    r"""Build a navigation environment from an ASCII map.

    Args:
        text: the map, one line per row of tiles; `jaxenstein list --symbols` prints the symbols.
            It needs at least one spawn `S` and one goal `G`, because the task is to reach a goal.
            For your own task without a goal, use
            `jaxenstein.maps.parse_ascii(text, goal_required=False)`.
        **settings: the settings of `make`, and: `name`; `heading`, the first heading in degrees:
            None for any, a number, or (lowest, highest); `regions`, a second text of the same
            shape that gives floor cells the symbol of the walls around them, or `faces`, a text
            that sets the look of each wall face; `floor`, the two RGB colours of its squares, and
            `ceiling`, one.

    Returns:
        The environment and its default params (1000 steps per episode, discount 0.99).

    Raises:
        MapError: the map is invalid; the message names line and column.
        SettingError: a setting does not exist, or its value is out of range.

    Examples:
        >>> import jax
        >>> env, params = from_ascii("#####\n#S G#\n#####", heading=0)
        >>> obs, state = env.reset(jax.random.key(0), params)
        >>> state.position.tolist(), obs.shape
        ([1.5, 1.5], (64, 64, 3))
        >>> from_ascii("#####\n#S ?#\n#####")
        Traceback (most recent call last):
        jaxenstein.errors.MapError: line 2, column 4: unknown symbol '?'; the symbols are ...
    """
    try:
        return _from_texts(text, settings)
    except MapError as error:
        if isinstance(text, Path) or (isinstance(text, str) and re.fullmatch(r"[^#]+\.\w+", text)):
            hint = f"; if {quoted(str(text))} is a file name, use from_file to read it"
            raise MapError(f"{error}{hint}") from error
        raise


def from_file(path: str | Path, **settings: Any) -> tuple[Navigation, NavigationParams]:
    """Build a navigation environment from a file with an ASCII map.

    Args:
        path: the map. Beside `maze.txt`, the file `maze.regions.txt` or `maze.faces.txt` sets
            the look of the walls.
        **settings: the settings of `from_ascii`; `name` defaults to the file name.

    Returns:
        As `from_ascii`.

    Raises:
        MapError: a file cannot be read, or is not a valid map.
        SettingError: a setting does not exist, or its value is out of range.
    """
    from .maps.map_files import read_map

    if not isinstance(path, str | Path):
        raise MapError(f"a file name must be a str or a Path, not {type(path).__name__}")
    texts = read_map(Path(path))
    return _from_texts(texts.pop("text"), {**texts, **settings})


def _from_texts(text: str, settings: dict[str, Any]) -> tuple[Navigation, NavigationParams]:
    """As `from_ascii`; warnings point at the caller's caller."""
    from .maps.ascii import parse_ascii
    from .tasks.first_person import SETTINGS
    from .tasks.goals import NavigationParams
    from .tasks.navigation import Navigation

    known = (*SETTINGS, "name", "heading", "regions", "faces", "floor", "ceiling")
    check_settings(settings, known, lambda: names_of(NavigationParams))
    name = settings.get("name", "custom")
    painted = {kind: settings.pop(kind, None) for kind in ("regions", "faces")}
    tilemap = parse_ascii(text, name, **painted, stacklevel=4)
    if tilemap.apples:
        warnings.warn(
            f"{name}: apples are left out; jaxenstein.tasks.maze.Maze(tilemap="
            "jaxenstein.maps.parse_ascii(text)) is a task with apples",
            MapWarning,
            stacklevel=3,
        )
    env = Navigation(tilemap=tilemap, **settings)
    return env, env.check_params()
