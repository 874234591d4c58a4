"""Scripted players of Doom's scenarios, who know how its bodies get around."""

from __future__ import annotations

import functools
import heapq
import math
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import where_few
from ...about import Choose, Player
from ...players.chance import NO_OP
from ...players.walking import flood, walking_actions
from ..health import FULL_HEALTH
from .fixed import ONE
from .geometry import LATTICE, Geometry, load_geometry
from .shots import bearing

if TYPE_CHECKING:
    from .health_gathering import DoomHealthGathering, DoomHealthState
    from .scenario import DoomScenario

# A body walks on while its way is less than this off, in 2**32ths of a circle; a turn of a tic is
# 1.76 or 3.52 degrees.
ALIGNED = 1 << 25
# A straight way is looked at in so many steps; how much farther a medkit counts that is behind
# walls or poison, and how near poison is too near, in map units.
_STEPS, _BLOCKED, _POISONED, _CLEARANCE = 48, 1e4, 1e3, 60
# So near a medkit that is not needed, a player waits; so far it looks ahead on a way around, in
# nodes.
_ARRIVED, _AHEAD = 20, 2
# Places between which a way is free are looked at so far apart, in map units.
_SAMPLE = 2
_NEIGHBOURS = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]


def shortest_path(env: DoomScenario[Any, Any], params: Any) -> Choose:
    """Walk to the goal by the way that is shortest for the body's box."""
    del params
    table = jnp.asarray(waypoints(env.map_name, tuple(map(int, env.goals[0]))))
    walk = walker(env)

    def choose(key: jax.Array, state: Any) -> jax.Array:
        del key
        node = nearest_node(env.geometry, state.fixed_position)
        target = table[node[0], node[1]] * ONE
        return walk(state, target)

    return choose


SHORTEST_PATH = Player("walks the shortest way; sees the whole state", shortest_path)


def walker(env: DoomScenario[Any, Any]) -> Any:
    """A function of a state and an int32[2] place (16.16) that gives the action to get there."""
    left, right, ahead = walking_actions(env.action_names)

    def walk(state: Any, target: jax.Array) -> jax.Array:
        error = bearing(target - state.fixed_position) - state.angle.astype(jnp.int32)
        turn = jnp.where(error > 0, jnp.int32(left), jnp.int32(right))
        aligned = jnp.abs(error) < ALIGNED * env.frame_skip
        return jnp.where(aligned, jnp.int32(ahead), turn)

    return walk


def nearest_node(geometry: Geometry, position: jax.Array) -> jax.Array:
    """int32[2]: the point of the lattice of 16 units that is nearest to a position."""
    half = LATTICE * ONE // 2
    node = (position - jnp.asarray(geometry.origin) + half) // (LATTICE * ONE)
    return jnp.clip(node, 0, np.array(geometry.cells.shape, np.int32) - 1)


@functools.cache
def waypoints(map_name: str, goal: tuple[int, int]) -> np.ndarray:
    """int32[n, m, 2]: from each point of the lattice, the farthest one to walk straight to.

    Args:
        map_name: of the map.
        goal: where the ways lead, in map units, on the lattice.
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


def free_nodes(geometry: Geometry) -> np.ndarray:
    """bool[n, m]: the points of the lattice where a body may stand."""
    return (geometry.cells >> 3 & 1) == 0


def _node(geometry: Geometry, place: tuple[int, int]) -> tuple[int, int]:
    x, y = ((np.array(place) - geometry.origin // ONE) // LATTICE).tolist()
    return x, y


def _ways(free: np.ndarray, goal: tuple[int, int]) -> dict[tuple[int, int], tuple[int, int]]:
    """The next point of the shortest way to the goal, straight or across, from each point."""
    following: dict[tuple[int, int], tuple[int, int]] = {}
    far = {goal: 0.0}
    heap = [(0.0, goal)]
    while heap:
        distance, (x, y) = heapq.heappop(heap)
        if distance > far[x, y]:
            continue
        for i, j in _NEIGHBOURS:
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
    """Whether a body may walk from one point of the lattice straight to another."""
    a, b = (np.array(node) * LATTICE * ONE for node in (start, end))
    count = max(2, int(np.abs(b - a).max() / (_SAMPLE * ONE)) + 1)
    places = (a + (b - a) * np.linspace(0, 1, count)[:, None]).astype(np.int64)
    cell = places >> 20
    on_edge = (places & ((1 << 20) - 1)) == 0
    codes = geometry.cells[cell[:, 0], cell[:, 1]]
    return not (codes >> (on_edge[:, 0] + 2 * on_edge[:, 1]) & 1).any()


def greedy_medkits(env: DoomHealthGathering, params: Any) -> Choose:
    """Go to the nearest medkit that can be walked to straight, past no poison if possible.

    Where there is none, it goes by the way around the walls to the nearest.
    """
    del params
    count = env.kinds[0].capacity
    walk = walker(env)
    around = where_few(functools.partial(_way_around, env.geometry))

    def choose(key: jax.Array, state: DoomHealthState) -> jax.Array:
        del key
        medkits, there = state.places[:count], state.present[:count]
        offset = (medkits - state.fixed_position[None]).astype(jnp.float32) * (1 / ONE)
        distance = jnp.sqrt(jnp.sum(offset**2, axis=-1))
        free = there & _walkable(env.geometry, state.fixed_position, medkits)
        safe = ~_passes(offset, state.fixed_position, state.places[count:], state.present[count:])
        cost = jnp.where(there, distance, jnp.inf) + jnp.where(free, 0, _BLOCKED)
        nearest = jnp.argmin(cost + jnp.where(safe, 0, _POISONED))
        lost = there[nearest] & ~free[nearest]
        target = around(lost, state.fixed_position, medkits, there)
        target = jnp.where(lost, target, medkits[nearest])
        # One that is not needed now is left where it lies, and a body must move to take it.
        arrived = jnp.all(jnp.abs(target - state.fixed_position) < _ARRIVED * ONE)
        waits = arrived & (state.health >= FULL_HEALTH) | ~jnp.any(there)
        return jnp.where(waits, NO_OP, walk(state, target))

    return choose


GREEDY_MEDKITS = Player(
    "goes to the nearest medkit and waits there while it is not needed; sees the whole state",
    greedy_medkits,
    waits="waits: healthy",
)


def _walkable(geometry: Geometry, position: jax.Array, places: jax.Array) -> jax.Array:
    """bool[N]: whether a body may walk straight from a position to places int32[N, 2]."""
    part = np.linspace(0, 1, _STEPS + 1, dtype=np.float32)[1:-1]
    way = (places - position[None]).astype(jnp.float32)[:, None] * part[None, :, None]
    steps = position[None, None] + way.astype(jnp.int32)
    return ~jnp.any(jax.vmap(jax.vmap(geometry.blocked))(steps), axis=1)


def _passes(
    offset: jax.Array, position: jax.Array, poison: jax.Array, there: jax.Array
) -> jax.Array:
    """bool[N]: whether the straight way along float32[N, 2] map units comes near poison."""
    if poison.shape[0] == 0:
        return jnp.zeros(offset.shape[0], bool)
    place = (poison - position[None]).astype(jnp.float32) * (1 / ONE)
    length = jnp.maximum(jnp.sum(offset**2, axis=-1), 1)
    along = jnp.sum(place[None] * offset[:, None], axis=-1) / length[:, None]
    beside = place[None] - offset[:, None] * jnp.clip(along, 0, 1)[..., None]
    return jnp.any((jnp.sum(beside**2, axis=-1) < _CLEARANCE**2) & there[None], axis=1)


def _way_around(
    geometry: Geometry, position: jax.Array, medkits: jax.Array, there: jax.Array
) -> jax.Array:
    """int32[2]: where to walk to reach the nearest medkit over the lattice of 32 units."""
    shape = tuple(size // 2 for size in geometry.cells.shape)
    node = jax.vmap(functools.partial(nearest_node, geometry))(medkits) // 2
    node = jnp.minimum(node, np.array(shape, np.int32)[None] - 1)
    target = jnp.zeros(shape, bool).at[node[:, 0], node[:, 1]].max(there)
    free = free_nodes(geometry)[: 2 * shape[0] : 2, : 2 * shape[1] : 2]
    field = flood(jnp.asarray(np.pad(free, 1)), jnp.pad(target, 1))
    here = jnp.minimum(nearest_node(geometry, position) // 2, np.array(shape, np.int32) - 1)
    for _ in range(_AHEAD):
        beside = here[None] + np.array(_NEIGHBOURS, np.int32)
        best = jnp.argmin(field[beside[:, 0] + 1, beside[:, 1] + 1])
        nearer = field[beside[best][0] + 1, beside[best][1] + 1] < field[here[0] + 1, here[1] + 1]
        here = jnp.where(nearer, beside[best], here)
    return jnp.asarray(geometry.origin) + here * (2 * LATTICE * ONE)
