"""ViZDoom's My Way Home, tic by tic: find the green armour in a maze of eight rooms."""

from __future__ import annotations

import dataclasses
import functools
import heapq
import math
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ...about import About, Choose, Event, Player
from ...engine.motion import length
from ...engine.shade import ImageKind
from ...environment import Info
from ...params import Params, Scalar
from .collision import CELL_BITS, LATTICE, REACH, Geometry, load_geometry
from .fixed import ONE
from .game_look import gilded
from .items import Goal
from .maps import ARMOUR, MAP_SPOT
from .motion import moved
from .parts import Part
from .physics import FORWARD, MOVE_LEFT, MOVE_RIGHT, TURN_LEFT, TURN_RIGHT, touches
from .players import NEIGHBOURS, free_nodes, nearest_node, walker
from .pose import ANY_ANGLE, DoomState
from .scenario import DoomScenario
from .view import BROWN, Room

# The spacing of the points that are checked along a straight path, in map units.
_SAMPLE = 2
EVERY_SPOT = tuple(range(10, 27))


class DoomHomeParams(Params):
    """The params of the task.

    Attributes:
        goal_reward: reward of touching the armour.
        living_reward: reward of every tic, including the last one.
    """

    max_steps_in_episode: Scalar = 2100
    discount: Scalar = 0.999
    goal_reward: Scalar = 1.0
    living_reward: Scalar = -0.0001


class DoomHomeState(DoomState):
    """The state of the task.

    Attributes:
        taken: bool[], whether the armour has been taken; the next tic ends the episode.
    """

    taken: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomMyWayHome(DoomScenario[DoomHomeState, DoomHomeParams]):
    """Find the green armour, with Doom's own motion, so that policies transfer to the game.

    Reward: `goal_reward` in the tic that touches the armour, and `living_reward` in every tic.
    The tic after it, in which the game leaves the level, terminates the episode.

    Attributes:
        spots: ids of the map spots where episodes start, 10 to 26.
        angles: the lowest and the highest first heading, in 65536ths of a turn, counter-clockwise
            from east.
    """

    spots: tuple[int, ...] = EVERY_SPOT
    angles: tuple[int, int] = ANY_ANGLE

    params_class: ClassVar[type[Params]] = DoomHomeParams
    success_event: ClassVar[str] = "reached_goal"
    unit: ClassVar[int] = 16
    takes_game_look: ClassVar[bool] = True
    first_tic: ClassVar[int] = 10
    button_names: ClassVar[tuple[str, ...]] = (
        TURN_LEFT,
        TURN_RIGHT,
        FORWARD,
        MOVE_LEFT,
        MOVE_RIGHT,
    )

    @property
    def room(self) -> Room:
        """The maze."""
        return Room("my-way-home", floor=BROWN, ceiling=BROWN)

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
        return self.doom_map.places(ARMOUR)

    @functools.cached_property
    def goal(self) -> Goal:
        """The armour."""
        return Goal((self.goals[0] * ONE).astype(np.int32))

    @functools.cached_property
    def parts(self) -> tuple[Part, ...]:
        """The armour."""
        return (self.goal,)

    def init_state(self, key: jax.Array, params: DoomHomeParams) -> DoomHomeState:
        """Sample spot and heading."""
        del params
        pose = self.start_pose(jax.random.bits(key, (2,), jnp.uint32), self.angles)
        return DoomHomeState(**pose, taken=jnp.bool_(False))

    def transition(
        self, key: jax.Array, state: DoomHomeState, action: jax.Array, params: DoomHomeParams
    ) -> tuple[DoomHomeState, jax.Array, jax.Array, Info]:
        """Move, and check whether the armour was touched."""
        del key
        leaves = state.taken
        state, places = moved(self, state, action)
        reached = touches(places, jnp.asarray(self.goal.place), REACH) & ~leaves
        reward = params.living_reward + jnp.where(reached, params.goal_reward, 0)
        state = state.replace(taken=leaves | reached)
        return state, reward, leaves, {"reached_goal": reached}

    def draw(self, state: DoomHomeState, params: DoomHomeParams, kind: ImageKind) -> jax.Array:
        """Add the game's gold when the armour is taken."""
        image = super().draw(state, params, kind)
        shows = self.on_screen and kind in ("rgb", "gray")
        return gilded(image, state.taken) if shows else image

    def describe(self, state: DoomHomeState, params: DoomHomeParams) -> Info:
        """Add the straight-line distance to the armour, in tiles."""
        offset = self.to_tiles(jnp.asarray(self.goal.place)) - state.position
        return super().describe(state, params) | {"distance_to_goal": length(offset)}

    def about(self) -> About:
        """A description of the task."""
        return About(
            aim="reached the armour",
            ends="in the tic after the armour is reached",
            rewards={"goal_reward": "{:+g} at the armour", "living_reward": "{:+g} per tic"},
            events={"reached_goal": Event("reached the armour")},
            variables={"distance_to_goal": "tiles to the armour, in a straight line"},
            players={"shortest_path": SHORTEST_PATH},
            expert="shortest_path",
            lasting=("taken",),
        )


def shortest_path(env: DoomMyWayHome, params: Any) -> Choose:
    """Walk to the goal on the path that is shortest for the body's box."""
    del params
    table = jnp.asarray(waypoints(env.room.map_name, tuple(map(int, env.goals[0]))))
    walk = walker(env)

    def choose(key: jax.Array, state: Any) -> jax.Array:
        del key
        node = nearest_node(env.geometry, state.fixed_position)
        target = table[node[0], node[1]] * ONE
        return walk(state, target)

    return choose


SHORTEST_PATH = Player("walks the shortest path; sees the whole state", shortest_path)


@functools.cache
def waypoints(map_name: str, goal: tuple[int, int]) -> np.ndarray:
    """int32[n, m, 2]: from each lattice point, the farthest point to walk to in a straight line.

    Args:
        map_name: the name of the map.
        goal: the target in map units, on the lattice.
    """
    geometry = load_geometry(map_name)
    following = _ways(free_nodes(geometry), _node(geometry, goal))
    origin = geometry.origin // ONE
    table = np.zeros((*geometry.cells.shape, 2), np.int32)
    for node in np.ndindex(*geometry.cells.shape):
        target = node
        while (after := following.get(target)) and _is_straight(geometry, node, after):
            target = after
        table[node] = origin + np.array(target) * LATTICE
    return table


def _node(geometry: Geometry, place: tuple[int, int]) -> tuple[int, int]:
    x, y = ((np.array(place) - geometry.origin // ONE) // LATTICE).tolist()
    return x, y


def _ways(free: np.ndarray, goal: tuple[int, int]) -> dict[tuple[int, int], tuple[int, int]]:
    """The next point of the shortest path to the goal, straight or diagonal, from each point."""
    following: dict[tuple[int, int], tuple[int, int]] = {}
    far = {goal: 0.0}
    heap = [(0.0, goal)]
    while heap:
        distance, (x, y) = heapq.heappop(heap)
        if distance > far[x, y]:
            continue
        for i, j in NEIGHBOURS:
            step = x + i, y + j
            inside = 0 <= step[0] < free.shape[0] and 0 <= step[1] < free.shape[1]
            if not inside or not (free[step] and free[x, step[1]] and free[step[0], y]):
                continue
            length = distance + math.hypot(i, j)
            if length < far.get(step, math.inf) - 1e-9:
                far[step], following[step] = length, (x, y)
                heapq.heappush(heap, (length, step))
    return following


def _is_straight(geometry: Geometry, start: tuple[int, int], end: tuple[int, int]) -> bool:
    """Whether a body can walk straight from one lattice point to another."""
    a, b = (np.array(node) * LATTICE * ONE for node in (start, end))
    count = max(2, int(np.abs(b - a).max() / (_SAMPLE * ONE)) + 1)
    places = (a + (b - a) * np.linspace(0, 1, count)[:, None]).astype(np.int64)
    cell = places >> CELL_BITS
    on_edge = (places & ((1 << CELL_BITS) - 1)) == 0
    codes = geometry.cells[cell[:, 0], cell[:, 1]]
    return not (codes >> (on_edge[:, 0] + 2 * on_edge[:, 1]) & 1).any()
