"""The minimum number of MiniGrid's moves to solve one of its levels, or one of ours.

Levels may have at most one locked door. A move is a turn by 90 degrees, a step, or a hand action.
Passing a door always costs one more move, and an agent that carries a key always needs one move to
drop it before it picks up something else. MiniGrid's levels and ours are counted in the same way.
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
# The end of the supported worlds, by their sources: a goal to stand on, a thing to pick up, or a
# locked door to open.
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
    """The cell of a player, its heading in quarter turns, and whether it has the key."""

    cell: Cell
    heading: int
    key: bool


def source_of(name: str) -> str:
    """The module and class of a world; `name` has no prefix."""
    return str(ENTRIES[PREFIX + name].source).removeprefix("minigrid.")


def end_of(name: str) -> str:
    """The end of a world, "" if it is not supported; `name` has no prefix."""
    # Worlds with things to move out of the way are not supported.
    blocked = ENTRIES[PREFIX + name].fixed.get("blocked", False)
    return "" if blocked else ENDS.get(source_of(name), "")


def fewest_moves(found: Observation, end: str) -> int:
    """The minimum number of moves that solve a level, or -1 if it cannot be solved.

    Args:
        found: the content of the level (`minigrid_worlds`).
        end: the kind of its end.
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
    """The moves from a place to the end if it is in reach, else -1."""
    if end == "goal":
        return 0 if things.get(place.cell) == end else -1
    if things.get(_front(place)) != end:
        return -1
    if end == "locked":
        return 1 if place.key else -1
    return 2 if place.key else 1


def _ways(place: Place, things: dict[Cell, str]) -> list[tuple[int, Place]]:
    """The possible moves with their costs."""
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
