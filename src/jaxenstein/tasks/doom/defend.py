"""ViZDoom's Defend the Center, tic by tic: turn and shoot what comes from all around."""

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
from ...maps.things import RGB
from ...params import Params, Scalar, number
from ..draws import random_bits
from .aiming import TURN_AND_SHOOT
from .arena import DoomArena, DoomArenaParams, DoomArenaState
from .buttons import ATTACK, TURN_LEFT, TURN_RIGHT
from .creatures import placed
from .fixed import direction
from .geometry import Geometry, build_geometry
from .kinds import CHAINSAW_MARINE, DEMON, Kind
from .lattice import Tiles, fill
from .look import CEILING, GREY
from .respawn import absent, respawned
from .shooter import EVENTS
from .waking import begun
from .walls import Line

# How far away monsters appear, in map units.
DISTANCE = 735
# Nobody is pushed so far from the middle as these walls are.
_BOUNDS = 512
_FIFTHS = (0, 13107, 26214, 39321, 52428)


class DoomCenterParams(DoomArenaParams):
    """The numbers of the task.

    Attributes:
        kill_reward: reward of each monster that dies.
        death_penalty: taken off the reward of the tic in which the player dies.
        monster_health: of each.
        absence: tics from a monster's death to the next one of its kind.
    """

    max_steps_in_episode: Scalar = 2100
    discount: Scalar = 0.99
    kill_reward: Scalar = 1.0
    death_penalty: Scalar = 1.0
    monster_health: Scalar = number(1, 1)
    absence: Scalar = number(90, 1)


class DoomCenterState(DoomArenaState):
    """State of the task.

    Attributes:
        absence: int32[5], tics until a new monster takes the place of one that died.
    """

    absence: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomDefendTheCenter(DoomArena[DoomCenterState, DoomCenterParams]):
    """Shoot monsters that come from all sides; the player turns, but does not walk.

    Two demons and three marines with chainsaws. One that dies is replaced by another at the wall,
    anywhere around. There are 26 bullets. Reward: `kill_reward` for each monster that dies, and
    minus `death_penalty` for dying, which terminates.
    """

    params_class: ClassVar[type[Params]] = DoomCenterParams
    map_name: ClassVar[str] = "defend-the-center"
    button_names: ClassVar[tuple[str, ...]] = (TURN_LEFT, TURN_RIGHT, ATTACK)
    cast: ClassVar[tuple[Kind, ...]] = (
        CHAINSAW_MARINE,
        DEMON,
        CHAINSAW_MARINE,
        DEMON,
        CHAINSAW_MARINE,
    )
    floor: ClassVar[RGB] = GREY
    ceiling: ClassVar[RGB] = CEILING
    ammo: ClassVar[int] = 26
    draw_tics: ClassVar[int] = 6

    @functools.cached_property
    def tiles(self) -> Tiles:
        """The round hall in tiles."""
        return fill(self.doom_map, self.unit)

    @functools.cached_property
    def geometry(self) -> Geometry:
        """Walls that the player never reaches."""
        ends = [(-1, -1), (-1, 1), (1, 1), (1, -1), (-1, -1)]
        corners = [(x * _BOUNDS, y * _BOUNDS) for x, y in ends]
        return build_geometry([Line(*a, *b, "-") for a, b in itertools.pairwise(corners)])

    def init_state(self, key: jax.Array, params: DoomCenterParams) -> DoomCenterState:
        """Five monsters around the player, who have noticed it and taken a step."""
        count = len(self.roster)
        angle = jnp.asarray(np.array(_FIFTHS, np.uint32) << 16)
        health = jnp.broadcast_to(jnp.asarray(params.monster_health), (count,))
        creatures = placed(
            self.roster, _at_wall(angle), angle + np.uint32(1 << 31), jnp.ones(count, bool), health
        )
        body = self.drawn(jnp.zeros(2, jnp.uint32), (0, 0))
        player = body["fixed_position"]
        return DoomCenterState(
            **body,
            **self.armed(),
            creatures=begun(self.roster, creatures, player, key, self.monster_walls),
            kills=jnp.int32(0),
            absence=jnp.zeros(count, jnp.int32),
        )

    def transition(
        self, key: jax.Array, state: DoomCenterState, action: jax.Array, params: DoomCenterParams
    ) -> tuple[DoomCenterState, jax.Array, jax.Array, Info]:
        """Fight; the dead are taken away, and after a while others come."""
        fight_key, spawn_key = jax.random.split(key)
        state, fought = self.fight(fight_key, state, action, params)
        state = self._replaced(spawn_key, state, fought.killed, params)
        dead = state.health <= 0
        kills = jnp.sum(fought.killed, dtype=jnp.int32)
        reward = kills.astype(jnp.float32) * params.kill_reward
        reward = reward - jnp.where(dead, params.death_penalty, 0)
        events = {"shots": fought.fires.astype(jnp.int32), "kills": kills, "died": dead}
        return state, reward, dead, events

    def _replaced(
        self, key: jax.Array, state: DoomCenterState, killed: jax.Array, params: DoomCenterParams
    ) -> DoomCenterState:
        """The state without the dead, and with those whose time has come and who find room."""
        count = len(self.roster)
        absence = absent(state.absence, killed, params.absence)
        bits = random_bits(key, (count, 2))
        place = _at_wall(bits[:, 0] & np.uint32(0xFFFF0000))
        health = jnp.broadcast_to(jnp.asarray(params.monster_health), (count,))
        fresh = place, (bits[:, 1] >> 24) << 24, health
        creatures, _ = respawned(
            self.roster, state.creatures, killed, absence, fresh, self.monster_walls
        )
        return state.replace(creatures=creatures, absence=absence)

    def about(self) -> About:
        """What the task says of itself."""
        return about_defence()


def _at_wall(angle: jax.Array) -> jax.Array:
    """int32[..., 2]: the place near the wall at an angle uint32[...]."""
    cosine, sine = direction(angle)
    return jnp.stack([cosine, sine], axis=-1) * DISTANCE


def about_defence(**events: Event) -> About:
    """What is said of tasks in which monsters come and are shot.

    Args:
        events: more than shots, kills and death.
    """
    return About(
        aim="reached the time limit alive",
        ends="where the player dies",
        rewards={
            "kill_reward": "{:+g} for each monster that dies",
            "death_penalty": "-{:g} at death",
        },
        events={**EVENTS, **events, "died": Event("died")},
        variables={
            "health": "0 to 100",
            "ammo": "bullets left",
            "killed": "monsters killed",
        },
        captions=("health", "ammo"),
        players={"turn_and_shoot": TURN_AND_SHOOT},
        expert="turn_and_shoot",
    )
