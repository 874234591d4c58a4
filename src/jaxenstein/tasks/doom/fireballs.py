"""Scenarios whose monsters throw fireballs."""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import ClassVar, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import select, where_few
from ...maps.things import FIREBALL
from .arena import DoomArena, DoomArenaParams, DoomArenaState, Fought
from .creatures import FEW, Creatures, hurt
from .dice import byte, roll
from .feuds import quarry
from .geometry import RADIUS
from .kinds import Pose, Roster
from .look import FIREBALLS, Picture
from .projectiles import Projectiles, fly, in_the_air, throw
from .shots import way_to

# Fireballs: half-width, tics that a burst is seen.
BALL, BURST = 6, 18


class DoomFireState(DoomArenaState):
    """State of a player among monsters that throw.

    Attributes:
        balls: the fireballs.
    """

    balls: Projectiles


S = TypeVar("S", bound=DoomFireState)
P = TypeVar("P", bound=DoomArenaParams)


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomFireArena(DoomArena[S, P]):
    """Base of scenarios whose monsters throw fireballs."""

    # In flight at the same time; more would take the place of the oldest.
    most_balls: ClassVar[int] = 24

    @property
    def game_things(self) -> tuple[str, ...]:
        """Monsters and fireballs."""
        return (*super().game_things, "DoomImpBall")

    @property
    def thing_labels(self) -> tuple[int, ...]:
        """Their labels."""
        return (*super().thing_labels, FIREBALL.label)

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """Of monsters, fireballs and bursts."""
        return (*super().pictures, *FIREBALLS)

    def burn(self, key: jax.Array, state: S, fought: Fought, params: P) -> tuple[S, jax.Array]:
        """The fireballs' tic after `fight`: the state, and bool[M] which of them hit the player.

        They hurt monsters of other kinds than the thrower's as well.
        """
        roster, before = self.roster, state.creatures
        throws, balls = jnp.any(fought.throws), state.balls
        thrown = where_few(partial(_thrown, roster), FEW)
        thrown = thrown(throws, balls, fought.throws, before, state.fixed_position)
        balls = select(throws, thrown, balls)
        bodies = (
            jnp.concatenate([before.position, state.fixed_position[None]]),
            np.append(roster.half_widths, np.int32(RADIUS)),
            jnp.append(before.living, True),
        )
        balls, hits = fly(balls, BALL, bodies, self.monster_walls, BURST)
        bits = jax.random.bits(key, (self.most_balls,), jnp.uint32)
        dice, sides = (
            jnp.asarray(table).at[balls.owner].get(mode="clip")
            for table in (roster.ball_dice, roster.ball_sides)
        )
        damage = jnp.where(hits, roll(dice, sides, byte(bits, 0))[:, None], 0)
        lost = jnp.sum(damage[:, -1:], axis=1, dtype=jnp.int32)
        state = self.suffer(state.replace(balls=balls), balls.position, lost, params)
        if len(roster.kinds) > 1:
            kinds = jnp.asarray(roster.cast)
            others = kinds.at[balls.owner].get(mode="clip")[:, None] != kinds[None]
            burns = jnp.where(others, damage[:, :-1], 0)
            burnt = jnp.sum(burns, axis=0, dtype=jnp.int32)
            fate = jnp.broadcast_to(bits[0], (len(roster),))
            source = balls.owner.at[jnp.argmax(burns, axis=0)].get(mode="promise_in_bounds")
            creatures = hurt(roster, before, burnt, fate, source)
            killed = jnp.sum(before.living & ~creatures.living, dtype=jnp.int32)
            state = state.replace(creatures=creatures, kills=state.kills + killed)
        return state, hits[:, -1]

    def things(self, state: S) -> tuple[jax.Array, jax.Array, jax.Array]:
        """Monsters, fireballs and bursts."""
        places, looks, present = super().things(state)
        balls = state.balls
        first = np.int32(len(Pose) * len(self.roster.kinds))
        ball = jnp.where(balls.flies, first, first + 1)
        return (
            jnp.concatenate([places, balls.position]),
            jnp.concatenate([looks, ball]),
            jnp.concatenate([present, balls.flies | (balls.bursts > 0)]),
        )

    def with_things(self, state: S, health: int, things: np.ndarray) -> S:
        """The state with the monsters and the fireballs of the game."""
        state = super().with_things(state, health, things)
        balls = in_the_air(state.balls, things[things[:, 0] == len(self.roster.kinds)])
        return state.replace(balls=balls)


def _thrown(
    roster: Roster,
    balls: Projectiles,
    throws: jax.Array,
    creatures: Creatures,
    player: jax.Array,
) -> Projectiles:
    """The fireballs with those of bool[N] monsters who throw one."""
    goal, _ = quarry(roster, creatures, player)
    way = way_to(creatures.position, goal)
    return throw(balls, throws, creatures.position, way, roster.ball_speed)
