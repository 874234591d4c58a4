"""Walking: distance fields, the next tile, and the action that leads there.

A task whose aim is a place only needs a distance field to have a player: `shortest_path` follows
`env.distance_field`. Paths are 4-connected.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from .._jax.batching import varying
from ..about import Choose, Player
from ..engine.motion import forward, touched_door, walk
from ..errors import SettingError
from ..maps.reach import open_tiles, walking_distances
from ..maps.tilemap import TileMap

if TYPE_CHECKING:
    from ..engine.scene import Scene

FAR = 2**20
"""The distance of unreachable tiles."""
_MOST_KEYS = 8
_BESIDE = np.array(((1, 0), (-1, 0), (0, 1), (0, -1)), np.int32)
# Added to half a turn (radians), so that rounding cannot make a player turn to and fro forever.
_SLACK = 1e-3
# Turns of more radians, or strides of more tiles, are simulated before they are taken.
_WIDE_TURN, _LONG_STRIDE = 0.3, 0.35
# How many turns either way are simulated, and the least progress of a stride, in tiles.
_TURNS, _LEAST_GAIN = 6, 1e-3
# The probability of a random action where strides may carry a player past the place.
_CHANCE = 0.25


class Movement(NamedTuple):
    """How an agent moves: the indices of its actions, and the effect of one decision.

    Attributes:
        left: the action that turns left.
        right: the action that turns right.
        forward: the action that walks.
        angle: radians turned per decision, over all its world steps (`frame_skip`).
        step: tiles walked per world step.
        steps: world steps per decision.
    """

    left: int
    right: int
    forward: int
    angle: Any
    step: Any
    steps: int


def movement_of(env: Any, params: Any) -> Movement:
    """The movement of an environment whose params have `turn_angle` and `move_distance`.

    Raises:
        SettingError: the environment has no actions for walking.
    """
    angle = params.turn_angle * env.frame_skip
    return Movement(*walking_actions(env.action_names), angle, params.move_distance, env.frame_skip)


def walking_actions(names: Sequence[str]) -> tuple[int, int, int]:
    """The indices of the actions "turn left", "turn right" and "forward".

    Raises:
        SettingError: an action is missing.
    """
    wanted = ("turn left", "turn right", "forward")
    if missing := [name for name in wanted if name not in names]:
        raise SettingError(
            f"walking needs the actions {', '.join(wanted)}; missing: {', '.join(missing)}"
        )
    left, right, ahead = (list(names).index(name) for name in wanted)
    return left, right, ahead


def shortest_path(env: Any, params: Any) -> Choose:
    """Walk down `env.distance_field`, and open doors on the way with the action "interact".

    The field is a function of the state: int32[rows, columns], the walking distance in tiles to
    the next target, `FAR` where there is no path.
    """
    body = movement_of(env, params)
    interact = list(env.action_names).index("interact") if "interact" in env.action_names else None

    def choose(key: jax.Array, state: Any) -> jax.Array:
        scene = env.scene(state, params)
        action, target = walk_down(body, scene, env.distance_field(state), key)
        if interact is None:
            return action
        opens = faces_door(scene, target, params.interact_distance)
        return jnp.where(opens, jnp.int32(interact), action)

    return choose


def walk_down(
    body: Movement, scene: Scene, field: jax.Array, key: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """int32[], the next action on the way down a field; int32[2], the tile it leads to.

    Args:
        body: the movement of the agent.
        scene: the pose and the solid tiles.
        field: int32[rows, columns], the walking distance in tiles to the target.
        key: the random key.
    """
    target = next_tile(field, scene)
    offset = target.astype(jnp.float32) + 0.5 - scene.position
    wide = (body.angle > _WIDE_TURN) | (body.step * body.steps > _LONG_STRIDE)
    looked = best_stride(body, scene, offset, field, key)
    return jnp.where(wide, looked, towards(body, scene, offset)), target


SHORTEST_PATH = Player("walks the shortest path over tiles; sees the whole state", shortest_path)


def towards(body: Movement, scene: Scene, offset: jax.Array, slack: float = 0.5) -> jax.Array:
    """int32[]: the next action towards a place that is in open view.

    Walks forward if no turn brings the heading closer to the place, otherwise turns. If turns are
    wide, the closest heading may lead into the wall beside the path; then the closest heading on
    the other side of the path is used, so that the player leaves the wall.

    Args:
        body: the movement of the agent.
        scene: the pose and the solid tiles.
        offset: float32[2], from the player to the place, in tiles.
        slack: the tolerated error of the heading, in turns. 0.5 selects the closest heading; with
            more, a player on a long walk does not turn to and fro between two equally close ones.
    """
    error, aligned, turns = _turns(body, scene, offset, slack)
    side = jnp.where(error > 0, 1.0, -1.0)
    beyond = jnp.where(error > turns * body.angle, turns + 1, turns - 1)
    astray = _blocked(body, scene, turns) & ~_blocked(body, scene, beyond)
    side = jnp.where(astray, jnp.sign(beyond), side)
    ahead = jnp.where(astray, beyond == 0, aligned)
    turn = jnp.where(side > 0, jnp.int32(body.right), jnp.int32(body.left))
    return jnp.where(ahead, jnp.int32(body.forward), turn)


def _turns(
    body: Movement, scene: Scene, offset: jax.Array, slack: float = 0.5
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Radians to the place, to the right; whether the heading is close enough; turns to it."""
    error = jnp.arctan2(offset[1], offset[0]) - scene.heading
    error = jnp.mod(error + math.pi, 2 * math.pi) - math.pi
    aligned = jnp.abs(error) <= slack * body.angle + _SLACK
    return error, aligned, jnp.where(aligned, 0.0, jnp.round(error / body.angle))


def best_stride(
    body: Movement, scene: Scene, offset: jax.Array, field: jax.Array, key: jax.Array
) -> jax.Array:
    """int32[]: as `towards`, but simulates wide turns and long strides first.

    With these, the closest heading may end at the wall beside the path or farther from the target.
    This function chooses the heading with the most progress per decision. Every stride must make
    progress, so that no player walks to and fro forever. If no heading does, the action is random.
    It is also random now and then if a stride may pass the place, where passing counts.

    Args:
        body: the movement of the agent.
        scene: the pose and the solid tiles.
        offset: float32[2], from the player to the centre of the next tile.
        field: int32[rows, columns], the walking distance in tiles to the target.
        key: the random key.
    """
    _, _, nearest = _turns(body, scene, offset)
    turns = jnp.concatenate([nearest[None], np.arange(-_TURNS, _TURNS + 1, dtype=np.float32)])
    here = remaining(field, scene.position)
    after, passed = jax.vmap(functools.partial(_stride, body, scene, field))(turns)
    close = here < 1
    gains = here - jnp.where(close, passed, after)
    rates = jnp.where(gains > _LEAST_GAIN, gains / (jnp.abs(turns) + 1), -jnp.inf)
    # For single steps the closest heading is enough, unless it makes no progress.
    plain = (gains[0] > _LEAST_GAIN) & (body.steps == 1)
    chosen = jnp.where(plain, nearest, turns[jnp.argmax(rates)])
    turn = jnp.where(chosen > 0, jnp.int32(body.right), jnp.int32(body.left))
    action = jnp.where(chosen == 0, jnp.int32(body.forward), turn)
    some = jnp.array((body.left, body.right, body.forward), jnp.int32)
    chance_key, action_key = jax.random.split(key)
    passing = close & (body.step * body.steps > _LONG_STRIDE)
    lost = passing & jax.random.bernoulli(chance_key, _CHANCE)
    lost = lost | jnp.all(jnp.isneginf(rates))
    return jnp.where(lost, jax.random.choice(action_key, some), action)


def _stride(
    body: Movement, scene: Scene, field: jax.Array, turns: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """The distance left after walking once at a number of turns to the right; the least on it."""
    step = forward(scene.heading + turns * body.angle) * body.step

    def one(position: jax.Array, _: None) -> tuple[jax.Array, jax.Array]:
        position = walk(scene.level, scene.closed, position, step)
        return position, remaining(field, position)

    start = varying(scene.position, scene, step)
    left = jax.lax.scan(one, start, length=body.steps)[1]
    return left[-1], jnp.min(left)


def remaining(field: jax.Array, position: jax.Array) -> jax.Array:
    """float32[]: tiles left to walk from a position to the target of a field, via the next tile.

    Args:
        field: int32[rows, columns], the walking distance in tiles to the target.
        position: float32[2], (x, y) in tiles.
    """
    cell = jnp.floor(position).astype(jnp.int32)
    tiles, steps = _beside(field, cell)
    offset = tiles.astype(jnp.float32) + 0.5 - position[None]
    ways = steps.astype(jnp.float32) + jnp.sqrt(jnp.sum(offset**2, axis=-1))
    own = jnp.sqrt(jnp.sum((cell.astype(jnp.float32) + 0.5 - position) ** 2))
    return jnp.where(field[cell[1], cell[0]] == 0, own, jnp.min(ways))


def _beside(field: jax.Array, cell: jax.Array) -> tuple[jax.Array, jax.Array]:
    """int32[4, 2], the neighbours of a tile; int32[4], their values in the field."""
    rows, columns = field.shape
    beside = cell[None] + _BESIDE
    last = np.array((columns - 1, rows - 1), np.int32)
    inside = jnp.all((beside >= 0) & (beside <= last[None]), axis=-1)
    safe = jnp.clip(beside, 0, last[None])
    return beside, jnp.where(inside, field[safe[:, 1], safe[:, 0]], FAR)


def _blocked(body: Movement, scene: Scene, turns: jax.Array) -> jax.Array:
    """bool[]: whether a wall blocks a step after a number of turns to the right."""
    step = forward(scene.heading + turns * body.angle) * body.step
    after = walk(scene.level, scene.closed, scene.position, step)
    return jnp.all(after == scene.position)


def next_tile(field: jax.Array, state: Any) -> jax.Array:
    """int32[2]: the tile to walk to.

    The tile is the neighbour closest to the target, or the target itself. Of equally close
    neighbours, the one that needs the least turning is chosen.

    Args:
        field: int32[rows, columns], the walking distance in tiles to the target.
        state: a state with position and heading.
    """
    cell = jnp.floor(state.position).astype(jnp.int32)
    beside, steps = _beside(field, cell)
    offset = beside.astype(jnp.float32) + 0.5 - state.position[None]
    ahead = jnp.sum(offset * forward(state.heading)[None], axis=-1)
    cosine = ahead / jnp.sqrt(jnp.sum(offset**2, axis=-1))
    best = jnp.argmin(steps.astype(jnp.float32) + 0.25 * (1 - cosine))
    there = field[cell[1], cell[0]] == 0
    return jnp.where(there, cell, beside[best])


def faces_door(scene: Scene, tile: jax.Array, reach: Any) -> jax.Array:
    """bool[]: whether an arm of `reach` tiles would touch a closed door on that tile."""
    level = scene.level
    if level.doors.shape[0] == 0:
        return jnp.bool_(False)
    arm = forward(scene.heading) * reach
    touched = touched_door(level, scene.closed, scene.position, arm)
    here = jnp.all(jnp.asarray(level.doors) - level.margin == tile[None], axis=-1)
    return jnp.any(touched & here)


@functools.lru_cache(maxsize=16)
def distance_tables(tilemap: TileMap) -> np.ndarray:
    """int32[2**K, goals, rows, columns]: the distance left to walk, for each set of K keys.

    Bit k of the first index says whether the agent has key k. From tiles that reach the goal
    through the doors that these keys open, this is the distance to the goal; from other tiles, to
    the closest remaining key; `FAR` if neither is reachable.

    Args:
        tilemap: the map, with at most 8 keys.

    Raises:
        SettingError: there are more keys.
    """
    keys = tilemap.keys
    if len(keys) > _MOST_KEYS:
        raise SettingError(f"shortest_path supports at most {_MOST_KEYS} keys, not {len(keys)}")
    tables = []
    for taken in range(2 ** len(keys)):
        carried = {key.colour for k, key in enumerate(keys) if taken >> k & 1}
        walkable = open_tiles(tilemap, locked=False)
        for door in tilemap.doors:
            walkable[door.row, door.column] |= door.colour in carried
        left = tuple((key.column, key.row) for k, key in enumerate(keys) if not taken >> k & 1)
        to_key = np.full((1, *walkable.shape), FAR)
        if left:
            steps = walking_distances(walkable, left)
            to_key = np.where(steps < 0, FAR, steps).min(axis=0, keepdims=True)
        to_goal = walking_distances(walkable, tilemap.goals)
        tables.append(np.where(to_goal < 0, to_key, to_goal).astype(np.int32))
    return np.stack(tables)


def mask_of(tiles: jax.Array, shape: tuple[int, ...], which: jax.Array | None = None) -> jax.Array:
    """bool[rows, columns]: the tiles in a list.

    Args:
        tiles: int32[K, 2], or one tile int32[2]: (column, row).
        shape: (rows, columns).
        which: bool[K], the tiles that count; None for all.
    """
    row, column = np.indices(shape, np.int32)
    tiles = tiles.reshape(-1, 2)
    here = (column[None] == tiles[:, :1, None]) & (row[None] == tiles[:, 1:, None])
    return jnp.any(here if which is None else here & which[:, None, None], axis=0)


def flood(walkable: jax.Array, target: jax.Array) -> jax.Array:
    """int32[rows, columns]: walking distance in tiles to the target; the border must be solid.

    For maps that are generated in a compiled program; for maps on the host, use
    `maps.reach.walking_distances`.

    Args:
        walkable: bool[rows, columns].
        target: bool[rows, columns], the target tiles.
    """

    def relax(carry: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
        steps, _ = carry
        beside = [jnp.roll(steps, shift, axis) for axis in (0, 1) for shift in (1, -1)]
        nearer = jnp.minimum(steps, functools.reduce(jnp.minimum, beside) + 1)
        nearer = jnp.where(walkable, nearer, FAR)
        return nearer, jnp.any(nearer != steps)

    start = jnp.where(target, 0, FAR).astype(jnp.int32), jnp.bool_(True)
    return jax.lax.while_loop(lambda carry: carry[1], relax, varying(start, walkable, target))[0]
