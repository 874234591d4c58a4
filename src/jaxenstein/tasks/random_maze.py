"""DeepMind Lab's random mazes of rooms and corridors, drawn inside a compiled program.

The rules are those of the text maze generator of google-deepmind/lab, which the package labmaze
also has. Odd rows and columns form a lattice. Rooms are rectangles on it. Mazes of corridors fill
the rest. Every two regions that touch are connected once. Dead ends are walled up, and detours
around three sides of a rectangle are straightened. `fidelity/labmaze_layouts.py` compares both.
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
from .maze_ways import AROUND, shift, straighten

# How often rooms are redrawn if there are too few; one draw of fifty has too few in 9x9 mazes.
TRIES = 16
# The largest sum of the weights of rooms, apart from rounding.
LARGEST = 2**23
# (row, column) of the lattice's directions: east, west, south, north.


class RandomMaze(PyTreeNode):
    """A maze of N by N cells, including its border.

    Attributes:
        open: bool[N, N], the cells of rooms, corridors and doorways.
        room: int32[N, N], the number of the room, starting at 1; 0 elsewhere.
        rooms: int32[], the number of rooms.
        doorways: bool[N, N], the cells that connect two regions.
    """

    open: jax.Array
    room: jax.Array
    rooms: jax.Array
    doorways: jax.Array


@dataclasses.dataclass(frozen=True)
class MazePlan:
    """A distribution of mazes.

    Attributes:
        size: rows and columns, including the border: an odd number from 5 to 63.
        rooms: the largest number of rooms.
        least: the shortest side of a room in cells, odd, at least 3.
        most: the longest side, odd.
        fewest: the smallest number of rooms; with fewer, all rooms are redrawn.
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
        """The number of lattice points in a row."""
        return self.size // 2


def sample_maze(key: jax.Array, plan: MazePlan) -> RandomMaze:
    """Sample a maze.

    Args:
        key: the random key.
        plan: the distribution of mazes.
    """
    points, tries = plan.lattice**2, plan.rooms * TRIES
    bits = jax.random.bits(key, (tries + 3 * points,), jnp.uint32)
    room, rooms = _sample_rooms(bits[:tries].reshape(TRIES, -1), plan)
    region, links = carve(bits[tries : tries + points], room)
    doors = _connect(bits[tries + points :], region)
    links, left = _wall_up(room, links, doors)
    none = jnp.zeros_like(left)
    doorways = _cells(none, doors & _both_ends(left), none)
    # A room's cells are between its lattice points; a corner belongs to a room if all points do.
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
        maze: the maze; rooms that it lacks get cells of its border.
        rooms: the largest number of rooms of a maze.
        count: cells per room, at most as many as the smallest room has.
    """
    size = maze.room.shape[0]
    index = np.arange(size * size, dtype=np.uint32)
    # No two are equal; other rooms and the border are less than all of them.
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
    """int32[N, N]: the number of the room at or beside each cell; the largest if several."""
    around = [shift(maze.room, row, column) for row in (-1, 0, 1) for column in (-1, 0, 1)]
    return functools.reduce(jnp.maximum, around)


@functools.cache
def _rectangles(plan: MazePlan) -> tuple[np.ndarray, np.ndarray]:
    """bool[C, K, K], every rectangle that may be a room; int32[C], their relative probabilities.

    Two sides are drawn uniformly from least to middle. One of them, at random, is extended by a
    number drawn uniformly from 0 to most - middle.
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
    scale = Fraction(math.lcm(*(weight.denominator for weight in weights)))
    # Larger sums would overflow, or be drawn from with rounding: round the weights here instead.
    scale = min(scale, LARGEST / sum(weights))
    return np.stack(masks), np.array([max(1, int(weight * scale)) for weight in weights], np.int32)


def _sample_rooms(bits: jax.Array, plan: MazePlan) -> tuple[jax.Array, jax.Array]:
    """int32[K, K], the number of each point's room or 0; int32[], the number of rooms.

    Rectangles are drawn from those that are apart from all earlier ones. This is equivalent to
    drawing from all rectangles with rejection.

    Args:
        bits: uint32[TRIES, rooms], random.
        plan: the distribution of mazes.
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
    """[2, K, K]: the points east and south of each point."""
    return jnp.stack([shift(grid, 0, 1), shift(grid, 1, 0)])


def _both_ends(points: jax.Array) -> jax.Array:
    """bool[2, K, K]: whether a point and the one east, or south, of it are both set."""
    return points[None] & _ahead(points)


def carve(bits: jax.Array, room: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Fill everything outside rooms with corridors, by recursive backtracking.

    Each step continues from the latest point that has an unvisited neighbour; that is the point
    that backtracking finds.

    Args:
        bits: uint32[K * K], random.
        room: int32[K, K], the number of each point's room, or 0.

    Returns:
        int32[K, K], the region of each point: the number of a room, or a larger one; bool[2, K,
        K], which points are linked with the one east and the one south of them.
    """
    size = room.shape[0]
    index = np.arange(size * size, dtype=np.int32).reshape(size, size)

    def visit(carry: tuple[jax.Array, ...]) -> tuple[jax.Array, ...]:
        time, region, reached, links = carry
        left = region == 0
        beside = jnp.stack([shift(left, *step) for step in AROUND])
        last = jnp.argmax(jnp.where(jnp.any(beside, axis=0), reached, 0)).astype(jnp.int32)
        here = index == last
        ways = jnp.any(beside & here[None], axis=(1, 2)) & (reached.reshape(-1)[last] > 0)
        upto = jnp.cumsum(ways, dtype=jnp.int32)
        way = jnp.argmax(upto > sample_index(bits[time], jnp.maximum(upto[-1], 1)))
        steps = jnp.stack([shift(here, -down, -along) for down, along in AROUND])
        # If no visited point can continue, a new maze starts at the first unvisited point.
        goes = upto[-1] > 0
        there = jnp.where(goes, steps[way], index == jnp.argmax(left))
        number = jnp.where(goes, region.reshape(-1)[last], jnp.max(region) + 1)
        # A link is stored at its western or northern point.
        owner = jnp.where((way % 2 == 0), here, there) & goes
        links = links | (owner[None] & (np.arange(2)[:, None, None] == way // 2))
        reached = jnp.where(there, time + 1, reached)
        return time + 1, jnp.where(there, number, region), reached, links

    start = jnp.int32(0), room, jnp.zeros_like(room), jnp.zeros((2, *room.shape), bool)
    start = varying(start, room, bits)
    end = jax.lax.while_loop(lambda carry: jnp.any(carry[1] == 0), visit, start)
    return end[1], end[3]


def _connect(bits: jax.Array, region: jax.Array) -> jax.Array:
    """bool[2, K, K]: one place between every two regions that touch."""
    size = region.shape[0]
    count = 2 * size * size
    ahead = _ahead(region)
    pair = jnp.minimum(region[None], ahead) * (size * size + 1) + jnp.maximum(region[None], ahead)
    pair = jnp.where((ahead > 0) & (ahead != region[None]), pair, 0).reshape(-1)
    drawn = (bits & ~jnp.uint32(8191)) | np.arange(count, dtype=np.uint32)
    better = (pair[:, None] == pair[None]) & (drawn[:, None] > drawn[None])
    return ((pair > 0) & ~jnp.any(better, axis=1)).reshape(2, size, size)


def _wall_up(room: jax.Array, links: jax.Array, doors: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Wall up the dead ends of corridors; returns the links and bool[K, K] corridor points left."""

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
    """[N, N] cells of a lattice: its points, the cells east and south of them, and south-east."""
    size = points.shape[0]
    blocks = jnp.stack([jnp.stack([points, between[0]]), jnp.stack([between[1], corner])])
    cells = blocks.transpose(2, 0, 3, 1).reshape(2 * size, 2 * size)
    return jnp.pad(cells, ((1, 0), (1, 0)))
