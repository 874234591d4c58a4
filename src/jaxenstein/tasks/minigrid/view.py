"""The rendering of a world of things and doors, including the hand and the instruction.

The thing in the hand is drawn small at the lower right, the thing that an instruction names at the
lower left. Both are billboards just in front of the eye, and only a wall right at the eye can hide
them. So an image has the same information as the `dict` observation.
"""

from __future__ import annotations

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from ...engine.art import load_art
from ...engine.camera import Camera
from ...engine.motion import forward
from ...engine.scene import Scene, Sprites, Theme
from ...maps.symbols import door_label
from ...maps.things import COLOURS
from ..appearance import build_theme
from .state import DOOR_KIND, KINDS, PORTABLE, GridState

# Tiles from the eye to the thing in the hand; nearer things would be behind the eye.
_NEAR = 0.06
# Sizes and positions of the small pictures, as shares of half the image's height and width.
_SIDE, _RIGHT, _LEFT, _NEXT = 0.2, 0.6, -0.75, -0.3


def theme_of(kinds: Sequence[int], camera: Camera, *, asks: bool) -> Theme:
    """The look of a world: each kind in its colours, and the portable kinds again, small.

    Args:
        kinds: the kinds that the world may have.
        camera: the camera of the environment, which determines where small pictures appear.
        asks: whether instructions name things and doors.
    """
    whole = tuple(label for kind in kinds for label in KINDS[kind].labels)
    small = tuple(label for kind in _small(kinds) for label in KINDS[kind].labels)
    theme = build_theme((*whole, *small), doors=True)
    drop, radius = _low(camera)
    table = np.arange(len(whole) + len(small)) < len(whole)
    theme = theme.replace(
        sprite_radius=np.where(table, theme.sprite_radius, radius).astype(np.float32),
        sprite_drop=np.where(table, theme.sprite_drop, drop).astype(np.float32),
    )
    # Instructions name things that can be carried, or doors if nothing can.
    return _with_doors(theme, radius, drop) if asks and not _small(kinds) else theme


def scene_of(
    state: GridState,
    theme: Theme,
    kinds: Sequence[int],
    camera: Camera,
    *,
    hands: bool,
    asks: bool,
) -> Scene:
    """The scene of a state; without hands or instructions, these cost nothing."""
    things = state.things
    pictures = _first_pictures(kinds, small=False)[things.kind]
    pictures = pictures + jnp.where(things.kind < PORTABLE, things.colour, 0)
    held = jnp.stack([_sum(things.kind, things.held), _sum(things.colour, things.held)])
    small = jnp.concatenate([jnp.where(jnp.any(things.held), held, -1)[None], state.asked])
    shown = np.flatnonzero([hands and bool(_small(kinds)), asks, asks]).astype(np.int32)
    small, places = small[shown], np.array((_RIGHT, _LEFT, _NEXT), np.float32)[shown]
    places = places * np.float32(camera.half_plane * _NEAR)
    ahead = forward(state.heading)
    aside = jnp.stack([-ahead[1], ahead[0]])
    before = state.position[None] + _NEAR * ahead[None] + places[:, None] * aside[None]
    kind = jnp.clip(small[:, 0], 0, DOOR_KIND)
    smalls = _first_pictures(kinds, small=True)
    return Scene(
        level=state.level,
        closed=~state.doors.opened,
        position=state.position,
        heading=state.heading,
        sprites=Sprites(
            position=jnp.concatenate([things.tile.astype(jnp.float32) + 0.5, before]),
            picture=jnp.concatenate([pictures, smalls[kind] + small[:, 1]]),
            visible=jnp.concatenate([things.lying, small[:, 0] >= 0]),
        ),
        theme=theme,
    )


def _small(kinds: Sequence[int]) -> tuple[int, ...]:
    return tuple(kind for kind in kinds if kind < PORTABLE)


def _first_pictures(kinds: Sequence[int], *, small: bool) -> jax.Array:
    """int32[kinds and the door], the picture of each kind's first colour; 0 if it has none."""
    count = sum(len(KINDS[kind].labels) for kind in kinds) if small else 0
    firsts = np.zeros(DOOR_KIND + 1, np.int32)
    for kind in _small(kinds) if small else kinds:
        firsts[kind] = count
        count += len(KINDS[kind].labels)
    firsts[DOOR_KIND] = count
    return jnp.asarray(firsts)


def _sum(values: jax.Array, which: jax.Array) -> jax.Array:
    return jnp.sum(jnp.where(which, values, 0), dtype=jnp.int32)


def _low(camera: Camera) -> tuple[float, float]:
    """How far below the eye the small pictures are, and half their side, in tiles."""
    half = camera.height / (2 * camera.row_focal)
    radius = _SIDE * min(half, camera.half_plane)
    return (half - 1.15 * radius) * _NEAR, radius * _NEAR


def _with_doors(theme: Theme, radius: float, drop: float) -> Theme:
    """A theme with a small door in each colour."""
    count = len(COLOURS)
    shades = np.array([[rgb, [0.5 * part for part in rgb]] for _, rgb in COLOURS], np.float32)
    labels = [door_label(colour, locked=False) for colour in range(count)]
    return theme.replace(
        sprite_art=np.concatenate([theme.sprite_art, np.stack([load_art("door-sign")] * count)]),
        sprite_colours=np.concatenate([theme.sprite_colours, shades]),
        sprite_radius=np.append(theme.sprite_radius, np.full(count, radius, np.float32)),
        sprite_drop=np.append(theme.sprite_drop, np.full(count, drop, np.float32)),
        sprite_labels=np.append(theme.sprite_labels, np.array(labels, np.uint8)),
    )
