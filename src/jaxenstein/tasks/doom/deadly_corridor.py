"""ViZDoom's Deadly Corridor, tic by tic: get past six marksmen to the armour at the end."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ...about import About, Choose, Event, Player
from ...environment import Info
from ...params import Params, Scalar, number
from ...players.chance import NO_OP
from ..health import FULL_HEALTH
from .arsenal import Arsenal
from .collision import REACH, Geometry, build_geometry, offsets, segments
from .drops import Drops
from .fight import FightParams, FightState, before_fight, fight
from .fixed import ONE
from .items import Goal
from .maps import ARMOUR, MapThing
from .monster_ai import sight
from .monster_kinds import CHAINGUN_GUY, SHOTGUN_GUY, ZOMBIE, standing
from .monsters import Horde
from .parts import Health, Part
from .physics import ALL_MOVES, FORWARD, touches
from .players import only, turn_and_shoot, walker
from .respawn import asleep
from .scenario import DoomScenario, Room
from .view import BROWN
from .weapons import PISTOL, SHOOTING, Slot

# The game's numbers of the kinds of monsters; the eighth of a turn in which those of a side look.
_KINDS = {3004: ZOMBIE, 9: SHOTGUN_GUY, 65: CHAINGUN_GUY}
_SOUTH_WEST, _NORTH_WEST = 5, 3
# How far the things that monsters drop can get from them, between rails and walls, in map units.
_ROOM = 44, 12
# The player cannot move in the first tics of the game; the distance along the corridor, in map
# units, at which the player `storm` shoots at monsters.
_FROZEN, _STORMS = 7, 420


class DoomCorridorParams(FightParams):
    """The params of the task.

    Attributes:
        goal_reward: reward of reaching the armour.
        death_penalty: subtracted from the reward of the tic in which the player dies.
        way_reward: reward per map unit of progress along the corridor.
        kill_reward: reward of each monster that dies; the game gives none.
        monster_health: health of each monster.
    """

    max_steps_in_episode: Scalar = 2100
    discount: Scalar = 0.99
    goal_reward: Scalar = 1000.0
    death_penalty: Scalar = 100.0
    way_reward: Scalar = 1.0
    kill_reward: Scalar = 0.0
    monster_health: Scalar = number(1, 1)
    damage_factor: Scalar = number(2.0, 0, 1000)


class DoomCorridorState(FightState):
    """The state of the task.

    Attributes:
        taken: bool[], whether the armour was reached; the next tic ends the episode.
        drops: int32[6, 2], with `look="game"` how far the thing that each monster drops gets from
            it, map units in 16.16; else None.
    """

    taken: jax.Array
    drops: jax.Array | None = None


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomDeadlyCorridor(DoomScenario[DoomCorridorState, DoomCorridorParams]):
    """Reach the armour at the end of a corridor with six gunmen in its alcoves.

    They never move, one hit kills each of them, and their hits do double damage. Reward: progress
    in map units along the corridor, `goal_reward` at the armour, and minus `death_penalty` for
    dying, which terminates the episode. So does the tic after the armour is reached.
    """

    params_class: ClassVar[type[Params]] = DoomCorridorParams
    takes_game_look: ClassVar[bool] = True
    success_event: ClassVar[str] = "reached_goal"
    button_names: ClassVar[tuple[str, ...]] = ALL_MOVES

    @property
    def room(self) -> Room:
        """A corridor with alcoves."""
        return Room("deadly-corridor", floor=BROWN, ceiling=BROWN)

    @functools.cached_property
    def geometry(self) -> Geometry:
        """The walls of the corridor, and the rails in front of the alcoves."""
        walls = [w for w in self.doom_map.walls if w.x0 == w.x1 or abs(w.y0) == abs(w.y1) == 32]
        return build_geometry([*walls, *self.doom_map.rails])

    @property
    def goals(self) -> np.ndarray:
        """float[1, 2]: the armour."""
        return self.doom_map.places(ARMOUR)

    @property
    def _marksmen(self) -> list[MapThing]:
        found = [thing for thing in self.doom_map.things if thing.kind in _KINDS]
        return sorted(found, key=lambda thing: thing.id)

    @functools.cached_property
    def horde(self) -> Horde:
        """The monsters of the map by their ids: they never move, and react at once."""
        walls = segments(self.doom_map.walls)
        kinds = [standing(_KINDS[thing.kind]) for thing in self._marksmen]
        return Horde(kinds, walls=walls, opaque=walls, fast=True, pictured=self.look == "game")

    @functools.cached_property
    def arsenal(self) -> Arsenal:
        """The pistol."""
        return Arsenal([Slot(PISTOL)], shots=52, raise_tics=15)

    @functools.cached_property
    def drops(self) -> Drops:
        """What monsters drop."""
        return Drops(self.horde, _ROOM)

    @functools.cached_property
    def goal(self) -> Goal:
        """The armour."""
        return Goal((self.goals[0] * ONE).astype(np.int32))

    @functools.cached_property
    def parts(self) -> tuple[Part, ...]:
        """Health, weapon, monsters, armour; with `look="game"` what monsters drop."""
        drops = (self.drops,) if self.look == "game" else ()
        return Health(FULL_HEALTH), self.arsenal, self.horde, self.goal, *drops

    def init_state(self, key: jax.Array, params: DoomCorridorParams) -> DoomCorridorState:
        """The monsters of the map, which look for the player now and then."""
        count = len(self.horde)
        bits = jax.random.bits(key, (count,), jnp.uint32)
        spots = np.array([(thing.x, thing.y) for thing in self._marksmen])
        eighths = np.where(spots[:, 1] > 0, _SOUTH_WEST, _NORTH_WEST).astype(np.uint32)
        facing = jnp.asarray(eighths << np.uint32(29))
        health = jnp.broadcast_to(jnp.asarray(params.monster_health), (count,))
        return DoomCorridorState(
            **self.only_pose(),
            **before_fight(
                self, asleep(self.horde, (spots * ONE).astype(np.int32), facing, health, bits)
            ),
            taken=jnp.bool_(False),
            drops=self.drops.sample(jax.random.bits(jax.random.fold_in(key, 1), (count, 2)))
            if self.look == "game"
            else None,
        )

    def transition(
        self,
        key: jax.Array,
        state: DoomCorridorState,
        action: jax.Array,
        params: DoomCorridorParams,
    ) -> tuple[DoomCorridorState, jax.Array, jax.Array, Info]:
        """Fight, and check whether the armour was touched."""
        before, leaves, kills = state.fixed_position[0], state.taken, state.kills
        frozen, buttons = state.time < _FROZEN, self.pressed(action)
        turns = buttons.turn_left | buttons.turn_right
        # While the player cannot move, the game counts the tics of a turn button all the same.
        turn_tics = jnp.where(turns, state.turn_tics + 1, 0)
        state, fought = fight(self, key, state, jnp.where(frozen, NO_OP, action), params)
        state = state.replace(turn_tics=jnp.where(frozen, turn_tics, state.turn_tics))
        reached = touches(fought.reached, jnp.asarray(self.goal.place), REACH) & ~leaves
        way = (state.fixed_position[0] - before).astype(jnp.float32) * jnp.float32(1 / ONE)
        dead = (state.health <= 0) & ~leaves
        killed = state.kills - kills
        reward = way * params.way_reward + jnp.where(reached, params.goal_reward, 0)
        reward = reward + killed.astype(jnp.float32) * params.kill_reward
        reward = reward - jnp.where(dead, params.death_penalty, 0)
        events = {"shots": fought.fires.astype(jnp.int32), "kills": killed}
        events |= {"reached_goal": reached, "died": dead}
        return state.replace(taken=leaves | reached), reward, dead | leaves, events

    def about(self) -> About:
        """A description of the task."""
        return About(
            aim="reached the armour",
            ends="when the player dies, and in the tic after the armour is reached",
            rewards={
                "way_reward": "{:+g} per map unit of progress",
                "goal_reward": "{:+g} at the armour",
                "death_penalty": "-{:g} at death",
                "kill_reward": "{:+g} per monster that dies",
            },
            events={**SHOOTING, "reached_goal": Event("reached the armour"), "died": Event("died")},
            variables={"health": "0 to 100", "ammo": "bullets left", "killed": "monsters killed"},
            captions=("health", "ammo"),
            players={"run": RUN, "storm": STORM},
            expert="storm",
            lasting=("taken",),
        )


def storm(env: DoomDeadlyCorridor, params: Any) -> Choose:
    """Wait until the player can move, shoot monsters that are near and see it, then walk on."""
    aim, walk = turn_and_shoot(env, params), walker(env)
    goal = jnp.asarray(env.goal.place)

    def choose(key: jax.Array, state: DoomCorridorState) -> jax.Array:
        monsters = state.monsters
        distance = offsets(state.fixed_position, monsters.position)[:, 0]
        near = sight(monsters, state.fixed_position, env.horde.opaque)
        near = near & monsters.living & (jnp.abs(distance) < _STORMS)
        shoots = aim(key, only(state, near))
        chosen = jnp.where(jnp.any(near), shoots, walk(state, goal))
        # A turn button held until then would turn it twice as fast.
        return jnp.where(state.time < _FROZEN, NO_OP, chosen)

    return choose


STORM = Player("shoots what is near, then walks on; sees the whole state", storm)


def run(env: DoomDeadlyCorridor, params: Any) -> Choose:
    """Run straight ahead."""
    del params
    ahead = env.index_of(FORWARD)
    return lambda key, state: jnp.int32(ahead)


RUN = Player("runs straight ahead", run)
