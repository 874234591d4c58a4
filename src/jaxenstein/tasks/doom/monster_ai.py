"""How monsters look, walk and decide to attack: one rule updates all monsters of a state at once.

As in the game, a monster goes through frames: each lasts some tics and starts with an action.
Standing monsters look for the player. Walking ones decide at every step whether to attack, to
continue, or to turn, in eight directions and mostly towards the player (the rules are those of
ZDoom's p_enemy.cpp). In the game monsters move one after another. Here all decide at once, and of
two that would overlap the later one waits.
"""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import where_few
from .collision import RADIUS, bearing, crosses, is_seen, overlap, ranked
from .fixed import FEW, ONE, byte
from .monster_kinds import Act
from .monsters import Horde, Infighting, Monsters

# The distance from the side of an enemy at which a monster bites, in map units, and the distance
# from the middle of the player at which a monster notices it from behind.
_BITES, _NOTICES = 44, 64 * ONE
# The game subtracts the first from the distance, and the second too if a monster cannot bite, and
# caps the result at the third. A shot is fired if a random byte is at least that large.
_NEARER, _NO_BITE, _FARTHEST = 64, 128, 200
# The offset along an axis from which on the player is in that direction; the length of a diagonal
# step along each axis, in 16.16.
_LEVEL, _DIAGONAL = 10 * ONE, 46341
_DIRECTIONS = 8
_STEPS = np.array(
    [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)], np.int32
) * np.where(np.arange(_DIRECTIONS) % 2, _DIAGONAL, ONE)[:, None].astype(np.int32)
# The rank of a direction that is not free.
_NOWHERE = 99

Place = tuple[jax.Array, jax.Array, jax.Array]
"""int32[N, 2], positions of monsters; bool[N], which of them live; int32[2], the player."""


def approximate(offset: jax.Array) -> jax.Array:
    """int32[...]: the game's length of int32[..., 2]: the longer side plus half of the other."""
    size = jnp.abs(offset)
    return jnp.max(size, axis=-1) + (jnp.min(size, axis=-1) >> 1)


def in_reach(offset: jax.Array, half_width: jax.Array | np.ndarray, sees: jax.Array) -> jax.Array:
    """bool[N]: which monsters see their enemy and are close enough to bite it.

    Args:
        offset: int32[N, 2], from each monster to its enemy.
        half_width: int32[N], of the enemy, in map units.
        sees: bool[N], whether there is no wall between them.
    """
    return sees & (approximate(offset) < jnp.asarray(_BITES + half_width) * ONE)


def sight(monsters: Monsters, goal: jax.Array, walls: np.ndarray) -> jax.Array:
    """bool[N]: which monsters have no wall between them and int32[2] or int32[N, 2]."""
    if not len(walls):
        return jnp.ones(monsters.present.shape, bool)
    return is_seen(monsters.position, jnp.broadcast_to(goal, monsters.position.shape), walls)


def act(
    horde: Horde, monsters: Monsters, player: jax.Array, noise: jax.Array, bits: jax.Array
) -> tuple[Monsters, jax.Array]:
    """A tic of all monsters.

    Args:
        horde: the tables of the monsters, and the walls.
        monsters: the monsters before the tic.
        player: int32[2], the position of the player.
        noise: bool[], whether the player has just shot.
        bits: uint32[N, 2], random.

    Returns:
        The monsters, and bool[N], which of them attack now, by the action of their frame.
    """
    monsters = settled(monsters)
    goal, width = horde.enemies(monsters, player)
    offset = goal - monsters.position
    sees = sight(monsters, goal, horde.opaque)
    near = in_reach(offset, width, sees)
    alarmed = monsters.alarmed | (monsters.living & noise)
    tics = monsters.tics - 1
    begins = monsters.present & (tics <= 0)
    frame = jnp.where(begins, _following(horde, monsters, sees, near, bits), monsters.frame)
    watches = begins & (horde.at(horde.acts, frame) == Act.WATCH)
    wakes = watches & (alarmed | (sees & _notices(monsters, offset)))
    frame = jnp.where(wakes, horde.walk, frame)
    chases = begins & (horde.at(horde.acts, frame) == Act.CHASE)
    reaction = jnp.maximum(monsters.reaction - chases.astype(jnp.int32), 0)
    rests = chases & monsters.just_attacked
    bites = chases & ~rests & near & (horde.melee >= 0)
    ready = (monsters.steps_left == 0) | horde.fast
    may_shoot = chases & ~rests & ~bites & ready & sees & (horde.missile >= 0)
    shoots = (reaction == 0) & _dares(horde, offset, byte(bits[:, 0], 0))
    shoots = may_shoot & (shoots if monsters.just_hit is None else shoots | monsters.just_hit)
    frame = jnp.where(bites, horde.melee, jnp.where(shoots, horde.missile, frame))
    walks = chases & ~rests & ~bites & ~shoots
    turns = rests & ~horde.fast
    position, direction, steps_left = walk(
        horde, monsters, player, offset, walks, turns, bits[:, 0]
    )
    if horde.pictured:
        faces = begins & (horde.at(horde.faces, frame) != 0)
        monsters = monsters.replace(facing=turned(monsters, chases, faces, offset))
    after = monsters.replace(
        position=position,
        frame=frame,
        tics=jnp.where(begins, horde.at(horde.frame_tics, frame), tics),
        direction=direction,
        steps_left=steps_left,
        reaction=reaction,
        just_attacked=(monsters.just_attacked & ~chases) | shoots,
        alarmed=alarmed,
        infighting=_calmer(monsters.infighting, chases),
        just_hit=None if monsters.just_hit is None else monsters.just_hit & ~may_shoot,
    )
    return after, begins & (horde.at(horde.acts, frame) >= Act.BITE)


def turned(monsters: Monsters, steps: jax.Array, faces: jax.Array, offset: jax.Array) -> jax.Array:
    """uint32[N]: the headings after a tic; they only matter to the eye.

    Args:
        monsters: the monsters before the tic.
        steps: bool[N], which of them take a step, before which they turn by an eighth of a circle.
        faces: bool[N], which of them turn to their enemy.
        offset: int32[N, 2], from each to its enemy.
    """
    eighth = (monsters.facing >> 29).astype(jnp.int32)
    apart = (eighth - monsters.direction) & 7
    towards = eighth + jnp.where(apart == 0, 0, jnp.where(apart < 4, -1, 1))
    steps = steps & (monsters.direction < _DIRECTIONS)
    facing = jnp.where(steps, towards.astype(jnp.uint32) << 29, monsters.facing)
    return jnp.where(faces, bearing(offset).astype(jnp.uint32), facing)


def settled(monsters: Monsters) -> Monsters:
    """The monsters, after those whose enemy is dead turn to the player again."""
    infighting = monsters.infighting
    if infighting is None:
        return monsters
    count = infighting.target.shape[0]
    over = ~jnp.append(monsters.living, True)[infighting.target]
    target = jnp.where(over, count, infighting.target)
    anger = jnp.where(over, 0, infighting.anger)
    return monsters.replace(infighting=Infighting(target, anger))


def _calmer(infighting: Infighting | None, steps: jax.Array) -> Infighting | None:
    """The infighting after a tic in which bool[N] have taken a step."""
    if infighting is None:
        return None
    anger = jnp.maximum(infighting.anger - steps.astype(jnp.int32), 0)
    return infighting.replace(anger=anger)


def _following(
    horde: Horde, monsters: Monsters, sees: jax.Array, near: jax.Array, bits: jax.Array
) -> jax.Array:
    """int32[N]: the frame after this one; some monsters keep attacking while they can."""
    following = horde.at(horde.following, monsters.frame)
    if not (horde.back >= 0).any():
        return following
    back = horde.at(horde.back, monsters.frame)
    again = jnp.where(horde.missile >= 0, sees | (byte(bits[:, 1], 0) < 40), near)
    return jnp.where((back >= 0) & again, back, following)


def _notices(monsters: Monsters, offset: jax.Array) -> jax.Array:
    """bool[N]: whether the player is in front, or so close that it does not matter."""
    turn = bearing(offset).astype(jnp.uint32) - monsters.facing
    in_front = (turn <= jnp.uint32(1 << 30)) | (turn >= jnp.uint32(3 << 30))
    return in_front | (approximate(offset) <= _NOTICES)


def _dares(horde: Horde, offset: jax.Array, luck: jax.Array) -> jax.Array:
    """bool[N]: whether it shoots, less likely at larger distances; `luck` is a random byte."""
    shift = _NEARER + np.where(horde.melee >= 0, 0, _NO_BITE)
    distance = (approximate(offset) >> 16) - shift.astype(np.int32)
    return luck >= jnp.minimum(distance, _FARTHEST)


def walk(
    horde: Horde,
    monsters: Monsters,
    player: jax.Array,
    offset: jax.Array,
    walks: jax.Array,
    turns: jax.Array,
    bits: jax.Array,
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Positions, directions and steps left after walking monsters have stepped or turned.

    Args:
        horde: the tables of the monsters, and the walls that block them.
        monsters: the monsters.
        player: int32[2], a body in their way.
        offset: int32[N, 2], from each to its enemy.
        walks: bool[N], which take a step.
        turns: bool[N], which choose another direction first.
        bits: uint32[N], random.
    """
    steps_left = monsters.steps_left - walks.astype(jnp.int32)
    place = monsters.position, monsters.living, player
    ahead = _free(horde, place, _step(horde, monsters, monsters.direction)[:, None])
    goes_on = walks & (steps_left >= 0) & ahead[:, 0] & (monsters.direction < _DIRECTIONS)
    turns = turns | (walks & ~goes_on)
    # Few members of a batch choose another direction in the same tic.
    choose = where_few(partial(_another, horde), FEW)
    best = choose(jnp.any(turns), place, monsters.direction, offset, bits)
    return _stepped(horde, monsters, goes_on, (turns, best), steps_left, bits)


def set_off(
    horde: Horde, monsters: Monsters, player: jax.Array, bits: jax.Array
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """As `walk` for monsters that all take their first step; bits are uint32[N], random."""
    every, offset = jnp.ones(len(horde), bool), player[None] - monsters.position
    place = monsters.position, monsters.living, player
    best = _another(horde, place, monsters.direction, offset, bits)
    return _stepped(horde, monsters, ~every, (every, best), monsters.steps_left - 1, bits)


def _stepped(
    horde: Horde,
    monsters: Monsters,
    goes_on: jax.Array,
    turning: tuple[jax.Array, jax.Array],
    steps_left: jax.Array,
    bits: jax.Array,
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """As `walk`, after all have chosen.

    Args:
        horde: the tables of the monsters.
        monsters: the monsters.
        goes_on: bool[N], which step in their direction.
        turning: bool[N], which turn; int32[N], to which direction.
        steps_left: int32[N], of those that do not turn.
        bits: uint32[N], random.
    """
    turns, best = turning
    direction = jnp.where(turns, best, monsters.direction)
    again = turns & (best < _DIRECTIONS)
    steps_left = jnp.where(again, byte(bits, 3) & 15, steps_left)
    if not horde.speed.any():
        return monsters.position, direction, steps_left
    moves = (goes_on | turns) & (direction < _DIRECTIONS)
    moved = _step(horde, monsters, direction)
    width = horde.half_width
    bumps = overlap(moved[:, None], width[:, None], moved[None], width[None])
    earlier = np.tri(len(horde), k=-1, dtype=bool)
    waits = jnp.any(bumps & earlier & moves[None] & moves[:, None], axis=1)
    return jnp.where((moves & ~waits)[:, None], moved, monsters.position), direction, steps_left


def _step(horde: Horde, monsters: Monsters, direction: jax.Array) -> jax.Array:
    """int32[N, 2]: the position of each after a step in direction int32[N], without obstacles."""
    way = jnp.asarray(np.append(_STEPS, np.zeros((1, 2), np.int32), axis=0))
    way = way.at[direction].get(mode="promise_in_bounds")
    return monsters.position + way * horde.speed[:, None]


def _another(
    horde: Horde,
    place: Place,
    old: jax.Array,
    offset: jax.Array,
    bits: jax.Array,
) -> jax.Array:
    """int32[N]: the direction that each would choose; the arguments are those of `walk`."""
    target = place[0][:, None] + _STEPS[None] * horde.speed[:, None, None]
    free = _free(horde, place, target)
    best = jnp.argmin(jnp.where(free, _preferences(old, offset, bits), _NOWHERE), axis=1)
    return jnp.where(jnp.any(free, axis=1), best.astype(jnp.int32), _DIRECTIONS)


def _free(horde: Horde, place: Place, target: jax.Array) -> jax.Array:
    """bool[N, D]: whether each can step to int32[N, D, 2]; one without speed always can."""
    if not horde.speed.any():
        return jnp.ones(target.shape[:2], bool)
    position, living, player = place
    width = horde.half_width
    others = jnp.concatenate([position, player[None]])
    widths = np.append(width, np.int32(RADIUS))
    there = jnp.append(living, True)[None] & ~np.eye(len(width), len(widths), dtype=bool)
    bumps = overlap(
        target[:, :, None], width[:, None, None], others[None, None], widths[None, None]
    )
    met = jnp.any(bumps & there[:, None], axis=-1)
    return ~met & ~crosses(target, ranked(jnp.asarray(width)[:, None], 2), horde.walls)


def _preferences(old: jax.Array, offset: jax.Array, bits: jax.Array) -> jax.Array:
    """int32[N, 8]: the rank of each direction, lowest first: to the enemy, ahead, any, back.

    Args:
        old: int32[N], the direction so far.
        offset: int32[N, 2], to the enemy.
        bits: uint32[N], random.
    """
    x, y = offset[:, 0], offset[:, 1]
    east_west = jnp.where(x > _LEVEL, 0, jnp.where(x < -_LEVEL, 4, _DIRECTIONS))
    north_south = jnp.where(y > _LEVEL, 2, jnp.where(y < -_LEVEL, 6, _DIRECTIONS))
    both = (east_west < _DIRECTIONS) & (north_south < _DIRECTIONS)
    across = jnp.where(y > 0, jnp.where(x > 0, 1, 3), jnp.where(x > 0, 7, 5))
    across = jnp.where(both, across, _DIRECTIONS)
    swaps = (byte(bits, 1) > 200) | (jnp.abs(y) > jnp.abs(x))
    first = jnp.where(swaps, north_south, east_west)
    second = jnp.where(swaps, east_west, north_south)
    around = jnp.where(old < _DIRECTIONS, (old + 4) % _DIRECTIONS, _DIRECTIONS)
    index = jnp.arange(_DIRECTIONS, dtype=jnp.int32)[None]
    rank = 10 + jnp.where((byte(bits, 2) & 1 == 1)[:, None], index, _DIRECTIONS - index)
    for place, choice in ((4, old), (3, second), (2, first), (1, across)):
        rank = jnp.where(index == choice[:, None], place, rank)
    return jnp.where(index == around[:, None], 30, rank)
