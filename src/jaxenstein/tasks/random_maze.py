"""DeepMind Lab's random mazes, rooms and corridors, drawn inside a compiled program.

Rules: the text maze generator of google-deepmind/lab, which the package labmaze has as well. Odd
rows and columns are a lattice. Rooms are rectangles of it; what they leave is filled by mazes of
corridors; every two regions that touch are connected once; dead ends are walled up, and detours
around three sides of a rectangle are pulled straight. `fidelity/labmaze_layouts.py` compares.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np

from .._jax.batching import varying
from ..errors import SettingError
from ..fields import check_whole
from ..pytree import PyTreeNode
from .draws import sample_index
from .maze_ways import shift, straighten

# How often rooms are drawn anew where they are too few; of 9x9 mazes, one in fifty has too few.
TRIES = 16
# (row, column) of the lattice's directions: east, west, south, north.
_AROUND = ((0, 1), (0, -1), (1, 0), (-1, 0))


class RandomMaze(PyTreeNode):
    """A maze of N by N cells, its border included.

    Attributes:
        open: bool[N, N], the cells of rooms, corridors and doorways.
        room: int32[N, N], the number of the room from 1 on, 0 elsewhere.
        rooms: int32[], how many there are.
        doorways: bool[N, N], the cells that connect two regions.
    """

    open: jax.Array
    room: jax.Array
    rooms: jax.Array
    doorways: jax.Array


@dataclasses.dataclass(frozen=True)
class MazePlan:
    """What mazes are sampled.

    Attributes:
        size: rows and columns, the border included: an odd number from 7 to 63.
        rooms: the most rooms.
        least: the shortest side of a room in cells, odd, at least 3.
        most: the longest side, odd.
        fewest: the fewest rooms; with less, all rooms are drawn anew.
    """

    size: int
    rooms: int
    least: int = 3
    most: int = 5
    fewest: int = 1

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_whole("size", self.size, 1, 63)
        check_whole("rooms", self.rooms, 1, 64)
        odd = self.size % 2 and self.least % 2 and self.most % 2
        if not (odd and 3 <= self.least <= self.most <= self.size - 2):
            raise SettingError(
                "size, least and most of a MazePlan must be odd, with 3 <= least <= most <= "
                f"size - 2, not {self.size}, {self.least} and {self.most}"
            )
        check_whole("fewest", self.fewest, 1, self.rooms)

    @property
    def lattice(self) -> int:
        """Points of the lattice in a row."""
        return self.size // 2


def sample_maze(key: jax.Array, plan: MazePlan) -> RandomMaze:
    """Sample a maze.

    Args:
        key: the random key.
        plan: what mazes are sampled.
    """
    points, tries = plan.lattice**2, plan.rooms * TRIES
    bits = jax.random.bits(key, (tries + 3 * points,), jnp.uint32)
    room, rooms = _sample_rooms(bits[:tries].reshape(TRIES, -1), plan)
    region, links = carve(bits[tries : tries + points], room)
    doors = _connect(bits[tries + points :], region)
    links, left = _wall_up(room, links, doors)
    none = jnp.zeros_like(left)
    doorways = _cells(none, doors & _both_ends(left), none)
    # A room's cells lie between points of it; a corner belongs to it with the points around it.
    inside = room > 0
    within = _both_ends(inside) & (room[None] == _ahead(room))
    corner = inside & (room == shift(shift(room, 0, 1), 1, 0))
    chamber = _cells(inside, within, corner)
    paved = _cells(left, links, none) | chamber
    paved = straighten(paved, ~(paved | _cells(none, doors, none)))
    return RandomMaze(
        open=paved | doorways,
        room=jnp.where(chamber, _cells(room, jnp.stack([room, room]), room), 0),
        rooms=rooms,
        doorways=doorways,
    )


def sample_in_rooms(bits: jax.Array, maze: RandomMaze, rooms: int, count: int) -> jax.Array:
    """int32[rooms, count, 2]: (column, row) of different random cells of each room.

    Args:
        bits: uint32[N * N], random.
        maze: the maze; rooms that it lacks have cells of its border.
        rooms: how many rooms a maze may have.
        count: cells of each room, at most 9.
    """
    size = maze.room.shape[0]
    index = np.arange(size * size, dtype=np.uint32)
    # No two are equal; those of other rooms and the border are less than any.
    drawn = ((bits >> 2 & ~jnp.uint32(4095)) | index).astype(jnp.int32)
    own = maze.room.reshape(-1)[None] == np.arange(1, rooms + 1, dtype=np.int32)[:, None]
    left, found = jnp.where(own, drawn[None] + 1, 0), []
    for _ in range(count):
        best = jnp.argmax(left, axis=1).astype(jnp.int32)
        found.append(best)
        left = jnp.where(best[:, None] == index.astype(np.int32)[None], 0, left)
    cells = jnp.stack(found, axis=1)
    return jnp.stack([cells % size, cells // size], axis=-1)


def beside_rooms(maze: RandomMaze) -> jax.Array:
    """int32[N, N]: the number of the room at or beside each cell, the largest of several."""
    around = [shift(maze.room, row, column) for row in (-1, 0, 1) for column in (-1, 0, 1)]
    return functools.reduce(jnp.maximum, around)


@functools.cache
def _rectangles(plan: MazePlan) -> tuple[np.ndarray, np.ndarray]:
    """bool[C, K, K], every rectangle that may be a room; int32[C], how likely they are, relatively.

    The short side is uniform between least and middle; the other one, which either may be, has
    something up to most - middle added to that.
    """
    least, most, points = (plan.least - 1) // 2, (plan.most - 1) // 2, plan.lattice
    middle = (least + most) // 2
    chance: dict[tuple[int, int], Fraction] = {}
    for one in range(least, middle + 1):
        for other in range(least, middle + 1):
            for more in range(most - middle + 1):
                for shape in ((one + more, other), (one, other + more)):
                    each = Fraction(1, 2 * (middle - least + 1) ** 2 * (most - middle + 1))
                    chance[shape] = chance.get(shape, Fraction(0)) + each
    masks, weights = [], []
    for (height, width), likely in chance.items():
        places = (points - height) * (points - width)
        for row in range(points - height):
            for column in range(points - width):
                mask = np.zeros((points, points), bool)
                mask[row : row + height + 1, column : column + width + 1] = True
                masks.append(mask)
                weights.append(likely / places)
    scale = math.lcm(*(weight.denominator for weight in weights))
    return np.stack(masks), np.array([int(weight * scale) for weight in weights], np.int32)


def _sample_rooms(bits: jax.Array, plan: MazePlan) -> tuple[jax.Array, jax.Array]:
    """int32[K, K], the number of each point's room or 0; int32[], how many rooms there are.

    Rectangles are drawn among those that are apart from all before them, which is what drawing
    among all and trying again comes to.

    Args:
        bits: uint32[TRIES, rooms], random.
        plan: what mazes are sampled.
    """
    masks, weights = _rectangles(plan)

    none = varying(jnp.zeros((plan.lattice, plan.lattice), jnp.int32), bits)

    def place(i: jax.Array, carry: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
        tried, room = carry
        free = ~jnp.any(masks & (room > 0)[None], axis=(1, 2))
        upto = jnp.cumsum(jnp.where(free, weights, 0), dtype=jnp.int32)
        chosen = jnp.argmax(upto > sample_index(bits[tried, i], jnp.maximum(upto[-1], 1)))
        here = jnp.asarray(masks)[chosen] & (upto[-1] > 0)
        return tried, jnp.where(here, i + 1, room)

    def draw(carry: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
        tried, _ = carry
        return tried + 1, jax.lax.fori_loop(0, plan.rooms, place, (tried, none))[1]

    def again(carry: tuple[jax.Array, jax.Array]) -> jax.Array:
        return (carry[0] < TRIES) & (jnp.max(carry[1]) < plan.fewest)

    _, room = jax.lax.while_loop(again, draw, (varying(jnp.int32(0), bits), none))
    return room, jnp.max(room)


def _ahead(grid: jax.Array) -> jax.Array:
    """[2, K, K]: what lies east and south of each point."""
    return jnp.stack([shift(grid, 0, 1), shift(grid, 1, 0)])


def _both_ends(points: jax.Array) -> jax.Array:
    """bool[2, K, K]: whether a point and that east, or south, of it are of a kind."""
    return points[None] & _ahead(points)


def carve(bits: jax.Array, room: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Corridors by recursive backtracking in all that rooms leave.

    One goes on from the point that was reached last among those beside which something is left:
    that is what going back one by one finds.

    Args:
        bits: uint32[K * K], random.
        room: int32[K, K], the number of each point's room, or 0.

    Returns:
        int32[K, K], the region of each point: a room's number, or one above; bool[2, K, K], which
        points are linked with that east and that south of them.
    """
    size = room.shape[0]
    index = np.arange(size * size, dtype=np.int32).reshape(size, size)

    def visit(carry: tuple[jax.Array, ...]) -> tuple[jax.Array, ...]:
        time, region, reached, links = carry
        left = region == 0
        beside = jnp.stack([shift(left, *step) for step in _AROUND])
        last = jnp.argmax(jnp.where(jnp.any(beside, axis=0), reached, 0)).astype(jnp.int32)
        here = index == last
        ways = jnp.any(beside & here[None], axis=(1, 2)) & (reached.reshape(-1)[last] > 0)
        upto = jnp.cumsum(ways, dtype=jnp.int32)
        way = jnp.argmax(upto > sample_index(bits[time], jnp.maximum(upto[-1], 1)))
        steps = jnp.stack([shift(here, -down, -along) for down, along in _AROUND])
        # Where no way leads on, a maze begins at the first point that is left.
        goes = upto[-1] > 0
        there = jnp.where(goes, steps[way], index == jnp.argmax(left))
        number = jnp.where(goes, region.reshape(-1)[last], jnp.max(region) + 1)
        # A link belongs to its western or northern point.
        owner = jnp.where((way % 2 == 0), here, there) & goes
        links = links | (owner[None] & (np.arange(2)[:, None, None] == way // 2))
        reached = jnp.where(there, time + 1, reached)
        return time + 1, jnp.where(there, number, region), reached, links

    start = jnp.int32(0), room, jnp.zeros_like(room), jnp.zeros((2, *room.shape), bool)
    start = varying(start, room, bits)
    end = jax.lax.while_loop(lambda carry: jnp.any(carry[1] == 0), visit, start)
    return end[1], end[3]


def _connect(bits: jax.Array, region: jax.Array) -> jax.Array:
    """bool[2, K, K]: for every two regions that touch, one of the places between them."""
    size = region.shape[0]
    count = 2 * size * size
    ahead = _ahead(region)
    pair = jnp.minimum(region[None], ahead) * (size * size + 1) + jnp.maximum(region[None], ahead)
    pair = jnp.where((ahead > 0) & (ahead != region[None]), pair, 0).reshape(-1)
    drawn = (bits & ~jnp.uint32(8191)) | np.arange(count, dtype=np.uint32)
    better = (pair[:, None] == pair[None]) & (drawn[:, None] > drawn[None])
    return ((pair > 0) & ~jnp.any(better, axis=1)).reshape(2, size, size)


def _wall_up(room: jax.Array, links: jax.Array, doors: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Wall up the dead ends of corridors: the links and bool[K, K] the corridor points left."""

    def degree(edges: jax.Array) -> jax.Array:
        east, south = edges.astype(jnp.int32)
        return east + south + shift(east, 0, -1) + shift(south, -1, 0)

    ways = degree(doors)

    def close(carry: tuple[jax.Array, ...]) -> tuple[jax.Array, ...]:
        links, left, _ = carry
        dead = left & (ways + degree(links) <= 1)
        left = left & ~dead
        return links & _both_ends(left), left, jnp.any(dead)

    start = varying((links, room == 0, jnp.bool_(True)), room, links, doors)
    links, left, _ = jax.lax.while_loop(lambda carry: carry[2], close, start)
    return links, left | (room > 0)


def _cells(points: jax.Array, between: jax.Array, corner: jax.Array) -> jax.Array:
    """[N, N] cells of a lattice: its points, what lies east and south of them, and south-east."""
    size = points.shape[0]
    blocks = jnp.stack([jnp.stack([points, between[0]]), jnp.stack([between[1], corner])])
    cells = blocks.transpose(2, 0, 3, 1).reshape(2 * size, 2 * size)
    return jnp.pad(cells, ((1, 0), (1, 0)))
