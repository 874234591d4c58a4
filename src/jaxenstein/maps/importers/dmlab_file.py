"""Read the `.map` file of a DeepMind Lab maze; `dmlab` explains its geometry."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from ...errors import MapError
from ..tilemap import MAX_SIZE, Cell
from .quake import LARGEST, Brush, Entity, Patch, read_entities

Side = Literal["west", "east", "north", "south"]
CellSide = tuple[int, int, Side]
"""(column, row, side) of a cell, with rows counted from the south."""

CELL = 100.0
"""The width of a cell in the units of the file."""
MAX_CELLS = (MAX_SIZE - 1) // 2
"""The most cells in each direction that a tile map can hold."""

# In units: the limit for thin, the largest gap between picture and wall, a tolerance for equality.
_THIN, _CLOSE = 10.0, 0.5
# The sides of a cell at its low and its high end, along x and along y.
_ENDS: tuple[tuple[Side, Side], ...] = (("west", "east"), ("south", "north"))
# The lowest and highest coordinate along an axis, each with the texture of the plane there.
_Span = tuple[tuple[float, str], tuple[float, str]]


@dataclass(frozen=True)
class LabMaze:
    """The content of the `.map` file of a maze. Cells are (column, row), row 0 in the south.

    Attributes:
        name: the name of the maze.
        columns: number of cells from west to east.
        rows: number of cells from south to north.
        floors: texture of the floor of each cell; a cell without floor is solid.
        panels: texture of the wall panel at each side of a cell that has one.
        decals: texture of the picture at each side of a cell that has one.
        spawns: cells where an episode may start.
        goals: cells of the goals.
        apples: cells of the apples.
    """

    name: str
    columns: int
    rows: int
    floors: tuple[tuple[Cell, str], ...]
    panels: tuple[tuple[CellSide, str], ...]
    decals: tuple[tuple[CellSide, str], ...]
    spawns: tuple[Cell, ...]
    goals: tuple[Cell, ...]
    apples: tuple[Cell, ...]

    def tile_of(self, cell: Cell) -> Cell:
        """(column, row) of the tile of a cell."""
        return 2 * cell[0] + 1, 2 * (self.rows - 1 - cell[1]) + 1


def read_maze(text: str, name: str = "maze", source: str = "") -> LabMaze:
    """Read the `.map` file of a maze.

    Entities other than starts, goals and apples, such as lights, are ignored.

    Args:
        text: the content of the file.
        name: the name of the maze.
        source: the name of the file, for errors.

    Raises:
        MapError: the file is damaged, has no floor or no start, is too large, or is not a maze of
            cells and panels. The message names the line.

    Warns:
        MapWarning: an entity starts without its brace; the message names the line.
    """
    if not isinstance(text, str):
        raise MapError(f"a .map file must be text (str), not {type(text).__name__}", source=source)
    entities = read_entities(text, source)
    if not entities:
        raise MapError("the file is empty", source=source)
    reader = _MazeReader(source)
    for entity in entities:
        reader.add(entity)
    return reader.maze(name)


class _MazeReader:
    """Collects the content of the entities. Every value comes with its line."""

    def __init__(self, source: str) -> None:
        self._source = source
        self._floors: dict[Cell, tuple[str, int]] = {}
        self._panels: dict[CellSide, tuple[str, int]] = {}
        self._decals: dict[CellSide, tuple[str, int]] = {}
        self._things: dict[str, dict[Cell, int]] = {
            "info_player_start": {},
            "goal": {},
            "apple_reward": {},
        }

    def add(self, entity: Entity) -> None:
        """Add one entity."""
        if entity.classname == "worldspawn":
            for brush in entity.brushes:
                self._add_brush(brush)
            for patch in entity.patches:
                self._add_decal(patch)
        elif entity.classname in self._things:
            cells, cell = self._things[entity.classname], self._cell_of(entity)
            if cell in cells and entity.classname != "info_player_start":
                raise self._error(f"a second {entity.classname} in one cell", entity.line)
            cells.setdefault(cell, entity.line)

    def maze(self, name: str) -> LabMaze:
        """Check that the parts fit together, and move the south-western cell to (0, 0)."""
        if not self._floors:
            raise self._error("the maze has no floor")
        starts, goals, apples = self._things.values()
        if not starts:
            raise self._error("the maze has no start, an entity of the class info_player_start")
        self._check_places()
        column, row = (min(cell[axis] for cell in self._floors) for axis in (0, 1))
        columns, rows = (
            max(cell[axis] for cell in self._floors) - low + 1
            for axis, low in enumerate((column, row))
        )
        if max(columns, rows) > MAX_CELLS:
            size = f"a maze of {columns} by {rows} cells is too large"
            raise self._error(f"{size}: the limit is {MAX_CELLS} of each")

        def cells(things: Iterable[Cell]) -> tuple[Cell, ...]:
            return tuple((c - column, r - row) for c, r in things)

        def sides(table: dict[CellSide, tuple[str, int]]) -> tuple[tuple[CellSide, str], ...]:
            return tuple(((c - column, r - row, s), name) for (c, r, s), (name, _) in table.items())

        floors = [texture for texture, _ in self._floors.values()]
        return LabMaze(
            name=name,
            columns=columns,
            rows=rows,
            floors=tuple(zip(cells(self._floors), floors, strict=True)),
            panels=sides(self._panels),
            decals=sides(self._decals),
            spawns=cells(starts),
            goals=cells(goals),
            apples=cells(apples),
        )

    def _check_places(self) -> None:
        """Check that everything is on floor, and that decals are on panels."""
        for (column, row, _), (texture, line) in self._panels.items():
            if (column, row) not in self._floors:
                raise self._error(f"the panel {texture} is in a cell without floor", line)
        for side, (texture, line) in self._decals.items():
            if side not in self._panels:
                raise self._error(f"the decal {texture} is not on a wall panel", line)
        for kind, cells in self._things.items():
            for cell, line in cells.items():
                if cell not in self._floors:
                    raise self._error(f"the {kind} is in a cell without floor", line)
        starts, goals, apples = self._things.values()
        for cell, line in goals.items():
            if cell in starts or cell in apples:
                raise self._error("the goal shares its cell with a start or an apple", line)

    def _add_brush(self, brush: Brush) -> None:
        """Add a floor, ceiling or wall panel, with its cell."""
        spans = self._spans(brush)
        lengths = [high - low for (low, _), (high, _) in spans]
        wide = [abs(length - CELL) < _CLOSE for length in lengths]
        thin = [length < _THIN for length in lengths]
        low, high, top = spans[2][0][0], *spans[2][1]
        if wide[0] and wide[1] and thin[2]:
            cell = self._place(spans[0], brush), self._place(spans[1], brush)
            if low + high < CELL:
                self._floors.setdefault(cell, (top, brush.line))
        elif thin[0] != thin[1] and wide[thin.index(False)] and wide[2] and abs(low) < _THIN:
            self._add_panel(spans, 0 if thin[0] else 1, brush)
        else:
            size = " by ".join(f"{length:g}" for length in lengths)
            message = f"a brush of {size} units is not the floor, ceiling or a wall of a cell"
            raise self._error(f"{message}, which is {CELL:g} units wide", brush.line)

    def _add_panel(self, spans: list[_Span], across: int, brush: Brush) -> None:
        """Add a wall panel that is thin along axis `across`."""
        (low, low_texture), (high, high_texture) = spans[across]
        if _is_line(low):
            end, cell, texture = 0, round(low / CELL), high_texture
        elif _is_line(high):
            end, cell, texture = 1, round(high / CELL) - 1, low_texture
        else:
            raise self._off_lattice(low, high, brush)
        place = self._place(spans[1 - across], brush)
        column, row = (cell, place) if across == 0 else (place, cell)
        self._panels.setdefault((column, row, _ENDS[across][end]), (texture, brush.line))

    def _spans(self, brush: Brush) -> list[_Span]:
        """The extent of a brush along x, y and z."""
        ends: list[dict[float, str]] = [{}, {}, {}]
        for plane in brush.planes:
            level = [axis for axis in range(3) if len({point[axis] for point in plane.points}) == 1]
            if len(level) == 1:
                ends[level[0]][plane.points[0][level[0]]] = plane.texture
        if len(brush.planes) != 6 or any(len(end) != 2 for end in ends):
            raise self._error("a brush is not a box along the axes", brush.line)
        spans = [sorted(end.items()) for end in ends]
        return [(span[0], span[1]) for span in spans]

    def _place(self, span: _Span, brush: Brush) -> int:
        """The number of the cell with the extent of a span."""
        (low, _), (high, _) = span
        if not _is_line(low):
            raise self._off_lattice(low, high, brush)
        return round(low / CELL)

    def _add_decal(self, patch: Patch) -> None:
        """Add a picture at the side of a cell."""
        low, high = ([f(axis) for axis in zip(*patch.points, strict=True)] for f in (min, max))
        flat = [b - a < _CLOSE for a, b in zip(low, high, strict=True)]
        if flat[0] == flat[1] or flat[2]:
            message = f"the patch {patch.texture} is not a flat, upright picture along x or y"
            raise self._error(message, patch.line)
        across = 0 if flat[0] else 1
        column, row = (math.floor((low[axis] + high[axis]) / 2 / CELL) for axis in (0, 1))
        away = low[across] - CELL * (column, row)[across]
        end = 0 if away < CELL / 2 else 1
        if min(away, CELL - away) >= _THIN:
            raise self._error(f"the decal {patch.texture} is not at a side of a cell", patch.line)
        side = column, row, _ENDS[across][end]
        if side in self._decals:
            raise self._error(f"the decal {patch.texture} hides another decal", patch.line)
        self._decals[side] = patch.texture, patch.line

    def _cell_of(self, entity: Entity) -> Cell:
        """The cell that contains the origin of an entity."""
        words = entity.properties.get("origin", "").split()
        try:
            point = [float(word) for word in words]
        except ValueError:
            point = []
        if len(point) != 3 or not all(abs(value) <= LARGEST for value in point):
            message = f"the {entity.classname} has no origin with three coordinates"
            raise self._error(message, entity.line)
        return math.floor(point[0] / CELL), math.floor(point[1] / CELL)

    def _off_lattice(self, low: float, high: float, brush: Brush) -> MapError:
        message = f"a brush from {low:g} to {high:g} does not line up with cells of {CELL:g} units"
        return self._error(message, brush.line)

    def _error(self, message: str, line: int | None = None) -> MapError:
        return MapError(message, line=line, source=self._source)


def _is_line(coordinate: float) -> bool:
    """Whether a coordinate is the edge of a cell."""
    return abs(coordinate - CELL * round(coordinate / CELL)) < _CLOSE
