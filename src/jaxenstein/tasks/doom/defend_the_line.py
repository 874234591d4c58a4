"""ViZDoom's Defend the Line, tic by tic: turn and shoot monsters across a room."""

from __future__ import annotations

import dataclasses
import functools
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ...about import About
from ...environment import Info
from ...params import Params, Scalar, number
from ..health import FULL_HEALTH
from .arsenal import Arsenal
from .collision import segments
from .defend_the_center import DoomCenterParams, about_defence, result_of
from .fight import FightState, before_fight, fight, fly_fireballs
from .fixed import ONE
from .monster_kinds import DEMON, IMP, standing
from .monsters import Horde
from .parts import Health, Part
from .physics import ATTACK, TURN_LEFT, TURN_RIGHT
from .projectiles import HITS, Missiles, Projectiles, fireballs
from .respawn import absent, replaced, woken
from .scenario import DoomScenario
from .view import CRATES, Room
from .weapons import PISTOL, Slot

# Imps and demons are at this x, at these y.
LINE = 64
_IMPS, _DEMONS = (90, 200, 400), (150, 300, 450)


class DoomLineParams(DoomCenterParams):
    """The params of the task.

    Attributes:
        monster_health: health of the first monsters.
        growth: health that each new monster has in addition to its predecessor's.
    """

    growth: Scalar = number(4, 0)


class DoomLineState(FightState):
    """The state of the task.

    Attributes:
        fireballs: fireballs in flight.
        absence: int32[6], tics until a new monster replaces one that died.
        strength: int32[6], the health of the next one.
    """

    fireballs: Projectiles
    absence: jax.Array
    strength: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomDefendTheLine(DoomScenario[DoomLineState, DoomLineParams]):
    """Shoot monsters at the other side of a room; the player turns, but does not walk.

    Three imps stay there and throw fireballs, and three demons attack. A dead one is replaced at
    its place by a stronger one. Ammunition is unlimited. Reward: `kill_reward` for each monster
    that dies, whoever killed it, and minus `death_penalty` for dying, which ends the episode. The
    game has no time limit; here it is 2100 tics.
    """

    params_class: ClassVar[type[Params]] = DoomLineParams
    takes_game_look: ClassVar[bool] = True
    first_tic: ClassVar[int] = 10
    button_names: ClassVar[tuple[str, ...]] = (TURN_LEFT, TURN_RIGHT, ATTACK)

    @property
    def room(self) -> Room:
        """A rectangular room."""
        return Room("defend-the-line", floor=CRATES, ceiling=CRATES)

    @functools.cached_property
    def horde(self) -> Horde:
        """The imps, then the demons."""
        kinds = [standing(IMP)] * len(_IMPS) + [DEMON] * len(_DEMONS)
        return Horde(kinds, walls=segments(self.doom_map.walls), pictured=self.look == "game")

    @functools.cached_property
    def arsenal(self) -> Arsenal:
        """The pistol."""
        return Arsenal([Slot(PISTOL)], shots=79, most=200, raise_tics=4)

    @functools.cached_property
    def fireballs(self) -> Missiles:
        """The fireballs of the imps."""
        return fireballs(24, pictured=self.look == "game")

    @functools.cached_property
    def parts(self) -> tuple[Part, ...]:
        """Health, weapon, monsters, fireballs."""
        return Health(FULL_HEALTH), self.arsenal, self.horde, self.fireballs

    @property
    def _fresh(self) -> tuple[jax.Array, jax.Array]:
        """The positions and headings of monsters: int32[6, 2], uint32[6]."""
        places = np.array([(LINE, y) for y in _IMPS + _DEMONS], np.int32) * np.int32(ONE)
        return jnp.asarray(places), jnp.full(len(places), np.uint32(1 << 31))

    def init_state(self, key: jax.Array, params: DoomLineParams) -> DoomLineState:
        """Six monsters that have noticed the player and taken a step."""
        count, pose = len(self.horde), self.only_pose()
        health = jnp.broadcast_to(jnp.asarray(params.monster_health), (count,))
        monsters = self.horde.placed(*self._fresh, jnp.ones(count, bool), health)
        return DoomLineState(
            **pose,
            **before_fight(
                self, woken(self.horde, monsters, pose["fixed_position"], key, self.first_tic)
            ),
            fireballs=self.fireballs.none(),
            absence=jnp.zeros(count, jnp.int32),
            strength=health + params.growth,
        )

    def transition(
        self, key: jax.Array, state: DoomLineState, action: jax.Array, params: DoomLineParams
    ) -> tuple[DoomLineState, jax.Array, jax.Array, Info]:
        """Fight; dead monsters disappear and are replaced by stronger ones after a while."""
        fight_key, ball_key = jax.random.split(key)
        living, before = state.monsters.living, state.kills
        state, fought = fight(self, fight_key, state, action, params)
        state, hits = fly_fireballs(self, self.fireballs, ball_key, state, fought, params)
        killed = living & ~state.monsters.living
        absence = absent(state.absence, killed, params.absence)
        fresh = *self._fresh, state.strength
        monsters, comes = replaced(self.horde, state.monsters, killed, absence, fresh)
        trigger = state.trigger
        state = state.replace(
            monsters=monsters,
            absence=absence,
            strength=state.strength + jnp.where(comes, params.growth, 0),
            trigger=trigger.replace(ammo=jnp.minimum(trigger.ammo + 1, self.arsenal.most)),
        )
        reward, dead, events = result_of(state, fought, state.kills - before, params)
        return state, reward, dead, events | {"hits": hits}

    def about(self) -> About:
        """A description of the task."""
        return about_defence(**HITS)
