"""The small drawings on a map: doors, things, the agent."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from PIL import Image, ImageDraw, ImageFilter

from ..engine.art import load_art, planes_of
from ..maps.things import THING_OF, Thing

Colour = tuple[int, int, int]
Point = tuple[float, float]

INK: Colour = (30, 30, 34)
GOLD: Colour = (255, 196, 0)
LEAF: Colour = (64, 140, 48)
CROSS: Colour = (214, 30, 44)
BOX: Colour = (255, 255, 255)
# If a tile has fewer canvas pixels than this, a key is drawn as a disc.
KEY_TILE = 20


def closed_door(
    draw: ImageDraw.ImageDraw, corner: Point, tile: float, colour: Colour, locked: bool
) -> None:
    """A framed panel with a keyhole if it is locked, else with a handle.

    Args:
        draw: the canvas.
        corner: upper left corner of the tile, in pixels.
        tile: the tile's side in pixels.
        colour: the colour of the panel.
        locked: whether the door needs a key.
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
    """A ring with a shaft and two teeth; a disc if that would be too small to see.

    Args:
        draw: the canvas.
        centre: the centre of the tile, in pixels.
        tile: the tile's side in pixels.
        colour: the colour of the key.
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


def thing(
    draw: ImageDraw.ImageDraw, centre: Point, tile: float, label: int, colour: Colour
) -> None:
    """The drawing of the thing with a label; a disc if the label is not a thing.

    Args:
        draw: the canvas.
        centre: the centre of the drawing, in pixels.
        tile: the tile's side in pixels.
        label: the label id.
        colour: the colour of the label.
    """
    row = THING_OF.get(label)
    if row is None:
        disc(draw, centre, tile, colour)
    elif row.glyph is None:
        picture(draw, centre, tile, row, label)
    else:
        GLYPHS[row.glyph](draw, centre, tile, colour)


def star(draw: ImageDraw.ImageDraw, centre: Point, tile: float, colour: Colour) -> None:
    """A golden five-pointed star with an outline."""
    del colour
    size = max(0.46 * tile, 14.0)
    for paint, radius in ((INK, size), (GOLD, 0.74 * size)):
        angles = [-math.pi / 2 + i * math.pi / 5 for i in range(10)]
        spokes = [radius * (0.5 if i % 2 else 1.0) for i in range(10)]
        points = [_polar(centre, *spoke) for spoke in zip(angles, spokes, strict=True)]
        draw.polygon(points, paint)


def apple(draw: ImageDraw.ImageDraw, centre: Point, tile: float, colour: Colour) -> None:
    """A round fruit with a stem and a leaf."""
    x, y = centre
    size = max(0.26 * tile, 6.0)
    rim = max(1.0, 0.22 * size)
    top = y - 0.7 * size
    _disc(draw, x, y + 0.1 * size, size + rim, INK)
    draw.line([(x, top + 0.3 * size), (x, top - 0.75 * size)], INK, max(2, round(0.28 * size)))
    # The leaf leans away from the stem: an ellipse to its right.
    left, right = x + 0.05 * size, x + 1.15 * size
    draw.ellipse((left, top - 0.85 * size, right, top - 0.05 * size), INK)
    inset = 0.5 * rim
    box = (left + inset, top - 0.85 * size + inset, right - inset, top - 0.05 * size - inset)
    draw.ellipse(box, LEAF)
    _disc(draw, x, y + 0.1 * size, size, colour)


def medkit(draw: ImageDraw.ImageDraw, centre: Point, tile: float, colour: Colour) -> None:
    """A white box with a red cross."""
    del colour
    x, y = centre
    size = max(0.3 * tile, 8.0)
    rim = max(1.0, 0.18 * size)
    _square(draw, x, y, size + rim, size + rim, INK)
    _square(draw, x, y, size, size, BOX)
    long, wide = 0.7 * size, 0.27 * size
    _square(draw, x, y, long, wide, CROSS)
    _square(draw, x, y, wide, long, CROSS)


def disc(draw: ImageDraw.ImageDraw, centre: Point, tile: float, colour: Colour) -> None:
    """A disc with an outline."""
    size = max(0.22 * tile, 6.0)
    _disc(draw, *centre, size + max(1.0, 0.22 * size), INK)
    _disc(draw, *centre, size, colour)


def picture(draw: ImageDraw.ImageDraw, centre: Point, tile: float, row: Thing, label: int) -> None:
    """The picture of a billboard in its two colours, with an outline."""
    side = round(max(0.8 * tile, 20.0))
    planes = planes_of(load_art(row.art)).astype(np.uint8) * 255
    masks = [Image.fromarray(plane).resize((side, side)) for plane in planes]
    corner = round(centre[0] - side / 2), round(centre[1] - side / 2)
    outline = masks[0].filter(ImageFilter.MaxFilter(2 * round(0.05 * side) + 1))
    for mask, paint in zip((outline, *masks), (INK, *row.paints(label)), strict=True):
        draw.bitmap(corner, mask, tuple(map(round, paint)))


GLYPHS: dict[str, Callable[[ImageDraw.ImageDraw, Point, float, Colour], None]] = {
    "apple": apple,
    "key": key,
    "medkit": medkit,
    "star": star,
}
"""The drawings that things refer to by name."""


def arrow(
    draw: ImageDraw.ImageDraw, centre: Point, size: float, heading: float, colour: Colour
) -> None:
    """An arrow head that points along `heading`, in radians clockwise from the right."""
    corners = ((0.0, 1.0), (2.45, 0.85), (math.pi, 0.35), (-2.45, 0.85))
    for paint, radius in ((INK, 1.3 * size), (colour, size)):
        points = [_polar(centre, heading + turn, radius * share) for turn, share in corners]
        draw.polygon(points, paint)


def blend(first: Colour, second: Colour, share: float) -> Colour:
    """The colour at a fraction `share` of the way from the first to the second."""
    red, green, blue = (round(a + (b - a) * share) for a, b in zip(first, second, strict=True))
    return red, green, blue


def _disc(draw: ImageDraw.ImageDraw, x: float, y: float, radius: float, colour: Colour) -> None:
    draw.ellipse((x - radius, y - radius, x + radius, y + radius), colour)


def _square(
    draw: ImageDraw.ImageDraw, x: float, y: float, wide: float, high: float, colour: Colour
) -> None:
    """A rectangle, given by its centre and half its sides."""
    left, top = round(x - wide), round(y - high)
    right, bottom = round(x + wide) - 1, round(y + high) - 1
    draw.rectangle((left, top, max(left, right), max(top, bottom)), colour)


def _polar(centre: Point, angle: float, radius: float) -> Point:
    return centre[0] + math.cos(angle) * radius, centre[1] + math.sin(angle) * radius
