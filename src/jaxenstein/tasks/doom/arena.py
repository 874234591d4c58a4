"""What ViZDoom's scenarios with monsters that fight have in common: who hurts whom in a tic."""

from __future__ import annotations

import dataclasses
import functools
from typing import ClassVar, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import where_few
from ...environment import Info
from ...params import Params, Scalar, number
from ...pytree import PyTreeNode
from ..draws import random_bits
from ..health import HealthTask
from .bodies import overlap
from .creatures import FEW, Creatures, act, hurt
from .dice import byte
from .fixed import ONE
from .geometry import RADIUS
from .kinds import Kind, Pose, Roster
from .look import MONSTERS, Picture
from .motion import Tried
from .shooter import DoomShooter, DoomShooterState
from .shots import segments, way_to
from .strikes import strike, throws


class DoomArenaParams(Params):
    """The numbers that they share.

    Attributes:
        damage_factor: what hurts the player is multiplied by it.
    """

    damage_factor: Scalar = number(1.0, 0)


class DoomArenaState(DoomShooterState):
    """State of a player among monsters.

    Attributes:
        creatures: the monsters.
        kills: int32[], monsters killed in this episode.
    """

    creatures: Creatures
    kills: jax.Array


class Fought(PyTreeNode):
    """What came of a tic of fighting.

    Attributes:
        fires: bool[], whether the player's bullet left.
        killed: bool[N], the monsters that died.
        throws: bool[N], the monsters that throw something.
        tried: where the player was put.
    """

    fires: jax.Array
    killed: jax.Array
    throws: jax.Array
    tried: Tried


S = TypeVar("S", bound=DoomArenaState)
P = TypeVar("P", bound=DoomArenaParams)


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomArena(DoomShooter[S, P], HealthTask[S, P]):  # pyright: ignore[reportIncompatibleVariableOverride]
    """Base of scenarios with monsters that fight: who lives to the time limit succeeds."""

    cast: ClassVar[tuple[Kind, ...]]

    @functools.cached_property
    def roster(self) -> Roster:
        """The kinds of the monsters."""
        return Roster(self.cast)

    @property
    def game_things(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """What the game calls them."""
        return tuple(kind.game_name for kind in self.roster.kinds)

    @property
    def thing_labels(self) -> tuple[int, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The label of each."""
        return tuple(MONSTERS[kind.name][0].label for kind in self.roster.kinds)

    @property
    def pictures(self) -> tuple[Picture, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Of each kind, pose by pose."""
        return tuple(look for kind in self.roster.kinds for look in MONSTERS[kind.name])

    @property
    def half_widths(self) -> np.ndarray:
        """int32[N]: of the monsters."""
        return self.roster.half_widths

    @functools.cached_property
    def monster_walls(self) -> np.ndarray:
        """float32[L, 4]: what monsters do not cross."""
        return segments(self.doom_map.walls)

    def fight(self, key: jax.Array, state: S, action: jax.Array, params: P) -> tuple[S, Fought]:
        """A tic: the player turns, shoots, and moves; then the monsters do."""
        roster, before = self.roster, state.creatures
        rays = max(int(roster.rays.max()), 1)
        bits = random_bits(key, (len(roster) + 1, 4 + rays))

        def bodies(place: jax.Array) -> jax.Array:
            width = np.full(len(roster), RADIUS, np.int32)
            met = overlap(place[None], width, before.position, roster.half_widths)
            return jnp.any(met & before.living)

        origin = state.fixed_position
        state, tried = self.moved(state, action, bodies)
        state, fires, towards = self.shoot(state, state.angle, action, bits[-1, 0])
        shot = fires, towards
        damage = self.volley(key, state, origin, shot, bits[-1, 0])
        creatures = hurt(roster, before, damage, bits[:-1, 0])
        creatures, strikes = act(
            roster,
            creatures,
            state.fixed_position,
            fires,
            bits[:-1, 1:3],
            opaque=self.opaque_walls,
            walls=self.monster_walls,
        )
        blows = strike(
            roster, creatures, strikes, state.fixed_position, bits[:-1, 4:], self.opaque_walls
        )
        creatures = hurt(roster, creatures, blows.dealt, bits[:-1, 3], blows.source)
        state = state.replace(creatures=creatures)
        state = self.suffer(state, creatures.position, blows.lost, params)
        killed = before.living & ~creatures.living
        state = state.replace(kills=state.kills + jnp.sum(killed, dtype=jnp.int32))
        return state, Fought(fires, killed, throws(roster, creatures, strikes, blows.bitten), tried)

    def volley(
        self,
        key: jax.Array,
        state: S,
        origin: jax.Array,
        shot: tuple[jax.Array, jax.Array],
        bits: jax.Array,
    ) -> jax.Array:
        """int32[N]: what a shot does to each monster.

        Args:
            key: of the tic's fight.
            state: with the monsters as they stand when it leaves.
            origin: int32[2], from where.
            shot: bool[], whether it leaves, and uint32[], at which angle.
            bits: uint32[], random.
        """
        del key
        fires, towards = shot
        aimed = origin, towards, state.creatures.position, state.creatures.living
        hit = fires & where_few(self.struck, FEW)(fires, *aimed)
        return jnp.where(hit, self.weapon.damage(byte(bits, 2)), 0)

    def suffer(self, state: S, origins: jax.Array, damage: jax.Array, params: P) -> S:
        """The state after blows to the player, which also push it by an eighth of a unit a point.

        Args:
            state: before them.
            origins: int32[N, 2], where each comes from.
            damage: int32[N], before the damage factor.
            params: of the environment.
        """
        factor = jnp.asarray(params.damage_factor, jnp.float32)
        blows = where_few(_suffered, FEW)
        place = state.fixed_position
        lost, push = blows(jnp.any(damage > 0), damage, factor, origins, place)
        state, felt = self.shielded(state, lost)
        return state.replace(
            health=jnp.maximum(state.health - felt, 0), fixed_velocity=state.fixed_velocity + push
        )

    def shielded(self, state: S, lost: jax.Array) -> tuple[S, jax.Array]:
        """The state after blows int32[N], and int32[] what of them is felt."""
        return state, jnp.sum(lost, dtype=jnp.int32)

    def tiles_of(self, places: np.ndarray | jax.Array, which: np.ndarray | jax.Array) -> jax.Array:
        """bool[rows, columns]: the tiles of some places, int32[N, 2] and bool[N]."""
        cell = jnp.floor(self.to_tiles(jnp.asarray(places))).astype(jnp.int32)
        none = jnp.zeros((self.tilemap.rows, self.tilemap.columns), bool)
        return none.at[cell[:, 1], cell[:, 0]].max(jnp.asarray(which))

    def describe(self, state: S, params: P) -> Info:
        """Add the kills."""
        return super().describe(state, params) | {"killed": state.kills}

    def things(self, state: S) -> tuple[jax.Array, jax.Array, jax.Array]:
        """The monsters."""
        poses = (
            jnp.asarray(self.roster.poses).at[state.creatures.frame].get(mode="promise_in_bounds")
        )
        looks = jnp.asarray(self.roster.cast) * len(Pose) + poses
        return state.creatures.position, looks, state.creatures.present

    def with_things(self, state: S, health: int, things: np.ndarray) -> S:
        """The state with the monsters of the game, kind by kind in the roster's places."""
        creatures, count = state.creatures, len(self.roster)
        place, present = np.zeros((count, 2), np.int32), np.zeros(count, bool)
        for kind in range(len(self.roster.kinds)):
            slots = np.flatnonzero(self.roster.cast == kind)
            rows = things[things[:, 0] == kind][: len(slots)]
            place[slots[: len(rows)]], present[slots[: len(rows)]] = rows[:, 1:3], True
        creatures = creatures.replace(
            position=place, present=present, health=np.where(present, 1, 0).astype(np.int32)
        )
        return state.replace(creatures=creatures, health=np.int32(health))


def _suffered(
    damage: jax.Array, factor: jax.Array, origins: jax.Array, player: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """int32[N] health lost by int32[N] damage from int32[N, 2], and int32[2] by which it pushes."""
    lost = jnp.floor(damage.astype(jnp.float32) * factor)
    way = way_to(origins, player[None])
    push = jnp.sum(way * (lost[:, None] * jnp.float32(ONE / 8)), axis=0)
    return lost.astype(jnp.int32), push.astype(jnp.int32)
