"""Frames with textures, pixel by pixel in float64, without an atlas."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from jaxenstein.engine.camera import Camera
from jaxenstein.engine.textures import Sampling

from . import raycaster
from .worlds import World

# Float32 can move a point this close to the edge of a texel to its other side, and likewise a light
# this close to the border of a shade.
EDGE, STEP = 1e-2, 1e-3


@dataclasses.dataclass(frozen=True)
class Wall:
    """A picture uint8[h, w, 3], texels per tile, and the offset of the texel column."""

    picture: np.ndarray
    across: int
    down: float
    offset: int


@dataclasses.dataclass(frozen=True)
class Flat:
    """A picture uint8[h, w, 3], texels per tile along x and y, and the offset of both."""

    picture: np.ndarray
    scale: tuple[float, float]
    origin: tuple[float, float]


@dataclasses.dataclass(frozen=True)
class Thing:
    """A picture uint8[h, w, 4], and its edges in tiles from its middle and from eye height."""

    picture: np.ndarray
    half_width: float
    top: float
    bottom: float
    bright: bool


@dataclasses.dataclass(frozen=True)
class Looks:
    """All pictures; `wall_of(face, tile, label)` is the row of `walls` for a face."""

    walls: list[Wall]
    ceiling: Flat
    floor: Flat
    things: list[Thing]
    wall_of: Callable[[int, tuple[int, int], int], int]


def draw(
    looks: Looks,
    world: World,
    things: tuple[np.ndarray, ...],
    camera: Camera,
    places: Sampling,
    layers: int,
) -> tuple[np.ndarray, np.ndarray]:
    """The frame uint8[height, width, 3], and bool[height, width]: whether a pixel is certain.

    Args:
        looks: the pictures.
        world: a bordered map; its first pose is used.
        things: positions float[N, 2], rows of `looks.things` int[N], and visibility bool[N].
        camera: size, field of view and heights.
        places: the points of a pixel at which textures are sampled.
        layers: the number of billboards that a column shows.
    """
    eye, heading = world.positions[0].astype(np.float64), float(world.headings[0])
    size = camera.height, camera.width
    image, sure = np.zeros((*size, 3), np.uint8), np.ones(size, bool)
    for column in range(camera.width):
        rays = [_ray(heading, column + p[0], camera) for p in (places.wall, places.plane)]
        sight = raycaster.march(world.solid, eye[None], rays[0][None])
        if sight.clearance[0] < 0 or sight.depth[0] < 0.02:
            sure[:, column] = False
        for row in range(camera.height):
            shown = _wall(looks, world, sight, eye, rays[0], row + places.wall[1], camera)
            shown = shown or _flat(looks, eye, rays[1], row, camera, places)
            image[row, column], certain = shown
            sure[row, column] &= certain
        slope = _slope(column + places.thing[0], camera)
        wall = float(sight.depth[0])
        for row, colour, certain in _things(
            looks, things, eye, heading, slope, wall, camera, places, layers
        ):
            sure[row, column] &= certain
            if colour is not None:
                image[row, column] = colour
    return image, sure


def _slope(place: float, camera: Camera) -> float:
    return float(np.tan(np.deg2rad(camera.field_of_view) / 2)) * (2 * place / camera.width - 1)


def _ray(heading: float, place: float, camera: Camera) -> np.ndarray:
    forward = np.array([np.cos(heading), np.sin(heading)])
    return forward + np.array([-forward[1], forward[0]]) * _slope(place, camera)


def _focal(camera: Camera) -> float:
    plane = np.tan(np.deg2rad(camera.field_of_view) / 2)
    if camera.row_focal_share is None:
        return float(camera.width / 2 / plane)
    return float(camera.row_focal_share * camera.height / plane)


def _shaded(colour: np.ndarray, light: float) -> tuple[np.ndarray, bool]:
    """A colour in the nearest of 32 shades, and whether the shade is certain."""
    step = (1 - light) * 32
    shade = min(max(round(step), 0), 31)
    certain = abs(step - np.floor(step) - 0.5) > STEP or step > 31
    return np.floor(colour * (1 - shade / 32) + 0.5).astype(np.uint8), certain


def _light(depth: float) -> float:
    return max(1 / (1 + 0.13 * depth), 0.22)


def _inside(place: float) -> bool:
    return abs(place - round(place)) > EDGE


def _wall(looks, world, sight, eye, ray, place, camera):
    """The colour and certainty of a wall pixel, or None if the pixel shows floor or ceiling."""
    depth, face = float(sight.depth[0]), int(sight.face[0])
    height = (place - camera.height / 2) * depth / _focal(camera)
    above, below = camera.wall - camera.eye, camera.eye
    if not -above < height < below:
        return None
    column, row = (int(v) for v in sight.tile[0])
    look = looks.walls[looks.wall_of(face, (column, row), int(world.walls[row, column]))]
    x, y = eye + depth * ray
    # From left to right as seen: southwards on west faces, and so on.
    along = {raycaster.WEST: y, raycaster.EAST: -y, raycaster.NORTH: -x, raycaster.SOUTH: x}[face]
    across, down = along * look.across, (height + above) * look.down
    rows, columns = look.picture.shape[:2]
    texel = look.picture[
        int(np.floor(down)) % rows, (int(np.floor(across)) + look.offset) % columns
    ]
    light = _light(depth) * (0.8 if face in (raycaster.NORTH, raycaster.SOUTH) else 1)
    colour, certain = _shaded(texel, light)
    near_edge = min(height + above, below - height) < 1e-4 * (1 + depth)
    return colour, certain and _inside(across) and _inside(down) and not near_edge


def _flat(looks, eye, ray, row, camera, places):
    """The colour and certainty of a pixel of floor or ceiling."""
    below = row + places.plane[1] - camera.height / 2
    look = looks.floor if below > 0 else looks.ceiling
    room = camera.eye if below > 0 else camera.wall - camera.eye
    if below == 0:
        return np.zeros(3, np.uint8), False
    point = eye + room * _focal(camera) / abs(below) * ray
    x, y = (point[i] * look.scale[i] + look.origin[i] for i in (0, 1))
    rows, columns = look.picture.shape[:2]
    texel = look.picture[int(np.floor(y)) % rows, int(np.floor(x)) % columns]
    lit = abs(row + places.light_row - camera.height / 2)
    # The row of the light can belong to the other plane or to none.
    same = (row + places.light_row - camera.height / 2 > 0) == (below > 0)
    colour, certain = _shaded(texel, _light(room * _focal(camera) / max(lit, 1e-2)))
    return colour, certain and same and _inside(x) and _inside(y)


def _things(looks, things, eye, heading, slope, wall, camera, places, layers):
    """(row, colour or None, certainty) of pixels near billboards, from far to near."""
    forward = np.array([np.cos(heading), np.sin(heading)])
    right = np.array([-forward[1], forward[0]])
    crossed = []
    for position, look, visible in zip(*things, strict=True):
        offset = position.astype(np.float64) - eye
        depth, side = float(offset @ forward), float(offset @ right)
        picture = looks.things[look]
        columns = picture.picture.shape[1]
        across = ((slope * depth - side) / picture.half_width + 1) / 2 * columns
        if visible and depth > 0.05 and depth < wall and -EDGE < across < columns + EDGE:
            crossed.append((depth, across, picture))
    crossed.sort(key=lambda one: one[0])
    for depth, across, look in reversed(crossed[:layers]):
        rows, columns = look.picture.shape[:2]
        for row in range(camera.height):
            height = (row + places.thing[1] - camera.height / 2) * depth / _focal(camera)
            down = (height - look.top) / (look.bottom - look.top) * rows
            if not -EDGE < down < rows + EDGE:
                continue
            texel = look.picture[
                min(max(int(np.floor(down)), 0), rows - 1),
                min(max(int(np.floor(across)), 0), columns - 1),
            ]
            colour, certain = _shaded(texel[:3], 1.0 if look.bright else _light(depth))
            inside = 0 <= down < rows and 0 <= across < columns and texel[3] > 0
            certain &= _inside(across) and _inside(down) and wall - depth > 1e-4 * wall
            yield row, colour if inside else None, certain
