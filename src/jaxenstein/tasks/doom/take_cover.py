"""ViZDoom's Take Cover, tic by tic: dodge fireballs for as long as possible."""

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
from ..draws import sample_index
from ..health import FULL_HEALTH
from .arsenal import Arsenal
from .collision import offsets, overlap, segments
from .fight import FightParams, FightState, before_fight, fight, fly_fireballs
from .fixed import ONE
from .monster_kinds import IMP, standing
from .monsters import Horde, Monsters
from .parts import Health, Part
from .physics import MOVE_LEFT, MOVE_RIGHT
from .projectiles import HITS, Missiles, Projectiles, fireballs
from .respawn import arrived
from .scenario import DoomScenario
from .view import CRATES, Room
from .weapons import PISTOL, Slot

# Imps are on this line, between these two y; the most imps.
LINE, LOWEST, HIGHEST, MOST = 64, 20, 652, 16
_FIRST = (20, 278, 652)
# Tics of the game before the player can move.
_FROZEN = 7
# Map units: fireballs farther away than this, ahead or sideways, are not dangerous yet; this close
# to a side of the room, a player goes back.
_AHEAD, _ASIDE, _WALL = 260, 70, 70


class DoomCoverParams(FightParams):
    """The params of the task.

    Attributes:
        living_reward: reward of every tic, including the last one.
        period: tics from one new imp to the next.
    """

    max_steps_in_episode: Scalar = 2100
    discount: Scalar = 0.99
    living_reward: Scalar = 1.0
    period: Scalar = number(60, 1)
    damage_factor: Scalar = number(7.0, 0, 1000)


class DoomCoverState(FightState):
    """The state of the task.

    Attributes:
        fireballs: fireballs in flight.
    """

    fireballs: Projectiles


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomTakeCover(DoomScenario[DoomCoverState, DoomCoverParams]):
    """Dodge the fireballs of imps at the other side of the room, which become more and more.

    One or two hits kill the player, and the imps cannot be hurt. Reward: `living_reward` in every
    tic. Death terminates the episode. The game has no time limit; here it is 2100 tics.
    """

    params_class: ClassVar[type[Params]] = DoomCoverParams
    takes_game_look: ClassVar[bool] = True
    always_bobs: ClassVar[bool] = True
    button_names: ClassVar[tuple[str, ...]] = (MOVE_LEFT, MOVE_RIGHT)

    @property
    def room(self) -> Room:
        """A rectangular room."""
        return Room("take-cover", floor=CRATES, ceiling=CRATES)

    @functools.cached_property
    def horde(self) -> Horde:
        """Imps that cannot be hurt."""
        imp = dataclasses.replace(standing(IMP), pain_chance=0)
        return Horde(
            [imp] * MOST, walls=segments(self.doom_map.walls), pictured=self.look == "game"
        )

    @functools.cached_property
    def arsenal(self) -> Arsenal:
        """An empty weapon without a button."""
        return Arsenal([Slot(PISTOL)], shots=0)

    @functools.cached_property
    def fireballs(self) -> Missiles:
        """The fireballs of the imps."""
        return fireballs(24, pictured=self.look == "game")

    @functools.cached_property
    def parts(self) -> tuple[Part, ...]:
        """Health, weapon, imps, fireballs."""
        return Health(FULL_HEALTH), self.arsenal, self.horde, self.fireballs

    def init_state(self, key: jax.Array, params: DoomCoverParams) -> DoomCoverState:
        """Three imps, which have not noticed the player yet."""
        del key, params
        places = np.zeros((MOST, 2), np.int32)
        places[: len(_FIRST)] = [(LINE * ONE, y * ONE) for y in _FIRST]
        none = self.horde.placed(*self._imps(jnp.asarray(places)))
        first = jnp.arange(MOST) < len(_FIRST)
        return DoomCoverState(
            **self.only_pose(),
            **before_fight(self, none.replace(present=first, tics=none.tics - 1)),
            fireballs=self.fireballs.none(),
        )

    def transition(
        self, key: jax.Array, state: DoomCoverState, action: jax.Array, params: DoomCoverParams
    ) -> tuple[DoomCoverState, jax.Array, jax.Array, Info]:
        """Step, let the imps throw and the fireballs fly; sometimes add an imp."""
        fight_key, ball_key, imp_key = jax.random.split(key, 3)
        time = state.time + 1
        action = jnp.where(state.time < _FROZEN, NO_OP, action)
        state, fought = fight(self, fight_key, state, action, params)
        state, hits = fly_fireballs(self, self.fireballs, ball_key, state, fought, params)
        comes = time % jnp.maximum(params.period, 1) == 0
        state = state.replace(monsters=self._joined(imp_key, state.monsters, comes))
        dead = state.health <= 0
        reward = jnp.asarray(params.living_reward, jnp.float32)
        return state, reward, dead, {"hits": hits, "died": dead}

    def _joined(self, key: jax.Array, imps: Monsters, comes: jax.Array) -> Monsters:
        """The imps with one more, if it is due and finds room."""
        y = sample_index(jax.random.bits(key, (), jnp.uint32), (HIGHEST - LOWEST) * ONE + 1)
        place = jnp.stack([jnp.int32(LINE * ONE), LOWEST * ONE + y])
        width = self.horde.half_width
        room = ~jnp.any(overlap(place[None], width, imps.position, width) & imps.present)
        free = ~imps.present
        here = comes & room & free & (jnp.cumsum(free) == 1)
        places, west, _, health = self._imps(jnp.broadcast_to(place[None], imps.position.shape))
        return arrived(self.horde, imps, here, (places, west, health))

    def _imps(self, places: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
        """Arguments of `Horde.placed`: imps at int32[N, 2] that look west; none is present yet."""
        west = jnp.full(MOST, np.uint32(1 << 31))
        return places, west, jnp.zeros(MOST, bool), jnp.asarray(self.horde.health)

    def about(self) -> About:
        """A description of the task."""
        return About(
            aim="reached the time limit alive",
            ends="when the player dies",
            rewards={"living_reward": "{:+g} per tic"},
            events={**HITS, "died": Event("died")},
            variables={
                "health": "0 to 100",
                "ammo": "bullets left; there is no weapon here",
                "killed": "monsters killed",
            },
            captions=("health",),
            players={"dodge": DODGE},
            expert="dodge",
        )


def dodge(env: DoomTakeCover, params: Any) -> Choose:
    """Step away from the nearest fireball ahead, but not into a corner."""
    del params
    left, right = (env.index_of(name) for name in (MOVE_LEFT, MOVE_RIGHT))
    sides = [wall.y0 for wall in env.doom_map.walls]
    south, north = min(sides) + _WALL, max(sides) - _WALL

    def choose(key: jax.Array, state: DoomCoverState) -> jax.Array:
        del key
        offset = offsets(state.fixed_position, state.fireballs.position)
        ahead, aside = offset[:, 0], offset[:, 1]
        near = state.fireballs.flies & (ahead > -30) & (ahead < _AHEAD) & (jnp.abs(aside) < _ASIDE)
        first = jnp.argmin(jnp.where(near, ahead, jnp.inf))
        y = state.fixed_position[1].astype(jnp.float32) * (1 / ONE)
        go_left = jnp.where(y < south, True, jnp.where(y > north, False, aside[first] < 0))
        step = jnp.where(go_left, jnp.int32(left), jnp.int32(right))
        return jnp.where(jnp.any(near), step, NO_OP)

    return choose


DODGE = Player(
    "steps away from the nearest fireball; sees the whole state", dodge, waits="waits: no danger"
)
