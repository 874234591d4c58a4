"""Textures of walls, floor, ceiling and billboards: an atlas of texels, and tables that index it.

The atlas holds every texel in every shade, so a pixel is one word of it. The texels of a picture
are stored column by column, each from top to bottom.
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
"""Levels of brightness; shade 0 is full light."""
COVER, ADD, MEAN = range(3)
"""How a picture meets what is behind it."""
Place = tuple[float, float]
"""A point (column, row) in a pixel, from (0, 0) at the upper left corner to (1, 1)."""
CENTRE: Place = (0.5, 0.5)


@dataclass(frozen=True)
class Sampling:
    """The point of a pixel at which textures are sampled.

    Attributes:
        wall: the point for walls; its row also decides where a wall begins and ends.
        plane: the point for floor and ceiling.
        thing: the point for billboards.
        light_row: the row at which the light of floor and ceiling is computed.
        samples: 1, or 2 to average the left and the right half of each pixel; the points above are
            then points of each half.
        screen: the width of a screen on which walls and billboards begin and end at whole columns,
            as in old games; the columns of the image are some of its columns. 0 for exact edges.
    """

    wall: Place = CENTRE
    plane: Place = CENTRE
    thing: Place = CENTRE
    light_row: float = 0.5
    samples: int = 1
    screen: int = 0


class Materials(PyTreeNode):
    """M pictures on walls, which start at the top of the wall and repeat both ways.

    Attributes:
        first: int32[M], the first texel of the picture in the atlas; a JAX array if it differs
            between the scenes of one program.
        width: int32[M], in texels, a power of two.
        height: int32[M], in texels, a power of two.
        across: int32[M], texels per tile from left to right.
        down: float32[M], texels per tile from top to bottom.
        offset: int32[M], added to the texel column, which is 0 where x or y is 0 on the map, and at
            the left end of a free wall.
        begin: int32[M], the texel column at which the wall begins, before the offset is added;
            None if walls have no ends. Free walls begin at 0 if it is None.
        length: int32[M], the length of the wall in texel columns; None if walls have no ends. The
            length of a free wall follows from `across` if it is None.
        row: int32[M], the texel row at the top of the wall; None for 0.
    """

    first: Array
    width: np.ndarray
    height: np.ndarray
    across: np.ndarray
    down: np.ndarray
    offset: np.ndarray
    begin: np.ndarray | None = None
    length: np.ndarray | None = None
    row: np.ndarray | None = None


class Flats(PyTreeNode):
    """Pictures of the ceiling and the floor, in this order, with north at the top.

    Attributes:
        first: int32[2], the first texel of the picture in the atlas, as in `Materials`.
        width: int32[2], in texels, a power of two.
        height: int32[2], in texels, a power of two.
        scale: float32[2, 2], texels per tile along x and along y.
        origin: float32[2, 2], texels added along x and along y.
    """

    first: Array
    width: np.ndarray
    height: np.ndarray
    scale: np.ndarray
    origin: np.ndarray


class Cutouts(PyTreeNode):
    """S pictures of billboards, of any size and with transparent texels, in C columns in total.

    Attributes:
        first: int32[S], the first texel of the picture in the atlas, as in `Materials`.
        width: int32[S], texels from one side of the billboard to the other.
        height: int32[S], in texels.
        half_width: float32[S], tiles from the middle to either side.
        top: float32[S], tiles from the height of the eye down to the upper edge.
        bottom: float32[S], tiles from the height of the eye down to the lower edge.
        bright: bool[S], whether the picture is always in full light.
        column: int32[S], the first column of the picture in `opaque`.
        opaque: uint32[words, C + 1], the opaque texels of each column as bits of one or more words;
            the highest bit of the first word is the top. The last column is empty.
        left: int32[S], the column of the billboard at which the picture begins; `opaque` and the
            atlas lack the columns before it. For `Sampling.screen`; None for 0.
        right: int32[S], the column after its last one; None for the width.
        mirrored: bool[S], whether the picture's columns run from right to left; likewise; None if
            none do.
        blend: int32[S], `COVER`, `ADD` or `MEAN`; None if all pictures cover what is behind them.
    """

    first: Array
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
    mirrored: np.ndarray | None = None
    blend: np.ndarray | None = None


class Stamps(PyTreeNode):
    """Pictures that lie over the image, such as a weapon in the player's hands; S of them.

    They are in full light. Places are on a screen of 320 by 200, which fills the image.

    Attributes:
        first, width, height, column, opaque: as those of `Cutouts`.
        left: int32[S], columns from the left edge of a picture at the place (0, 0) to the screen's.
        top: int32[S], rows from its upper edge to the screen's.
        sway: by how much pictures are moved: to either side at most, and down at least and at most.
    """

    first: Array
    width: np.ndarray
    height: np.ndarray
    column: np.ndarray
    opaque: np.ndarray
    left: np.ndarray
    top: np.ndarray
    sway: tuple[int, int, int] = static(default=(0, 0, 0))


class Textures(PyTreeNode):
    """The pictures of a `scene.Theme` in numpy, which are constants of the program but for `first`.

    Attributes:
        atlas: uint32[SHADES * T + E], packed colours; texel t in shade s is at s * T + t.
        walls: the pictures on walls.
        of_wall: int32[n], the row of `walls` for each entry of `Level.walls`.
        of_face: int32[4, R, C], the row of `walls` for each face of a level of that size, margin
            included, in the order west, east, north, south; int32[L] for each of its free walls;
            None to use `of_wall`.
        flats: the pictures of ceiling and floor.
        cutouts: the pictures of billboards, in the order of `Sprites.picture`.
        sampling: the points of a pixel at which textures are sampled.
        extra: E, texels after those in all shades: they are in full light only.
        stamps: pictures that lie over the image, in the order of `Held.picture`, or None.
        blends: uint32[2**15], the packed colour for each colour of five bits a channel, red
            highest, to which sums and means of colours are rounded; None if all pictures cover
            what is behind them.
    """

    atlas: np.ndarray
    walls: Materials
    of_wall: np.ndarray
    flats: Flats
    cutouts: Cutouts
    of_face: np.ndarray | None = None
    sampling: Sampling = static(default=Sampling())
    extra: int = static(default=0)
    stamps: Stamps | None = None
    blends: np.ndarray | None = None

    @property
    def size(self) -> int:
        """The number of texels in one shade."""
        return (len(self.atlas) - self.extra) // SHADES

    def __repr__(self) -> str:
        """A short form, as for `scene.Theme`."""
        return f"Textures({self.size} texels)"


def darkened(picture: np.ndarray, shade: int) -> np.ndarray:
    """uint32[height, width]: the packed colours of [height, width, 3] in a shade."""
    light = np.float32(1 - shade / SHADES)
    return pack_rgb(list(np.moveaxis(picture, -1, 0).astype(np.float32)), light)


def build_atlas(
    pictures: Sequence[np.ndarray], paint: Callable[[np.ndarray, int], np.ndarray] = darkened
) -> tuple[np.ndarray, np.ndarray]:
    """The atlas of pictures, and int32[pictures]: the first texel of each.

    Args:
        pictures: arrays [height, width, ...] that `paint` accepts; the atlas holds an object once.
        paint: a function of (picture, shade) that returns words uint32[height, width] 0x00BBGGRR.
    """
    parts, first = _laid_out(
        pictures, lambda picture: np.stack([paint(picture, shade).T for shade in range(SHADES)])
    )
    return np.concatenate(parts, axis=1).reshape(-1), first


def append_bright(
    atlas: np.ndarray,
    pictures: Sequence[np.ndarray],
    paint: Callable[[np.ndarray, int], np.ndarray] = darkened,
) -> tuple[np.ndarray, np.ndarray]:
    """An atlas with more pictures, in full light only; the result is that of `build_atlas`."""
    if not pictures:
        return atlas, np.zeros(0, np.int32)
    parts, first = _laid_out(pictures, lambda picture: paint(picture, 0).T[None])
    return np.concatenate([atlas, *(part[0] for part in parts)]), first + np.int32(len(atlas))


def _laid_out(
    pictures: Sequence[np.ndarray], paint: Callable[[np.ndarray], np.ndarray]
) -> tuple[list[np.ndarray], np.ndarray]:
    """uint32[shades, texels] of each object; int32[pictures], the place of its first texel."""
    places: dict[int, int] = {}
    parts, size = [], 0
    for picture in pictures:
        if id(picture) not in places:
            places[id(picture)] = size
            painted = paint(picture)
            parts.append(painted.reshape(len(painted), -1))
            size += parts[-1].shape[1]
    return parts, np.array([places[id(picture)] for picture in pictures], np.int32)


def kept_once(pictures: Sequence[np.ndarray]) -> list[np.ndarray]:
    """The same pictures, with equal ones as one object, which an atlas holds once."""
    known: dict[tuple[tuple[int, ...], bytes], np.ndarray] = {}
    return [known.setdefault((one.shape, one.tobytes()), one) for one in pictures]


def pack_opaque(masks: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """`Cutouts.column` and `Cutouts.opaque` for masks bool[height, width] of pictures."""
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
    """The widths int32[n] and the heights int32[n] of pictures."""
    heights, widths = zip(*(picture.shape[:2] for picture in pictures), strict=True)
    return np.array(widths, np.int32), np.array(heights, np.int32)


def shade_of(light: Any) -> Any:
    """int32: the shade nearest to a light from 0 to 1; NumPy in, NumPy out."""
    xp = np if isinstance(light, np.ndarray) else jnp
    step = xp.rint((1 - light) * np.float32(SHADES))
    return xp.clip(step, 0, SHADES - 1).astype(np.int32)


def entry(table: Array, index: Any) -> Any:
    """Entries of a table [n]; a table of equal entries needs no lookup."""
    if isinstance(table, np.ndarray) and (table == table[0]).all():
        return jnp.full(index.shape, table[0])
    return jnp.asarray(table).at[index].get(mode="promise_in_bounds")
