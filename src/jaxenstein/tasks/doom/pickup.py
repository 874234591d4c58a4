"""Taking things: what lies where the body's box was put, in the order in which the game looks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import varying, where_few
from ..health import FULL_HEALTH
from .fixed import ONE
from .geometry import BLOCK_BITS, RADIUS, Geometry
from .look import Picture
from .motion import Tried
from .places import RADIUS as THING_RADIUS

REACH = (RADIUS + THING_RADIUS) * ONE


@dataclass(frozen=True)
class Pickup:
    """A kind of thing to take.

    Attributes:
        picture: how it looks.
        health: what it gives, or takes.
        at_first: how many lie there in the first observation.
        period: tics from one new one to the next.
        capacity: how many an episode of 2100 tics can have.
        spared_when_full: whether it is left where it lies at full health.
        name: what it is called.
    """

    picture: Picture
    health: int
    at_first: int
    period: int
    capacity: int
    spared_when_full: bool = False
    name: str = "medkit"

    @property
    def one(self) -> str:
        """What happened when one was taken."""
        return f"took {'a medkit' if self.name == 'medkit' else self.name}"

    @property
    def several(self) -> str:
        """What happened when {} were taken."""
        return "took {} medkits" if self.name == "medkit" else f"took {{}} times {self.name}"


def touched(tried: Tried, places: jax.Array, present: jax.Array) -> jax.Array:
    """bool[N]: the things into which the body's box was put in a tic, even if it was sent back.

    Args:
        tried: where it was put.
        places: int32[N, 2], of the things.
        present: bool[N], which are there.
    """

    def others(others: jax.Array, places: jax.Array) -> jax.Array:
        close = jnp.abs(others[:, None] - places[None]) < REACH
        return jnp.any(jnp.all(close, axis=-1), axis=0)

    first = jnp.all(jnp.abs(places - tried.target[None]) < REACH, axis=-1)
    more = where_few(others)(tried.slid, tried.others, places)
    return present & tried.moving & (first | (more & tried.slid))


def take_one(
    kinds: Sequence[Pickup], looks: jax.Array, health: jax.Array, reach: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """What becomes of the health, int32[], and bool[N] what is taken, if at most one is in reach.

    Args:
        kinds: the kinds of things.
        looks: int32[N], the kind of each.
        health: int32[].
        reach: bool[N].
    """
    after, spared = health, jnp.zeros(reach.shape, bool)
    for i, kind in enumerate(kinds):
        own = reach & (looks == i)
        leaves = (health >= FULL_HEALTH) & kind.spared_when_full
        spared = spared | (own & leaves)
        after = jnp.where(jnp.any(own) & ~leaves, _healed(health, kind.health), after)
    return after, reach & ~spared


def take_some(
    geometry: Geometry,
    kinds: Sequence[Pickup],
    looks: np.ndarray,
    target: jax.Array,
    places: jax.Array,
    number: jax.Array,
    health: jax.Array,
    reach: jax.Array,
) -> tuple[jax.Array, jax.Array]:
    """As `take_one` of several, one after another: block by block, in each the newest first.

    Args:
        geometry: for the game's blocks.
        kinds: the kinds of things.
        looks: int32[N], the kind of each.
        target: int32[2], where the body was put.
        places: int32[N, 2].
        number: int32[N], which of all things so far each is.
        health: int32[].
        reach: bool[N].
    """
    block = _first_block(geometry, target, places)
    gains = np.array([kind.health for kind in kinds], np.int32)[looks]
    spares = np.array([kind.spared_when_full for kind in kinds])[looks]

    def visit(_: jax.Array, carry: tuple[jax.Array, ...]) -> tuple[jax.Array, ...]:
        health, left, taken = carry
        first = left & (block == jnp.min(jnp.where(left, block, np.int32(2**31 - 1))))
        next_one = jnp.argmax(jnp.where(first, number, np.int32(-(2**31))))
        here = left & (np.arange(len(looks)) == next_one)
        gain = jnp.sum(jnp.where(here, gains, 0), dtype=jnp.int32)
        wanted = here & ~((health >= FULL_HEALTH) & jnp.asarray(spares)) & (health > 0)
        health = jnp.where(jnp.any(wanted), _healed(health, gain), health)
        return health, left & ~here, taken | wanted

    start = health, reach, jnp.zeros(reach.shape, bool)
    start = varying(start, start, target, places, number)
    health, _, taken = jax.lax.fori_loop(0, jnp.sum(reach, dtype=jnp.int32), visit, start)
    return health, taken


def _first_block(geometry: Geometry, target: jax.Array, places: jax.Array) -> jax.Array:
    """int32[N]: the first block with both the body and a thing, in the game's order."""
    origin = jnp.asarray(geometry.origin)
    body = (target - origin - RADIUS * ONE) >> BLOCK_BITS
    thing = (places - origin[None] - THING_RADIUS * ONE) >> BLOCK_BITS
    beyond = jnp.maximum(thing - body[None], 0)
    return beyond[:, 0] + 2 * beyond[:, 1]


def _healed(health: jax.Array, gain: jax.Array | int) -> jax.Array:
    return jnp.clip(health + gain, 0, FULL_HEALTH)
