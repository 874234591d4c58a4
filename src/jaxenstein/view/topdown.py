"""A top-down picture of a tile map, with doors, goals and other things, and the path of an agent.

Everything is drawn at twice the size and then averaged down, which smooths the edges.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Self

import numpy as np
from PIL import Image, ImageDraw

from ..maps.symbols import door_label
from ..maps.things import APPLE, GOAL, KEY
from ..maps.tilemap import Door, TileMap
from . import glyphs
from .glyphs import Colour, blend
from .ground import draw_ground, open_floor, paint

SPAWN: Colour = (176, 170, 156)
AGENT: Colour = (214, 40, 60)
VIEW = (255, 150, 40, 90)
# The path runs from the first colour to the second.
PATH: tuple[Colour, Colour] = ((120, 170, 235), (150, 20, 110))

OVERSAMPLING = 2
# Moves of more tiles are new starts, unless an agent can move farther in a step.
JUMP = 1.5
# How far the field of view is drawn, in tiles, and with how many rays and steps.
VIEW_RANGE, VIEW_RAYS, VIEW_STEP = 6.0, 48, 0.04
# More spawns or goals than this are not marked: nearly every tile would be.
MOST_MARKS = 24


class MapPicture:
    """A map picture under construction: draw on it, then call `image()`.

    Places are in tiles: x along a row, y down the rows; pixel (x * scale, y * scale) shows them.
    """

    def __init__(self, tilemap: TileMap, canvas: Image.Image, scale: int) -> None:
        """Wrap a canvas; `draw_map` returns one with the walls on it.

        Args:
            tilemap: the map on the canvas.
            canvas: RGB picture at `OVERSAMPLING` times the final size.
            scale: pixels per tile of the final picture.
        """
        self.tilemap = tilemap
        self.scale = scale
        self._canvas = canvas
        self._draw = ImageDraw.Draw(canvas, "RGBA")
        self._tile = scale * OVERSAMPLING

    def copy(self) -> MapPicture:
        """A copy that can be drawn on without changing this picture."""
        return MapPicture(self.tilemap, self._canvas.copy(), self.scale)

    def image(self) -> Image.Image:
        """The finished RGB picture, `scale` pixels per tile."""
        return self._canvas.reduce(OVERSAMPLING)

    def marks(self) -> Self:
        """Draw spawns and goals as small rings, if there are few."""
        width = max(1, round(0.05 * self._tile))
        for cells, colour in ((self.tilemap.spawns, SPAWN), (self.tilemap.goals, glyphs.GOLD)):
            if len(cells) <= MOST_MARKS:
                for column, row in cells:
                    radius = max(0.16 * self._tile, 1.5)
                    self._ring(column + 0.5, row + 0.5, radius, colour, width)
        return self

    def things(self) -> Self:
        """Draw the things of the map, with all doors closed."""
        tilemap = self.tilemap
        listed = [((key.column, key.row), KEY.labels[key.colour]) for key in tilemap.keys]
        listed += [(cell, APPLE.label) for cell in tilemap.apples]
        listed += [(cell, GOAL.label) for cell in tilemap.goals]
        listed += [((item.column, item.row), item.label) for item in tilemap.items]
        positions = np.array([cell for cell, _ in listed], np.float64).reshape(-1, 2) + 0.5
        return self.doors().sprites(positions, np.array([label for _, label in listed], int))

    def doors(self, closed: np.ndarray | None = None) -> Self:
        """Draw the doors; of an open door only the posts, so that a path through it is visible.

        Args:
            closed: bool[D], which doors of the map are closed; None for all.
        """
        for door, shut in zip(self.tilemap.doors, self._shut(closed), strict=True):
            self._door(door, is_open=not shut)
        return self

    def sprites(
        self, positions: np.ndarray, labels: np.ndarray, visible: np.ndarray | None = None
    ) -> Self:
        """Draw things by their labels; other labels become discs.

        Args:
            positions: float[N, 2], (x, y) in tiles.
            labels: int[N], label ids of `jaxenstein.maps.symbols`.
            visible: bool[N], which things are present; None for all.
        """
        there = np.ones(len(labels), bool) if visible is None else np.asarray(visible)
        # Goals go on top of everything.
        order = sorted(np.flatnonzero(there), key=lambda i: labels[i] == GOAL.label)
        for i in order:
            label = int(labels[i])
            glyphs.thing(self._draw, self._pixel(*positions[i]), self._tile, label, paint(label))
        return self

    def path(
        self,
        positions: np.ndarray,
        start: int = 0,
        total: int | None = None,
        longest_step: float = JUMP,
    ) -> Self:
        """Draw steps of a path, coloured by time.

        Args:
            positions: float[n, 2], (x, y) in tiles, one more than the number of steps drawn.
            start: index of the first of them in the whole path.
            total: steps of the whole path, so that pieces drawn one by one get the right colours.
            longest_step: in tiles; longer moves are new starts and are not drawn.
        """
        total = max(total or start + len(positions) - 1, 1)
        width = max(2, round(0.13 * self._tile), round(1.6 * OVERSAMPLING))
        for i, (here, there) in enumerate(itertools.pairwise(positions), start):
            if math.dist(here, there) > longest_step:
                continue
            line = [self._pixel(*here), self._pixel(*there)]
            colour = blend(*PATH, i / total)
            self._draw.line(line, colour, width)
            for x, y in line:
                radius = width / 2 - 0.5
                self._draw.ellipse((x - radius, y - radius, x + radius, y + radius), colour)
        return self

    def sight(
        self,
        position: Sequence[float] | np.ndarray,
        heading: float,
        field_of_view: float = 60.0,
        closed: np.ndarray | None = None,
    ) -> Self:
        """Shade what the agent can see, up to a few tiles away.

        Args:
            position: (x, y) in tiles.
            heading: radians, 0 along +x, growing clockwise on the map.
            field_of_view: horizontal angle in degrees.
            closed: bool[D], which doors of the map are closed; None for all.
        """
        x, y = float(position[0]), float(position[1])
        rim = self._visible(x, y, float(heading), math.radians(field_of_view), closed)
        self._draw.polygon([self._pixel(x, y), *(self._pixel(*point) for point in rim)], VIEW)
        return self

    def agent(self, position: Sequence[float] | np.ndarray, heading: float) -> Self:
        """Draw the agent as an arrow head.

        Args:
            position: (x, y) in tiles.
            heading: radians, 0 along +x, growing clockwise on the map.
        """
        size = max(0.42 * self._tile, 5.5 * OVERSAMPLING)
        place = self._pixel(float(position[0]), float(position[1]))
        glyphs.arrow(self._draw, place, size, float(heading), AGENT)
        return self

    def state(
        self,
        pose: tuple[np.ndarray, float],
        field_of_view: float,
        closed: np.ndarray | None,
        things: tuple[np.ndarray, np.ndarray, np.ndarray | None],
    ) -> Self:
        """Draw one state: the doors, the visible area, the things, and the agent.

        Args:
            pose: the agent's position and heading, as for `agent`.
            field_of_view: as for `sight`.
            closed: as for `doors`.
            things: positions, labels and visibility, as for `sprites`.
        """
        self.doors(closed).sight(*pose, field_of_view, closed)
        return self.sprites(*things).agent(*pose)

    def _visible(
        self, x: float, y: float, heading: float, angle: float, closed: np.ndarray | None
    ) -> list[tuple[float, float]]:
        """End points of rays over the field of view, stopped by walls and closed doors."""
        free = self._passable(closed)
        angles = heading + np.linspace(-angle / 2, angle / 2, VIEW_RAYS)
        reach = np.arange(0, VIEW_RANGE + VIEW_STEP, VIEW_STEP)
        xs = x + np.cos(angles)[:, None] * reach
        ys = y + np.sin(angles)[:, None] * reach
        columns, rows = np.floor(xs).astype(int), np.floor(ys).astype(int)
        inside = (columns >= 0) & (columns < self.tilemap.columns)
        inside &= (rows >= 0) & (rows < self.tilemap.rows)
        rows, columns = rows.clip(0, free.shape[0] - 1), columns.clip(0, free.shape[1] - 1)
        blocked = ~(inside & free[rows, columns])
        blocked[:, -1] = True
        last = blocked.argmax(axis=1)
        pick = np.arange(VIEW_RAYS)
        return [(float(a), float(b)) for a, b in zip(xs[pick, last], ys[pick, last], strict=True)]

    def _passable(self, closed: np.ndarray | None) -> np.ndarray:
        free = open_floor(self.tilemap)
        for door, shut in zip(self.tilemap.doors, self._shut(closed), strict=True):
            free[door.row, door.column] = not shut
        return free

    def _shut(self, closed: np.ndarray | None) -> list[bool]:
        """Whether each door of the map is closed."""
        if closed is None:
            return [True] * len(self.tilemap.doors)
        return [bool(shut) for shut in closed]

    def _door(self, door: Door, *, is_open: bool) -> None:
        colour = paint(door_label(door.colour, locked=door.locked))
        column, row = door.column, door.row
        if is_open:
            # The posts are where the walls are, so that a path between them stays visible.
            for box in self._posts(column, row):
                self._box(*box, colour)
            return
        glyphs.closed_door(self._draw, self._pixel(column, row), self._tile, colour, door.locked)

    def _posts(self, column: int, row: int) -> list[tuple[float, float, float, float]]:
        free = np.pad(open_floor(self.tilemap), 1)
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
        """Fill a rectangle given in tiles, exact to a pixel of the large canvas."""
        a, b = round(left * self._tile), round(top * self._tile)
        c, d = round(right * self._tile) - 1, round(bottom * self._tile) - 1
        self._draw.rectangle((a, b, max(a, c), max(b, d)), colour)

    def _ring(self, x: float, y: float, radius: float, colour: Colour, width: int) -> None:
        x, y = self._pixel(x, y)
        self._draw.ellipse((x - radius, y - radius, x + radius, y + radius), None, colour, width)


def draw_map(tilemap: TileMap, *, scale: int | None = None, size: int = 480) -> MapPicture:
    """Draw the walls, spawns and goals of a map; add things, path and agent to the result.

    Args:
        tilemap: the map, from 1x1 to a few hundred tiles.
        scale: pixels per tile; None chooses it by `size`.
        size: approximate length of the longer side in pixels; it is only exceeded if there are
            more tiles than that.
    """
    scale = scale or max(1, size // max(tilemap.rows, tilemap.columns))
    canvas = draw_ground(tilemap, scale * OVERSAMPLING)
    return MapPicture(tilemap, canvas, scale).marks()
