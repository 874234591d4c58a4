"""Colours of walls, floor and ceiling with patterns, pixel by pixel in float64."""

from __future__ import annotations

import numpy as np

from jaxenstein.engine.camera import Camera
from jaxenstein.engine.scene import Theme

from . import images, raycaster
from .worlds import World

TEXELS = 32
# A pixel closer than this to the edge of a texel or stripe, in texels or stripes, can be on either
# side of it.
EDGE = 2e-2


def light(depth: float) -> float:
    """The share of its colour that a surface keeps at a depth."""
    return max(1 / (1 + 0.13 * depth), 0.22)


def bit(word: int, place: float) -> bool:
    """Bit `floor(place)` of a word of 32 bits, counted from the highest."""
    return bool(int(word) >> (31 - int(np.floor(place))) & 1)


def near_edge(place: float) -> bool:
    """Whether rounding can move a position into another texel."""
    return abs(place - round(place)) < EDGE


def paint(
    picture: images.Picture, world: World, theme: Theme, camera: Camera
) -> tuple[np.ndarray, np.ndarray]:
    """Colours float64[height, width, 3] of an image without billboards, and where they are certain.

    Args:
        picture: what each pixel shows.
        world: the map and the pose.
        theme: the look of the map.
        camera: size and field of view of the image.
    """
    heading, eye = float(world.headings[0]), world.positions[0].astype(np.float64)
    rays = raycaster.directions(heading, camera.width, camera.field_of_view)
    sight = raycaster.march(world.solid, np.repeat(eye[None], camera.width, axis=0), rays)
    colours, sure = np.zeros((camera.height, camera.width, 3)), ~picture.unsure
    below = images.row_offsets(camera.height) / camera.row_focal
    for row, column in np.ndindex(camera.height, camera.width):
        label, depth = int(picture.labels[row, column]), float(picture.depth[row, column])
        if label == images.CEILING:
            colours[row, column], certain = np.asarray(theme.ceiling) * light(depth), True
        elif label == images.FLOOR:
            colours[row, column], certain = floor(theme, eye + depth * rays[column], depth)
        else:
            height = (below[row] * depth + camera.wall - camera.eye) / camera.wall
            place = float(sight.along[column]), float(height)
            side = 0.8 if sight.face[column] >= raycaster.NORTH else 1.0
            colours[row, column], certain = wall(theme, label, place, depth, side)
        sure[row, column] &= certain
    return colours, sure


def floor(theme: Theme, place: np.ndarray, depth: float) -> tuple[np.ndarray, bool]:
    """The colour of the floor at a position (x, y), and whether rounding cannot change it."""
    assert theme.floor_words is not None
    stripes = place % 2 * 16
    along, across = (bit(w, s) for w, s in zip(np.asarray(theme.floor_words), stripes, strict=True))
    both = np.asarray(theme.floor, np.float64)
    left = np.clip((9 - depth) / 8, 0, 1)
    colour = both.mean(axis=0) * (1 - left) + both[int(along != across)] * left
    # Stripes touch at their edges and repeat.
    return colour * light(depth), not any(near_edge(s) for s in stripes)


def wall(
    theme: Theme, label: int, place: tuple[float, float], depth: float, side: float
) -> tuple[np.ndarray, bool]:
    """The colour of a wall at a position, and whether rounding cannot change it.

    Args:
        theme: the look of walls.
        label: the label of the wall.
        place: the position (across, down) on the wall, each from 0 to 1.
        depth: the depth of the wall.
        side: the share of light that its side gets.
    """
    across, down = place
    panel = int(np.asarray(theme.wall_panels)[label])
    planes = [int(plane) for plane in np.asarray(theme.panels)[panel, :, min(int(across * 32), 31)]]
    texels = across * TEXELS, down * TEXELS
    bright = light(depth) * side
    at_seam = min(across, 1 - across) < 0.03
    bright *= 1 - 0.3 * max(1 - depth / 7, 0) * at_seam
    colour = np.asarray(theme.wall_colours, np.float64)[label]
    certain = not any(near_edge(t) for t in texels) and abs(min(across, 1 - across) - 0.03) > 1e-3
    shadow, accent = (bit(plane, min(texels[1], 31.999)) for plane in planes)
    if accent:
        return np.asarray(theme.panel_accent, np.float64) * bright, certain
    if shadow:
        reach = np.inf if theme.panel_reach is None else float(theme.panel_reach[panel])
        colour = colour * (1 - 0.55 * max(1 - depth / reach, 0))
    return colour * bright, certain
