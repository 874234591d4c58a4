"""ViZDoom's Deadly Corridor, tic by tic: get past six marksmen to the armour at the end."""

from __future__ import annotations

import dataclasses
import functools
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ...about import About, Event
from ...environment import Info
from ...maps.things import GOAL, RGB
from ...params import Params, Scalar, number
from ...players.chance import NO_OP
from ..draws import draw_index
from .aiming import RUN, STORM
from .arena import DoomArena, DoomArenaParams, DoomArenaState
from .buttons import (
    ATTACK,
    BACKWARD,
    FORWARD,
    MOVE_LEFT,
    MOVE_RIGHT,
    TURN_LEFT,
    TURN_RIGHT,
)
from .creatures import placed
from .fixed import ONE
from .geometry import Geometry, build_geometry
from .kinds import CHAINGUN_GUY, SHOTGUN_GUY, ZOMBIE, Kind, Pose, Roster, standing
from .lattice import Tiles, fill
from .look import BROWN, VEST, Picture
from .motion import Blocked, Tried
from .my_way_home import REACH
from .scenario import near
from .shooter import EVENTS
from .shots import segments
from .walls import ARMOUR, Thing

# The game's numbers of the kinds of monsters; to which eighth of a circle those of a side look.
_KINDS = {3004: ZOMBIE, 9: SHOTGUN_GUY, 65: CHAINGUN_GUY}
_SOUTH_WEST, _NORTH_WEST = 5, 3
# Nobody moves in the first tics of the game; the first look of its monsters is one of so many tics.
_FROZEN, _FIRST_LOOKS = 7, 10


class DoomCorridorParams(DoomArenaParams):
    """The numbers of the task.

    Attributes:
        goal_reward: reward of reaching the armour.
        death_penalty: taken off the reward of the tic in which the player dies.
        way_reward: reward of each map unit nearer to the end of the corridor.
        monster_health: of each.
    """

    max_steps_in_episode: Scalar = 2100
    discount: Scalar = 0.99
    goal_reward: Scalar = 1000.0
    death_penalty: Scalar = 100.0
    way_reward: Scalar = 1.0
    monster_health: Scalar = number(1, 1)
    damage_factor: Scalar = number(2.0, 0)


class DoomCorridorState(DoomArenaState):
    """State of the task.

    Attributes:
        taken: bool[], whether the armour was reached; the next tic ends the episode.
    """

    taken: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomDeadlyCorridor(DoomArena[DoomCorridorState, DoomCorridorParams]):
    """Reach the armour at the end of a corridor with six marksmen in its alcoves.

    They never leave their places, one hit kills each, and what they hit hurts twice. Reward: way in
    map units along the corridor, `goal_reward` at the armour, and minus `death_penalty` for
    dying, which terminates. The tic after the armour was reached terminates, too.
    """

    params_class: ClassVar[type[Params]] = DoomCorridorParams
    map_name: ClassVar[str] = "deadly-corridor"
    success_event: ClassVar[str] = "reached_goal"
    button_names: ClassVar[tuple[str, ...]] = (
        MOVE_LEFT,
        MOVE_RIGHT,
        ATTACK,
        FORWARD,
        BACKWARD,
        TURN_LEFT,
        TURN_RIGHT,
    )
    floor: ClassVar[RGB] = BROWN
    ceiling: ClassVar[RGB] = BROWN
    ammo: ClassVar[int] = 52
    draw_tics: ClassVar[int] = 15

    @functools.cached_property
    def cast(self) -> tuple[Kind, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The monsters of the map, by their ids."""
        return tuple(standing(_KINDS[thing.kind]) for thing in self._monsters)

    @property
    def _monsters(self) -> list[Thing]:
        found = [thing for thing in self.doom_map.things if thing.kind in _KINDS]
        return sorted(found, key=lambda thing: thing.id)

    @functools.cached_property
    def roster(self) -> Roster:
        """The monsters, who react at once."""
        return Roster(self.cast, fast=True)

    @property
    def game_things(self) -> tuple[str, ...]:
        """The monsters and the armour."""
        return (*super().game_things, "GreenArmor")

    @property
    def thing_labels(self) -> tuple[int, ...]:
        """Their labels."""
        return (*super().thing_labels, GOAL.label)

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """Of monsters and armour."""
        return (*super().pictures, VEST)

    @property
    def goals(self) -> np.ndarray:
        """float[1, 2]: the armour."""
        return np.array([(thing.x, thing.y) for thing in self.doom_map.of_kind(ARMOUR)])

    @functools.cached_property
    def tiles(self) -> Tiles:
        """The corridor and its alcoves in tiles."""
        return fill(self.doom_map, self.unit)

    @functools.cached_property
    def geometry(self) -> Geometry:
        """The corridor's own walls, and the rails before the alcoves."""
        walls = [w for w in self.doom_map.walls if w.x0 == w.x1 or abs(w.y0) == abs(w.y1) == 32]
        return build_geometry([*walls, *self.doom_map.rails])

    @property
    def opaque_walls(self) -> np.ndarray:
        """float32[L, 4]: all walls."""
        return segments(self.doom_map.walls)

    def init_state(self, key: jax.Array, params: DoomCorridorParams) -> DoomCorridorState:
        """The monsters of the map, who look every now and then."""
        count = len(self.roster)
        bits = jax.random.bits(key, (count,), jnp.uint32)
        spots = np.array([(thing.x, thing.y) for thing in self._monsters])
        eighths = np.where(spots[:, 1] > 0, _SOUTH_WEST, _NORTH_WEST).astype(np.uint32)
        creatures = placed(
            self.roster,
            jnp.asarray((spots * ONE).astype(np.int32)),
            jnp.asarray(eighths << np.uint32(29)),
            jnp.ones(count, bool),
            jnp.broadcast_to(jnp.asarray(params.monster_health), (count,)),
        )
        return DoomCorridorState(
            **self.drawn(jnp.zeros(2, jnp.uint32), (0, 0)),
            **self.armed(),
            creatures=creatures.replace(tics=1 + draw_index(bits, _FIRST_LOOKS)),
            kills=jnp.int32(0),
            taken=jnp.bool_(False),
        )

    def moved(
        self, state: DoomCorridorState, action: jax.Array, bodies: Blocked | None = None
    ) -> tuple[DoomCorridorState, Tried]:
        """The state after the body has moved, but for the first tics."""
        return super().moved(state, jnp.where(state.time < _FROZEN, NO_OP, action), bodies)

    def transition(
        self,
        key: jax.Array,
        state: DoomCorridorState,
        action: jax.Array,
        params: DoomCorridorParams,
    ) -> tuple[DoomCorridorState, jax.Array, jax.Array, Info]:
        """Fight, and look whether the armour was touched."""
        before, leaves = state.fixed_position[0], state.taken
        state, fought = self.fight(key, state, action, params)
        reached = near(fought.tried, self._armour, REACH) & ~leaves
        way = (state.fixed_position[0] - before).astype(jnp.float32) * jnp.float32(1 / ONE)
        dead = (state.health <= 0) & ~leaves
        reward = way * params.way_reward + jnp.where(reached, params.goal_reward, 0)
        reward = reward - jnp.where(dead, params.death_penalty, 0)
        kills = jnp.sum(fought.killed, dtype=jnp.int32)
        events = {"shots": fought.fires.astype(jnp.int32), "kills": kills}
        events |= {"reached_goal": reached, "died": dead}
        return state.replace(taken=leaves | reached), reward, dead | leaves, events

    def about(self) -> About:
        """What the task says of itself."""
        return About(
            aim="reached the armour",
            ends="where the player dies, and in the tic after the armour was reached",
            rewards={
                "way_reward": "{:+g} a map unit of the way",
                "goal_reward": "{:+g} at the armour",
                "death_penalty": "-{:g} at death",
            },
            events={**EVENTS, "reached_goal": Event("reached the armour"), "died": Event("died")},
            variables={"health": "0 to 100", "ammo": "bullets left", "killed": "monsters killed"},
            captions=("health", "ammo"),
            players={"run": RUN, "storm": STORM},
            expert="storm",
            lasting=("taken",),
        )

    def things(self, state: DoomCorridorState) -> tuple[jax.Array, jax.Array, jax.Array]:
        """The monsters and the armour."""
        places, looks, present = super().things(state)
        vest = jnp.full(1, len(Pose) * len(self.roster.kinds), jnp.int32)
        return (
            jnp.concatenate([places, self._armour[None]]),
            jnp.concatenate([looks, vest]),
            jnp.append(present, ~state.taken),
        )

    @property
    def _armour(self) -> jax.Array:
        return jnp.asarray((self.goals[0] * ONE).astype(np.int32))
