"""Scripted players: what a task yields to nobody, to chance, and to one who sees the whole state.

Each player is a function of an environment and its params that returns `choose(key, state)`,
which gives the next action as int32[]. Players keep nothing from one step to the next and are
pure, so they run under `jax.jit`, `jax.vmap` and `jax.lax.scan`. They read the state, not the
picture: they show that a task can be solved. None goes out of its way for apples.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .engine.level import Level
from .engine.motion import forward, touched_door
from .environment import Environment
from .errors import SettingError
from .maps.reach import open_tiles, walking_distances
from .maps.tilemap import TileMap
from .pytree import PyTreeNode
from .tasks.health_gathering import FULL_HEALTH, HealthGathering
from .tasks.key_corridor import KeyCorridor
from .tasks.navigation import Navigation
from .tasks.steering import FORWARD, INTERACT, TURN_LEFT, TURN_RIGHT

Choose = Callable[[jax.Array, Any], jax.Array]
"""(key, state) -> int32[], the next action."""
Player = Callable[[Environment[Any, Any], Any], Choose]
"""(env, params) -> `Choose`."""

NOTHING = -1
_FAR = 2**14
_MOST_KEYS = 8
_BESIDE = np.array(((1, 0), (-1, 0), (0, 1), (0, -1)), np.int32)
# Added to half a turn (radians), lest rounding turn a player to and fro for ever.
_SLACK = 1e-3


class Episodes(PyTreeNode):
    """What came of B episodes.

    Attributes:
        returned: float32[B], undiscounted sums of rewards.
        length: int32[B], steps.
        terminated: bool[B], whether the task ended it; else the time limit did.
        successes: int32[B], how often the task's aim was reached.
    """

    returned: jax.Array
    length: jax.Array
    terminated: jax.Array
    successes: jax.Array


def idle(env: Environment[Any, Any], params: Any) -> Choose:
    """Never do anything: the action is -1, which is outside every action space."""
    del env, params

    def choose(key: jax.Array, state: Any) -> jax.Array:
        del key, state
        return jnp.int32(NOTHING)

    return choose


def uniform(env: Environment[Any, Any], params: Any) -> Choose:
    """Draw each action uniformly."""
    del params

    def choose(key: jax.Array, state: Any) -> jax.Array:
        del state
        return jax.random.randint(key, (), 0, env.num_actions, jnp.int32)

    return choose


def greedy_medkits(env: Environment[Any, Any], params: Any) -> Choose:
    """Go to the nearest medkit, wait there until all of it is needed, then take it.

    Raises:
        SettingError: the environment is not health-gathering.
    """
    if not isinstance(env, HealthGathering):
        raise SettingError(f"greedy_medkits plays health-gathering, not {env.name!r}")

    def choose(key: jax.Array, state: Any) -> jax.Array:
        del key
        offset = state.medkits - state.position[None]
        distance = jnp.where(state.present, jnp.sum(offset**2, axis=-1), jnp.inf)
        offset = offset[jnp.argmin(distance)]
        in_reach = jnp.all(jnp.abs(offset) < params.pickup_reach)
        needed = state.health <= FULL_HEALTH - params.heal
        wait = ~jnp.any(state.present) | (in_reach & ~needed)
        return jnp.where(
            wait, NOTHING, _towards(state.heading, offset, params.turn_angle * env.frame_skip)
        )

    return choose


def shortest_path(env: Environment[Any, Any], params: Any) -> Choose:
    """Walk to the goal over the fewest tiles, by way of keys where locked doors are in between.

    Paths are 4-connected. Where the goal is behind a locked door, the nearest key that is left is
    fetched first.

    Raises:
        SettingError: the environment has no goal to walk to, or more than 8 keys.
    """
    if isinstance(env, KeyCorridor):
        field_of = _corridor_field
    elif isinstance(env, Navigation):
        tables = distance_tables(env.tilemap)
        field_of = functools.partial(_table_field, tables)
    else:
        raise SettingError(f"shortest_path plays tasks with a goal, not {env.name!r}")

    def choose(key: jax.Array, state: Any) -> jax.Array:
        del key
        target = _next_tile(field_of(state), state)
        offset = target.astype(jnp.float32) + 0.5 - state.position
        action = _towards(state.heading, offset, params.turn_angle * env.frame_skip)
        scene = env.scene(state, params)
        opens = _faces_door(scene.level, scene.closed, state, target, params)
        return jnp.where(opens, INTERACT, action)

    return choose


PLAYERS: dict[str, Player] = {
    "idle": idle,
    "uniform": uniform,
    "greedy_medkits": greedy_medkits,
    "shortest_path": shortest_path,
}
"""All players by name."""


def expert(env: Environment[Any, Any]) -> str:
    """Name of the player that knows how the environment's task is done."""
    return "greedy_medkits" if isinstance(env, HealthGathering) else "shortest_path"


@functools.partial(jax.jit, static_argnums=(0, 1))
def play(
    env: Environment[Any, Any], player: Player, params: Any, key: jax.Array, states: Any
) -> Episodes:
    """Play one episode from each state to its end, without drawing a picture.

    Args:
        env: the environment; its `autoreset` does not matter.
        player: one of `PLAYERS`.
        params: its params.
        key: the random key of all steps.
        states: B first states, each leaf with a leading axis `B`.
    """
    choose = player(env, params)
    batch = states.done.shape[0]

    def advance(key: jax.Array, state: Any) -> tuple[Any, jax.Array, jax.Array]:
        policy_key, step_key = jax.random.split(key)
        action = choose(policy_key, state)
        after, _, terminated, info = env.advance(step_key, state, action, params)
        success = info["success"] & ~state.done
        after = jax.tree.map(lambda old, new: jnp.where(state.done, old, new), state, after)
        return after, terminated & ~state.done, success.astype(jnp.int32)

    def body(carry: tuple[Any, ...]) -> tuple[Any, ...]:
        key, states, terminated, successes = carry
        key, step_key = jax.random.split(key)
        states, ended, reached = jax.vmap(advance)(jax.random.split(step_key, batch), states)
        return key, states, terminated | ended, successes + reached

    start = key, states, jnp.zeros(batch, bool), jnp.zeros(batch, jnp.int32)
    end = jax.lax.while_loop(lambda carry: ~jnp.all(carry[1].done), body, start)
    _, states, terminated, successes = end
    return Episodes(
        returned=states.episode_return,
        length=states.time,
        terminated=terminated,
        successes=successes,
    )


@functools.lru_cache(maxsize=16)
def distance_tables(tilemap: TileMap) -> np.ndarray:
    """int16[2**K, goals, rows, columns]: tiles still to walk, for each set of K keys taken.

    Bit k of the first index says whether key k is taken. From tiles that reach the goal through
    the doors that these keys open, the distance is that to the goal; from others, that to the
    nearest key left; 16384 where neither can be reached.

    Args:
        tilemap: the map, with at most 8 keys.

    Raises:
        SettingError: there are more keys.
    """
    keys = tilemap.keys
    if len(keys) > _MOST_KEYS:
        raise SettingError(f"shortest_path can plan for {_MOST_KEYS} keys, not {len(keys)}")
    tables = []
    for taken in range(2 ** len(keys)):
        carried = {key.colour for k, key in enumerate(keys) if taken >> k & 1}
        walkable = open_tiles(tilemap, locked=False)
        for door in tilemap.doors:
            walkable[door.row, door.column] |= door.colour in carried
        left = tuple((key.column, key.row) for k, key in enumerate(keys) if not taken >> k & 1)
        to_key = np.full((1, *walkable.shape), _FAR)
        if left:
            steps = walking_distances(walkable, left)
            to_key = np.where(steps < 0, _FAR, steps).min(axis=0, keepdims=True)
        to_goal = walking_distances(walkable, tilemap.goals)
        tables.append(np.where(to_goal < 0, to_key, to_goal).astype(np.int16))
    return np.stack(tables)


def _table_field(tables: np.ndarray, state: Any) -> jax.Array:
    """int32[rows, columns]: the distances that hold in a state of a fixed map."""
    weights = 2 ** np.arange(state.taken.shape[0], dtype=np.int32)
    taken = jnp.sum(jnp.where(state.taken, weights, 0), dtype=jnp.int32)
    return jnp.asarray(tables)[taken, state.goal].astype(jnp.int32)


def _corridor_field(state: Any) -> jax.Array:
    """int32[rows, columns]: distances to the key, or to the goal once the key is taken."""
    walls = jnp.asarray(state.level.walls)[0] != 0
    columns, rows = state.level.doors[:, 0], state.level.doors[:, 1]
    # An absent door stands on the map's border.
    passable = (~state.locked | state.taken) & (columns > 0)
    row, column = np.indices(walls.shape, np.int32)
    here = (column[None] == columns[:, None, None]) & (row[None] == rows[:, None, None])
    walkable = ~walls | jnp.any(here & passable[:, None, None], axis=0)
    target = jnp.floor(jnp.where(state.taken, state.goal, state.key)).astype(jnp.int32)
    return _flood(walkable, (column == target[0]) & (row == target[1]))


def _flood(walkable: jax.Array, target: jax.Array) -> jax.Array:
    """int32[rows, columns]: tiles on foot to the target, inside a map whose border is solid."""

    def relax(carry: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
        steps, _ = carry
        beside = [jnp.roll(steps, shift, axis) for axis in (0, 1) for shift in (1, -1)]
        nearer = jnp.minimum(steps, functools.reduce(jnp.minimum, beside) + 1)
        nearer = jnp.where(walkable, nearer, _FAR)
        return nearer, jnp.any(nearer != steps)

    start = jnp.where(target, 0, _FAR).astype(jnp.int32)
    return jax.lax.while_loop(lambda carry: carry[1], relax, (start, jnp.bool_(True)))[0]


def _next_tile(field: jax.Array, state: Any) -> jax.Array:
    """int32[2]: the tile to walk to: the neighbour nearest the target, or the target's own.

    Among equally near ones, that which takes the least turning.
    """
    rows, columns = field.shape
    cell = jnp.floor(state.position).astype(jnp.int32)
    beside = cell[None] + _BESIDE
    last = np.array((columns - 1, rows - 1), np.int32)
    inside = jnp.all((beside >= 0) & (beside <= last[None]), axis=-1)
    safe = jnp.clip(beside, 0, last[None])
    steps = jnp.where(inside, field[safe[:, 1], safe[:, 0]], _FAR)
    offset = beside.astype(jnp.float32) + 0.5 - state.position[None]
    ahead = jnp.sum(offset * forward(state.heading)[None], axis=-1)
    cosine = ahead / jnp.sqrt(jnp.sum(offset**2, axis=-1))
    best = jnp.argmin(steps.astype(jnp.float32) + 0.25 * (1 - cosine))
    return jnp.where(field[cell[1], cell[0]] == 0, cell, beside[best])


def _towards(heading: jax.Array, offset: jax.Array, angle: Any) -> jax.Array:
    """int32[]: forward if no turn by `angle` brings the heading nearer to the offset, or it."""
    error = jnp.arctan2(offset[1], offset[0]) - heading
    error = jnp.mod(error + math.pi, 2 * math.pi) - math.pi
    turn = jnp.where(error > 0, jnp.int32(TURN_RIGHT), jnp.int32(TURN_LEFT))
    aligned = jnp.abs(error) <= 0.5 * angle + _SLACK
    return jnp.where(aligned, jnp.int32(FORWARD), turn)


def _faces_door(
    level: Level, closed: jax.Array, state: Any, tile: jax.Array, params: Any
) -> jax.Array:
    """bool[]: whether interacting now would touch a closed door on that tile."""
    if level.doors.shape[0] == 0:
        return jnp.bool_(False)
    arm = forward(state.heading) * params.interact_distance
    touched = touched_door(level, closed, state.position, arm)
    return jnp.any(
        touched & jnp.all(jnp.asarray(level.doors) - level.margin == tile[None], axis=-1)
    )
