"""Text maps: one line per row, one character per tile; see `symbols` for the characters."""

from __future__ import annotations

import dataclasses
import importlib.resources
import warnings
from collections.abc import Collection
from importlib.resources.abc import Traversable

from ..errors import MapError, MapWarning, nearest, quoted
from .faces import make_page, read_faces, read_regions, split_lines
from .reach import problems, summarised
from .symbols import PEACEFUL, SYMBOLS, Symbol
from .tilemap import Door, Item, Key, TileMap

_WALL = SYMBOLS["#"]


def parse_ascii(
    text: str,
    name: str = "custom",
    *,
    goal_required: bool = True,
    regions: str | None = None,
    faces: str | None = None,
    known: Collection[str] = PEACEFUL,
    stacklevel: int = 2,
) -> TileMap:
    r"""Read a map from text.

    Ignored are: empty lines before and after the map, a byte order mark, the carriage returns of
    Windows line ends, and spaces after the last line end, where closing quotes are indented. Other
    spaces are floor, so indentation is not removed. Short lines are padded with the default wall.
    Everything outside the map is solid.

    Args:
        text: the map; `symbols.legend()` explains the characters.
        name: the name of the map.
        goal_required: whether a map without a goal is an error; False for a task without a goal.
        regions: a second text of the same shape. A wall symbol on a floor or door tile sets the
            look of all wall faces beside that tile; floor symbols do not change the walls. On a
            wall tile, only the wall's own symbol, `#` or floor are allowed. Doors keep their look.
        faces: instead of regions, a text that sets the look of single wall faces. It has a block
            of the map's shape below each of the lines `west`, `east`, `north` and `south`. A
            wall symbol in a block is the look of the face in that direction. Floor symbols, which
            doors need, and missing blocks do not change the faces.
        known: the allowed symbols; by default all except those of shooters.
        stacklevel: the stack level of warnings, as for `warnings.warn`.

    Raises:
        MapError: the map has an unknown symbol, is empty, has more than `MAX_SIZE` columns or
            rows, has no spawn, lacks a required goal, or its regions or faces do not fit. Line
            and column refer to the given text, counted from 1.

    Warns:
        MapWarning: the text is indented, no spawn reaches a goal, or a spawn reaches no goal,
            either with all doors open or for lack of a key.

    Examples:
        >>> tilemap = parse_ascii("#####\n#S G#\n#####")
        >>> tilemap.spawns, tilemap.goals
        (((1, 1),), ((3, 1),))
    """
    page = make_page(split_lines(text), 1, known=known)
    tilemap = _build(name, [[SYMBOLS[character] for character in line] for line in page.lines])
    if not tilemap.spawns:
        raise MapError("the map has no spawn: put an 'S' where an episode may start")
    if goal_required and not tilemap.goals:
        raise MapError(
            "the map has no goal: put a 'G' where the goal may lie; for a task without a goal call "
            "parse_ascii(text, goal_required=False)"
        )
    if regions is not None and faces is not None:
        raise MapError("give either regions or faces of a map, not both")
    if regions is not None:
        tilemap = dataclasses.replace(tilemap, faces=read_regions(tilemap, regions))
    if faces is not None:
        tilemap = dataclasses.replace(tilemap, faces=read_faces(tilemap, faces))
    blanks = min(len(line) - len(line.lstrip(" ")) for line in page.lines if line)
    if blanks > 1:
        warnings.warn(
            f"every line of the map starts with {blanks} spaces, which are "
            "floor: remove the indentation with textwrap.dedent",
            MapWarning,
            stacklevel=stacklevel,
        )
    for problem, (column, row) in summarised(problems(tilemap)):
        place = f"line {page.first_line + row}, column {column + 1}"
        warnings.warn(f"{place}: {problem}", MapWarning, stacklevel=stacklevel)
    return tilemap


def layout_names() -> tuple[str, ...]:
    """The names of the maps that come with the package."""
    files = (item.name for item in _layouts().iterdir())
    return tuple(sorted(f[:-4] for f in files if f.endswith(".txt") and f.count(".") == 1))


def load_layout(name: str, *, regions: bool = True, goal_required: bool = True) -> TileMap:
    """Load a map that comes with the package.

    Args:
        name: one of `layout_names()`.
        regions: whether to use the regions or faces of the layout, if it has any.
        goal_required: whether a map without a goal is an error.

    Raises:
        MapError: the layout does not exist.
    """
    names = layout_names()
    if name not in names:
        raise MapError(
            f"unknown layout {quoted(name)}{nearest(name, names)}; known: {', '.join(names)}"
        )
    looks = {}
    for kind in ("regions", "faces") if regions else ():
        file = _layouts() / f"{name}.{kind}.txt"
        looks[kind] = file.read_text("utf-8") if file.is_file() else None
    text = (_layouts() / f"{name}.txt").read_text("utf-8")
    return parse_ascii(text, name, goal_required=goal_required, **looks)


def _layouts() -> Traversable:
    return importlib.resources.files("jaxenstein.maps") / "layouts"


def _build(name: str, grid: list[list[Symbol]]) -> TileMap:
    """Build a tile map from the symbols on each tile."""
    columns = max(map(len, grid))
    grid = [line + [_WALL] * (columns - len(line)) for line in grid]
    placed = [(c, r, symbol) for r, line in enumerate(grid) for c, symbol in enumerate(line)]
    return TileMap(
        name=name,
        tiles=tuple(bytes(symbol.tile for symbol in line) for line in grid),
        spawns=tuple((c, r) for c, r, symbol in placed if symbol.spawn),
        goals=tuple((c, r) for c, r, symbol in placed if symbol.kind == "goal"),
        apples=tuple((c, r) for c, r, symbol in placed if symbol.kind == "apple"),
        keys=tuple(Key(c, r, symbol.colour) for c, r, symbol in placed if symbol.kind == "key"),
        doors=tuple(
            Door(c, r, symbol.colour, symbol.locked)
            for c, r, symbol in placed
            if symbol.kind == "door"
        ),
        items=tuple(Item(c, r, symbol.label) for c, r, symbol in placed if symbol.role),
    )
