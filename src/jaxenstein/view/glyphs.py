"""The small drawings on a map: doors, keys, goals, the agent."""

from __future__ import annotations

import math

from PIL import ImageDraw

Colour = tuple[int, int, int]
Point = tuple[float, float]

INK: Colour = (30, 30, 34)
# Below this many pixels of the canvas a tile, a key is drawn as a disc.
KEY_TILE = 20


def closed_door(
    draw: ImageDraw.ImageDraw, corner: Point, tile: float, colour: Colour, locked: bool
) -> None:
    """A framed panel with a keyhole if it is locked and a handle if not.

    Args:
        draw: what to draw on.
        corner: upper left corner of its tile, in pixels.
        tile: the tile's side in pixels.
        colour: of the panel.
        locked: whether it takes a key.
    """
    left, top = round(corner[0]), round(corner[1])
    right, bottom = left + round(tile) - 1, top + round(tile) - 1
    draw.rectangle((left, top, right, bottom), blend(colour, INK, 0.55))
    rim = round(0.1 * tile)
    draw.rectangle((left + rim, top + rim, right - rim, bottom - rim), colour)
    x, y = (left + right) / 2, (top + bottom) / 2
    if locked:
        hole = 0.15 * tile
        _disc(draw, x, y - 0.7 * hole, hole, INK)
        draw.polygon([(x, y - hole), (x - hole, y + 1.8 * hole), (x + hole, y + 1.8 * hole)], INK)
    else:
        _disc(draw, x + 0.22 * tile, y, 0.08 * tile, INK)


def key(draw: ImageDraw.ImageDraw, centre: Point, tile: float, colour: Colour) -> None:
    """A ring with a shaft and two teeth; a disc where that would be too small to see.

    Args:
        draw: what to draw on.
        centre: of the tile, in pixels.
        tile: the tile's side in pixels.
        colour: of the key.
    """
    x, y = centre
    if tile < KEY_TILE:
        _disc(draw, x, y, max(0.42 * tile, 5.5), INK)
        _disc(draw, x, y, max(0.3 * tile, 4.0), colour)
        return
    bars = ((-0.1, -0.05, 0.38, 0.05), (0.14, 0.0, 0.21, 0.19), (0.28, 0.0, 0.35, 0.19))
    for grow, paint in ((0.05 * tile, INK), (0.0, colour)):
        for left, top, right, bottom in bars:
            start = x + left * tile - grow, y + top * tile - grow
            end = x + right * tile + grow, y + bottom * tile + grow
            draw.rectangle((*start, *end), paint)
        _disc(draw, x - 0.2 * tile, y, 0.19 * tile + grow, paint)
    _disc(draw, x - 0.2 * tile, y, 0.08 * tile, INK)


def star(draw: ImageDraw.ImageDraw, centre: Point, size: float, colour: Colour) -> None:
    """A five-pointed star with an outline; `size` is its radius in pixels."""
    for paint, radius in ((INK, size), (colour, 0.74 * size)):
        angles = [-math.pi / 2 + i * math.pi / 5 for i in range(10)]
        spokes = [radius * (0.5 if i % 2 else 1.0) for i in range(10)]
        points = [_polar(centre, *spoke) for spoke in zip(angles, spokes, strict=True)]
        draw.polygon(points, paint)


def arrow(
    draw: ImageDraw.ImageDraw, centre: Point, size: float, heading: float, colour: Colour
) -> None:
    """An arrow head that points along `heading`, in radians clockwise from the right."""
    corners = ((0.0, 1.0), (2.45, 0.85), (math.pi, 0.35), (-2.45, 0.85))
    for paint, radius in ((INK, 1.3 * size), (colour, size)):
        points = [_polar(centre, heading + turn, radius * share) for turn, share in corners]
        draw.polygon(points, paint)


def blend(first: Colour, second: Colour, share: float) -> Colour:
    """The colour at `share` of the way from the first to the second."""
    red, green, blue = (round(a + (b - a) * share) for a, b in zip(first, second, strict=True))
    return red, green, blue


def _disc(draw: ImageDraw.ImageDraw, x: float, y: float, radius: float, colour: Colour) -> None:
    draw.ellipse((x - radius, y - radius, x + radius, y + radius), colour)


def _polar(centre: Point, angle: float, radius: float) -> Point:
    return centre[0] + math.cos(angle) * radius, centre[1] + math.sin(angle) * radius
