"""Whole images in float64: what each pixel shows, its depth, and where rounding decides."""

from __future__ import annotations

import dataclasses

import numpy as np

from . import raycaster

CEILING, FLOOR = 0, 1
TEXELS = 32
# A billboard nearer than this is not drawn.
NEAREST = 0.05
# Float32 can move an edge by this share of a texel, or of the height of a wall in pixels.
TEXEL_ROUNDING = 4e-3
EDGE_ROUNDING = 1e-4


@dataclasses.dataclass(frozen=True)
class Billboards:
    """N billboards, and S looks as in a theme of the engine.

    Attributes:
        position: float[N, 2].
        picture: int[N].
        visible: bool[N].
        shape: uint32[S, 32], the shape plane by column, highest bit on top.
        radius: float[S], half the side in tiles.
        drop: float[S], tiles from the eye's height down to the centre.
        labels: uint8[S].
    """

    position: np.ndarray
    picture: np.ndarray
    visible: np.ndarray
    shape: np.ndarray
    radius: np.ndarray
    drop: np.ndarray
    labels: np.ndarray


@dataclasses.dataclass(frozen=True)
class Picture:
    """One image.

    Attributes:
        labels: int[height, width].
        depth: float64[height, width].
        sprite: int[height, width], index of the billboard shown, or -1.
        unsure: bool[height, width], pixels within rounding of an edge.
    """

    labels: np.ndarray
    depth: np.ndarray
    sprite: np.ndarray
    unsure: np.ndarray


def focal_length(width: int, field_of_view: float) -> float:
    """The distance of the image plane in pixels."""
    return width / (2 * np.tan(np.deg2rad(field_of_view) / 2))


def row_offsets(height: int) -> np.ndarray:
    """float64[height]: pixels from the horizon down to the centre of each row."""
    return np.array([row + 0.5 - height / 2 for row in range(height)])


def draw(
    solid: np.ndarray,
    walls: np.ndarray,
    eye: np.ndarray,
    heading: float,
    billboards: Billboards,
    *,
    height: int,
    width: int,
    field_of_view: float,
    layers: int,
    room: tuple[float, float] = (0.5, 0.5),
    row_focal: float | None = None,
) -> Picture:
    """Draw a map uint8[rows, columns] with a solid border, and billboards in it.

    `room` is the distance of the floor below the eye and of the ceiling above it.
    """
    rays = raycaster.directions(heading, width, field_of_view)
    eyes = np.repeat(eye[None].astype(np.float64), width, axis=0)
    sight = raycaster.march(solid, eyes, rays)
    focal = focal_length(width, field_of_view)
    shown = walls[sight.tile[:, 1], sight.tile[:, 0]].astype(int)
    if row_focal is not None:
        focal = row_focal
    picture = _background(sight.depth, shown, row_offsets(height), focal, room)
    rounding = raycaster.rounding_of_depth(eyes, rays, sight)
    picture.unsure[:, (sight.clearance < 0) | (rounding > 2e-5 * sight.depth)] = True
    for column in range(width):
        slope = raycaster.slopes(width, field_of_view)[column]
        _add_billboards(
            picture, column, slope, sight.depth[column], eye, heading, billboards, focal, layers
        )
    return picture


def _background(
    depth: np.ndarray, labels: np.ndarray, rows: np.ndarray, focal: float, room: tuple[float, float]
) -> Picture:
    """Walls, floor and ceiling."""
    below = rows[:, None]
    bottom, top = (height * focal / np.maximum(depth, 1e-9)[None] for height in room)
    is_wall = (below < bottom) & (-below < top)
    with np.errstate(divide="ignore"):
        plane = focal * np.where(below > 0, *room) / np.abs(below)
    nearest = np.minimum(np.abs(below - bottom), np.abs(below + top))
    return Picture(
        labels=np.where(is_wall, labels[None], np.where(below > 0, FLOOR, CEILING)),
        depth=np.where(is_wall, depth[None], plane),
        sprite=np.full(is_wall.shape, -1),
        unsure=nearest < EDGE_ROUNDING * (1 + bottom + top),
    )


def _add_billboards(
    picture: Picture,
    column: int,
    slope: float,
    wall: float,
    eye: np.ndarray,
    heading: float,
    billboards: Billboards,
    focal: float,
    layers: int,
) -> None:
    """Draw the nearest billboards of one column, the nearest on top."""
    rows = row_offsets(picture.labels.shape[0])
    forward = np.array([np.cos(heading), np.sin(heading)])
    right = np.array([-forward[1], forward[0]])
    crossed = []
    for i in np.flatnonzero(billboards.visible):
        offset = billboards.position[i].astype(np.float64) - eye
        depth, side = offset @ forward, offset @ right
        look = billboards.picture[i]
        radius, drop = float(billboards.radius[look]), float(billboards.drop[look])
        across = ((slope * depth - side) / radius + 1) / 2 * TEXELS
        if not -TEXEL_ROUNDING < across < TEXELS + TEXEL_ROUNDING or depth <= 0:
            continue
        edge = abs(across - np.rint(across)) < TEXEL_ROUNDING
        near = abs(depth - NEAREST) < 1e-4 or abs(depth - wall) < 1e-4 * (1 + wall)
        if edge or near:
            picture.unsure[:, column] = True
        elif depth > NEAREST and depth < wall:
            bits = ((rows * depth / focal - drop) / radius + 1) / 2 * TEXELS
            crossed.append((depth, int(i), bits, int(billboards.shape[look, int(across)])))
    crossed.sort(key=lambda one: one[0])
    depths = np.array([one[0] for one in crossed])
    if (np.diff(depths) < 1e-4 * depths[1:]).any():
        picture.unsure[:, column] = True
    for depth, i, bits, word in reversed(crossed[:layers]):
        whole = np.floor(bits).astype(np.int64)
        inside = (whole >= 0) & (whole < TEXELS)
        covers = inside & ((word >> np.where(inside, TEXELS - 1 - whole, 0)) & 1 == 1)
        picture.labels[covers, column] = billboards.labels[billboards.picture[i]]
        picture.depth[covers, column] = depth
        picture.sprite[covers, column] = i
        near_edge = np.abs(bits - np.rint(bits)) < TEXEL_ROUNDING
        picture.unsure[near_edge & (bits > -1) & (bits < TEXELS + 1), column] = True
