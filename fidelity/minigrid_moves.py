"""How many of MiniGrid's moves solve one of its levels, or one of ours, at the least.

Of levels with one locked door at most. A move is a turn by 90 degrees, a step, or what the hand
does. A door costs one more wherever it is passed, and who carries a key lays it down in one move
before picking something else up, wherever that is: both sides are counted alike.
"""

from __future__ import annotations

import ast
import heapq
from typing import NamedTuple

from fidelity.frequencies import Observation
from jaxenstein.catalogue import ENTRIES

PREFIX = "minigrid-"
STEPS = ((1, 0), (0, 1), (-1, 0), (0, -1))
Cell = tuple[int, int]
# What ends the worlds that are counted, by their sources: a goal to stand on, a thing to pick up,
# or a locked door to open.
ENDS = {
    "open_rooms:Empty": "goal",
    "open_rooms:FourRooms": "goal",
    "multi_room:MultiRoom": "goal",
    "open_rooms:Crossing": "goal",
    "open_rooms:LavaGap": "goal",
    "open_rooms:DistShift": "goal",
    "doors:DoorKey": "goal",
    "doors:LockedRoom": "goal",
    "doors:UnlockPickup": "box",
    "doors:Unlock": "locked",
    "doors:KeyCorridorBall": "ball",
}


class Place(NamedTuple):
    """Where a player is: its cell, its heading in quarter turns, and whether it has the key."""

    cell: Cell
    heading: int
    key: bool


def source_of(name: str) -> str:
    """The module and class of a world; without the prefix of the id."""
    return str(ENTRIES[PREFIX + name].source).removeprefix("minigrid.")


def end_of(name: str) -> str:
    """What ends a world, "" if it is not counted; without the prefix of the id."""
    # Nothing is counted that has to be moved out of the way.
    blocked = ENTRIES[PREFIX + name].fixed.get("blocked", False)
    return "" if blocked else ENDS.get(source_of(name), "")


def fewest_moves(found: Observation, end: str) -> int:
    """The fewest moves that solve a level, or -1 if none do.

    Args:
        found: what the level shows (`minigrid_worlds`).
        end: the kind of what ends it.
    """
    things = {_cell(place): kind for kind, place in map(str.split, found["things"])}
    things |= {_cell(place): kind for kind, place in map(str.split, found["doors"])}
    things |= {_cell(place): "wall" for place in found["walls"]}
    column, row, heading = ast.literal_eval(found["start"][0])
    start = Place((column, row), heading, key=False)
    best, queue = {start: 0}, [(0, start)]
    while queue:
        moves, place = heapq.heappop(queue)
        if moves > best[place]:
            continue
        if (last := _last(place, things, end)) >= 0:
            return moves + last
        for cost, after in _ways(place, things):
            if moves + cost < best.get(after, moves + cost + 1):
                best[after] = moves + cost
                heapq.heappush(queue, (moves + cost, after))
    return -1


def _cell(place: str) -> Cell:
    column, row = place.split(",")
    return int(column), int(row)


def _front(place: Place) -> Cell:
    return place.cell[0] + STEPS[place.heading][0], place.cell[1] + STEPS[place.heading][1]


def _last(place: Place, things: dict[Cell, str], end: str) -> int:
    """Moves from a place to the end if it is at hand, else -1."""
    if end == "goal":
        return 0 if things.get(place.cell) == end else -1
    if things.get(_front(place)) != end:
        return -1
    if end == "locked":
        return 1 if place.key else -1
    return 2 if place.key else 1


def _ways(place: Place, things: dict[Cell, str]) -> list[tuple[int, Place]]:
    """What one may do, with what it costs."""
    found = [(1, place._replace(heading=(place.heading + way) % 4)) for way in (1, 3)]
    front = _front(place)
    kind = things.get(front, "floor")
    if kind == "key" and not place.key:
        found.append((1, place._replace(key=True)))
    cost = {"floor": 1, "goal": 1, "door": 2}.get(kind, 0)
    if place.key:
        cost = {"key": 1, "locked": 2}.get(kind, cost)
    if cost:
        found.append((cost, place._replace(cell=front)))
    return found
