"""Pictures drawn anew for each episode: `look="random"`.

Walls, floor and ceiling lie where `look="game"` has them, but each of the map's textures shows one
of `PICTURES` patterns, and each kind of thing has one of `SHADES_OF_THINGS` colours.
"""

from __future__ import annotations

import colorsys
import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ...engine.art import SIZE, planes_of
from ...engine.art.patterns import wall_patterns
from ...engine.level import Level
from ...engine.scene import Scene, Theme
from ...engine.textures import Flats, Textures, build_atlas
from ..draws import sample_unit
from ..dressing import square_cutouts, thing_picture
from ..looks import hashed
from .game_look import sampling
from .game_walls import free_walls, wall_materials, wall_rows
from .maps import DoomMap, TileGrid

PICTURES, SHADES_OF_THINGS = 32, 4
SIDE = 64
"""Texels and map units from one side of a pattern to the other."""
# Texels a side of the squares of noise, from coarse to fine; the range of its strength.
_OCTAVES, _NOISE = (16, 8, 4, 2, 1), (0.0, 0.5)
# How far the colours of things move towards random ones.
_TINT = 0.4


class RandomLook(NamedTuple):
    """What a scenario shows with `look="random"`.

    Attributes:
        level: the map for the renderer, with walls where the game has them.
        theme: the look of the map, whose textures lack the places of pictures.
        surface: int32[L], the number of the texture of each wall.
        surfaces: the number of textures, those of ceiling and floor included, which come last.
        patterns: int32[pictures], the first texel of each pattern.
        things: int32[shades, S], the first texel of each thing's picture in each shade.
        kind: int32[S], the kind of thing that each picture shows.
        kinds: the number of kinds.
    """

    level: Level
    theme: Theme
    surface: np.ndarray
    surfaces: int
    patterns: np.ndarray
    things: np.ndarray
    kind: np.ndarray
    kinds: int

    def dressed(self, scene: Scene, seed: jax.Array, share: float) -> Scene:
        """The plain scene of a state in the look of a seed.

        Args:
            scene: the scene.
            seed: uint32[]; equal seeds give equal looks.
            share: the probability of a random picture for each texture and kind of thing; others
                have the same picture in each episode.
        """
        count = self.surfaces + self.kinds
        unit = sample_unit(hashed(seed, 2 * count)).reshape(2, count)
        redrawn = unit[0] < share
        own = np.arange(count, dtype=np.int32) % np.int32(PICTURES)
        own[self.surfaces :] = 0
        limits = np.repeat(
            np.array([PICTURES, SHADES_OF_THINGS], np.float32), [self.surfaces, self.kinds]
        )
        drawn = jnp.where(redrawn, (unit[1] * limits).astype(jnp.int32), own)
        patterns = jnp.asarray(self.patterns)[drawn[: self.surfaces]]
        shade = drawn[self.surfaces :][self.kind]
        things = jnp.asarray(self.things)[shade, np.arange(len(self.kind))]
        textures = self.theme.textures
        assert textures is not None
        return scene.replace(
            level=self.level,
            theme=self.theme.replace(
                textures=textures.replace(
                    walls=textures.walls.replace(first=patterns[self.surface]),
                    flats=textures.flats.replace(first=patterns[-2:]),
                    cutouts=textures.cutouts.replace(first=things),
                )
            ),
        )


def build_random_look(
    theme: Theme, level: Level, doom_map: DoomMap, tiles: TileGrid, size: tuple[int, int, int]
) -> RandomLook:
    """The random look of a scenario.

    Args:
        theme: its plain look.
        level: the map for the renderer with other looks.
        doom_map: the map.
        tiles: the map as tiles.
        size: rows and columns of the view, and samples for each pixel.
    """
    names = sorted({wall.texture for wall in doom_map.walls})
    surface = np.array([names.index(wall.texture) for wall in doom_map.walls], np.int32)
    labels, kind = np.unique(theme.sprite_labels, return_inverse=True)
    things = [thing_picture(theme, i) for i in range(len(kind))]
    shaded = [
        _tinted(picture, shade, int(of))
        for shade in range(SHADES_OF_THINGS)
        for picture, of in zip(things, kind, strict=True)
    ]
    atlas, first = build_atlas([*random_pictures(), *shaded])
    patterns, first = first[:PICTURES], first[PICTURES:].reshape(SHADES_OF_THINGS, -1)
    count = len(doom_map.walls)
    sides = np.full(count, SIDE, np.int32)
    textures = Textures(
        atlas=atlas,
        walls=wall_materials(doom_map, tiles, patterns[surface % PICTURES], (sides, sides)),
        of_wall=np.zeros(256, np.int32),
        of_face=wall_rows(doom_map, tiles),
        flats=Flats(
            patterns[:2],
            *np.full((2, 2), SIDE, np.int32),
            scale=np.full((2, 2), tiles.unit, np.float32),
            origin=np.array([(tiles.west % SIDE, -tiles.north % SIDE)] * 2, np.float32),
        ),
        cutouts=square_cutouts(theme, things, first[0], {}),
        sampling=sampling(*size),
    )
    return RandomLook(
        level=level.replace(free_walls=free_walls(doom_map, tiles)),
        theme=theme.replace(textures=textures),
        surface=surface,
        surfaces=len(names) + 2,
        patterns=patterns,
        things=first,
        kind=kind.astype(np.int32),
        kinds=len(labels),
    )


def _tinted(picture: np.ndarray, shade: int, kind: int) -> np.ndarray:
    """uint8[height, width, 3]: a thing in one of its shades; shade 0 has its own colours."""
    colours = picture[..., :3]
    if shade == 0:
        return np.ascontiguousarray(colours)
    other = _colour(np.random.default_rng((shade, kind)))
    mixed = colours + np.float32(_TINT) * (other - colours.astype(np.float32))
    return (mixed + np.float32(0.5)).astype(np.uint8)


@functools.cache
def random_pictures() -> tuple[np.ndarray, ...]:
    """The patterns: uint8[SIDE, SIDE, 3] each, the same on every machine."""
    return tuple(_picture(number) for number in range(PICTURES))


def _picture(number: int) -> np.ndarray:
    """A pattern of two colours, under noise."""
    draw = np.random.default_rng((number, PICTURES))
    pattern = _PATTERNS[number % len(_PATTERNS)](draw)[..., None]
    first, second = _colour(draw), _colour(draw)
    strength = np.float32(draw.uniform(*_NOISE))
    image = np.where(pattern, second, first) * (1 + strength * (2 * _noise(draw)[..., None] - 1))
    return (np.clip(image, 0, 255) + np.float32(0.5)).astype(np.uint8)


def _colour(draw: np.random.Generator) -> np.ndarray:
    """float32[3]: an RGB colour; pale and dark ones are as frequent as in buildings."""
    hue, vivid, value = draw.random(3)
    return np.array(colorsys.hsv_to_rgb(hue, vivid**2, 0.15 + 0.8 * value), np.float32) * 255


def _noise(draw: np.random.Generator) -> np.ndarray:
    """float32[SIDE, SIDE], 0 to 1: squares of some sizes, each with a random brightness."""
    parts = [np.kron(draw.random((SIDE // n,) * 2), np.ones((n, n))) for n in _OCTAVES]
    weights = draw.dirichlet(np.ones(len(_OCTAVES)))
    return np.tensordot(weights, np.stack(parts), 1).astype(np.float32)


def _masonry(draw: np.random.Generator) -> np.ndarray:
    """One of the engine's patterns of walls, in twice its size."""
    words = wall_patterns()[draw.integers(len(wall_patterns())), 0]
    return np.kron(planes_of(words), np.ones((SIDE // SIZE,) * 2)).astype(bool)


def _bricks(draw: np.random.Generator) -> np.ndarray:
    """Joints of bricks or, without an offset of the courses, of tiles."""
    y, x = np.indices((SIDE, SIDE))
    high, wide = 2 ** draw.integers(3, 5), 2 ** draw.integers(3, 6)
    offset = wide // 2 * draw.integers(2) * (y // high % 2)
    return (y % high < 2) | ((x + offset) % wide < 2)


def _stripes(draw: np.random.Generator) -> np.ndarray:
    """Upright, level or slanted stripes."""
    y, x = np.indices((SIDE, SIDE))
    wide = 2 ** draw.integers(2, 6)
    along = (x, y, x + y, x - y)[draw.integers(4)]
    return along % wide < wide * draw.uniform(0.2, 0.6)


def _checks(draw: np.random.Generator) -> np.ndarray:
    """A checker."""
    y, x = np.indices((SIDE, SIDE))
    return (x // (side := 2 ** draw.integers(2, 6)) + y // side) % 2 == 1


def _spots(draw: np.random.Generator) -> np.ndarray:
    """Noise with a threshold."""
    noise = _noise(draw)
    return noise > np.quantile(noise, draw.uniform(0.3, 0.9))


def _bare(draw: np.random.Generator) -> np.ndarray:
    """One colour."""
    del draw
    return np.zeros((SIDE, SIDE), bool)


_PATTERNS = (_masonry, _bricks, _stripes, _checks, _spots, _bare)
