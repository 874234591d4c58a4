"""ViZDoom's Defend the Line, tic by tic: turn and shoot what stands at the other side of a room."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ...about import About, Event
from ...environment import Info
from ...maps.things import RGB
from ...params import Params, Scalar, number
from .buttons import ATTACK, TURN_LEFT, TURN_RIGHT
from .creatures import placed
from .defend import DoomCenterParams, about_defence
from .fireballs import DoomFireArena, DoomFireState
from .fixed import ONE
from .kinds import DEMON, IMP, Kind, standing
from .look import CRATES
from .projectiles import no_projectiles
from .respawn import absent, respawned
from .waking import begun

# Imps and demons stand at this x, at these y.
LINE = 64
_IMPS, _DEMONS = (90, 200, 400), (150, 300, 450)


class DoomLineParams(DoomCenterParams):
    """The numbers of the task.

    Attributes:
        monster_health: of the first ones.
        growth: how much more health than the last one each new monster of a place has.
    """

    growth: Scalar = number(4, 0)


class DoomLineState(DoomFireState):
    """State of the task.

    Attributes:
        absence: int32[6], tics until a new monster takes the place of one that died.
        strength: int32[6], the health of the next one.
    """

    absence: jax.Array
    strength: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomDefendTheLine(DoomFireArena[DoomLineState, DoomLineParams]):
    """Shoot monsters at the other side of a room; the player turns, but does not walk.

    Three imps, who stay there and throw fireballs, and three demons, who run up. One that dies
    is replaced at its place by a stronger one. Ammunition never ends. Reward: `kill_reward` for
    each monster that dies, whoever killed it, and minus `death_penalty` for dying, which ends;
    the game knows no time limit, here it is 2100 tics.
    """

    params_class: ClassVar[type[Params]] = DoomLineParams
    map_name: ClassVar[str] = "defend-the-line"
    button_names: ClassVar[tuple[str, ...]] = (TURN_LEFT, TURN_RIGHT, ATTACK)
    cast: ClassVar[tuple[Kind, ...]] = (standing(IMP),) * len(_IMPS) + (DEMON,) * len(_DEMONS)
    floor: ClassVar[RGB] = CRATES
    ceiling: ClassVar[RGB] = CRATES
    ammo: ClassVar[int] = 79
    most_ammo: ClassVar[int] = 200
    draw_tics: ClassVar[int] = 4

    @property
    def _fresh(self) -> tuple[jax.Array, jax.Array]:
        """Where monsters stand and look: int32[6, 2], uint32[6]."""
        places = np.array([(LINE, y) for y in _IMPS + _DEMONS], np.int32) * np.int32(ONE)
        return jnp.asarray(places), jnp.full(len(places), np.uint32(1 << 31))

    def init_state(self, key: jax.Array, params: DoomLineParams) -> DoomLineState:
        """Six monsters, who have noticed the player and taken a step."""
        count = len(self.roster)
        health = jnp.broadcast_to(jnp.asarray(params.monster_health), (count,))
        creatures = placed(self.roster, *self._fresh, jnp.ones(count, bool), health)
        body = self.drawn(jnp.zeros(2, jnp.uint32), (0, 0))
        player = body["fixed_position"]
        return DoomLineState(
            **body,
            **self.armed(),
            creatures=begun(self.roster, creatures, player, key, self.monster_walls),
            kills=jnp.int32(0),
            balls=no_projectiles(self.most_balls),
            absence=jnp.zeros(count, jnp.int32),
            strength=health + params.growth,
        )

    def transition(
        self, key: jax.Array, state: DoomLineState, action: jax.Array, params: DoomLineParams
    ) -> tuple[DoomLineState, jax.Array, jax.Array, Info]:
        """Fight; the dead are taken away, and after a while stronger ones come."""
        fight_key, ball_key = jax.random.split(key)
        living, before = state.creatures.living, state.kills
        state, fought = self.fight(fight_key, state, action, params)
        state, hits = self.burn(ball_key, state, fought, params)
        killed = living & ~state.creatures.living
        absence = absent(state.absence, killed, params.absence)
        fresh = *self._fresh, state.strength
        creatures, comes = respawned(
            self.roster, state.creatures, killed, absence, fresh, self.monster_walls
        )
        trigger = state.trigger
        state = state.replace(
            creatures=creatures,
            absence=absence,
            strength=state.strength + jnp.where(comes, params.growth, 0),
            trigger=trigger.replace(ammo=jnp.minimum(trigger.ammo + 1, self.most_ammo)),
        )
        dead = state.health <= 0
        kills = state.kills - before
        reward = kills.astype(jnp.float32) * params.kill_reward
        reward = reward - jnp.where(dead, params.death_penalty, 0)
        events = {"shots": fought.fires.astype(jnp.int32), "kills": kills}
        events |= {"hits": jnp.sum(hits, dtype=jnp.int32), "died": dead}
        return state, reward, dead, events

    def about(self) -> About:
        """What the task says of itself."""
        burnt = Event("was hit by a fireball", "was hit by {} fireballs")
        return about_defence(hits=burnt)
