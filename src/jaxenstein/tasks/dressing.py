"""A theme with images of your own. Surfaces and things without an image keep their usual look."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..engine.art import SIZE, planes_of
from ..engine.art.patterns import FLOOR_PATTERNS
from ..engine.camera import Camera
from ..engine.image_columns import PANEL_SHADOW
from ..engine.scene import CEILING, FLOOR, Theme
from ..engine.shade import SEAM_SHADE, Light
from ..engine.textures import (
    SHADES,
    Cutouts,
    Flats,
    Materials,
    Textures,
    build_atlas,
    darkened,
    kept_once,
    pack_opaque,
    shade_of,
    sides_of,
)
from ..errors import SettingError
from ..images import Images, Picture, power_of_two

MOST_TEXELS = 1 << 20
"""The maximum number of texels of all images together: 128 MiB in all shades."""
# A wall in some shade is at least this share of the depth at which floor and ceiling have that
# shade, because some walls are darker than the floor at the same depth.
WALL_SHARE = 0.5


def dressed(theme: Theme, images: Images, camera: Camera) -> Theme:
    """Add textures to a theme of constant colours.

    An image on a wall is as high as the wall. Its width in tiles follows from its aspect ratio,
    rounded to a power of two, and it repeats across: a square image covers one tile of a wall that
    is one tile high. On floor and ceiling an image covers a square of about that size. On a thing
    it is as high as the thing's usual picture; alpha below 128 is transparent.

    Distant images are smoothed: the texels of each shade are averages over a pixel at the depth
    that has this shade.

    Raises:
        SettingError: the images have more than `MOST_TEXELS` together.
    """
    own = images.of_labels()
    span = power_of_two(camera.wall)
    count = len(theme.wall_colours)
    walls = [_wall(theme, label, own.get(label)) for label in range(count)]
    flats = [_ceiling(theme, own.get(CEILING)), _floor(theme, own.get(FLOOR))]
    things = [
        thing_picture(theme, i, own.get(int(label))) for i, label in enumerate(theme.sprite_labels)
    ]
    pictures = kept_once([*walls, *flats, *(rgba[..., :3] for rgba in things)])
    texels = sum({id(p): p.shape[0] * p.shape[1] for p in pictures}.values())
    if texels > MOST_TEXELS:
        raise SettingError(
            f"textures have {texels:,} texels together, more than {MOST_TEXELS:,}: give fewer or "
            "smaller images"
        )
    across = [_across(own.get(label), camera.wall, wall) for label, wall in enumerate(walls)]
    down = [len(wall) / camera.wall for wall in walls]
    scales = np.stack(
        [
            _scale(label, flat, own, span)
            for label, flat in zip((CEILING, FLOOR), flats, strict=True)
        ]
    )
    depths = depth_of_shades(theme.light)
    near = WALL_SHARE * depths / camera.row_focal
    # Floor and ceiling are seen at a slant, so a pixel covers a longer piece of them.
    far = depths / camera.row_focal * np.sqrt(np.maximum(depths / camera.eye, 1))
    sizes = [*(np.outer(near, rates) for rates in zip(across, down, strict=True))]
    sizes += [np.outer(far, scale) for scale in scales]
    covered = {id(p): size for p, size in zip(pictures[: count + 2], sizes, strict=True)}

    def paint(picture: np.ndarray, shade: int) -> np.ndarray:
        size = covered.get(id(picture))
        return darkened(picture if size is None else smoothed(picture, *size[shade]), shade)

    atlas, first = build_atlas(pictures, paint)
    textures = Textures(
        atlas=atlas,
        walls=Materials(
            first[:count],
            *sides_of(walls),
            np.array(across, np.int32),
            np.array(down, np.float32),
            np.zeros(count, np.int32),
        ),
        of_wall=np.arange(count, dtype=np.int32),
        flats=Flats(
            first[count : count + 2], *sides_of(flats), scales, np.zeros((2, 2), np.float32)
        ),
        cutouts=square_cutouts(theme, things, first[count + 2 :], own),
    )
    return theme.replace(textures=textures)


def depth_of_shades(light: Light) -> np.ndarray:
    """float[32]: the depth in tiles at which floor and ceiling get each shade; inf if never."""
    depth = np.geomspace(0.01, 256, 4096, dtype=np.float32)
    shades = shade_of(light.plain(depth))
    first = np.searchsorted(np.maximum.accumulate(shades), np.arange(SHADES))
    return np.append(depth, np.float32(np.inf))[first]


def smoothed(picture: np.ndarray, across: float, down: float) -> np.ndarray:
    """float[height, width, 3]: the mean of `across` by `down` texels; the picture repeats."""
    image = picture.astype(np.float64)
    for axis, wanted in ((0, down), (1, across)):
        length = picture.shape[axis]
        # An odd number of texels, or all.
        count = length if wanted >= length else 2 * round((max(wanted, 1) - 1) / 2) + 1
        if count >= length:
            image = np.broadcast_to(image.mean(axis=axis, keepdims=True), picture.shape)
        elif count > 1:
            reach = count // 2
            rows = np.arange(-reach - 1, length + reach) % length
            sums = np.take(image, rows, axis=axis).cumsum(axis=axis)
            ends = (np.arange(length) + start for start in (count, 0))
            last, before = (np.take(sums, end, axis=axis) for end in ends)
            image = (last - before) / count
    return image


def _across(own: Picture | None, wall: float, picture: np.ndarray) -> int:
    """Texels per tile of an image on a wall; `wall` is its height in tiles."""
    width = picture.shape[1]
    if own is None:
        return width
    return max(1, int(width / power_of_two(own.shape * wall)))


def _scale(label: int, flat: np.ndarray, own: Mapping[int, Picture], span: float) -> np.ndarray:
    """float32[2]: texels per tile along x and y."""
    tiles = span if label in own else 2
    return np.array([flat.shape[1] / tiles, flat.shape[0] / tiles], np.float32)


def _over(own: Picture, colour: np.ndarray) -> np.ndarray:
    """uint8[height, width, 3]: an image over a colour, which shows through transparent pixels."""
    alpha = own.pixels[..., 3:] / np.float32(255)
    return _rounded(own.pixels[..., :3] * alpha + colour * (1 - alpha))


def _rounded(colours: np.ndarray) -> np.ndarray:
    return (colours + np.float32(0.5)).astype(np.uint8)


def _wall(theme: Theme, label: int, own: Picture | None) -> np.ndarray:
    colour = np.asarray(theme.wall_colours[label], np.float32)
    if own is not None:
        return _over(own, colour)
    panel = int(theme.wall_panels[label])
    seams = theme.light == Light()
    shadow, accent = planes_of(np.asarray(theme.panels[panel]))
    flat = not (shadow.any() or accent.any())
    rows, columns = (1 if flat else SIZE), (SIZE if seams or not flat else 1)
    image = np.broadcast_to(colour, (rows, columns, 3)).copy()
    if not flat:
        image[shadow] *= np.float32(PANEL_SHADOW)
        image[accent] = theme.panel_accent
    if seams:
        image[:, [0, -1]] *= np.float32(1 - SEAM_SHADE / 2)
    return _rounded(image)


def _floor(theme: Theme, own: Picture | None) -> np.ndarray:
    colours = np.asarray(theme.floor, np.float32)
    if own is not None:
        return _over(own, colours.mean(axis=0))
    words = theme.floor_words
    words = FLOOR_PATTERNS["checker"] if words is None else np.asarray(words).tolist()
    along, down = (np.array([word >> (31 - i) & 1 for i in range(SIZE)]) for word in words)
    return _rounded(colours[along[None] ^ down[:, None]])


def _ceiling(theme: Theme, own: Picture | None) -> np.ndarray:
    colour = np.asarray(theme.ceiling, np.float32)
    return _rounded(colour[None, None]) if own is None else _over(own, colour)


def thing_picture(theme: Theme, picture: int, own: Picture | None = None) -> np.ndarray:
    """uint8[height, width, 4]: the picture of a billboard of the theme."""
    if own is not None:
        return own.pixels
    shape, detail = planes_of(np.asarray(theme.sprite_art[picture]))
    colours = np.asarray(theme.sprite_colours[picture], np.float32)
    colour = np.where(detail[..., None], colours[1], colours[0])
    alpha = np.where(shape, np.uint8(255), np.uint8(0))
    return np.concatenate([_rounded(colour), alpha[..., None]], axis=-1)


def square_cutouts(
    theme: Theme, things: list[np.ndarray], first: np.ndarray, own: Mapping[int, Picture]
) -> Cutouts:
    """The table of billboards; those without an image of your own are the theme's squares."""
    labels = np.asarray(theme.sprite_labels).tolist()
    shapes = [own[label].shape if label in own else 1.0 for label in labels]
    if not things:
        # The engine's tables cannot be empty.
        things, first = [np.zeros((1, 1, 4), np.uint8)], np.zeros(1, np.int32)
    column, opaque = pack_opaque([rgba[..., 3] >= 128 for rgba in things])
    radius, drop = (np.asarray(t, np.float32) for t in (theme.sprite_radius, theme.sprite_drop))
    return Cutouts(
        first,
        *sides_of(things),
        half_width=(radius * np.array(shapes)).astype(np.float32),
        top=drop - radius,
        bottom=drop + radius,
        bright=np.zeros(len(things), bool),
        column=column,
        opaque=opaque,
    )
