"""ViZDoom's Defend the Center, tic by tic: turn and shoot monsters from all sides."""

from __future__ import annotations

import dataclasses
import functools
import itertools
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ...about import About, Event
from ...environment import Info
from ...params import Params, Scalar, number
from ..draws import random_bits
from ..health import FULL_HEALTH
from .arsenal import Arsenal
from .collision import Geometry, build_geometry, segments
from .fight import FightParams, FightState, Fought, before_fight, fight
from .fixed import direction
from .maps import Line
from .monster_kinds import CHAINSAW_MARINE, DEMON
from .monsters import Horde
from .parts import Health, Part
from .physics import ATTACK, TURN_LEFT, TURN_RIGHT
from .players import TURN_AND_SHOOT
from .respawn import absent, replaced, woken
from .scenario import DoomScenario
from .view import CEILING, GREY, Room
from .weapons import PISTOL, SHOOTING, Slot

# The distance at which monsters appear, in map units.
DISTANCE = 735
# Walls so far from the middle that no blow pushes the player to them.
_BOUNDS = 512
_FIFTHS = (0, 13107, 26214, 39321, 52428)


class DoomCenterParams(FightParams):
    """The params of the task.

    Attributes:
        kill_reward: reward of each monster that dies.
        shot_reward: reward of each shot; the game gives none.
        death_penalty: subtracted from the reward of the tic in which the player dies.
        monster_health: health of each monster.
        absence: tics from a monster's death to the next one of its kind.
    """

    max_steps_in_episode: Scalar = 2100
    discount: Scalar = 0.99
    kill_reward: Scalar = 1.0
    shot_reward: Scalar = 0.0
    death_penalty: Scalar = 1.0
    monster_health: Scalar = number(1, 1)
    absence: Scalar = number(90, 1)


class DoomCenterState(FightState):
    """The state of the task.

    Attributes:
        absence: int32[5], tics until a new monster replaces one that died.
    """

    absence: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomDefendTheCenter(DoomScenario[DoomCenterState, DoomCenterParams]):
    """Shoot monsters that come from all sides; the player turns, but does not walk.

    There are two demons and three marines with chainsaws. A dead one is replaced by another
    somewhere along the wall. There are 26 bullets. Reward: `kill_reward` for each monster that
    dies, and minus `death_penalty` for dying, which terminates the episode.
    """

    params_class: ClassVar[type[Params]] = DoomCenterParams
    takes_game_look: ClassVar[bool] = True
    first_tic: ClassVar[int] = 10
    button_names: ClassVar[tuple[str, ...]] = (TURN_LEFT, TURN_RIGHT, ATTACK)

    @property
    def room(self) -> Room:
        """A round hall."""
        return Room("defend-the-center", floor=GREY, ceiling=CEILING)

    @functools.cached_property
    def horde(self) -> Horde:
        """Three marines and two demons in turn."""
        kinds = [CHAINSAW_MARINE, DEMON, CHAINSAW_MARINE, DEMON, CHAINSAW_MARINE]
        return Horde(kinds, walls=segments(self.doom_map.walls), pictured=self.look == "game")

    @functools.cached_property
    def arsenal(self) -> Arsenal:
        """The pistol."""
        return Arsenal([Slot(PISTOL)], shots=26, raise_tics=6)

    @functools.cached_property
    def parts(self) -> tuple[Part, ...]:
        """Health, weapon, monsters."""
        return Health(FULL_HEALTH), self.arsenal, self.horde

    @functools.cached_property
    def geometry(self) -> Geometry:
        """Walls that the player never reaches."""
        ends = [(-1, -1), (-1, 1), (1, 1), (1, -1), (-1, -1)]
        corners = [(x * _BOUNDS, y * _BOUNDS) for x, y in ends]
        return build_geometry([Line(*a, *b, "-") for a, b in itertools.pairwise(corners)])

    def init_state(self, key: jax.Array, params: DoomCenterParams) -> DoomCenterState:
        """Five monsters around the player that have noticed it and taken a step."""
        count, pose = len(self.horde), self.only_pose()
        angle = jnp.asarray(np.array(_FIFTHS, np.uint32) << 16)
        health = jnp.broadcast_to(jnp.asarray(params.monster_health), (count,))
        facing = angle + np.uint32(1 << 31)
        monsters = self.horde.placed(_at_wall(angle), facing, jnp.ones(count, bool), health)
        return DoomCenterState(
            **pose,
            **before_fight(
                self, woken(self.horde, monsters, pose["fixed_position"], key, self.first_tic)
            ),
            absence=jnp.zeros(count, jnp.int32),
        )

    def transition(
        self, key: jax.Array, state: DoomCenterState, action: jax.Array, params: DoomCenterParams
    ) -> tuple[DoomCenterState, jax.Array, jax.Array, Info]:
        """Fight; dead monsters disappear and are replaced after a while."""
        fight_key, spawn_key = jax.random.split(key)
        living, before = state.monsters.living, state.kills
        state, fought = fight(self, fight_key, state, action, params)
        killed = living & ~state.monsters.living
        absence = absent(state.absence, killed, params.absence)
        bits = random_bits(spawn_key, (len(self.horde), 2))
        place = _at_wall(bits[:, 0] & np.uint32(0xFFFF0000))
        health = jnp.broadcast_to(jnp.asarray(params.monster_health), (len(self.horde),))
        fresh = place, (bits[:, 1] >> 24) << 24, health
        monsters, _ = replaced(self.horde, state.monsters, killed, absence, fresh)
        state = state.replace(monsters=monsters, absence=absence)
        return state, *result_of(state, fought, state.kills - before, params)

    def about(self) -> About:
        """A description of the task."""
        return about_defence()


def _at_wall(angle: jax.Array) -> jax.Array:
    """int32[..., 2]: the position near the wall at an angle uint32[...]."""
    cosine, sine = direction(angle)
    return jnp.stack([cosine, sine], axis=-1) * DISTANCE


def result_of(
    state: FightState, fought: Fought, kills: jax.Array, params: DoomCenterParams
) -> tuple[jax.Array, jax.Array, Info]:
    """The reward of a tic, whether the player is dead, and the events.

    Args:
        state: the state after the tic.
        fought: what happened in the fight.
        kills: int32[], how many monsters died.
        params: the params.
    """
    dead = state.health <= 0
    reward = kills.astype(jnp.float32) * params.kill_reward
    reward = reward + jnp.where(fought.fires, params.shot_reward, 0)
    reward = reward - jnp.where(dead, params.death_penalty, 0)
    return reward, dead, {"shots": fought.fires.astype(jnp.int32), "kills": kills, "died": dead}


def about_defence(**events: Event) -> About:
    """A description of tasks in which the player shoots monsters that come.

    Args:
        events: events in addition to shots, kills and death.
    """
    return About(
        aim="reached the time limit alive",
        ends="when the player dies",
        rewards={
            "kill_reward": "{:+g} per monster that dies",
            "shot_reward": "{:+g} per shot",
            "death_penalty": "-{:g} at death",
        },
        events={**SHOOTING, **events, "died": Event("died")},
        variables={
            "health": "0 to 100",
            "ammo": "bullets left",
            "killed": "monsters killed",
        },
        captions=("health", "ammo"),
        players={"turn_and_shoot": TURN_AND_SHOOT},
        expert="turn_and_shoot",
    )
