"""ViZDoom's Basic, tic by tic: step to the side until the monster is ahead, and shoot it.

Also Simpler Basic, in which the monster is closer, and Rocket Basic, with a rocket launcher.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import Any, ClassVar, Literal

import jax
import jax.numpy as jnp
import numpy as np

from ...about import About, Choose, Player
from ...environment import Info
from ...fields import choice
from ...params import Params, Scalar
from ...players.chance import NO_OP
from ..draws import sample_index
from ..health import FULL_HEALTH
from .arsenal import Arsenal
from .fixed import ONE
from .game_things import Look, Shown
from .monster_kinds import CACODEMON
from .monster_looks import TARGET
from .motion import moved
from .parts import Game, GameObject, Health, Part, Sprites
from .physics import ATTACK, MOVE_LEFT, MOVE_RIGHT
from .pose import DoomState
from .projectiles import Missiles, Projectiles, launch, rockets, with_player
from .scenario import DoomScenario
from .view import OCHRE, SLATE, TAN, TILES, Room
from .weapons import PISTOL, ROCKET_LAUNCHER, SHOOTING, Slot, Trigger

# The monster is on the line x = 0, between these two y.
LOWEST, HIGHEST = -161, 224
HALF_WIDTH = CACODEMON.half_width
_NO_WALLS = np.zeros((0, 4), np.float32)
# How far a player with velocity 1 moves in the 4 or 8 tics before the shot and until it stops; the
# distance in map units at which a shot still hits with some margin.
_COASTS, _STOPS, _NEAR = {4: 3.2, 8: 5.6}, 9.0, 24


class DoomBasicParams(Params):
    """The params of the task.

    Attributes:
        kill_reward: reward of hitting the monster.
        shot_reward: reward of each shot, including the one that hits.
        living_reward: reward of every tic.
    """

    max_steps_in_episode: Scalar = 300
    discount: Scalar = 0.99
    kill_reward: Scalar = 106.0
    shot_reward: Scalar = -5.0
    living_reward: Scalar = -1.0


class DoomBasicState(DoomState):
    """The state of the task.

    Attributes:
        health: int32[], of the player.
        trigger: the state of the weapon.
        target: int32[2], the position of the monster, map units in 16.16.
        killed: bool[], whether it was hit; the next tic ends the episode.
        rockets: rockets in flight; None if the weapon fires bullets.
    """

    health: jax.Array
    trigger: Trigger
    target: jax.Array
    killed: jax.Array
    rockets: Projectiles | None = None


class Target(Part):
    """A passive monster: `state.target` and `state.killed`."""

    objects = (GameObject(CACODEMON.game_name, CACODEMON.label, CACODEMON.pictures[2:]),)

    @property
    def looks(self) -> tuple[Look, ...]:
        """The game's pictures of the monster alive and hit."""
        return TARGET

    def sprites(self, state: Any) -> Sprites:
        """The monster, alive or dead."""
        dead = state.killed[None].astype(jnp.int32)
        return Sprites(self._place(state), dead, jnp.ones(1, bool))

    def _place(self, state: Any) -> jax.Array:
        """int32[1, 2]: where the monster is."""
        return state.target[None]

    def shown(self, state: Any, tic: jax.Array) -> Shown:
        """The monster, which looks west, in the game's pictures."""
        del tic
        west = jnp.full(1, np.uint32(1 << 31))
        places, looks, visible, _ = self.sprites(state)
        return Shown(places, looks, visible, west)

    def from_game(self, state: Any, game: Game) -> Any:
        """Read the monster from the game."""
        rows = game.of(CACODEMON.game_name)
        return state.replace(target=rows[0, :2].astype(np.int32)) if len(rows) else state


Hall = Literal["basic", "simpler-basic"]
_ROOMS = {
    "basic": Room("basic", floor=TAN, ceiling=SLATE),
    "simpler-basic": Room("simpler-basic", floor=TILES, ceiling=OCHRE),
}


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomBasic(DoomScenario[DoomBasicState, DoomBasicParams]):
    """Shoot a passive monster. The player steps sideways but cannot turn.

    The weapon is a pistol, whose bullet hits at once, or a rocket launcher, whose rocket needs a
    second to arrive. Rockets have no width here, so they must hit the monster itself. The launcher
    only accepts ATTACK after it is raised and ATTACK has been released. Reward: `kill_reward` for
    the hit, `shot_reward` for every shot, `living_reward` in every tic. The tic after the hit
    terminates the episode.

    Attributes:
        hall: `"basic"`, or `"simpler-basic"`: 64 map units shorter, with brighter walls.
        rocket: whether the weapon is the rocket launcher.
    """

    hall: Hall = choice("basic", Hall)
    rocket: bool = False

    params_class: ClassVar[type[Params]] = DoomBasicParams
    success_event: ClassVar[str] = "kills"
    success_count: ClassVar[str] = "KILLCOUNT"
    takes_game_look: ClassVar[bool] = True
    first_tic: ClassVar[int] = 14
    button_names: ClassVar[tuple[str, ...]] = (MOVE_LEFT, MOVE_RIGHT, ATTACK)

    @property
    def room(self) -> Room:
        """A rectangular room."""
        return _ROOMS[self.hall]

    @property
    def scenario(self) -> str | None:
        """Its name in ViZDoom; Rocket Basic plays in the room of Simpler Basic."""
        if self.rocket:
            return "rocket_basic" if self.hall == "simpler-basic" else None
        return super().scenario

    @functools.cached_property
    def arsenal(self) -> Arsenal:
        """The weapon."""
        weapon = ROCKET_LAUNCHER if self.rocket else PISTOL
        return Arsenal([Slot(weapon)], raise_tics=3 if self.rocket else 0)

    @functools.cached_property
    def rockets(self) -> Missiles:
        """The rockets; none for the pistol."""
        pictured = self.look == "game"
        return rockets(
            3 if self.rocket else 0, half_width=0, name="CustomRocket", pictured=pictured
        )

    @functools.cached_property
    def parts(self) -> tuple[Part, ...]:
        """Health, weapon, monster, and rockets if there are any."""
        missiles = (self.rockets,) if self.rocket else ()
        return (Health(FULL_HEALTH), self.arsenal, Target(), *missiles)

    def init_state(self, key: jax.Array, params: DoomBasicParams) -> DoomBasicState:
        """Sample the position of the monster."""
        del params
        bits = jax.random.bits(key, (3,), jnp.uint32)
        y = LOWEST * ONE + sample_index(bits[2], (HIGHEST - LOWEST) * ONE + 1)
        return DoomBasicState(
            **self.start_pose(bits[:2]),
            health=jnp.int32(FULL_HEALTH),
            trigger=self.arsenal.trigger(),
            target=jnp.stack([jnp.int32(0), y]),
            killed=jnp.bool_(False),
            rockets=self.rockets.none() if self.rocket else None,
        )

    def transition(
        self, key: jax.Array, state: DoomBasicState, action: jax.Array, params: DoomBasicParams
    ) -> tuple[DoomBasicState, jax.Array, jax.Array, Info]:
        """Shoot, then move."""
        over, origin = state.killed, state.fixed_position
        bits = jax.random.bits(key, (), jnp.uint32)
        attack = jnp.asarray(self.pressed(action).attack)
        state, fires = self.arsenal.tic(state, attack, self.held(action))
        state, _ = moved(self, state, action)
        widths = np.array([HALF_WIDTH], np.int32)
        targets = state.target[None], widths, ~state.killed[None]
        if state.rockets is None:
            damage = self.arsenal.bullets(state, (fires, origin), targets, _NO_WALLS, bits[None])
            hits = damage[0] > 0
        else:
            flying = launch(state.rockets, ROCKET_LAUNCHER, fires, origin, state.angle)
            after, met = self.rockets.fly(flying, with_player(origin, targets), _NO_WALLS)
            state, hits = state.replace(rockets=after), jnp.any(met[:, 1])
        reward = params.living_reward + jnp.where(fires, params.shot_reward, 0)
        reward = reward + jnp.where(hits, params.kill_reward, 0)
        events = {"shots": fires.astype(jnp.int32), "kills": hits.astype(jnp.int32)}
        return state.replace(killed=over | hits), reward, over, events

    def about(self) -> About:
        """A description of the task."""
        return About(
            aim="hit the monster",
            ends="in the tic after the hit",
            rewards={
                "kill_reward": "{:+g} for the hit",
                "shot_reward": "{:+g} per shot",
                "living_reward": "{:+g} per tic",
            },
            events=SHOOTING,
            variables={"health": "0 to 100", "ammo": "bullets left"},
            captions=("ammo",),
            players={"step_and_shoot": STEP_AND_SHOOT},
            expert="step_and_shoot",
            lasting=("killed",),
        )


def step_and_shoot(env: DoomBasic, params: Any) -> Choose:
    """Step sideways until a shot would hit the monster, then shoot."""
    del params
    left, right, shoot = (env.index_of(name) for name in (MOVE_LEFT, MOVE_RIGHT, ATTACK))
    coasts = _COASTS[env.arsenal.slots[0].weapon.shot]

    def choose(key: jax.Array, state: DoomBasicState) -> jax.Array:
        del key
        gap = (state.target[1] - state.fixed_position[1]).astype(jnp.float32) * (1 / ONE)
        speed = state.fixed_velocity[1].astype(jnp.float32) * (1 / ONE)
        aligned = jnp.abs(gap - coasts * speed) < _NEAR
        step = jnp.where(gap - _STOPS * speed > 0, jnp.int32(left), jnp.int32(right))
        acts = jnp.where(aligned, jnp.int32(shoot), step)
        return jnp.where(env.arsenal.locked(state.time), NO_OP, acts)

    return choose


STEP_AND_SHOOT = Player(
    "steps aside until the monster is ahead, then shoots; sees the whole state", step_and_shoot
)
