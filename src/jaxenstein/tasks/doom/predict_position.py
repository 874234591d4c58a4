"""ViZDoom's Predict Position, tic by tic: one rocket for a monster that walks back and forth."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ...about import About, Choose, Player
from ...environment import Info
from ...params import Params, Scalar
from ...players.chance import NO_OP
from ..draws import sample_index
from ..health import FULL_HEALTH
from .arsenal import Arsenal
from .basic import Target
from .collision import bearing, offsets, segments
from .fixed import ONE
from .game_things import Shown
from .monster_ai import approximate, turned, walk
from .monster_kinds import CACODEMON
from .monsters import Horde, Monsters
from .motion import moved
from .parts import Game, Health, Part
from .physics import ATTACK, TURN_LEFT, TURN_RIGHT
from .players import off_by
from .pose import DoomState
from .projectiles import Missiles, Projectiles, launch, rockets, with_player
from .scenario import DoomScenario
from .view import STEEL, TUBES, Room
from .weapons import ROCKET_LAUNCHER, SHOOTING, Slot, Trigger

# The monster: map units per step, where it turns back and how close to that, the lines on which it
# walks and starts, and its steps before the first tic.
STEP, _END, _NEAR, _LINES, _STARTS, _BEFORE = 20, 608, 52, 200, 600, 3
# The tics that the game waits after the only shot.
_WAITS = 46
# The distance in map units at which a shot still hits with some margin; a monster that walks past
# this y will turn back soon.
_SPARE, _TURNS_BACK = 24, 560


class DoomPredictParams(Params):
    """The params of the task.

    Attributes:
        kill_reward: reward of hitting the monster.
        living_reward: reward of every tic.
        aim_reward: reward of each radian by which the aim gets better, until the shot; worse aim
            costs as much. The best aim is where a rocket would meet the monster. 0 in the game.
    """

    max_steps_in_episode: Scalar = 300
    discount: Scalar = 0.99
    kill_reward: Scalar = 1.0
    living_reward: Scalar = -0.001
    aim_reward: Scalar = 0.0


class DoomPredictState(DoomState):
    """The state of the task.

    Attributes:
        health: int32[], of the player.
        trigger: the state of the weapon.
        monsters: the monster.
        rockets: the only rocket.
        line: int32[], the x on which the monster walks, 16.16 map units.
        northward: bool[], the direction in which it walks.
        waits: int32[], tics until the shot counts as missed; 0 before the shot.
        killed: bool[], whether the monster was hit; the next tic ends the episode.
    """

    health: jax.Array
    trigger: Trigger
    monsters: Monsters
    rockets: Projectiles
    line: jax.Array
    northward: jax.Array
    waits: jax.Array
    killed: jax.Array


class Walker(Target):
    """The monster: `state.monsters` and `state.killed`."""

    def _place(self, state: DoomPredictState) -> jax.Array:
        return state.monsters.position

    def shown(self, state: DoomPredictState, tic: jax.Array) -> Shown:
        """The monster in the game's pictures."""
        del tic
        places, looks, visible, _ = self.sprites(state)
        return Shown(places, looks, visible, state.monsters.facing)

    def from_game(self, state: DoomPredictState, game: Game) -> DoomPredictState:
        """Read the monster of the game, which looks in the direction of its walk."""
        rows = game.of(CACODEMON.game_name)
        if not len(rows):
            return state
        eighth = np.round(rows[0, 3] / 2**29).astype(np.int32) % 8
        monster = state.monsters.replace(
            position=rows[:1, :2].astype(np.int32),
            direction=eighth[None],
            facing=rows[:1, 3].astype(np.uint32),
        )
        return state.replace(monsters=monster)


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomPredictPosition(DoomScenario[DoomPredictState, DoomPredictParams]):
    """Hit a monster that walks back and forth with the only rocket, which needs a second to arrive.

    The player turns, but does not walk. Reward: `kill_reward` for the hit, `living_reward` in every
    tic. The tic after the hit terminates the episode, and so does the 46th tic after the shot.
    """

    params_class: ClassVar[type[Params]] = DoomPredictParams
    takes_game_look: ClassVar[bool] = True
    first_tic: ClassVar[int] = 16
    success_event: ClassVar[str] = "kills"
    success_count: ClassVar[str] = "KILLCOUNT"
    button_names: ClassVar[tuple[str, ...]] = (TURN_LEFT, TURN_RIGHT, ATTACK)

    @property
    def room(self) -> Room:
        """A long room."""
        return Room("predict-position", floor=STEEL, ceiling=TUBES)

    @functools.cached_property
    def horde(self) -> Horde:
        """The monster, and the walls that stop it and the rocket."""
        walls = segments(self.doom_map.walls)
        kinds = [dataclasses.replace(CACODEMON, speed=STEP)]
        return Horde(kinds, walls=walls, pictured=self.look == "game")

    @functools.cached_property
    def arsenal(self) -> Arsenal:
        """The rocket launcher, with its only rocket."""
        return Arsenal([Slot(ROCKET_LAUNCHER)], shots=1, raise_tics=1)

    @functools.cached_property
    def rockets(self) -> Missiles:
        """The rocket in flight."""
        return rockets(1, pictured=self.look == "game")

    @functools.cached_property
    def parts(self) -> tuple[Part, ...]:
        """Health, weapon, monster, rocket."""
        return Health(FULL_HEALTH), self.arsenal, Walker(), self.rockets

    def init_state(self, key: jax.Array, params: DoomPredictParams) -> DoomPredictState:
        """Sample the monster's line, position and direction; it is already walking."""
        del params
        bits = jax.random.bits(key, (3 + _BEFORE,), jnp.uint32)
        line = sample_index(bits[0], _LINES * ONE + 1)
        y = sample_index(bits[1], 2 * _STARTS * ONE + 1) - _STARTS * ONE
        one = jnp.ones(1, jnp.int32)
        monster = self.horde.placed(
            jnp.stack([line, y])[None], jnp.zeros(1, jnp.uint32), one > 0, one
        )
        state = DoomPredictState(
            **self.only_pose(),
            health=jnp.int32(FULL_HEALTH),
            trigger=self.arsenal.trigger(),
            monsters=monster.replace(frame=jnp.asarray(self.horde.walk), tics=one),
            rockets=self.rockets.none(),
            line=line,
            northward=bits[2] & 1 == 1,
            waits=jnp.int32(0),
            killed=jnp.bool_(False),
        )

        def step(number: jax.Array, state: DoomPredictState) -> DoomPredictState:
            after = self.patrol(state, bits[3 + number])
            return after.replace(monsters=after.monsters.replace(tics=one))

        state = jax.lax.fori_loop(0, _BEFORE, step, state)
        return state.replace(monsters=state.monsters.replace(tics=3 * one))

    def patrol(self, state: DoomPredictState, bits: jax.Array) -> DoomPredictState:
        """A tic of the monster's walk, with random bits uint32[]."""
        horde, monster = self.horde, state.monsters
        tics = monster.tics - 1
        steps = monster.living & (tics <= 0)
        end = jnp.where(state.northward, _END * ONE, -_END * ONE)
        offset = jnp.stack([state.line, end])[None] - monster.position
        arrives = steps & ~monster.just_attacked & (approximate(offset) < _NEAR * ONE)
        walks = steps & ~monster.just_attacked & ~arrives
        turns = steps & monster.just_attacked
        position, direction, steps_left = walk(
            horde, monster, state.fixed_position, offset, walks, turns, bits[None]
        )
        if horde.pictured:
            monster = monster.replace(facing=turned(monster, steps, steps & False, offset))
        monster = monster.replace(
            position=position,
            tics=jnp.where(steps, jnp.asarray(horde.frame_tics[horde.walk]), tics),
            direction=direction,
            steps_left=steps_left,
            # A monster that has arrived chooses another direction at its next step.
            just_attacked=jnp.where(steps, arrives, monster.just_attacked),
        )
        return state.replace(monsters=monster, northward=state.northward ^ arrives[0])

    def transition(
        self, key: jax.Array, state: DoomPredictState, action: jax.Array, params: DoomPredictParams
    ) -> tuple[DoomPredictState, jax.Array, jax.Array, Info]:
        """Turn, shoot; then the monster walks, and the rocket flies."""
        bits = jax.random.bits(key, (2,), jnp.uint32)
        over = state.killed | (state.waits == 1)
        origin, error = state.fixed_position, off_by(self.lead(state)[0])
        state, _ = moved(self, state, action)
        attack = jnp.asarray(self.pressed(action).attack)
        state, fires = self.arsenal.tic(state, attack, self.held(action))
        state = self.patrol(state, bits[1])
        target = state.monsters.position, self.horde.half_width, ~state.killed[None]
        flying = launch(state.rockets, ROCKET_LAUNCHER, fires, origin, state.angle)
        rocket, met = self.rockets.fly(flying, with_player(origin, target), self.horde.walls)
        hits = jnp.any(met[:, 1])
        waits = jnp.where(fires, _WAITS, jnp.maximum(state.waits - 1, 0))
        health = state.monsters.health * (~hits).astype(jnp.int32)
        state = state.replace(
            rockets=rocket,
            waits=waits,
            killed=state.killed | hits,
            monsters=state.monsters.replace(health=health),
        )
        reward = params.living_reward + jnp.where(hits, params.kill_reward, 0)
        aimed = params.aim_reward * (error - off_by(self.lead(state)[0]))
        reward = reward + jnp.where(state.trigger.ammo > 0, aimed, 0)
        events = {"shots": fires.astype(jnp.int32), "kills": hits.astype(jnp.int32)}
        return state, reward, over, events

    def lead(self, state: DoomPredictState) -> tuple[jax.Array, jax.Array]:
        """Where a rocket that is fired now meets the monster.

        Returns:
            int32[], how far to turn left, 2**32 per turn; float32[2], the offset in map units.
        """
        weapon, monster = ROCKET_LAUNCHER, state.monsters
        step = int(self.horde.speed[0]) / int(self.horde.frame_tics[self.horde.walk[0]])
        angles = np.arange(8) * (math.pi / 4)
        ways = np.stack([np.cos(angles), np.sin(angles)], axis=1) * step
        way = jnp.asarray(ways, jnp.float32)[monster.direction[0] % 8]
        target = place = offsets(state.fixed_position, monster.position)[0]
        for _ in range(3):
            flight = weapon.shot + jnp.sqrt(jnp.sum(target**2)) / weapon.speed
            target = place + way * flight
        error = bearing((target * ONE).astype(jnp.int32)) - state.angle.astype(jnp.int32)
        return error, target

    def about(self) -> About:
        """A description of the task."""
        return About(
            aim="hit the monster",
            ends="in the tic after the hit, and in the 46th after the shot",
            rewards={
                "kill_reward": "{:+g} for the hit",
                "living_reward": "{:+g} per tic",
                "aim_reward": "{:+g} per radian of better aim",
            },
            events=SHOOTING,
            variables={"health": "0 to 100", "ammo": "rockets left"},
            captions=("ammo",),
            players={"lead_and_shoot": LEAD_AND_SHOOT},
            expert="lead_and_shoot",
            lasting=("killed",),
        )


def lead_and_shoot(env: DoomPredictPosition, params: Any) -> Choose:
    """Turn to where the monster will be when the rocket arrives, and shoot."""
    del params
    left, right, shoot = (env.index_of(name) for name in (TURN_LEFT, TURN_RIGHT, ATTACK))

    def choose(key: jax.Array, state: DoomPredictState) -> jax.Array:
        del key
        error, target = env.lead(state)
        aligned = off_by(error) * jnp.sqrt(jnp.sum(target**2)) < _SPARE
        turn = jnp.where(error > 0, jnp.int32(left), jnp.int32(right))
        acts = jnp.where(aligned, jnp.int32(shoot), turn)
        # A monster that turns back soon could go anywhere.
        vain = (jnp.abs(target[1]) > _TURNS_BACK) | (state.trigger.ammo == 0)
        vain = vain | env.arsenal.locked(state.time)
        return jnp.where(vain, NO_OP, acts)

    return choose


LEAD_AND_SHOOT = Player(
    "turns to where the monster will be, and shoots; sees the whole state",
    lead_and_shoot,
    waits="waits: the monster turns back, or the rocket is fired",
)
