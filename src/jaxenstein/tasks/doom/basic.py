"""ViZDoom's Basic, tic by tic: step to the side until the monster stands ahead, and shoot it."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ...about import About
from ...environment import Info
from ...maps.things import CACODEMON, RGB
from ...params import Params, Scalar
from ..draws import draw_index
from .aiming import STEP_AND_SHOOT
from .buttons import ATTACK, MOVE_LEFT, MOVE_RIGHT
from .fixed import ONE
from .look import CACODEMONS, OCHRE, SLATE, TAN, TILES, Picture
from .shooter import EVENTS, DoomShooter, DoomShooterState

# The monster stands on the line x = 0, from the one y to the other, and is so wide.
LOWEST, HIGHEST = -161, 224
HALF_WIDTH = 31


class DoomBasicParams(Params):
    """The numbers of the task.

    Attributes:
        kill_reward: reward of hitting the monster.
        shot_reward: reward of each shot, that one included.
        living_reward: reward of every tic.
    """

    max_steps_in_episode: Scalar = 300
    discount: Scalar = 0.99
    kill_reward: Scalar = 106.0
    shot_reward: Scalar = -5.0
    living_reward: Scalar = -1.0


class DoomBasicState(DoomShooterState):
    """State of the task.

    Attributes:
        target: int32[2], where the monster is, map units in 16.16.
        killed: bool[], whether it was hit; the next tic ends the episode.
    """

    target: jax.Array
    killed: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomBasic(DoomShooter[DoomBasicState, DoomBasicParams]):
    """Shoot a monster that does nothing, with a pistol. The player steps aside, but cannot turn.

    Reward: `kill_reward` for the hit, `shot_reward` for every shot, `living_reward` in every tic.
    The tic after the hit terminates.
    """

    params_class: ClassVar[type[Params]] = DoomBasicParams
    map_name: ClassVar[str] = "basic"
    success_event: ClassVar[str] = "kills"
    success_count: ClassVar[str] = "KILLCOUNT"
    button_names: ClassVar[tuple[str, ...]] = (MOVE_LEFT, MOVE_RIGHT, ATTACK)
    pictures: ClassVar[tuple[Picture, ...]] = CACODEMONS
    game_things: ClassVar[tuple[str, ...]] = ("Cacodemon",)
    thing_labels: ClassVar[tuple[int, ...]] = (CACODEMON.label,)
    floor: ClassVar[RGB] = TAN
    ceiling: ClassVar[RGB] = SLATE

    @property
    def half_widths(self) -> np.ndarray:
        """int32[1]: of the monster."""
        return np.array([HALF_WIDTH], np.int32)

    def init_state(self, key: jax.Array, params: DoomBasicParams) -> DoomBasicState:
        """Draw where the monster stands."""
        del params
        bits = jax.random.bits(key, (3,), jnp.uint32)
        y = LOWEST * ONE + draw_index(bits[2], (HIGHEST - LOWEST) * ONE + 1)
        return DoomBasicState(
            **self.drawn(bits[:2], (0, 0)),
            **self.armed(),
            target=jnp.stack([jnp.int32(0), y]),
            killed=jnp.bool_(False),
        )

    def transition(
        self, key: jax.Array, state: DoomBasicState, action: jax.Array, params: DoomBasicParams
    ) -> tuple[DoomBasicState, jax.Array, jax.Array, Info]:
        """Shoot, then move."""
        over, origin = state.killed, state.fixed_position
        bits = jax.random.bits(key, (), jnp.uint32)
        state, fires, towards = self.shoot(state, state.angle, action, bits)
        state, _ = self.moved(state, action)
        state, hits = self.hit(state, origin, fires, towards)
        reward = params.living_reward + jnp.where(fires, params.shot_reward, 0)
        reward = reward + jnp.where(hits, params.kill_reward, 0)
        events = {"shots": fires.astype(jnp.int32), "kills": hits.astype(jnp.int32)}
        return state.replace(killed=over | hits), reward, over, events

    def hit(
        self, state: Any, origin: jax.Array, fires: jax.Array, towards: jax.Array
    ) -> tuple[Any, jax.Array]:
        """The state after a shot, if there was one, and bool[] whether the monster is hit now."""
        there = ~state.killed[None]
        return state, fires & self.struck(origin, towards, state.target[None], there)[0]

    def about(self) -> About:
        """What the task says of itself."""
        return About(
            aim="hit the monster",
            ends="in the tic after the hit",
            rewards={
                "kill_reward": "{:+g} for the hit",
                "shot_reward": "{:+g} a shot",
                "living_reward": "{:+g} a tic",
            },
            events=EVENTS,
            variables={"health": "0 to 100", "ammo": "bullets left"},
            captions=("ammo",),
            players={"step_and_shoot": STEP_AND_SHOOT},
            expert="step_and_shoot",
            lasting=("killed",),
        )

    def things(self, state: DoomBasicState) -> tuple[jax.Array, jax.Array, jax.Array]:
        """The monster."""
        return state.target[None], state.killed[None].astype(jnp.int32), jnp.ones(1, bool)

    def with_things(self, state: DoomBasicState, health: int, things: np.ndarray) -> DoomBasicState:
        """The state with the monster of the game."""
        rows = things[things[:, 0] == 0]
        target = rows[0, 1:3].astype(np.int32) if len(rows) else state.target
        return state.replace(target=target, health=np.int32(health))


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomSimplerBasic(DoomBasic):
    """Basic in a room that is 64 map units shorter, with brighter walls."""

    map_name: ClassVar[str] = "simpler-basic"
    floor: ClassVar[RGB] = TILES
    ceiling: ClassVar[RGB] = OCHRE
