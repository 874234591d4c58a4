"""Monsters: one rule that moves all of a state at once, by a roster of kinds.

A monster goes through frames as in the game: each lasts some tics and begins with an act. Standing
ones look for the player; walking ones choose at every step whether to strike, to go on, or to turn,
in eight directions and mostly towards the player (ZDoom's p_enemy.cpp, read for its rules). In the
game one moves after the other; here all choose at once, and of two that would overlap the later one
waits. They go for the player, or for each other if the roster says so (`feuds`).
"""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import where_few
from ...pytree import PyTreeNode
from .bodies import crosses, overlap
from .dice import byte
from .feuds import Feud, calmer, peace, provoked, quarry, settled
from .fixed import ONE
from .geometry import RADIUS
from .kinds import NOWHERE, Act, Roster
from .shots import bearing, is_seen, ranked

REACTION = 8
"""Steps after waking up before which nobody shoots."""
# How near the side of an enemy is to be bitten, in map units, and the middle of the player to be
# noticed behind one's back.
_BITES, _NOTICES = 44, 64 * ONE
# Aims that fail by distance: nearer ones count as farther off for who bites, and none beyond.
_NEARER, _NO_BITE, _FARTHEST = 64, 128, 200
# A step counts as towards the player from so far off, and so much of it is one across.
_LEVEL, _DIAGONAL = 10 * ONE, 46341
_DIRECTIONS = 8
_STEPS = np.array(
    [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)], np.int32
) * np.where(np.arange(_DIRECTIONS) % 2, _DIAGONAL, ONE)[:, None].astype(np.int32)

Place = tuple[jax.Array, jax.Array, jax.Array]
"""int32[N, 2] where monsters are, bool[N] who of them lives, int32[2] where the player is."""
FEW = 8
"""What few of a batch need in a tic is computed for one in so many at a time."""


class Creatures(PyTreeNode):
    """The monsters of a state, N of them, each of the kind that the roster has in its place.

    Attributes:
        position: int32[N, 2], map units in 16.16.
        facing: uint32[N], where those look who stand, 2**32 a circle.
        present: bool[N], whether it is on the map, dead or alive.
        health: int32[N], at most 0 if it is dead.
        frame: int32[N], the row of the roster's frames.
        tics: int32[N], until the next one.
        direction: int32[N], of its walk, counterclockwise from east; 8 for none.
        leg: int32[N], steps until it thinks of another one.
        reaction: int32[N], steps before it may shoot.
        struck: bool[N], whether it has just shot and now walks first.
        alarmed: bool[N], whether it has heard the player shoot.
        feud: whom they are after; None if it is always the player.
        stung: bool[N], whether it has flinched, and shoots as soon as it may think of it; None
            if no kind both flinches and shoots.
    """

    position: jax.Array
    facing: jax.Array
    present: jax.Array
    health: jax.Array
    frame: jax.Array
    tics: jax.Array
    direction: jax.Array
    leg: jax.Array
    reaction: jax.Array
    struck: jax.Array
    alarmed: jax.Array
    feud: Feud | None = None
    stung: jax.Array | None = None

    @property
    def living(self) -> jax.Array:
        """bool[N]: which of them stand in the way, and can be hurt."""
        return self.present & (self.health > 0)


def placed(
    roster: Roster, position: jax.Array, facing: jax.Array, present: jax.Array, health: jax.Array
) -> Creatures:
    """Monsters that stand there and have not looked yet; arguments as of `Creatures`."""
    none = jnp.zeros(len(roster), jnp.int32)
    stand = jnp.asarray(roster.stand)
    return Creatures(
        position=position,
        facing=facing,
        present=present,
        health=health,
        frame=stand,
        tics=jnp.asarray(roster.tics[roster.stand]),
        direction=none,
        leg=none,
        reaction=none + (0 if roster.fast else REACTION),
        struck=jnp.zeros(len(roster), bool),
        alarmed=jnp.zeros(len(roster), bool),
        feud=peace(len(roster)) if roster.feuds else None,
        stung=jnp.zeros(len(roster), bool) if _shoots_back(roster).any() else None,
    )


def joined(old: Creatures, new: Creatures, comes: jax.Array) -> Creatures:
    """The old monsters, but the new ones in the places of those who come, bool[N]."""

    def chosen(fresh: jax.Array, kept: jax.Array) -> jax.Array:
        return jnp.where(comes.reshape((-1,) + (1,) * (kept.ndim - 1)), fresh, kept)

    return jax.tree.map(chosen, new, old)


def approximate(offset: jax.Array) -> jax.Array:
    """int32[...]: the game's length of int32[..., 2]: the longer side and half of the other."""
    size = jnp.abs(offset)
    return jnp.max(size, axis=-1) + (jnp.min(size, axis=-1) >> 1)


def in_reach(offset: jax.Array, half_width: jax.Array | np.ndarray, sees: jax.Array) -> jax.Array:
    """bool[N]: who is near enough to be bitten, and seen.

    Args:
        offset: int32[N, 2], from each monster to its enemy.
        half_width: int32[N], of that one, in map units.
        sees: bool[N], whether there is no wall between them.
    """
    return sees & (approximate(offset) < jnp.asarray(_BITES + half_width) * ONE)


def sight(creatures: Creatures, goal: jax.Array, walls: np.ndarray) -> jax.Array:
    """bool[N]: which monsters have no wall between them and places int32[2] or int32[N, 2]."""
    if not len(walls):
        return jnp.ones(creatures.present.shape, bool)
    return is_seen(creatures.position, jnp.broadcast_to(goal, creatures.position.shape), walls)


def act(
    roster: Roster,
    creatures: Creatures,
    player: jax.Array,
    noise: jax.Array,
    bits: jax.Array,
    *,
    opaque: np.ndarray,
    walls: np.ndarray,
) -> tuple[Creatures, jax.Array]:
    """A tic of all monsters.

    Args:
        roster: their kinds.
        creatures: the monsters.
        player: int32[2], where the player is.
        noise: bool[], whether it has just shot.
        bits: uint32[N, 2], random.
        opaque: float32[L, 4], walls that hide the player.
        walls: float32[L, 4], walls that block monsters.

    Returns:
        The monsters, and bool[N] which of them strike now, as the act of their frame says.
    """
    creatures = settled(creatures)
    goal, width = quarry(roster, creatures, player)
    offset = goal - creatures.position
    sees = sight(creatures, goal, opaque)
    near = in_reach(offset, width, sees)
    alarmed = creatures.alarmed | (creatures.living & noise)
    tics = creatures.tics - 1
    begins = creatures.present & (tics <= 0)
    frame = jnp.where(begins, _following(roster, creatures, sees, near, bits), creatures.frame)
    looks = begins & (_of(roster.acts, frame) == Act.LOOK)
    wakes = looks & (alarmed | (sees & _notices(creatures, offset)))
    frame = jnp.where(wakes, roster.walk, frame)
    chases = begins & (_of(roster.acts, frame) == Act.CHASE)
    reaction = jnp.maximum(creatures.reaction - chases.astype(jnp.int32), 0)
    rests = chases & creatures.struck
    bites = chases & ~rests & near & (roster.melee >= 0)
    ready = (creatures.leg == 0) | roster.fast
    thinks = chases & ~rests & ~bites & ready & sees & (roster.missile >= 0)
    dares = (reaction == 0) & _dares(roster, offset, byte(bits[:, 0], 0))
    stung = creatures.stung
    shoots = thinks & (dares if stung is None else dares | stung)
    frame = jnp.where(bites, roster.melee, jnp.where(shoots, roster.missile, frame))
    walks = chases & ~rests & ~bites & ~shoots
    turns = rests & ~roster.fast
    position, direction, leg = walk(
        roster, creatures, player, offset, walks, turns, bits[:, 0], walls
    )
    after = creatures.replace(
        position=position,
        frame=frame,
        tics=jnp.where(begins, _of(roster.tics, frame), tics),
        direction=direction,
        leg=leg,
        reaction=reaction,
        struck=(creatures.struck & ~chases) | shoots,
        alarmed=alarmed,
        feud=calmer(creatures.feud, chases),
        stung=None if stung is None else stung & ~thinks,
    )
    return after, begins & (_of(roster.acts, frame) >= Act.BITE)


def hurt(
    roster: Roster,
    creatures: Creatures,
    damage: jax.Array,
    bits: jax.Array,
    source: jax.Array | None = None,
) -> Creatures:
    """The monsters after blows: some flinch, some die.

    Args:
        roster: their kinds.
        creatures: the monsters.
        damage: int32[N].
        bits: uint32[N], random.
        source: int32[N], which monster has hurt each; the player if there is none.
    """
    hit = creatures.living & (damage > 0)
    health = creatures.health - jnp.where(hit, damage, 0)
    dies = hit & (health <= 0)
    flinches = hit & ~dies & (byte(bits, 3) < roster.pain_chance)
    wakes = hit & ~dies & (_of(roster.acts, creatures.frame) == Act.LOOK)
    frame = jnp.where(wakes, roster.walk, creatures.frame)
    frame = jnp.where(flinches, roster.pain, jnp.where(dies, roster.die, frame))
    changed = frame != creatures.frame
    tics = jnp.where(flinches | dies, _of(roster.tics, frame), creatures.tics)
    return creatures.replace(
        health=health,
        frame=frame,
        tics=jnp.where(changed & wakes & ~flinches, 1, tics),
        reaction=jnp.where(hit, 0, creatures.reaction),
        feud=provoked(creatures.feud, hit & ~dies, source),
        stung=None if creatures.stung is None else creatures.stung | flinches,
    )


def _shoots_back(roster: Roster) -> np.ndarray:
    """bool[N]: who may flinch and can shoot."""
    return (roster.missile >= 0) & (roster.pain_chance > 0)


def _of(table: np.ndarray, row: jax.Array) -> jax.Array:
    return jnp.asarray(table).at[row].get(mode="promise_in_bounds")


def _following(
    roster: Roster, creatures: Creatures, sees: jax.Array, near: jax.Array, bits: jax.Array
) -> jax.Array:
    """int32[N]: the frame after this one; some strike again while they can."""
    back = _of(roster.back, creatures.frame)
    again = jnp.where(roster.missile >= 0, sees | (byte(bits[:, 1], 0) < 40), near)
    return jnp.where((back >= 0) & again, back, _of(roster.following, creatures.frame))


def _notices(creatures: Creatures, offset: jax.Array) -> jax.Array:
    """bool[N]: whether the player is in front, or so near that it does not matter."""
    turn = bearing(offset).astype(jnp.uint32) - creatures.facing
    in_front = (turn <= jnp.uint32(1 << 30)) | (turn >= jnp.uint32(3 << 30))
    return in_front | (approximate(offset) <= _NOTICES)


def _dares(roster: Roster, offset: jax.Array, luck: jax.Array) -> jax.Array:
    """bool[N]: whether it shoots, the farther away the less likely; luck is a random byte."""
    shift = _NEARER + np.where(roster.melee >= 0, 0, _NO_BITE)
    distance = (approximate(offset) >> 16) - shift.astype(np.int32)
    return luck >= jnp.minimum(distance, _FARTHEST)


def walk(
    roster: Roster,
    creatures: Creatures,
    player: jax.Array,
    offset: jax.Array,
    walks: jax.Array,
    turns: jax.Array,
    bits: jax.Array,
    walls: np.ndarray,
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Positions, directions and legs after those step on who walk, or turn before they step.

    Args:
        roster: their kinds.
        creatures: the monsters.
        player: int32[2], a body in their way.
        offset: int32[N, 2], from each to where it wants to go.
        walks: bool[N], who goes on.
        turns: bool[N], who chooses another direction first.
        bits: uint32[N], random.
        walls: float32[L, 4], walls that block monsters.
    """
    leg = creatures.leg - walks.astype(jnp.int32)
    place = creatures.position, creatures.living, player
    ahead = _free(roster, place, _step(roster, creatures, creatures.direction)[:, None], walls)
    goes_on = walks & (leg >= 0) & ahead[:, 0] & (creatures.direction < _DIRECTIONS)
    turns = turns | (walks & ~goes_on)
    # Few think of another direction in the same tic.
    choose = where_few(partial(_another, roster, walls), FEW)
    best = choose(jnp.any(turns), place, creatures.direction, offset, bits)
    direction = jnp.where(turns, best, creatures.direction)
    leg = jnp.where(turns & (best < _DIRECTIONS), byte(bits, 3) & 15, leg)
    if not roster.speeds.any():
        return creatures.position, direction, leg
    moves = (goes_on | turns) & (direction < _DIRECTIONS)
    moved = _step(roster, creatures, direction)
    width = roster.half_widths
    bumps = overlap(moved[:, None], width[:, None], moved[None], width[None])
    earlier = np.tri(len(roster), k=-1, dtype=bool)
    waits = jnp.any(bumps & earlier & moves[None] & moves[:, None], axis=1)
    return jnp.where((moves & ~waits)[:, None], moved, creatures.position), direction, leg


def _step(roster: Roster, creatures: Creatures, direction: jax.Array) -> jax.Array:
    """int32[N, 2]: where each comes by a step in directions int32[N], if nothing is in its way."""
    way = jnp.asarray(np.append(_STEPS, np.zeros((1, 2), np.int32), axis=0))
    way = way.at[direction].get(mode="promise_in_bounds")
    return creatures.position + way * roster.speeds[:, None]


def _another(
    roster: Roster,
    walls: np.ndarray,
    place: Place,
    old: jax.Array,
    offset: jax.Array,
    bits: jax.Array,
) -> jax.Array:
    """int32[N]: the direction that each would choose; arguments as of `walk`."""
    target = place[0][:, None] + _STEPS[None] * roster.speeds[:, None, None]
    free = _free(roster, place, target, walls)
    best = jnp.argmin(jnp.where(free, _preferences(old, offset, bits), NOWHERE), axis=1)
    return jnp.where(jnp.any(free, axis=1), best.astype(jnp.int32), _DIRECTIONS)


def _free(roster: Roster, place: Place, target: jax.Array, walls: np.ndarray) -> jax.Array:
    """bool[N, D]: whether each can step to places int32[N, D, 2]; who has no speed always can."""
    if not roster.speeds.any():
        return jnp.ones(target.shape[:2], bool)
    position, living, player = place
    width = roster.half_widths
    others = jnp.concatenate([position, player[None]])
    widths = np.append(width, np.int32(RADIUS))
    there = jnp.append(living, True)[None] & ~np.eye(len(width), len(widths), dtype=bool)
    bumps = overlap(
        target[:, :, None], width[:, None, None], others[None, None], widths[None, None]
    )
    met = jnp.any(bumps & there[:, None], axis=-1)
    return ~met & ~crosses(target, ranked(jnp.asarray(width)[:, None], 2), walls)


def _preferences(old: jax.Array, offset: jax.Array, bits: jax.Array) -> jax.Array:
    """int32[N, 8]: which directions are tried first: towards the player, onwards, any, back.

    Args:
        old: int32[N], the direction so far.
        offset: int32[N, 2], to the player.
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
    for place, tried in ((4, old), (3, second), (2, first), (1, across)):
        rank = jnp.where(index == tried[:, None], place, rank)
    return jnp.where(index == around[:, None], 30, rank)
