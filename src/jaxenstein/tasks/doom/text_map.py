"""Text maps in Doom's map units: their tiles, their things, and their pickups."""

from __future__ import annotations

import functools
from typing import Any

import jax.numpy as jnp
import numpy as np

from ...maps import things
from ...maps.ascii import parse_ascii
from ...maps.symbols import SYMBOLS
from ...maps.things import THING_OF, Role
from ...maps.tilemap import TileMap
from .fixed import ONE
from .maps import DoomMap, TileGrid, outline
from .parts import GameObject, Part, Sprites
from .view import MEDKIT_BOX, Picture

TILE, HEIGHT = 64, 96
"""Map units per tile, and from floor to ceiling."""
_KNOWN = frozenset(
    character
    for character, symbol in SYMBOLS.items()
    if symbol.role or symbol.kind in ("floor", "spawn", "wall", "goal")
)
_AMMUNITION_BOX = Picture("ammunition", 26, (98, 104, 74), (226, 180, 76))
_GOAL_STAR = Picture("goal", 40, (255, 216, 20), (140, 118, 11), lift=10)


@functools.lru_cache(maxsize=64)
def read_text(text: str) -> TileMap:
    """Read a map; warnings name the caller that builds the environment."""
    return parse_ascii(text, goal_required=False, known=_KNOWN, stacklevel=7)


def doom_map_of(tilemap: TileMap) -> DoomMap:
    """The map in map units, with the map's south-western corner as the origin."""
    solid = np.array([list(row) for row in tilemap.tiles]) != 0
    return DoomMap(outline(solid, TILE), (), 0, HEIGHT, 255)


def grid_of(tilemap: TileMap) -> TileGrid:
    """The grid of tiles in map units."""
    walls = tilemap.walls
    faces = walls if walls.ndim == 3 else walls[None].repeat(4, axis=0)
    return TileGrid(faces[0] != 0, faces, (), 0, tilemap.rows * TILE, TILE)


def centres_of(tilemap: TileMap, cells: object) -> np.ndarray:
    """int32[n, 2]: the centres of (column, row) tiles, map units in 16.16."""
    centre = np.array(cells, np.float64).reshape(-1, 2) + 0.5
    east, north = centre[:, 0] * TILE, (tilemap.rows - centre[:, 1]) * TILE
    return (np.stack([east, north], axis=1) * ONE).astype(np.int32)


def things_of(tilemap: TileMap, role: Role) -> tuple[list[int], np.ndarray]:
    """The labels of the things with a role, row by row, and their positions int32[n, 2]."""
    items = [item for item in tilemap.items if THING_OF[item.label].role == role]
    places = centres_of(tilemap, [(item.column, item.row) for item in items])
    return [item.label for item in items], places


class Supplies(Part):
    """Medkits and boxes of ammunition: `state.supplies`.

    Attributes:
        places: int32[M, 2], their positions, map units in 16.16.
        medkits: bool[M], which of them are medkits.
    """

    objects = (
        GameObject("Medikit", things.MEDKIT.label, (MEDKIT_BOX,)),
        GameObject("ClipBox", things.AMMUNITION.label, (_AMMUNITION_BOX,)),
    )

    def __init__(self, places: np.ndarray, medkits: np.ndarray) -> None:
        """Store their positions; see the class."""
        self.places, self.medkits = places, medkits

    def sprites(self, state: Any) -> Sprites:
        """The supplies that are left."""
        pictures = jnp.asarray(np.where(self.medkits, 0, 1).astype(np.int32))
        return Sprites(jnp.asarray(self.places), pictures, state.supplies)


class Goals(Part):
    """The goals of the map, which never change.

    Attributes:
        places: int32[n, 2], map units in 16.16.
    """

    objects = (GameObject("", things.GOAL.label, (_GOAL_STAR,)),)

    def __init__(self, places: np.ndarray) -> None:
        """Store their positions."""
        self.places = places

    def sprites(self, state: Any) -> Sprites:
        """All goals."""
        del state
        count = len(self.places)
        none = jnp.zeros(count, jnp.int32)
        return Sprites(jnp.asarray(self.places), none, jnp.ones(count, bool))
