"""Things that keep appearing on the floor and change the player's health, as in Health Gathering.

They are taken where the body's box moved to, in the order in which the game checks them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import varying, where_few
from ..draws import random_bits
from ..health import FULL_HEALTH
from .collision import BLOCK_BITS, RADIUS, REACH, Geometry
from .fixed import ONE
from .free_places import load_free_places
from .maps import THING_RADIUS
from .parts import Game, GameObject, Part, Sprites
from .physics import Reached
from .view import Picture


@dataclass(frozen=True)
class Pickup:
    """A kind of pickup.

    Attributes:
        game_name: the game's name.
        label: its label id.
        picture: its picture.
        health: health that it gives or, if negative, takes.
        at_first: the number in the first observation.
        period: tics from one new one to the next.
        capacity: the most in an episode of 2100 tics.
        spared_when_full: whether it is not taken at full health.
        name: its name.
    """

    game_name: str
    label: int
    picture: Picture
    health: int
    at_first: int
    period: int
    capacity: int
    spared_when_full: bool = False
    name: str = "medkit"

    @property
    def one(self) -> str:
        """The event of taking one."""
        return f"took {'a medkit' if self.name == 'medkit' else self.name}"

    @property
    def several(self) -> str:
        """The event of taking {} of them."""
        return "took {} medkits" if self.name == "medkit" else f"took {self.name} {{}} times"


class Pickups(Part):
    """N places for things, kind by kind; N is the capacity of all kinds together.

    The state has `places`, int32[N, 2], map units in 16.16; `present`, bool[N]; and `number`,
    int32[N], the order in which things appeared: the game takes the newest first.

    Attributes:
        kinds: the kinds of things.
        kind_of: int32[N], the kind of each place.
    """

    def __init__(self, kinds: Sequence[Pickup], map_name: str, geometry: Geometry) -> None:
        """Build the places on a map."""
        self.kinds, self._geometry = tuple(kinds), geometry
        self._free = load_free_places(map_name)
        sizes = [kind.capacity for kind in kinds]
        self.kind_of = np.repeat(np.arange(len(kinds)), sizes).astype(np.int32)
        self._firsts = [sum(sizes[:i]) for i in range(len(sizes))]
        self.objects = tuple(GameObject(k.game_name, k.label, (k.picture,)) for k in kinds)

    def first(self, key: jax.Array) -> dict[str, jax.Array]:
        """The fields of the first state, with the first things at random places."""
        at_first = [kind.at_first for kind in self.kinds]
        new = self._free.sample(random_bits(key, (sum(at_first), 3)))
        parts, number, seen = [], [], 0
        for kind in self.kinds:
            rest = jnp.zeros((kind.capacity - kind.at_first, 2), jnp.int32)
            parts += [new[seen : seen + kind.at_first], rest]
            number += [*range(seen, seen + kind.at_first), *[0] * rest.shape[0]]
            seen += kind.at_first
        present = [np.arange(kind.capacity) < kind.at_first for kind in self.kinds]
        return {
            "places": jnp.concatenate(parts),
            "present": jnp.asarray(np.concatenate(present)),
            "number": jnp.asarray(np.array(number, np.int32)),
        }

    def appear(self, state: Any, key: jax.Array, time: jax.Array) -> Any:
        """The state with a new thing of each kind that is due at the time int32[]."""
        new = self._free.sample(random_bits(key, (len(self.kinds), 3)))
        here = jnp.zeros(len(self.kind_of), bool)
        slots = np.arange(len(self.kind_of), dtype=np.int32)
        for kind, first in zip(self.kinds, self._firsts, strict=True):
            due = time % kind.period == 0
            slot = first + (kind.at_first + time // kind.period - 1) % kind.capacity
            here = here | ((slots == slot) & due)
        place = new.at[self.kind_of].get(mode="promise_in_bounds")
        return state.replace(
            places=jnp.where(here[:, None], place, state.places),
            present=state.present | here,
            # If two are due at once, the game's script creates the first kind first.
            number=jnp.where(here, (time + 1) * len(self.kinds) + self.kind_of, state.number),
        )

    def take(self, state: Any, health: jax.Array, reached: Reached) -> tuple[Any, Any]:
        """The state after a living player has taken what it touches, and counts for each event.

        Args:
            state: the state before.
            health: int32[], of the player in this tic; a dead player takes nothing.
            reached: the positions that the player's body reached.
        """
        reach = touched(reached, state.places, state.present) & (health > 0)
        after, taken = self.take_one(health, reach)
        several = jnp.sum(reach, dtype=jnp.int32) > 1
        after_all, taken_all = where_few(self.take_some)(
            several, reached.target, state.places, state.number, health, reach
        )
        health = jnp.where(several, after_all, after)
        taken = jnp.where(several, taken_all, taken)
        counts = {
            f"took_{kind.name}": jnp.sum(taken & (self.kind_of == i), dtype=jnp.int32)
            for i, kind in enumerate(self.kinds)
        }
        return state.replace(health=health, present=state.present & ~taken), counts

    def take_one(self, health: jax.Array, reach: jax.Array) -> tuple[jax.Array, jax.Array]:
        """int32[], health after; bool[N], things taken, if at most one thing bool[N] is in reach.

        Args:
            health: int32[].
            reach: bool[N].
        """
        after, spared = health, jnp.zeros(reach.shape, bool)
        for i, kind in enumerate(self.kinds):
            own = reach & (self.kind_of == i)
            leaves = (health >= FULL_HEALTH) & kind.spared_when_full
            spared = spared | (own & leaves)
            after = jnp.where(jnp.any(own) & ~leaves, _healed(health, kind.health), after)
        return after, reach & ~spared

    def take_some(
        self,
        target: jax.Array,
        places: jax.Array,
        number: jax.Array,
        health: jax.Array,
        reach: jax.Array,
    ) -> tuple[jax.Array, jax.Array]:
        """As `take_one` for several things, one after another: block by block, newest first.

        Args:
            target: int32[2], where the body moved to.
            places: int32[N, 2].
            number: int32[N], the order in which things appeared.
            health: int32[].
            reach: bool[N].
        """
        block = _first_block(self._geometry, target, places)
        gains = np.array([kind.health for kind in self.kinds], np.int32)[self.kind_of]
        spares = np.array([kind.spared_when_full for kind in self.kinds])[self.kind_of]

        def visit(_: jax.Array, carry: tuple[jax.Array, ...]) -> tuple[jax.Array, ...]:
            health, left, taken = carry
            first = left & (block == jnp.min(jnp.where(left, block, np.int32(2**31 - 1))))
            next_one = jnp.argmax(jnp.where(first, number, np.int32(-(2**31))))
            here = left & (np.arange(len(gains)) == next_one)
            gain = jnp.sum(jnp.where(here, gains, 0), dtype=jnp.int32)
            wanted = here & ~((health >= FULL_HEALTH) & jnp.asarray(spares)) & (health > 0)
            health = jnp.where(jnp.any(wanted), _healed(health, gain), health)
            return health, left & ~here, taken | wanted

        start = health, reach, jnp.zeros(reach.shape, bool)
        start = varying(start, start, target, places, number)
        health, _, taken = jax.lax.fori_loop(0, jnp.sum(reach, dtype=jnp.int32), visit, start)
        return health, taken

    def sprites(self, state: Any) -> Sprites:
        """The things that are present."""
        first = sum(kind.at_first for kind in self.kinds)
        # The number of a thing that was not there at first is that of the time, see `appear`.
        born = jnp.where(state.number < first, 0, state.number // len(self.kinds) - 1)
        age = state.time - born
        return Sprites(state.places, jnp.asarray(self.kind_of), state.present, age)

    def from_game(self, state: Any, game: Game) -> Any:
        """Read the things of the game."""
        count = len(self.kind_of)
        places, present = np.zeros((count, 2), np.int32), np.zeros(count, bool)
        number = np.zeros(count, np.int32)
        for kind, first in zip(self.kinds, self._firsts, strict=True):
            rows = game.of(kind.game_name)[: kind.capacity]
            here = slice(first, first + len(rows))
            places[here], present[here], number[here] = rows[:, :2], True, rows[:, 2]
        return state.replace(places=places, present=present, number=number)


def touched(reached: Reached, places: jax.Array, present: jax.Array) -> jax.Array:
    """bool[N]: the things that the body's box overlapped in a tic, even if it was sent back.

    Args:
        reached: the positions of the body.
        places: int32[N, 2], of the things.
        present: bool[N], which are present.
    """

    def others(others: jax.Array, places: jax.Array) -> jax.Array:
        close = jnp.abs(others[:, None] - places[None]) < REACH * ONE
        return jnp.any(jnp.all(close, axis=-1), axis=0)

    first = jnp.all(jnp.abs(places - reached.target[None]) < REACH * ONE, axis=-1)
    more = where_few(others)(reached.slid, reached.others, places)
    return present & reached.moving & (first | (more & reached.slid))


def _first_block(geometry: Geometry, target: jax.Array, places: jax.Array) -> jax.Array:
    """int32[N]: the first block with both the body and a thing, in the game's order."""
    origin = jnp.asarray(geometry.origin)
    body = (target - origin - RADIUS * ONE) >> BLOCK_BITS
    thing = (places - origin[None] - THING_RADIUS * ONE) >> BLOCK_BITS
    beyond = jnp.maximum(thing - body[None], 0)
    return beyond[:, 0] + 2 * beyond[:, 1]


def _healed(health: jax.Array, gain: jax.Array | int) -> jax.Array:
    return jnp.clip(health + gain, 0, FULL_HEALTH)
