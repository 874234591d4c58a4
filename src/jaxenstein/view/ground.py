"""The background of a top-down map: floor, rock, and walls in their colours."""

from __future__ import annotations

import numpy as np
from PIL import Image, ImageDraw

from ..maps.symbols import LABEL_COLOURS
from ..maps.things import THING_OF
from ..maps.tilemap import TileMap
from .glyphs import Colour

ROCK: Colour = (44, 47, 54)
FLOOR: Colour = (233, 229, 219)
# How far the colour of a face extends into its wall, in tiles.
FACE = 0.34
# The neighbour (dx, dy) that each face looks at, in the order west, east, north, south.
NEIGHBOURS = ((-1, 0), (1, 0), (0, -1), (0, 1))


def draw_ground(tilemap: TileMap, tile: int) -> Image.Image:
    """An empty map, `tile` pixels per tile.

    Walls that touch open floor have their colour; the rest is dark rock. A wall whose faces differ
    has the colour of most of them, and each other face that touches floor is a strip along its
    edge. If most walls of the map are like that, the walls behind the strips are rock too.
    """
    canvas = Image.fromarray(_tile_colours(tilemap)).resize(
        (tilemap.columns * tile, tilemap.rows * tile), Image.Resampling.NEAREST
    )
    if tilemap.faces is not None:
        _draw_faces(canvas, tilemap, tile)
    return canvas


def open_floor(tilemap: TileMap) -> np.ndarray:
    """bool[rows, columns]: open floor, without doors."""
    return (_labels(tilemap) == 0) & ~_doors(tilemap)


def paint(label: int) -> Colour:
    """The colour of a label id."""
    thing = THING_OF.get(label)
    rgb = LABEL_COLOURS[label] if thing is None else thing.colours[label - thing.label]
    red, green, blue = (int(part) for part in rgb)
    return red, green, blue


def _draw_faces(canvas: Image.Image, tilemap: TileMap, tile: int) -> None:
    """Draw a strip along every visible face that looks different from the wall behind it."""
    draw = ImageDraw.Draw(canvas)
    faces, cores = np.asarray(tilemap.walls), _cores(tilemap)
    thick = max(1, round(FACE * tile))
    for face, (dx, dy), seen in zip(faces, NEIGHBOURS, _exposed(tilemap), strict=True):
        for row, column in np.argwhere(seen & (face != cores)):
            left, top = column * tile, row * tile
            right, bottom = left + tile - 1, top + tile - 1
            if dx:
                left, right = (left, left + thick - 1) if dx < 0 else (right - thick + 1, right)
            else:
                top, bottom = (top, top + thick - 1) if dy < 0 else (bottom - thick + 1, bottom)
            box = (int(left), int(top), int(right), int(bottom))
            draw.rectangle(box, paint(int(face[row, column])))


def _exposed(tilemap: TileMap) -> np.ndarray:
    """bool[4, rows, columns]: the faces of walls next to floor or a door."""
    free = open_floor(tilemap) | _doors(tilemap)
    padded = np.pad(free, 1)
    rows, columns = free.shape
    return np.stack(
        [~free & padded[1 + dy : 1 + dy + rows, 1 + dx : 1 + dx + columns] for dx, dy in NEIGHBOURS]
    )


def _cores(tilemap: TileMap) -> np.ndarray:
    """uint8[rows, columns]: the label of a wall behind its faces, 0 for floor and for rock."""
    faces, labels = np.asarray(tilemap.walls), _labels(tilemap)
    if tilemap.faces is None:
        return labels
    alike = (faces[:, None] == faces[None]).sum(axis=1) + 0.5 * (faces == labels)
    cores = np.take_along_axis(faces, alike.argmax(axis=0)[None], axis=0)[0]
    same = (faces == cores)[_exposed(tilemap)]
    return cores if same.mean() > 0.5 else np.zeros_like(cores)


def _tile_colours(tilemap: TileMap) -> np.ndarray:
    """uint8[rows, columns, 3], one colour per tile."""
    cores = _cores(tilemap)
    free = open_floor(tilemap) | _doors(tilemap)
    colours = np.asarray(LABEL_COLOURS, np.uint8)[cores]
    colours[~_beside(free) | (cores == 0)] = ROCK
    colours[free] = FLOOR
    return colours


def _labels(tilemap: TileMap) -> np.ndarray:
    return np.stack([np.frombuffer(row, np.uint8) for row in tilemap.tiles])


def _doors(tilemap: TileMap) -> np.ndarray:
    here = np.zeros((tilemap.rows, tilemap.columns), bool)
    for door in tilemap.doors:
        here[door.row, door.column] = True
    return here


def _beside(free: np.ndarray) -> np.ndarray:
    """bool: tiles that are free or touch a free one, including diagonally."""
    padded = np.pad(free, 1)
    rows, columns = free.shape
    near = np.zeros_like(free)
    for dy in range(3):
        for dx in range(3):
            near |= padded[dy : dy + rows, dx : dx + columns]
    return near
