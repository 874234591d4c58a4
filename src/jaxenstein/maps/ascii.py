"""Text maps: one line a row, one character a tile; `symbols` says what each means."""

from __future__ import annotations

import dataclasses
import importlib.resources
import warnings
from collections.abc import Collection
from importlib.resources.abc import Traversable

from ..errors import MapError, MapWarning, nearest, quoted
from .faces import make_page, read_faces, read_regions, split_lines
from .reach import problems
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

    Empty lines before and after the map are dropped, as are a byte order mark, the returns of
    Windows line ends, and blanks after the last line end, where closing quotes are indented.
    Other blanks are floor, so indentation is not taken off. Short lines are filled up with
    default wall. Everything outside the map is solid.

    Args:
        text: the map; `symbols.legend()` explains the characters.
        name: what to call it.
        goal_required: whether a map without a goal is an error; False for a task without a goal.
        regions: a second text of the same shape. The wall symbol on a floor or door tile says
            what every wall face beside that tile shows; floor symbols leave the walls as they
            are. On a wall it may only repeat the wall's symbol, `#` or floor. Doors keep their
            own look.
        faces: in place of regions, a text that says of every wall what its faces show. Below
            each of the lines `west`, `east`, `north` and `south` stands a block of the map's
            shape, whose wall symbols are what the faces that look there show. Where it shows
            floor, on doors too, the tile stays what it is; so do the faces without a block.
        known: the symbols that it may hold; by default all but those of shooters.
        stacklevel: whose line a warning names, as for `warnings.warn`.

    Raises:
        MapError: for an unknown symbol, an empty map, one of more than `MAX_SIZE` columns or
            rows, one without a spawn or without a goal where one is needed, and regions or
            faces that do not fit. Line and column are those of the text as given, counted from 1.

    Warns:
        MapWarning: for a text that is indented; for each goal that no spawn reaches and each
            spawn that reaches no goal, either with all doors open or for want of a key.

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
        raise MapError("give regions or faces of a map, not both")
    if regions is not None:
        tilemap = dataclasses.replace(tilemap, faces=read_regions(tilemap, regions))
    if faces is not None:
        tilemap = dataclasses.replace(tilemap, faces=read_faces(tilemap, faces))
    blanks = min(len(line) - len(line.lstrip(" ")) for line in page.lines if line)
    if blanks > 1:
        warnings.warn(
            f"every line of the map begins with {blanks} blanks, which are "
            "floor: textwrap.dedent takes an indentation off",
            MapWarning,
            stacklevel=stacklevel,
        )
    for problem, (column, row) in problems(tilemap):
        place = f"line {page.first_line + row}, column {column + 1}"
        warnings.warn(f"{place}: {problem}", MapWarning, stacklevel=stacklevel)
    return tilemap


def layout_names() -> tuple[str, ...]:
    """Names of the maps that come with the package."""
    files = (item.name for item in _layouts().iterdir())
    return tuple(sorted(f[:-4] for f in files if f.endswith(".txt") and f.count(".") == 1))


def load_layout(name: str, *, regions: bool = True, goal_required: bool = True) -> TileMap:
    """One of the maps that come with the package.

    Args:
        name: one of `layout_names()`.
        regions: whether walls look as the layout's regions or faces say, if it has any.
        goal_required: whether a map without a goal is an error.

    Raises:
        MapError: if there is no such layout.
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
    """Collect what the symbols put on each tile."""
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
