"""ViZDoom's Take Cover, tic by tic: step out of the way of fireballs for as long as it goes."""

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
from ...players.chance import NO_OP
from ..draws import draw_index
from .arena import DoomArenaParams
from .bobbing import height, walked
from .bodies import overlap
from .buttons import MOVE_LEFT, MOVE_RIGHT
from .creatures import Creatures, joined, placed
from .dodging import DODGE
from .fireballs import DoomFireArena, DoomFireState
from .fixed import ONE
from .kinds import IMP, Kind, standing
from .look import CRATES
from .projectiles import no_projectiles

# Imps stand on this line, from the one y to the other; there is room for so many.
LINE, LOWEST, HIGHEST, MOST = 64, 20, 652, 16
_FIRST = (20, 278, 652)
# Tics of the game before which the player cannot move.
_FROZEN = 7


class DoomCoverParams(DoomArenaParams):
    """The numbers of the task.

    Attributes:
        living_reward: reward of every tic, the last one included.
        period: tics from one new imp to the next.
    """

    max_steps_in_episode: Scalar = 2100
    discount: Scalar = 0.99
    living_reward: Scalar = 1.0
    period: Scalar = number(60, 1)
    damage_factor: Scalar = number(7.0, 0)


class DoomCoverState(DoomFireState):
    """State of a player who dodges.

    Attributes:
        pace: int32[2], the velocity that its own steps gave it.
        steps: int32[2], the same as the eye bobs by it.
    """

    pace: jax.Array
    steps: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomTakeCover(DoomFireArena[DoomCoverState, DoomCoverParams]):
    """Dodge fireballs: imps at the other side of the room throw them, and become ever more.

    One or two hits kill, and the imps cannot be hurt. Reward: `living_reward` in every tic. Death
    terminates; the game knows no time limit, here it is 2100 tics.
    """

    params_class: ClassVar[type[Params]] = DoomCoverParams
    map_name: ClassVar[str] = "take-cover"
    button_names: ClassVar[tuple[str, ...]] = (MOVE_LEFT, MOVE_RIGHT)
    # Nothing can hurt them.
    cast: ClassVar[tuple[Kind, ...]] = (dataclasses.replace(standing(IMP), pain_chance=0),) * MOST
    floor: ClassVar[RGB] = CRATES
    ceiling: ClassVar[RGB] = CRATES
    ammo: ClassVar[int] = 0

    def init_state(self, key: jax.Array, params: DoomCoverParams) -> DoomCoverState:
        """Three imps, who have not noticed the player yet."""
        del key, params
        places = np.zeros((MOST, 2), np.int32)
        places[: len(_FIRST)] = [(LINE * ONE, y * ONE) for y in _FIRST]
        creatures = self._imps(jnp.asarray(places), jnp.arange(MOST) < len(_FIRST))
        return DoomCoverState(
            **self.drawn(jnp.zeros(2, jnp.uint32), (0, 0)),
            **self.armed(),
            creatures=creatures,
            kills=jnp.int32(0),
            balls=no_projectiles(self.most_balls),
            pace=jnp.zeros(2, jnp.int32),
            steps=jnp.zeros(2, jnp.int32),
        )

    def _imps(self, places: jax.Array, present: jax.Array) -> Creatures:
        """Imps that look west and have ticked once."""
        west = jnp.full(MOST, np.uint32(1 << 31))
        new = placed(self.roster, places, west, present, jnp.asarray(self.roster.health))
        return new.replace(tics=new.tics - 1)

    def transition(
        self, key: jax.Array, state: DoomCoverState, action: jax.Array, params: DoomCoverParams
    ) -> tuple[DoomCoverState, jax.Array, jax.Array, Info]:
        """Step, let the imps throw and the fireballs fly; every now and then one more imp."""
        fight_key, ball_key, imp_key = jax.random.split(key, 3)
        time = state.time + 1
        action = jnp.where(state.time < _FROZEN, NO_OP, action)
        pace, angle, buttons = state.pace, state.angle, self.pressed(action)
        state, fought = self.fight(fight_key, state, action, params)
        steps, pace = walked(pace, angle, buttons, state.fixed_velocity, fought.tried.slid)
        state = state.replace(steps=steps, pace=pace)
        state, hits = self.burn(ball_key, state, fought, params)
        comes = time % jnp.maximum(params.period, 1) == 0
        state = state.replace(creatures=self._joined(imp_key, state.creatures, comes))
        dead = state.health <= 0
        count = jnp.sum(hits, dtype=jnp.int32)
        reward = jnp.asarray(params.living_reward, jnp.float32)
        return state, reward, dead, {"hits": count, "died": dead}

    def _joined(self, key: jax.Array, imps: Creatures, comes: jax.Array) -> Creatures:
        """The imps with one more, if it comes now and finds room where it is to stand."""
        drawn = draw_index(jax.random.bits(key, (), jnp.uint32), (HIGHEST - LOWEST) * ONE + 1)
        place = jnp.stack([jnp.int32(LINE * ONE), LOWEST * ONE + drawn])
        width = self.roster.half_widths
        room = ~jnp.any(overlap(place[None], width, imps.position, width) & imps.present)
        free = ~imps.present
        here = comes & room & free & (jnp.cumsum(free) == 1)
        new = self._imps(jnp.broadcast_to(place[None], imps.position.shape), imps.present | here)
        return joined(imps, new, here)

    def lift(self, state: DoomCoverState) -> jax.Array:
        """The eye bobs as the player walks."""
        return height(state.steps, state.time) * np.float32(1 / self.unit)

    def with_things(self, state: DoomCoverState, health: int, things: np.ndarray) -> DoomCoverState:
        """The state with the imps and the fireballs of the game; it does not tell the pace."""
        state = super().with_things(state, health, things)
        velocity = state.fixed_velocity
        return state.replace(pace=velocity, steps=velocity * 32 // 29)

    def about(self) -> About:
        """What the task says of itself."""
        return About(
            aim="reached the time limit alive",
            ends="where the player dies",
            rewards={"living_reward": "{:+g} a tic"},
            events={
                "hits": Event("was hit by a fireball", "was hit by {} fireballs"),
                "died": Event("died"),
            },
            variables={
                "health": "0 to 100",
                "ammo": "bullets left: there is no weapon here",
                "killed": "monsters killed",
            },
            captions=("health",),
            players={"dodge": DODGE},
            expert="dodge",
        )
