"""Convert a level on the device to a tile map and its doors on the host."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..engine.level import Level, unpack_bits
from ..maps.symbols import DEFAULT_WALL, DOOR_LABELS, WALL_LABELS, door_label
from ..maps.tilemap import Door, TileMap

_COLOURS = len(DOOR_LABELS) // 2


def read_level(name: str, level: Level) -> TileMap:
    """The walls and doors of a level.

    Doors that the layout does not have are on the border and are left out. Walls whose labels are
    not in `jaxenstein.maps.symbols` become default walls.

    Args:
        name: the name of the map.
        level: one level, not a batch of them.
    """
    columns, rows = level.size
    solid = unpack_bits(np.asarray(level.row_bits))[:, :columns]
    faces = np.where(solid, np.asarray(level.walls), 0)
    faces = np.where(solid & ~np.isin(faces, WALL_LABELS), DEFAULT_WALL, faces).astype(np.uint8)
    doors = []
    for column, row in np.asarray(level.doors).tolist():
        label = int(level.walls[0, row, column])
        if not solid[row, column] and label in DOOR_LABELS:
            faces[:, row, column] = label
            kind = label - door_label(0, locked=False)
            place = column - level.margin, row - level.margin
            doors.append(Door(*place, kind % _COLOURS, locked=kind >= _COLOURS))
    inside = slice(level.margin, rows - level.margin), slice(level.margin, columns - level.margin)
    shown = [tuple(bytes(row) for row in face[inside]) for face in faces]
    return TileMap(
        name=name,
        tiles=shown[0],
        faces=tuple(shown) if len(shown) == 4 else None,
        doors=tuple(doors),
    )


def closed_doors(tilemap: TileMap, doors: Any, closed: Any) -> np.ndarray:
    """Which doors of a map are closed; a level may order them differently and have absent ones.

    Args:
        tilemap: the map of the level.
        doors: int[D, 2], (column, row) of the level's doors, without the margin.
        closed: bool[..., D], as `Scene.closed`.

    Returns:
        bool[..., number of the map's doors], in the map's order. Doors that the level does not
        have are closed.
    """
    places = {(column, row): slot for slot, (column, row) in enumerate(np.asarray(doors).tolist())}
    slots = [places.get((door.column, door.row), -1) for door in tilemap.doors]
    closed = np.asarray(closed, bool)
    unknown = np.ones((*closed.shape[:-1], 1), bool)
    return np.concatenate([closed, unknown], axis=-1)[..., slots]
