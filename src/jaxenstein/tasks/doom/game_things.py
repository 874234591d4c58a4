"""The game's own pictures of things: which one a thing shows, and their tables."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ...engine.scene import Theme
from ...engine.textures import COVER, Cutouts, kept_once, pack_opaque, sides_of
from .fixed import ONE, direction
from .view import EYE
from .wad import ROTATIONS, Wad, WadPicture

# Marines wear another green: colours of the palette from the first to the second, moved by so many.
MARINES, GREENS, BROWNER = "PLAY", (112, 127), 16


@dataclass(frozen=True)
class Look:
    """A picture of a thing, from all sides.

    Attributes:
        sprite: the four letters of its name.
        letter: of its frame.
        bright: whether it is in full light.
        blend: how it meets what is behind it (`engine.textures`).
        height: of the thing above the floor, in map units.
        picture: the picture that shows the thing in images of labels and depth, counted over the
            part's objects; -1 if those images do not have the thing.
        green: whether a marine keeps the green of the picture, as the player does.
    """

    sprite: str
    letter: str = "A"
    bright: bool = False
    blend: int = COVER
    height: int = 0
    picture: int = 0
    green: bool = False


class Shown(NamedTuple):
    """The things of a part as the game shows them.

    Attributes:
        places: int32[N, 2], map units in 16.16.
        looks: int32[N], counted over the part's looks.
        visible: bool[N].
        facing: uint32[N], their headings; None if their pictures have no sides.
    """

    places: jax.Array
    looks: jax.Array
    visible: jax.Array
    facing: jax.Array | None = None


@dataclass(frozen=True)
class Frame:
    """A picture of a thing: its letter, how many tics it is shown, and if in full light.

    `height` is that of the thing above the floor, in map units.
    """

    letter: str = "A"
    tics: int = 1
    bright: bool = False
    height: int = 0


@dataclass(frozen=True)
class Animation:
    """The pictures that a thing shows in turn.

    Attributes:
        sprite: the four letters of its pictures' names.
        frames: its frames.
        start: the age at which the first frame begins, in tics.
        once: how many of the first frames are not repeated.
    """

    sprite: str
    frames: tuple[Frame, ...] = (Frame(),)
    start: int = 0
    once: int = 0

    @functools.cached_property
    def looks(self) -> tuple[Frame, ...]:
        """Its frames without their durations, each once."""
        return tuple(dict.fromkeys(replace(frame, tics=1) for frame in self.frames))

    def look_at(self, age: jax.Array) -> jax.Array:
        """int32[...]: the index in `looks` at an age int32[...] in tics."""
        looks = [self.looks.index(replace(frame, tics=1)) for frame in self.frames]
        tics = [frame.tics for frame in self.frames]
        first, every = sum(tics[: self.once]), sum(tics[self.once :])
        tic = age - self.start
        again = first + (tic - first) % every
        tic = jnp.where(tic < first, jnp.maximum(tic, 0), again) if first else again
        table = np.repeat(np.array(looks, np.int32), tics)
        return jnp.asarray(table).at[tic].get(mode="promise_in_bounds")


def falling(*frames: Frame) -> tuple[Frame, ...]:
    """The frames in the tics in which a thing falls from the height at which scripts make it.

    Gravity adds a map unit per tic to its speed, as in the game.
    """
    heights = [20, 19, 17, 14, 10, 5]
    return tuple(replace(frame, height=z) for frame, z in zip(frames, heights, strict=True))


_SWAY = [Frame(letter, 6) for letter in "ABCDCB"]
_BOTTLE = [Frame(frame.letter) for frame in _SWAY for _ in range(frame.tics)]
# A thing that a script made: its age is 0 in the first tic that shows it, the second of its frame.
_MEDKIT = Animation("MEDI", (*falling(*[Frame()] * 6), Frame()), once=6)
ANIMATIONS = {
    "GreenArmor": Animation("ARM1", (Frame("A", 6), Frame("B", 7, bright=True)), start=11),
    "Medikit": _MEDKIT,
    "CustomMedikit": _MEDKIT,
    "Poison": Animation("BON1", (*falling(*_BOTTLE[1:7]), *_BOTTLE[7:], *_BOTTLE[:7]), once=6),
}
"""The pictures of things, by the game's names."""
_BEGIN = ANIMATIONS["GreenArmor"].start
LYING = {
    "Medikit": Animation("MEDI"),
    "Stimpack": Animation("STIM"),
    "HealthBonus": Animation("BON1", tuple(_SWAY), _BEGIN),
    "ArmorBonus": Animation("BON2", tuple(_SWAY), _BEGIN),
    "GreenArmor": ANIMATIONS["GreenArmor"],
    "BlueArmor": Animation("ARM2", (Frame("A", 6), Frame("B", 6, bright=True)), _BEGIN),
    "ClipBox": Animation("AMMO"),
    "ShellBox": Animation("SBOX"),
    "RocketBox": Animation("BROK"),
    "Chainsaw": Animation("CSAW"),
    "SuperShotgun": Animation("SGN2"),
    "Chaingun": Animation("MGUN"),
    "RocketLauncher": Animation("LAUN"),
}
"""The pictures of things that lie on the map from the start."""


def looks_of(animations: Sequence[Animation]) -> tuple[Look, ...]:
    """The pictures of animations, thing by thing."""
    return tuple(
        Look(one.sprite, frame.letter, frame.bright, height=frame.height, picture=number)
        for number, one in enumerate(animations)
        for frame in one.looks
    )


def looks_at(animations: Sequence[Animation], age: jax.Array, picture: jax.Array) -> jax.Array:
    """int32[N]: numbers of the looks of `looks_of`.

    Args:
        animations: of the things.
        age: int32[N], tics since each appeared or, if it always was there, since the game began.
        picture: int32[N], numbers of animations.
    """
    look, first = jnp.zeros_like(picture), 0
    for number, one in enumerate(animations):
        look = jnp.where(picture == number, first + one.look_at(age), look)
        first += len(one.looks)
    return look


def side_seen(eye: jax.Array, places: jax.Array, facing: jax.Array) -> jax.Array:
    """int32[N], 0 to 7: the eighth of a turn from which an eye sees things, 0 from the front.

    Args:
        eye: int32[2], map units in 16.16.
        places: int32[N, 2], likewise.
        facing: uint32[N], their headings.
    """
    offset = (places - eye[None]).astype(jnp.float32) * np.float32(1 / ONE)
    # The things' heading, turned such that the eighths begin at a right angle.
    turned = direction(facing - np.uint32(round(202.5 / 360 * 2**32)))
    cosine, sine = (part.astype(jnp.float32) for part in turned)
    x = offset[:, 0] * cosine + offset[:, 1] * sine
    y = offset[:, 1] * cosine - offset[:, 0] * sine
    half, steep = y < 0, jnp.abs(y) >= jnp.abs(x)
    # Within a half, from its start on: ahead and flat, ahead and steep, behind and steep, and flat.
    ahead = jnp.where(half, x < 0, x >= 0)
    quarter = jnp.where(ahead, steep.astype(jnp.int32), 3 - steep.astype(jnp.int32))
    return quarter + 4 * half.astype(jnp.int32)


@dataclass(frozen=True)
class MissileLook:
    """The pictures of a missile, all in full light.

    Attributes:
        sprite: the four letters of their names.
        flies: the letters in flight, in turn.
        tics: of each of them.
        bursts: letters of its explosion, and tics of each.
        blend: how they meet what is behind them.
        height: of the missile above the floor, in map units.
        turns: whether it looks different from its sides.
    """

    sprite: str
    flies: str
    tics: int
    bursts: tuple[tuple[str, int], ...]
    blend: int = COVER
    height: int = 0
    turns: bool = False

    def looks(self) -> tuple[Look, ...]:
        """The pictures in flight, and those of the explosion."""
        letters = [(letter, 0) for letter in self.flies] + [(one, 1) for one, _ in self.bursts]
        return tuple(
            Look(self.sprite, letter, True, self.blend, self.height, picture)
            for letter, picture in letters
        )

    def look_at(self, flies: jax.Array, age: jax.Array, since: jax.Array) -> jax.Array:
        """int32[M]: numbers of `looks`.

        Args:
            flies: bool[M], whether it is in flight.
            age: int32[M], tics since it was thrown.
            since: int32[M], tics since it exploded.
        """
        ends = np.cumsum([tics for _, tics in self.bursts])[:-1].astype(np.int32)
        burst = jnp.sum(since[:, None] >= ends[None], axis=1, dtype=jnp.int32)
        count = len(self.flies)
        return jnp.where(flies, age // self.tics % count, count + burst)


class Views(NamedTuple):
    """The rows of the tables of billboards that looks have.

    Attributes:
        first: int32[L], the first row of each look.
        turns: bool[L], whether it has a row for each side.
        look: int32[S], the look of each row.
        pictures: the picture of each row.
    """

    first: np.ndarray
    turns: np.ndarray
    look: np.ndarray
    pictures: list[WadPicture]

    def rows(self, shown: Shown, eye: jax.Array) -> jax.Array:
        """int32[N]: the row of each thing, as an eye at int32[2] sees it."""
        first = jnp.asarray(self.first).at[shown.looks].get(mode="promise_in_bounds")
        if shown.facing is None or not self.turns.any():
            return first
        side = side_seen(eye, shown.places, shown.facing)
        turns = jnp.asarray(self.turns).at[shown.looks].get(mode="promise_in_bounds")
        return first + jnp.where(turns, side, 0)

    def themed(self, theme: Theme, pictures: np.ndarray) -> Theme:
        """A theme with a row of the tables of billboards for each row.

        Args:
            theme: the theme.
            pictures: int[L], the row of the theme for each look; -1 for an empty picture.
        """
        rows = pictures[self.look]
        names = "sprite_art", "sprite_colours", "sprite_radius", "sprite_drop", "sprite_labels"
        tables = {name: getattr(theme, name)[rows] for name in names}
        tables["sprite_art"][rows < 0] = 0
        return theme.replace(**tables)


def read_views(wad: Wad, looks: Sequence[Look]) -> Views:
    """The pictures of looks."""
    first, turns, rows, pictures = [], [], [], []
    for number, look in enumerate(looks):
        sides = wad.sprite(look.sprite, look.letter)
        turned = any(side is not sides[0] for side in sides)
        first.append(len(pictures))
        turns.append(turned)
        shown = sides if turned else sides[:1]
        assert len(shown) in (1, ROTATIONS)
        pictures += [dressed(look, side) for side in shown]
        rows += [number] * len(shown)
    return Views(np.array(first, np.int32), np.array(turns), np.array(rows), pictures)


def dressed(look: Look, picture: WadPicture) -> WadPicture:
    """A picture of a look in the colours in which the game shows it."""
    if look.sprite != MARINES or look.green:
        return picture
    low, high = GREENS
    green = (picture.pixels >= low) & (picture.pixels <= high)
    pixels = picture.pixels - np.int16(BROWNER) * green.astype(np.int16)
    return WadPicture(pixels, picture.left, picture.top, picture.mirrored)


def as_in_file(pictures: Sequence[WadPicture]) -> list[np.ndarray]:
    """int16[height, width]: the same object for equal pictures and for mirrored ones."""
    return kept_once([one.pixels[:, ::-1] if one.mirrored else one.pixels for one in pictures])


def cutouts_of(
    looks: Sequence[Look], pictures: Sequence[WadPicture], first: np.ndarray, unit: int
) -> Cutouts:
    """The engine's table of pictures.

    Args:
        looks: the look of each picture.
        pictures: the pictures.
        first: int32[S], their first texels in the atlas.
        unit: map units a tile.
    """
    widths, heights = sides_of([picture.pixels for picture in pictures])
    left = np.array([picture.left for picture in pictures], np.int32)
    half = np.maximum(np.maximum(left, widths - left), 1)
    files = as_in_file(pictures)
    own = {id(pixels): pixels for pixels in files}
    column, opaque = pack_opaque([pixels >= 0 for pixels in own.values()])
    places = dict(zip(own, column, strict=True))
    height = np.array([look.height for look in looks])
    top = EYE - height - np.array([picture.top for picture in pictures])
    blend = np.array([look.blend for look in looks], np.int32)
    mirrored = np.array([picture.mirrored for picture in pictures])
    return Cutouts(
        first,
        2 * half,
        heights,
        half_width=(half / unit).astype(np.float32),
        top=(top / unit).astype(np.float32),
        bottom=((top + heights) / unit).astype(np.float32),
        bright=np.array([look.bright for look in looks]),
        column=np.array([places[id(pixels)] for pixels in files], np.int32),
        opaque=opaque,
        left=half - left,
        right=half - left + widths,
        mirrored=mirrored if mirrored.any() else None,
        blend=blend if blend.any() else None,
    )
