"""March many rays from cell to cell (Amanatides and Woo) in float64."""

from __future__ import annotations

import dataclasses

import numpy as np

# The faces of a tile by the direction they face, in the order of a map's face ids.
WEST, EAST, NORTH, SOUTH = range(4)
# Float32 arithmetic can move a ray by this much per tile of its length plus one.
ROUNDING = 2e-5
# On a face at a small angle, the error of a ray grows at most by this factor.
SLANT = 64


@dataclasses.dataclass(frozen=True)
class Sight:
    """The first hits of N rays.

    Attributes:
        depth: float64[N], the ray parameter: for rays of `directions`, the perpendicular distance.
        tile: int64[N, 2], (column, row), at most one tile outside the map.
        face: int64[N], `WEST`, `EAST`, `NORTH` or `SOUTH`.
        along: float64[N], the position on the face from its left (0) to its right edge (1) as seen.
        clearance: float64[N], the least distance in tiles at which the ray passes a corner of a
            solid tile on a crossed border, minus `ROUNDING`. If it is negative, float32 can hit
            another tile.
    """

    depth: np.ndarray
    tile: np.ndarray
    face: np.ndarray
    along: np.ndarray
    clearance: np.ndarray


def slopes(width: int, field_of_view: float) -> np.ndarray:
    """float64[width]: the sideways offset of the centre of each column at distance 1."""
    edge = np.tan(np.deg2rad(field_of_view) / 2)
    return np.array([edge * (2 * (i + 0.5) / width - 1) for i in range(width)])


def directions(heading: float, width: int, field_of_view: float) -> np.ndarray:
    """float64[width, 2]: forward + right * slope for each column of an image."""
    forward = np.array([np.cos(heading), np.sin(heading)])
    right = np.array([-forward[1], forward[0]])
    return forward + right * slopes(width, field_of_view)[:, None]


def solid_tiles(walls: np.ndarray, doors: np.ndarray, closed: np.ndarray) -> np.ndarray:
    """bool[rows, columns]: solid tiles of a map uint8[(4,) rows, columns] with doors."""
    solid = (walls.reshape(-1, *walls.shape[-2:]) != 0).any(axis=0)
    for (column, row), shut in zip(doors, closed, strict=True):
        solid[row, column] = shut
    return solid


def march(solid: np.ndarray, eyes: np.ndarray, rays: np.ndarray) -> Sight:
    """Follow N rays through a map from tile to tile until each enters a solid tile.

    Args:
        solid: bool[rows, columns].
        eyes: float64[N, 2], each in an open tile.
        rays: float64[N, 2].
    """
    count = len(eyes)
    ringed = np.pad(solid, 1, constant_values=True)
    corners = _solid_corners(solid)
    tile = np.floor(eyes).astype(np.int64)
    step = np.where(rays > 0, 1, -1)
    depth, axis = np.zeros(count), np.zeros(count, np.int64)
    clearance = np.full(count, np.inf)
    going = np.arange(count)
    while going.size:
        eye, ray = eyes[going], rays[going]
        border = tile[going] + (ray > 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = np.where(ray == 0, np.inf, (border - eye) / ray)
        crossed = reach.argmin(axis=1)
        each = np.arange(going.size)
        t = reach[each, crossed]
        place = eye[each, 1 - crossed] + t * ray[each, 1 - crossed]
        corner = np.empty((going.size, 2), np.int64)
        corner[each, crossed] = border[each, crossed]
        corner[each, 1 - crossed] = np.rint(place)
        sine = np.abs(ray[each, crossed]) / np.linalg.norm(ray, axis=1)
        off = np.abs(place - np.rint(place))
        room = off * np.maximum(sine, 1 / SLANT) - ROUNDING * (1 + t)
        room = np.where(corners[corner[:, 1], corner[:, 0]], room, np.inf)
        clearance[going] = np.minimum(clearance[going], room)
        tile[going, crossed] += step[going, crossed]
        depth[going], axis[going] = t, crossed
        going = going[~ringed[tile[going, 1] + 1, tile[going, 0] + 1]]
    return _sight(eyes, rays, depth, tile, axis, clearance)


def _solid_corners(solid: np.ndarray) -> np.ndarray:
    """bool[rows + 1, columns + 1]: whether a solid tile touches corner (x, y) of the grid."""
    ringed = np.pad(solid, 1, constant_values=True)
    return ringed[:-1, :-1] | ringed[1:, :-1] | ringed[:-1, 1:] | ringed[1:, 1:]


def _sight(
    eyes: np.ndarray,
    rays: np.ndarray,
    depth: np.ndarray,
    tile: np.ndarray,
    axis: np.ndarray,
    clearance: np.ndarray,
) -> Sight:
    backwards = rays[np.arange(len(rays)), axis] < 0
    face = np.select(
        [(axis == 0) & ~backwards, (axis == 0) & backwards, ~backwards], [WEST, EAST, NORTH], SOUTH
    )
    return Sight(depth, tile, face, along_face(eyes, rays, depth, tile, face), clearance)


def along_face(
    eyes: np.ndarray, rays: np.ndarray, depth: np.ndarray, tile: np.ndarray, face: np.ndarray
) -> np.ndarray:
    """float64[N]: the position of hits on their faces, from the left (0) to the right edge (1)."""
    point = eyes + depth[:, None] * rays - tile
    # A viewer of a west face looks east, with the south, where y grows, on the right.
    return np.select(
        [face == WEST, face == EAST, face == NORTH],
        [point[:, 1], 1 - point[:, 1], 1 - point[:, 0]],
        point[:, 0],
    )


def rounding_of_depth(eyes: np.ndarray, rays: np.ndarray, sight: Sight) -> np.ndarray:
    """float64[N]: the unavoidable error of depth with float32 directions and eyes."""
    normal = np.where(sight.face < NORTH, np.abs(rays[:, 0]), np.abs(rays[:, 1]))
    return 4e-7 * sight.depth / np.maximum(normal, 1e-12)


def is_plausible(
    solid: np.ndarray, eye: np.ndarray, ray: np.ndarray, depth: float, tile: np.ndarray, face: int
) -> bool:
    """Whether a ray can end at a face if tiles are off by a rounding error.

    It can if the tile is solid, the ray is at the face at that depth, and it has not passed through
    the core of a solid tile before. This needs no march, so it also works for rays along tile
    borders or through corners, where the result of a march depends on each rounding.
    """
    rows, columns = solid.shape
    blur = ROUNDING * (1 + rows + columns)
    column, row = int(tile[0]), int(tile[1])
    inside = 0 <= column < columns and 0 <= row < rows
    if not (np.isfinite(depth) and -1 <= column <= columns and -1 <= row <= rows):
        return False
    if inside and not solid[row, column]:
        return False
    low = np.array([column, row], np.float64)
    point = eye + depth * ray
    axis = 0 if face in (WEST, EAST) else 1
    plane = low[axis] + (1 if face in (EAST, SOUTH) else 0)
    across = point[1 - axis] - low[1 - axis]
    slant = min(SLANT, np.linalg.norm(ray) / max(abs(ray[axis]), 1e-12))
    beyond = max(-across, across - 1)
    if abs(point[axis] - plane) > blur or beyond > max(blur, ROUNDING * slant):
        return False
    return depth <= _first_core(solid, eye, ray, blur) + blur * (1 + depth)


def _first_core(solid: np.ndarray, eye: np.ndarray, ray: np.ndarray, blur: float) -> float:
    """The least depth at which a ray is inside a solid tile by more than `blur`."""
    row, column = np.nonzero(np.pad(solid, 1, constant_values=True))
    low = np.stack([column, row], axis=1) - 1 + blur
    high = low + 1 - 2 * blur
    # A ray along an axis: a direction of 1e-15 misses a slab by less than a rounding error.
    ray = np.where(np.abs(ray) < 1e-15, 1e-15, ray)
    one, other = (low - eye) / ray, (high - eye) / ray
    enter = np.maximum(np.minimum(one, other).max(axis=1), 0)
    leave = np.maximum(one, other).min(axis=1)
    return float(np.where(enter < leave, enter, np.inf).min())
