"""ViZDoom's My Way Home, tic by tic: find the green armour in a maze of eight rooms."""

from __future__ import annotations

import dataclasses
import functools
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ...about import About, Event
from ...engine.scene import Theme
from ...environment import Info
from ...params import Params, Scalar
from .buttons import FORWARD, MOVE_LEFT, MOVE_RIGHT, TURN_LEFT, TURN_RIGHT
from .fixed import ONE
from .look import BROWN, VEST, doom_theme
from .players import SHORTEST_PATH
from .scenario import ANY_ANGLE, DoomScenario, DoomState, near
from .walls import ARMOUR, MAP_SPOT

# Half-widths of the player and of the armour.
REACH = 16 + 20
EVERY_SPOT = tuple(range(10, 27))


class DoomHomeParams(Params):
    """The numbers of the task.

    Attributes:
        goal_reward: reward of touching the armour.
        living_reward: reward of every tic, that one included.
    """

    max_steps_in_episode: Scalar = 2100
    discount: Scalar = 0.999
    goal_reward: Scalar = 1.0
    living_reward: Scalar = -0.0001


class DoomHomeState(DoomState):
    """State of the task.

    Attributes:
        taken: bool[], whether the armour has been taken; the next tic ends the episode.
    """

    taken: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomMyWayHome(DoomScenario[DoomHomeState, DoomHomeParams]):
    """Find the green armour. Doom's own motion, so nothing learned here is lost in the game.

    Reward: `goal_reward` in the tic that touches the armour, and `living_reward` in every tic.
    The tic after it, in which the game leaves the level, terminates.

    Attributes:
        spots: ids of the map spots where episodes start, 10 to 26.
        angles: the first heading, the lowest and the highest, in 65536ths of a circle
            counterclockwise from east.
    """

    spots: tuple[int, ...] = EVERY_SPOT
    angles: tuple[int, int] = ANY_ANGLE

    params_class: ClassVar[type[Params]] = DoomHomeParams
    map_name: ClassVar[str] = "my-way-home"
    success_event: ClassVar[str] = "reached_goal"
    unit: ClassVar[int] = 16
    button_names: ClassVar[tuple[str, ...]] = (
        TURN_LEFT,
        TURN_RIGHT,
        FORWARD,
        MOVE_LEFT,
        MOVE_RIGHT,
    )

    game_things: ClassVar[tuple[str, ...]] = ("GreenArmor",)

    @property
    def scenario(self) -> str | None:
        """Its name in ViZDoom, which has no sparse variants."""
        whole = (self.spots, self.angles) == (EVERY_SPOT, ANY_ANGLE)
        return super().scenario if whole else None

    @property
    def starts(self) -> np.ndarray:
        """float[n, 2]: the map spots."""
        spots = self.doom_map.of_kind(MAP_SPOT)
        return np.array([(spot.x, spot.y) for spot in spots if spot.id in self.spots])

    @property
    def goals(self) -> np.ndarray:
        """float[1, 2]: the armour."""
        return np.array([(thing.x, thing.y) for thing in self.doom_map.of_kind(ARMOUR)])

    @functools.cached_property
    def theme(self) -> Theme:
        """How the maze looks."""
        light = self.doom_map.light
        return doom_theme((VEST,), floor=BROWN, ceiling=BROWN, level=light, unit=self.unit)

    def init_state(self, key: jax.Array, params: DoomHomeParams) -> DoomHomeState:
        """Draw spot and heading."""
        del params
        pose = self.drawn(jax.random.bits(key, (2,), jnp.uint32), self.angles)
        return DoomHomeState(**pose, taken=jnp.bool_(False))

    def transition(
        self, key: jax.Array, state: DoomHomeState, action: jax.Array, params: DoomHomeParams
    ) -> tuple[DoomHomeState, jax.Array, jax.Array, Info]:
        """Move, and look whether the armour was touched."""
        del key
        leaves = state.taken
        state, tried = self.moved(state, action)
        reached = near(tried, self._armour, REACH) & ~leaves
        reward = params.living_reward + jnp.where(reached, params.goal_reward, 0)
        state = state.replace(taken=leaves | reached)
        return state, reward, leaves, {"reached_goal": reached}

    def describe(self, state: DoomHomeState, params: DoomHomeParams) -> Info:
        """Add the straight-line distance to the armour, in tiles."""
        offset = self.to_tiles(self._armour) - state.position
        distance = jnp.sqrt(jnp.sum(offset**2))
        return super().describe(state, params) | {"distance_to_goal": distance}

    def about(self) -> About:
        """What the task says of itself."""
        return About(
            aim="reached the armour",
            ends="in the tic after the armour was reached",
            rewards={"goal_reward": "{:+g} at the armour", "living_reward": "{:+g} a tic"},
            events={"reached_goal": Event("reached the armour")},
            variables={"distance_to_goal": "tiles to the armour, in a straight line"},
            players={"shortest_path": SHORTEST_PATH},
            expert="shortest_path",
            lasting=("taken",),
        )

    def things(self, state: DoomHomeState) -> tuple[jax.Array, jax.Array, jax.Array]:
        """The armour."""
        return self._armour[None], jnp.zeros(1, jnp.int32), ~state.taken[None]

    @property
    def _armour(self) -> jax.Array:
        return jnp.asarray((self.goals[0] * ONE).astype(np.int32))
