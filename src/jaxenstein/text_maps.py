"""Environments from the user's own maps, as text or in files."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import MapError, quoted
from .registry import check_names, fields_of

if TYPE_CHECKING:
    from .tasks.goals import NavigationParams
    from .tasks.navigation import Navigation


def from_ascii(text: str, **settings: Any) -> tuple[Navigation, NavigationParams]:
    r"""Build a navigation environment from a map in ASCII characters.

    Args:
        text: the map, one line a row of tiles; `jaxenstein list --symbols` prints the symbols.
            It needs at least one spawn `S` and one goal `G`, since the task is to reach a goal.
            For your own task without a goal use
            `jaxenstein.maps.parse_ascii(text, goal_required=False)`.
        **settings: those of `make`, and `name`; `heading`, degrees of the first heading: None
            for any, a number, or (lowest, highest); `regions`, a second text of the same shape
            that gives floor cells the symbol of the walls around them, or `faces`, one that says
            what each face of a wall shows; `floor` and `ceiling`, RGB colours.

    Returns:
        The environment and its default params (1000 steps in an episode, discount 0.99).

    Raises:
        MapError: with the line and column of what is wrong with the map.
        SettingError: there is no such setting, or its value is out of range.

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
            hint = f"; if {quoted(str(text))} is the name of a file: from_file reads one"
            raise MapError(f"{error}{hint}") from error
        raise


def from_file(path: str | Path, **settings: Any) -> tuple[Navigation, NavigationParams]:
    """Build a navigation environment from the file of a map in ASCII characters.

    Args:
        path: the map. Of `maze.txt`, `maze.regions.txt` or `maze.faces.txt` beside it says how
            the walls look.
        **settings: those of `from_ascii`; the `name` is by default that of the file.

    Returns:
        As `from_ascii`.

    Raises:
        MapError: a file cannot be read, or is no map.
        SettingError: there is no such setting, or its value is out of range.
    """
    from .maps.map_files import read_map

    if not isinstance(path, str | Path):
        raise MapError(f"a file's name is a str or a Path, not {type(path).__name__}")
    path = Path(path)
    texts = read_map(path)
    return _from_texts(texts.pop("text"), {"name": path.stem, **texts, **settings})


def _from_texts(text: str, settings: dict[str, Any]) -> tuple[Navigation, NavigationParams]:
    """As `from_ascii`; warnings name the line of the caller's caller."""
    from .maps.ascii import parse_ascii
    from .tasks.first_person import SETTINGS
    from .tasks.goals import NavigationParams
    from .tasks.navigation import Navigation

    known = (*SETTINGS, "name", "heading", "regions", "faces", "floor", "ceiling")
    check_names(settings, known, lambda: fields_of(NavigationParams))
    name = settings.get("name", "custom")
    painted = {kind: settings.pop(kind, None) for kind in ("regions", "faces")}
    tilemap = parse_ascii(text, name, **painted, stacklevel=4)
    env = Navigation(tilemap=tilemap, **settings)
    return env, env.check_params()
