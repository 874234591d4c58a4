"""Pictures on walls, floor, ceiling and billboards: an atlas of texels, and tables of its parts.

The atlas holds every texel in every shade, so a pixel is one word fetched from it. A picture's
texels lie column by column, each from top to bottom.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np

from ..pytree import PyTreeNode, static
from .level import WORD, Array
from .shade import pack_rgb

SHADES = 32
"""Steps of brightness; 0 is full light."""
Place = tuple[float, float]
"""(column, row) within a pixel, from 0 at its left and upper edge to 1."""
CENTRE: Place = (0.5, 0.5)


@dataclass(frozen=True)
class Sampling:
    """Where in a pixel a ray looks.

    Attributes:
        wall: of walls; the row decides where a wall begins and ends as well.
        plane: of floor and ceiling.
        thing: of billboards.
        light_row: row at which the light of floor and ceiling is taken.
        samples: 1, or 2 for the mean of two halves of each pixel, left and right, of which the
            columns above are places.
        screen: columns of a screen on which walls and billboards begin and end at whole columns,
            as in old games; the image's are taken out of them. 0 for exact places.
    """

    wall: Place = CENTRE
    plane: Place = CENTRE
    thing: Place = CENTRE
    light_row: float = 0.5
    samples: int = 1
    screen: int = 0


class Materials(PyTreeNode):
    """Pictures on walls, from the wall's top on down and repeated both ways; M of them.

    Attributes:
        first: int32[M], the picture's first texel in the atlas.
        width: int32[M], in texels; a power of two, as the height.
        height: int32[M].
        across: int32[M], texels a tile from left to right.
        down: float32[M], texels a tile from top to bottom.
        offset: int32[M], added to the texel column, which is 0 where x or y is 0 on the map, and at
            the left end of a free wall.
        begin: int32[M], the texel column at which a wall begins, before the offset is added; None
            if walls have no ends, or free walls begin at 0.
        length: int32[M], texel columns of it; None if walls have no ends, or for free walls as many
            as `across` gives.
    """

    first: np.ndarray
    width: np.ndarray
    height: np.ndarray
    across: np.ndarray
    down: np.ndarray
    offset: np.ndarray
    begin: np.ndarray | None = None
    length: np.ndarray | None = None


class Flats(PyTreeNode):
    """Pictures of the ceiling and of the floor, in this order, north up.

    Attributes:
        first: int32[2], the picture's first texel in the atlas.
        width: int32[2], in texels; a power of two, as the height.
        height: int32[2].
        scale: float32[2, 2], texels a tile along x and along y.
        origin: float32[2, 2], texels added to both.
    """

    first: np.ndarray
    width: np.ndarray
    height: np.ndarray
    scale: np.ndarray
    origin: np.ndarray


class Cutouts(PyTreeNode):
    """Pictures of billboards of any size with transparent texels; S of them, in C columns.

    Attributes:
        first: int32[S], the picture's first texel in the atlas.
        width: int32[S], in texels.
        height: int32[S].
        half_width: float32[S], tiles from the middle to either side.
        top: float32[S], tiles from the eye's height down to the upper edge.
        bottom: float32[S], and to the lower one.
        bright: bool[S], whether it is shown in full light.
        column: int32[S], its first column in `opaque`.
        opaque: uint32[words, C + 1], the opaque texels of each column as bits of one word or more,
            the greatest bit of the first word on top; the last column is empty.
        left: int32[S], the first column of the picture without the empty ones that centre it, for
            `Sampling.screen`; None for 0.
        right: int32[S], the column after its last one; None for the width.
    """

    first: np.ndarray
    width: np.ndarray
    height: np.ndarray
    half_width: np.ndarray
    top: np.ndarray
    bottom: np.ndarray
    bright: np.ndarray
    column: np.ndarray
    opaque: np.ndarray
    left: np.ndarray | None = None
    right: np.ndarray | None = None


class Textures(PyTreeNode):
    """The pictures of a `scene.Theme`, in numpy: constants of the program.

    Attributes:
        atlas: uint32[SHADES * T], packed colours; texel t in shade s is at s * T + t.
        walls: pictures on walls.
        of_wall: int32[n], row of `walls` for each entry of `Level.walls`.
        of_face: int32[4, R, C], row of `walls` for each face of a level of that size, margin
            included, in the order west, east, north, south, or int32[L] for each of its free walls;
            None to ask `of_wall`.
        flats: pictures of ceiling and floor.
        cutouts: pictures of billboards, in the order of `Sprites.picture`.
        sampling: where in a pixel rays look.
    """

    atlas: np.ndarray
    walls: Materials
    of_wall: np.ndarray
    flats: Flats
    cutouts: Cutouts
    of_face: np.ndarray | None = None
    sampling: Sampling = static(default=Sampling())

    @property
    def size(self) -> int:
        """Texels of one shade."""
        return len(self.atlas) // SHADES

    def __repr__(self) -> str:
        """Short, as that of `scene.Theme`."""
        return f"Textures({self.size} texels)"


def darkened(picture: np.ndarray, shade: int) -> np.ndarray:
    """uint32[height, width]: packed colours of [height, width, 3] in a shade: a factor."""
    light = np.float32(1 - shade / SHADES)
    return pack_rgb(list(np.moveaxis(picture, -1, 0).astype(np.float32)), light)


def build_atlas(
    pictures: Sequence[np.ndarray], paint: Callable[[np.ndarray, int], np.ndarray] = darkened
) -> tuple[np.ndarray, np.ndarray]:
    """The atlas of some pictures, and int32[pictures], the first texel of each.

    Args:
        pictures: [height, width, ...] each, of what `paint` takes; the atlas keeps one object once.
        paint: a function of (picture, shade) that gives uint32[height, width] of words 0x00BBGGRR.
    """
    places: dict[int, int] = {}
    parts, size = [], 0
    for picture in pictures:
        if id(picture) not in places:
            places[id(picture)] = size
            shades = np.stack([paint(picture, shade).T for shade in range(SHADES)])
            parts.append(shades.reshape(SHADES, -1))
            size += parts[-1].shape[1]
    atlas = np.concatenate(parts, axis=1).reshape(-1)
    return atlas, np.array([places[id(picture)] for picture in pictures], np.int32)


def pack_opaque(masks: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """`Cutouts.column` and `Cutouts.opaque` of the bool[height, width] of each picture."""
    words = max(-(-len(mask) // WORD) for mask in masks)
    weights = np.left_shift(np.uint32(1), np.arange(WORD, dtype=np.uint32)[::-1])[:, None]
    columns = []
    for mask in masks:
        padded = np.pad(mask, ((0, words * WORD - len(mask)), (0, 0)))
        bits = np.where(padded.reshape(words, WORD, -1), weights, np.uint32(0))
        columns.append(bits.sum(axis=1, dtype=np.uint32))
    opaque = np.concatenate([*columns, np.zeros((words, 1), np.uint32)], axis=1)
    ends = np.cumsum([part.shape[1] for part in columns])
    return np.concatenate([[0], ends[:-1]]).astype(np.int32), opaque


def sides_of(pictures: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """int32[n] twice: the widths and the heights of pictures."""
    heights, widths = zip(*(picture.shape[:2] for picture in pictures), strict=True)
    return np.array(widths, np.int32), np.array(heights, np.int32)


def shade_of(light: Any) -> Any:
    """int32: the shade that is nearest to a light from 0 to 1; numpy in, numpy out."""
    xp = np if isinstance(light, np.ndarray) else jnp
    step = xp.rint((1 - light) * np.float32(SHADES))
    return xp.clip(step, 0, SHADES - 1).astype(np.int32)


def entry(table: Array, index: Any) -> Any:
    """Entries of a table [n] without looking up those that are the same in all of it."""
    if isinstance(table, np.ndarray) and (table == table[0]).all():
        return jnp.full(index.shape, table[0])
    return jnp.asarray(table).at[index].get(mode="promise_in_bounds")
