"""Convert DeepMind Lab's mazes, `.map` files of cells with thin walls, to tile maps.

In these files a cell is 100 units wide; x grows to the east and y to the north. A wall is a panel
of 1 unit just inside a cell, at one of its sides, and as high as the cell. A picture (decal) hangs
just in front of a panel. In a tile map, walls are as thick as a tile: cell (column, row) becomes
tile (2 column + 1, 2 (rows - 1 - row) + 1), and the tile between two cells is the side that they
share. A tile between four cells is wall if any of the four sides that meet there is. Rows of cells
are counted from the south, rows of tiles from the north.
"""

from __future__ import annotations

import numpy as np

from ...errors import MapError
from ..symbols import DECAL_LABELS, DEFAULT_WALL, SYMBOLS
from ..tilemap import FACES, Cell, TileMap
from .dmlab_file import CellSide, LabMaze, Side, read_maze

WALL_SYMBOLS: dict[str, str] = {
    "green": "3",
    "green_bright": "F",
    "red": "1",
    "red_bright": "I",
    "yellow": "4",
    "yellow_bright": "W",
    "blue": "2",
    "blue_bright": "T",
    "orange": "W",
    "orange_bright": "I",
    "gray": "#",
    "gray_bright": "#",
}
"""The symbol of the wall for each texture `..._wall_COLOUR`; other textures become `#`."""

_STEPS: dict[Side, Cell] = {"west": (-1, 0), "east": (1, 0), "north": (0, -1), "south": (0, 1)}
_ACROSS: dict[Side, str] = {"west": "east", "east": "west", "north": "south", "south": "north"}


def build_tilemap(maze: LabMaze) -> TileMap:
    """Build the tile map of a maze: 2 columns + 1 by 2 rows + 1 tiles, north up.

    Decals are numbered in the order of the file; equal pictures have equal numbers. A wall tile
    with a decal has the decal's label in `TileMap.tiles`. In `TileMap.faces`, only the face with
    the decal has this label; the other faces show the panels.

    Raises:
        MapError: the maze has more different decals than there are labels.
    """
    faces = _panel_faces(maze)
    tiles = _first(faces)
    for (tile, face), label in _decals(maze).items():
        faces[face][tile] = tiles[tile] = label
    rows = tuple(row.tobytes() for row in tiles)
    return TileMap(
        name=maze.name,
        tiles=rows,
        faces=tuple(tuple(row.tobytes() for row in face) for face in faces)
        if (faces != tiles).any()
        else None,
        spawns=tuple(map(maze.tile_of, maze.spawns)),
        goals=tuple(map(maze.tile_of, maze.goals)),
        apples=tuple(map(maze.tile_of, maze.apples)),
    )


def wall_label(texture: str) -> int:
    """The label of the wall for the texture of a panel."""
    colour = texture.rpartition("_wall_")[2]
    return SYMBOLS[WALL_SYMBOLS.get(colour, "#")].label


def _panel_faces(maze: LabMaze) -> np.ndarray:
    """uint8[4, rows, columns] of tiles: the faces of the walls without decals."""
    faces = np.zeros((4, 2 * maze.rows + 1, 2 * maze.columns + 1), np.uint8)
    for side, texture in maze.panels:
        tile, face = _seen(maze, side)
        faces[face][tile] = wall_label(texture)
    # Cells without floor are solid, and so is everything around the cells.
    void = np.ones(faces.shape[1:], bool)
    for cell, _ in maze.floors:
        column, row = maze.tile_of(cell)
        void[row, column] = False
    cells = np.pad(void[1::2, 1::2], 1, constant_values=True)
    void[:] = False
    void[1::2, 1::2] = cells[1:-1, 1:-1]
    void[1::2, 0::2] = cells[1:-1, :-1] | cells[1:-1, 1:]
    void[0::2, 1::2] = cells[:-1, 1:-1] | cells[1:, 1:-1]
    faces[:, void & (faces == 0).all(axis=0)] = DEFAULT_WALL
    faces = np.where(faces == 0, _first(faces), faces)
    padded = np.pad(faces, ((0, 0), (1, 1), (1, 1)))
    for row, column in np.ndindex(maze.rows + 1, maze.columns + 1):
        around = padded[:, 2 * row : 2 * row + 3, 2 * column : 2 * column + 3]
        faces[:, 2 * row, 2 * column] = _corner(around)
    return faces


def _corner(around: np.ndarray) -> list[int]:
    """The faces of a tile between four cells: 0 if no wall ends there.

    A face continues the walls in line with it, if there are any.

    Args:
        around: uint8[4, 3, 3], the faces of the tiles around it.
    """
    walls = around[:, [0, 2, 1, 1], [1, 1, 0, 2]].T.tolist()
    in_line = walls[:2], walls[:2], walls[2:], walls[2:]
    return [
        next((wall[face] for wall in (*nearest, *walls) if wall[face]), 0)
        for face, nearest in enumerate(in_line)
    ]


def _decals(maze: LabMaze) -> dict[tuple[Cell, int], int]:
    """The label at each (tile as (row, column), face) with a decal."""
    textures = list(dict.fromkeys(texture for _, texture in maze.decals))
    if len(textures) > len(DECAL_LABELS):
        most = len(DECAL_LABELS)
        raise MapError(
            f"the maze has {len(textures)} different decals; there are only {most} labels"
        )
    return {
        _seen(maze, side): DECAL_LABELS[textures.index(texture)] for side, texture in maze.decals
    }


def _seen(maze: LabMaze, side: CellSide) -> tuple[Cell, int]:
    """The tile, as (row, column), and its face that show a side of a cell."""
    column, row = maze.tile_of(side[:2])
    dx, dy = _STEPS[side[2]]
    return (row + dy, column + dx), FACES.index(_ACROSS[side[2]])


def _first(faces: np.ndarray) -> np.ndarray:
    """uint8[rows, columns]: the first nonzero face of each tile."""
    chosen = (faces != 0).argmax(axis=0)
    return np.take_along_axis(faces, chosen[None], axis=0)[0]


__all__ = ["WALL_SYMBOLS", "LabMaze", "build_tilemap", "read_maze", "wall_label"]
