"""Random maps and poses for the comparisons, biased towards hard cases."""

from __future__ import annotations

import dataclasses

import numpy as np

from .raycaster import solid_tiles

DENSITIES = (0.0, 0.03, 0.15, 0.4, 0.7)
FIRST_WALL = 2


@dataclasses.dataclass(frozen=True)
class World:
    """A map with doors and poses.

    Attributes:
        walls: uint8[rows, columns] or uint8[4, rows, columns], ids from 2, or 0 where open.
        doors: int32[D, 2], (column, row).
        closed: bool[D].
        positions: float32[B, 2], each in an open tile.
        headings: float32[B].
    """

    walls: np.ndarray
    doors: np.ndarray
    closed: np.ndarray
    positions: np.ndarray
    headings: np.ndarray

    @property
    def solid(self) -> np.ndarray:
        """bool[rows, columns], closed doors included."""
        return solid_tiles(self.walls, self.doors, self.closed)

    def __repr__(self) -> str:
        """A short form, which Hypothesis prints."""
        rows, columns = self.walls.shape[-2:]
        return f"World({columns}x{rows}, {len(self.doors)} doors, {len(self.headings)} poses)"


def draw_world(
    seed: int,
    shape: tuple[int, int],
    *,
    bordered: bool,
    faces: int = 1,
    doors: int = 4,
    poses: int = 16,
    exact: bool = False,
) -> World:
    """Draw a world of `shape` (rows, columns).

    Args:
        seed: the seed of everything.
        shape: rows and columns.
        bordered: whether the border of the map is solid.
        faces: 1, or 4 for maps whose faces differ.
        doors: the largest number of doors.
        poses: the number of poses.
        exact: whether positions are on grid lines, in corners, in tile centres, and within an ulp
            of the next tile, and headings along the axes and at multiples of 15 degrees.
    """
    rng = np.random.default_rng(seed)
    rows, columns = shape
    solid = rng.random(shape) < rng.choice(DENSITIES)
    edge = int(bordered)
    if bordered:
        solid[[0, -1]], solid[:, [0, -1]] = True, True
    free = [(c, r) for r in range(edge, rows - edge) for c in range(edge, columns - edge)]
    picked = rng.permutation(len(free))[: doors + 1]
    start, *places = (free[i] for i in picked)
    places = np.array(places, np.int32).reshape(-1, 2)
    solid[start[1], start[0]] = False
    solid[places[:, 1], places[:, 0]] = True
    ids = rng.integers(FIRST_WALL, 256, (4, *shape) if faces == 4 else shape)
    walls = np.where(solid, ids, 0).astype(np.uint8)
    closed = rng.random(len(places)) < 0.5
    open_tiles = np.argwhere(~solid_tiles(walls, places, closed))[:, ::-1]
    tiles = open_tiles[rng.integers(0, len(open_tiles), poses)]
    draw = _exact_poses if exact else _free_poses
    return World(walls, places, closed, *draw(rng, tiles))


def _free_poses(rng: np.random.Generator, tiles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    spots = (tiles + rng.random(tiles.shape)).astype(np.float32)
    # Rounding to float32 must not move an eye into the next tile.
    spots = np.minimum(spots, np.nextafter((tiles + 1).astype(np.float32), np.float32(0)))
    headings = rng.uniform(-np.pi, 2 * np.pi, len(tiles)).astype(np.float32)
    return spots, headings


def _exact_poses(rng: np.random.Generator, tiles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    free, _ = _free_poses(rng, tiles)
    low = tiles.astype(np.float32)
    last = np.nextafter(low + 1, np.float32(0))
    spots = np.choose(rng.integers(0, 4, tiles.shape), [free, low, low + np.float32(0.5), last])
    turns = rng.integers(-12, 25, len(tiles))
    turns = np.where(rng.random(len(tiles)) < 0.6, turns // 6 * 6, turns)
    loose = rng.uniform(-np.pi, 2 * np.pi, len(tiles))
    headings = np.where(rng.random(len(tiles)) < 0.15, loose, turns * (np.pi / 12))
    return spots.astype(np.float32), headings.astype(np.float32)
