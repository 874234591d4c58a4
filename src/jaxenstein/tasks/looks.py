"""Other looks of the same world: patterns on walls and floor, and random colours per episode.

Doors, things and the parts that show an instruction do not change, because their colours have a
meaning.
"""

from __future__ import annotations

from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np

from ..engine.art.patterns import FLOOR_PATTERNS, wall_patterns
from ..engine.scene import Theme
from ..maps.symbols import DEFAULT_WALL, DOOR_LABELS
from .draws import mixed, sample_unit

Look = Literal["plain", "patterned", "random", "game"]
# Tiles from the eye at which a wall's pattern has faded: farther away it is finer than a pixel.
REACH = 9.0
# The range of random colours, for each of red, green and blue; the ceiling's are scaled down.
DARKEST, BRIGHTEST, CEILING_SHARE = 32.0, 248.0, 0.7
# The floor's second colour is its first one times a factor in this range.
FLOOR_SHADES = (0.6, 0.85)
# Label ids of walls come before those of doors.
_WALLS = DOOR_LABELS.start


def patterned(theme: Theme) -> Theme:
    """Add a pattern to the floor and to each wall without one, chosen by the wall's label."""
    panels = np.asarray(theme.panels)
    if not np.any(theme.wall_panels):
        panels = panels[:1]
    first, patterns = len(panels), wall_patterns()
    label = np.arange(len(theme.wall_panels), dtype=np.int32)
    own = first + (label - DEFAULT_WALL) % np.int32(len(patterns))
    bare = (label >= DEFAULT_WALL) & (label < _WALLS) & (np.asarray(theme.wall_panels) == 0)
    reach = np.full(first + len(patterns), np.inf, np.float32)
    reach[first:] = REACH
    return theme.replace(
        wall_panels=np.where(bare, own, theme.wall_panels).astype(np.int32),
        panels=np.concatenate([panels, patterns]),
        panel_reach=reach,
        floor_words=np.array(FLOOR_PATTERNS["tiles"], np.uint32),
    )


def randomised(theme: Theme, seed: jax.Array, share: float) -> Theme:
    """Draw random colours and patterns for a theme.

    Args:
        theme: the theme of the task.
        seed: uint32[]; equal seeds give equal looks on every machine.
        share: from 0, which only adds patterns, to 1: how far colours move from the theme's own
            to random ones, and the probability of a random pattern for each wall and the floor.
    """
    theme = patterned(theme)
    # Per wall: a colour, whether its pattern is drawn, and which. Two more rows for the rest.
    drawn = hashed(seed, 5 * (_WALLS + 2)).reshape(_WALLS + 2, 5)
    unit = sample_unit(drawn)
    colours = jnp.float32(DARKEST) + unit[:, :3] * jnp.float32(BRIGHTEST - DARKEST)
    walls, floor, ceiling = colours[:_WALLS], colours[_WALLS], colours[_WALLS + 1]
    redrawn = unit[: _WALLS + 1, 3] < share
    count = len(wall_patterns())
    pattern = len(theme.panels) - count + _below(unit[:_WALLS, 4], count)
    floors = np.array(tuple(FLOOR_PATTERNS.values()), np.uint32)
    words = jnp.asarray(floors)[_below(unit[_WALLS, 4], len(floors))]
    low, high = FLOOR_SHADES
    floor = jnp.stack([floor, floor * (low + (high - low) * unit[_WALLS + 1, 3])])
    return theme.replace(
        wall_colours=_first_rows(theme.wall_colours, walls, share),
        wall_panels=jnp.concatenate(
            [jnp.where(redrawn[:-1], pattern, theme.wall_panels[:_WALLS]), _rest(theme.wall_panels)]
        ),
        floor=_between(theme.floor, floor, share),
        ceiling=_between(theme.ceiling, ceiling * CEILING_SHARE, share),
        floor_words=jnp.where(redrawn[-1], words, jnp.asarray(theme.floor_words)),
    )


def _between(own: np.ndarray | jax.Array, drawn: jax.Array, share: float) -> jax.Array:
    return own + jnp.float32(share) * (drawn - own)


def _first_rows(own: np.ndarray | jax.Array, drawn: jax.Array, share: float) -> jax.Array:
    """A table of colours whose walls are drawn."""
    return jnp.concatenate([_between(own[:_WALLS], drawn, share), _rest(own)])


def _rest(table: np.ndarray | jax.Array) -> jax.Array:
    return jnp.asarray(table[_WALLS:])


def _below(unit: jax.Array, count: int) -> jax.Array:
    return (unit * jnp.float32(count)).astype(jnp.int32)


def hashed(seed: jax.Array, count: int) -> jax.Array:
    """uint32[count] pseudo-random words from a seed, at the cost of a few instructions.

    They are needed in every step, where JAX's generators would be noticeably slower.
    """
    index = np.arange(count, dtype=np.uint32) * np.uint32(0x9E3779B9)
    return mixed(mixed(seed) + index)
