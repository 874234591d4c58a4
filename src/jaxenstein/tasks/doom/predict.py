"""ViZDoom's Predict Position, tic by tic: one rocket for a monster that walks to and fro."""

from __future__ import annotations

import dataclasses
import functools
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ...about import About
from ...environment import Info
from ...maps.things import RGB
from ...params import Params, Scalar
from ..draws import draw_index
from .aiming import LEAD_AND_SHOOT
from .buttons import ATTACK, TURN_LEFT, TURN_RIGHT
from .creatures import Creatures, approximate, placed, walk
from .fixed import ONE
from .kinds import CACODEMON, Roster
from .look import STEEL, TUBES
from .projectiles import Projectiles, no_projectiles
from .rockets import Rockets, flown, shown
from .shooter import EVENTS, DoomShooter, DoomShooterState
from .shots import segments

# The monster: map units a step, where it turns back and how near to it, the lines on which it
# walks and starts, its steps before the first tic.
STEP, _END, _NEAR, _LINES, _STARTS, _BEFORE = 20, 608, 52, 200, 600, 3
# From the only shot on, the game waits for so many tics.
_WAITS = 46
# Half-width of the rocket.
_ROCKET = 11


class DoomPredictParams(Params):
    """The numbers of Predict Position.

    Attributes:
        kill_reward: reward of hitting the monster.
        living_reward: reward of every tic.
    """

    max_steps_in_episode: Scalar = 300
    discount: Scalar = 0.99
    kill_reward: Scalar = 1.0
    living_reward: Scalar = -0.001


class DoomPredictState(DoomShooterState):
    """State of Predict Position.

    Attributes:
        creatures: the monster.
        rockets: the only one.
        line: int32[], the x on which the monster walks, 16.16 map units.
        northward: bool[], to which of its ends.
        waits: int32[], tics until the shot counts as missed; 0 before it.
        killed: bool[], whether the monster was hit; the next tic ends the episode.
    """

    creatures: Creatures
    rockets: Projectiles
    line: jax.Array
    northward: jax.Array
    waits: jax.Array
    killed: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomPredictPosition(Rockets, DoomShooter[DoomPredictState, DoomPredictParams]):
    """Hit a monster that walks to and fro with the only rocket, which needs a second to get there.

    The player turns, but does not walk. Reward: `kill_reward` for the hit, `living_reward` in every
    tic. The tic after the hit terminates, and so does the 46th after the shot.
    """

    params_class: ClassVar[type[Params]] = DoomPredictParams
    map_name: ClassVar[str] = "predict-position"
    success_event: ClassVar[str] = "kills"
    success_count: ClassVar[str] = "KILLCOUNT"
    button_names: ClassVar[tuple[str, ...]] = (TURN_LEFT, TURN_RIGHT, ATTACK)
    game_things: ClassVar[tuple[str, ...]] = ("Cacodemon", "Rocket")
    floor: ClassVar[RGB] = STEEL
    ceiling: ClassVar[RGB] = TUBES
    ammo: ClassVar[int] = 1
    draw_tics: ClassVar[int] = 1

    @functools.cached_property
    def roster(self) -> Roster:
        """The one monster."""
        return Roster([dataclasses.replace(CACODEMON, speed=STEP)])

    @functools.cached_property
    def monster_walls(self) -> np.ndarray:
        """float32[L, 4]: what stops it, and the rocket."""
        return segments(self.doom_map.walls)

    @property
    def half_widths(self) -> np.ndarray:
        """int32[1]: of the monster."""
        return self.roster.half_widths

    def init_state(self, key: jax.Array, params: DoomPredictParams) -> DoomPredictState:
        """Draw the monster's line, its place there and its way; it has begun to walk."""
        del params
        bits = jax.random.bits(key, (3 + _BEFORE,), jnp.uint32)
        line = draw_index(bits[0], _LINES * ONE + 1)
        y = draw_index(bits[1], 2 * _STARTS * ONE + 1) - _STARTS * ONE
        one = jnp.ones(1, jnp.int32)
        creatures = placed(
            self.roster, jnp.stack([line, y])[None], jnp.zeros(1, jnp.uint32), one > 0, one
        )
        state = DoomPredictState(
            **self.drawn(jnp.zeros(2, jnp.uint32), (0, 0)),
            **self.armed(),
            creatures=creatures.replace(frame=jnp.asarray(self.roster.walk), tics=one),
            rockets=no_projectiles(1),
            line=line,
            northward=bits[2] & 1 == 1,
            waits=jnp.int32(0),
            killed=jnp.bool_(False),
        )

        def step(number: jax.Array, state: DoomPredictState) -> DoomPredictState:
            after = self.patrol(state, bits[3 + number])
            return after.replace(creatures=after.creatures.replace(tics=one))

        state = jax.lax.fori_loop(0, _BEFORE, step, state)
        return state.replace(creatures=state.creatures.replace(tics=3 * one))

    def patrol(self, state: DoomPredictState, bits: jax.Array) -> DoomPredictState:
        """A tic of the monster on its way, with random bits uint32[]."""
        roster, monster = self.roster, state.creatures
        tics = monster.tics - 1
        steps = monster.living & (tics <= 0)
        end = jnp.where(state.northward, _END * ONE, -_END * ONE)
        offset = jnp.stack([state.line, end])[None] - monster.position
        arrives = steps & ~monster.struck & (approximate(offset) < _NEAR * ONE)
        walks = steps & ~monster.struck & ~arrives
        position, direction, leg = walk(
            roster,
            monster,
            state.fixed_position,
            offset,
            walks,
            steps & monster.struck,
            bits[None],
            self.monster_walls,
        )
        monster = monster.replace(
            position=position,
            tics=jnp.where(steps, jnp.asarray(roster.tics[roster.walk]), tics),
            direction=direction,
            leg=leg,
            # One that has got there chooses another direction at its next step.
            struck=jnp.where(steps, arrives, monster.struck),
        )
        return state.replace(creatures=monster, northward=state.northward ^ arrives[0])

    def transition(
        self, key: jax.Array, state: DoomPredictState, action: jax.Array, params: DoomPredictParams
    ) -> tuple[DoomPredictState, jax.Array, jax.Array, Info]:
        """Turn, shoot; then the monster walks, and the rocket flies."""
        bits = jax.random.bits(key, (2,), jnp.uint32)
        over = state.killed | (state.waits == 1)
        origin = state.fixed_position
        state, _ = self.moved(state, action)
        state, fires, towards = self.shoot(state, state.angle, action, bits[0])
        state = self.patrol(state, bits[1])
        target = state.creatures.position[0], ~state.killed
        shot = origin, fires, towards
        rockets, hits = flown(state.rockets, shot, target, self.monster_walls, _ROCKET)
        waits = jnp.where(fires, _WAITS, jnp.maximum(state.waits - 1, 0))
        health = state.creatures.health * (~hits).astype(jnp.int32)
        state = state.replace(
            rockets=rockets,
            waits=waits,
            killed=state.killed | hits,
            creatures=state.creatures.replace(health=health),
        )
        reward = params.living_reward + jnp.where(hits, params.kill_reward, 0)
        events = {"shots": fires.astype(jnp.int32), "kills": hits.astype(jnp.int32)}
        return state, reward, over, events

    def about(self) -> About:
        """What the task says of itself."""
        return About(
            aim="hit the monster",
            ends="in the tic after the hit, and in the 46th after the shot",
            rewards={"kill_reward": "{:+g} for the hit", "living_reward": "{:+g} a tic"},
            events=EVENTS,
            variables={"health": "0 to 100", "ammo": "rockets left"},
            captions=("ammo",),
            players={"lead_and_shoot": LEAD_AND_SHOOT},
            expert="lead_and_shoot",
            lasting=("killed",),
        )

    def things(self, state: DoomPredictState) -> tuple[jax.Array, jax.Array, jax.Array]:
        """The monster and the rocket."""
        return shown((state.creatures.position[0], ~state.killed), state.rockets)

    def with_things(
        self, state: DoomPredictState, health: int, things: np.ndarray
    ) -> DoomPredictState:
        """The state with the monster of the game, and where it looks for the way that it walks."""
        rows = things[things[:, 0] == 0]
        if len(rows):
            eighth = np.round(rows[0, 4] / 2**29).astype(np.int32) % 8
            monster = state.creatures.replace(
                position=rows[:1, 1:3].astype(np.int32), direction=eighth[None]
            )
            state = state.replace(creatures=monster)
        return state.replace(health=np.int32(health))
