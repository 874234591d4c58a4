"""A tile map from above, with doors, keys, goals and the path of an agent.

Everything is drawn at twice the size and then averaged down, which smooths the edges.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Self

import numpy as np
from PIL import Image, ImageDraw

from ..maps.symbols import LABEL_COLOURS, door_label, key_label
from ..maps.tilemap import Door, TileMap
from . import glyphs
from .glyphs import Colour, blend

ROCK: Colour = (44, 47, 54)
FLOOR: Colour = (233, 229, 219)
GOAL: Colour = (255, 196, 0)
SPAWN: Colour = (176, 170, 156)
AGENT: Colour = (214, 40, 60)
VIEW = (255, 150, 40, 90)
# The path runs from the first colour to the second.
PATH: tuple[Colour, Colour] = ((120, 170, 235), (150, 20, 110))

OVERSAMPLING = 2
# A step longer than this is a new start, not a movement.
JUMP = 1.5
# How far the field of view is drawn, in tiles, and in how many rays and steps it is found.
VIEW_RANGE, VIEW_RAYS, VIEW_STEP = 6.0, 48, 0.04
_EMPTY = np.zeros(0, bool)


def fitting_scale(tilemap: TileMap, size: int) -> int:
    """Pixels a tile, at least 1, for a picture whose longer side is close to `size` pixels."""
    return max(1, size // max(tilemap.rows, tilemap.columns))


class MapPicture:
    """A picture of a map under construction: draw on it, then take `image()`.

    Places are in tiles: x along a row, y down the rows; pixel (x * scale, y * scale) shows them.
    """

    def __init__(self, tilemap: TileMap, canvas: Image.Image, scale: int) -> None:
        """Wrap a canvas; use `draw_map` to get one with the walls on it.

        Args:
            tilemap: what the canvas shows.
            canvas: RGB picture at `OVERSAMPLING` times the final size.
            scale: pixels a tile of the final picture.
        """
        self.tilemap = tilemap
        self.scale = scale
        self._canvas = canvas
        self._draw = ImageDraw.Draw(canvas, "RGBA")
        self._tile = scale * OVERSAMPLING

    def copy(self) -> MapPicture:
        """A picture that can be drawn on without changing this one."""
        return MapPicture(self.tilemap, self._canvas.copy(), self.scale)

    def image(self) -> Image.Image:
        """The finished RGB picture, `scale` pixels a tile."""
        return self._canvas.reduce(OVERSAMPLING)

    def spawns(self) -> Self:
        """Draw the start places as small rings."""
        radius = max(0.16 * self._tile, 1.5)
        for column, row in self.tilemap.spawns:
            self._ring(column + 0.5, row + 0.5, radius, SPAWN, max(1, round(0.05 * self._tile)))
        return self

    def objects(
        self,
        opened: np.ndarray = _EMPTY,
        taken: np.ndarray = _EMPTY,
        goal: int | None = None,
    ) -> Self:
        """Draw the doors, the keys that still lie there, and the goals.

        Args:
            opened: bool[D], which doors are open; closed where the array is too short.
            taken: bool[K], which keys are gone.
            goal: index of the goal that counts; the others become small rings. None shows all
                alike.
        """
        for i, door in enumerate(self.tilemap.doors):
            self._door(door, is_open=i < len(opened) and bool(opened[i]))
        for i, key in enumerate(self.tilemap.keys):
            if not (i < len(taken) and taken[i]):
                place = self._pixel(key.column + 0.5, key.row + 0.5)
                glyphs.key(self._draw, place, self._tile, _paint(key_label(key.colour)))
        for i, (column, row) in enumerate(self.tilemap.goals):
            if goal in (None, i):
                size = max(0.46 * self._tile, 7.0 * OVERSAMPLING)
                glyphs.star(self._draw, self._pixel(column + 0.5, row + 0.5), size, GOAL)
            else:
                width = max(1, round(0.07 * self._tile))
                self._ring(column + 0.5, row + 0.5, 0.18 * self._tile, GOAL, width)
        return self

    def path(self, positions: np.ndarray, start: int = 0, total: int | None = None) -> Self:
        """Draw steps of a path, coloured by time.

        Args:
            positions: float[n, 2], (x, y) in tiles, one more than the number of steps drawn.
            start: number of the first of them in the whole path.
            total: steps of the whole path, so that pieces drawn one by one get the right colours.
        """
        total = max(total or start + len(positions) - 1, 1)
        width = max(2, round(0.13 * self._tile), round(1.6 * OVERSAMPLING))
        for i, (here, there) in enumerate(itertools.pairwise(positions), start):
            if math.dist(here, there) > JUMP:
                continue
            line = [self._pixel(*here), self._pixel(*there)]
            colour = blend(*PATH, i / total)
            self._draw.line(line, colour, width)
            for x, y in line:
                radius = width / 2 - 0.5
                self._draw.ellipse((x - radius, y - radius, x + radius, y + radius), colour)
        return self

    def agent(
        self,
        position: Sequence[float] | np.ndarray,
        heading: float,
        field_of_view: float = 60.0,
        opened: np.ndarray = _EMPTY,
    ) -> Self:
        """Draw the agent as an arrow head, and what lies open to its view up to a few tiles.

        Args:
            position: (x, y) in tiles.
            heading: radians, 0 along +x, growing clockwise on the map.
            field_of_view: horizontal angle in degrees.
            opened: bool[D], which doors are open.
        """
        x, y = float(position[0]), float(position[1])
        heading = float(heading)
        rim = self._visible(x, y, heading, math.radians(field_of_view), opened)
        self._draw.polygon([self._pixel(x, y), *(self._pixel(*point) for point in rim)], VIEW)
        size = max(0.42 * self._tile, 5.5 * OVERSAMPLING)
        glyphs.arrow(self._draw, self._pixel(x, y), size, heading, AGENT)
        return self

    def _visible(
        self, x: float, y: float, heading: float, angle: float, opened: np.ndarray
    ) -> list[tuple[float, float]]:
        """End points of rays over the field of view, stopped by walls and closed doors."""
        open_floor = self._passable(opened)
        angles = heading + np.linspace(-angle / 2, angle / 2, VIEW_RAYS)
        reach = np.arange(0, VIEW_RANGE + VIEW_STEP, VIEW_STEP)
        xs = x + np.cos(angles)[:, None] * reach
        ys = y + np.sin(angles)[:, None] * reach
        columns, rows = np.floor(xs).astype(int), np.floor(ys).astype(int)
        inside = (columns >= 0) & (columns < self.tilemap.columns)
        inside &= (rows >= 0) & (rows < self.tilemap.rows)
        free = (
            inside
            & open_floor[
                rows.clip(0, self.tilemap.rows - 1), columns.clip(0, self.tilemap.columns - 1)
            ]
        )
        blocked = ~free
        blocked[:, -1] = True
        last = blocked.argmax(axis=1)
        pick = np.arange(VIEW_RAYS)
        return [(float(a), float(b)) for a, b in zip(xs[pick, last], ys[pick, last], strict=True)]

    def _passable(self, opened: np.ndarray) -> np.ndarray:
        free = _floor(self.tilemap)
        for i, door in enumerate(self.tilemap.doors):
            free[door.row, door.column] = i < len(opened) and bool(opened[i])
        return free

    def _door(self, door: Door, *, is_open: bool) -> None:
        colour = _paint(door_label(door.colour, locked=door.locked))
        column, row = door.column, door.row
        self._box(column, row, column + 1, row + 1, FLOOR)
        if is_open:
            # The two posts that stay visible stand where the walls are.
            for box in self._posts(column, row):
                self._box(*box, colour)
            return
        glyphs.closed_door(self._draw, self._pixel(column, row), self._tile, colour, door.locked)

    def _posts(self, column: int, row: int) -> list[tuple[float, float, float, float]]:
        free = np.pad(_floor(self.tilemap), 1)
        beside = free[row + 1, column] or free[row + 1, column + 2]
        thick = 0.16
        if beside:
            return [
                (column, row, column + 1, row + thick),
                (column, row + 1 - thick, column + 1, row + 1),
            ]
        return [
            (column, row, column + thick, row + 1),
            (column + 1 - thick, row, column + 1, row + 1),
        ]

    def _pixel(self, x: float, y: float) -> tuple[float, float]:
        return float(x) * self._tile, float(y) * self._tile

    def _box(self, left: float, top: float, right: float, bottom: float, colour: Colour) -> None:
        """Fill a rectangle given in tiles, exactly, down to a pixel of the large canvas."""
        a, b = round(left * self._tile), round(top * self._tile)
        c, d = round(right * self._tile) - 1, round(bottom * self._tile) - 1
        self._draw.rectangle((a, b, max(a, c), max(b, d)), colour)

    def _ring(self, x: float, y: float, radius: float, colour: Colour, width: int) -> None:
        x, y = self._pixel(x, y)
        self._draw.ellipse((x - radius, y - radius, x + radius, y + radius), None, colour, width)


def draw_map(tilemap: TileMap, *, scale: int | None = None, size: int = 480) -> MapPicture:
    """The walls and start places of a map; add objects, path and agent to the result.

    Walls that border on open floor have their colour, and where a map gives every face of a
    wall its own, a strip along each face; the rest is dark rock.

    Args:
        tilemap: the map, from 1x1 to a few hundred tiles.
        scale: pixels a tile; None chooses it by `size`.
        size: length in pixels that the longer side of the picture should come close to without
            exceeding it, unless there are more tiles than that.
    """
    scale = fitting_scale(tilemap, size) if scale is None else scale
    ground = Image.fromarray(_tile_colours(tilemap))
    tile = scale * OVERSAMPLING
    canvas = ground.resize((tilemap.columns * tile, tilemap.rows * tile), Image.Resampling.NEAREST)
    if tilemap.faces is not None:
        _draw_faces(canvas, tilemap, tile)
    return MapPicture(tilemap, canvas, scale).spawns()


def _draw_faces(canvas: Image.Image, tilemap: TileMap, tile: int) -> None:
    """A strip of each wall's own colour along every face that open floor touches."""
    draw = ImageDraw.Draw(canvas)
    faces = np.asarray(tilemap.walls)
    free = np.pad(_floor(tilemap) | _doors(tilemap), 1)
    thick = max(1, round(0.34 * tile))
    # Neighbour (dx, dy) of each face, in the order west, east, north, south.
    for face, (dx, dy) in enumerate(((-1, 0), (1, 0), (0, -1), (0, 1))):
        beside = free[1 + dy : 1 + dy + tilemap.rows, 1 + dx : 1 + dx + tilemap.columns]
        for row, column in np.argwhere(beside & ~free[1:-1, 1:-1]):
            left, top = column * tile, row * tile
            right, bottom = left + tile - 1, top + tile - 1
            if dx:
                left, right = (left, left + thick - 1) if dx < 0 else (right - thick + 1, right)
            else:
                top, bottom = (top, top + thick - 1) if dy < 0 else (bottom - thick + 1, bottom)
            box = (int(left), int(top), int(right), int(bottom))
            draw.rectangle(box, _paint(int(faces[face, row, column])))


def _tile_colours(tilemap: TileMap) -> np.ndarray:
    """uint8[rows, columns, 3], one colour a tile."""
    labels = _labels(tilemap)
    free = _floor(tilemap) | _doors(tilemap)
    colours = np.asarray(LABEL_COLOURS, np.uint8)[labels]
    colours[~_beside(free)] = ROCK
    if tilemap.faces is not None:
        colours[~free] = ROCK
    colours[free] = FLOOR
    return colours


def _labels(tilemap: TileMap) -> np.ndarray:
    return np.stack([np.frombuffer(row, np.uint8) for row in tilemap.tiles])


def _floor(tilemap: TileMap) -> np.ndarray:
    """bool[rows, columns]: open floor, doors not included."""
    return (_labels(tilemap) == 0) & ~_doors(tilemap)


def _doors(tilemap: TileMap) -> np.ndarray:
    here = np.zeros((tilemap.rows, tilemap.columns), bool)
    for door in tilemap.doors:
        here[door.row, door.column] = True
    return here


def _beside(free: np.ndarray) -> np.ndarray:
    """bool: tiles that are free or touch a free one, corners included."""
    padded = np.pad(free, 1)
    rows, columns = free.shape
    near = np.zeros_like(free)
    for dy in range(3):
        for dx in range(3):
            near |= padded[dy : dy + rows, dx : dx + columns]
    return near


def _paint(label: int) -> Colour:
    red, green, blue = (int(part) for part in LABEL_COLOURS[label])
    return red, green, blue
