"""Walls in the game's look: where they are, and how their pictures lie on them.

A map whose walls are all on the lattice of its tiles has its pictures on the faces of tiles. Other
maps have free walls (`engine.level.FreeWalls`), one for each wall of the map.
"""

from __future__ import annotations

import numpy as np

from ...engine.level import FreeWalls
from ...engine.textures import Materials
from .maps import DoomMap, Line, TileGrid, exact_ends_of, is_tiled, wall_faces
from .view import label_of


def free_walls(doom_map: DoomMap, tiles: TileGrid) -> FreeWalls | None:
    """The walls of a map in tiles; None if they are all on the lattice."""
    if is_tiled(doom_map, tiles.unit):
        return None
    ends = exact_ends_of(doom_map.walls)
    # In the game, a wall is seen from its right side, so its first end is on the left.
    places = np.stack([ends[..., 0] - tiles.west, tiles.north - ends[..., 1]], axis=-1)
    left, right = np.moveaxis((places / tiles.unit).astype(np.float32), 1, 0)
    labels = np.array([label_of(wall.texture) for wall in doom_map.walls], np.uint8)
    return FreeWalls(left, right, labels)


def wall_materials(
    doom_map: DoomMap, tiles: TileGrid, first: np.ndarray, sides: tuple[np.ndarray, np.ndarray]
) -> Materials:
    """The pictures of walls, a row for each wall of the map.

    Args:
        doom_map: the map.
        tiles: its tiles.
        first: int32[L], the first texel of each wall's picture.
        sides: int32[L] twice, the width and height of it.
    """
    count, unit = len(doom_map.walls), tiles.unit
    lengths = np.linalg.norm(np.diff(exact_ends_of(doom_map.walls), axis=1)[:, 0], axis=1)
    begin = np.zeros(count, np.int32)
    row = np.array([wall.row for wall in doom_map.walls], np.int32)
    if is_tiled(doom_map, tiles.unit):
        begin = np.array([_begin(wall, tiles) for wall in doom_map.walls], np.int32)
    return Materials(
        first,
        *sides,
        across=np.full(count, unit, np.int32),
        down=np.full(count, unit, np.float32),
        offset=np.array([wall.offset for wall in doom_map.walls], np.int32) - begin,
        begin=begin,
        length=np.floor(lengths + 0.5).astype(np.int32),
        row=row if row.any() else None,
    )


def wall_rows(doom_map: DoomMap, tiles: TileGrid) -> np.ndarray:
    """int32: the index of the wall on each face of the tiles, or of each free wall."""
    if not is_tiled(doom_map, tiles.unit):
        return np.arange(len(doom_map.walls), dtype=np.int32)
    of_face = np.zeros(tiles.faces.shape, np.int32)
    for number, wall in enumerate(doom_map.walls):
        of_face[wall_faces(wall, tiles.west, tiles.north, tiles.unit)] = number
    return of_face


def _begin(wall: Line, tiles: TileGrid) -> int:
    """Where a wall begins, in map units to the viewer's right from the edge of the map's tiles."""
    x, y = int(wall.x0) - tiles.west, tiles.north - int(wall.y0)
    if wall.x0 == wall.x1:
        return -y if wall.y1 > wall.y0 else y
    return x if wall.x1 > wall.x0 else -x
