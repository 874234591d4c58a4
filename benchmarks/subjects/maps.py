"""Maps to measure with: how the size of a map, and the number of sprites, change the speed."""

from __future__ import annotations

# Side of a room with one of its walls, and of the hall that sprites stand in.
ROOM = 8
HALL = 32
# Keys look like sprites that nobody takes; six colours of them.
KEYS = "rnbpye"


def rooms(side: int) -> str:
    """A square map of rooms with openings between them: from anywhere one sees about as much.

    Args:
        side: tiles, 9 to 256; a room is 7 tiles wide, and may be narrower at the right and below.
    """
    tiles = [[_room_tile(column, row, side) for column in range(side)] for row in range(side)]
    tiles[ROOM // 2 + 1][ROOM // 2] = "G"
    return "\n".join("".join(row) for row in tiles)


def _room_tile(column: int, row: int, side: int) -> str:
    if {column, row} & {0, side - 1}:
        return "#"
    on_walls = (column % ROOM == 0) + (row % ROOM == 0)
    middle = (column % ROOM == ROOM // 2) + (row % ROOM == ROOM // 2)
    if on_walls:
        # An opening in the middle of each wall.
        return "." if on_walls == 1 and middle else "#"
    return "S" if middle == 2 else "."


def hall(sprites: int) -> str:
    """One open hall of 32x32 tiles with a goal and keys spread evenly.

    Args:
        sprites: how many stand there, 1 to 196; the first is the goal.
    """
    tiles = [["#" if {c, r} & {0, HALL - 1} else "." for c in range(HALL)] for r in range(HALL)]
    places = [(column, row) for row in range(2, HALL - 2, 2) for column in range(2, HALL - 2, 2)]
    for number in range(sprites):
        column, row = places[number * len(places) // sprites]
        tiles[row][column] = KEYS[number % len(KEYS)] if number else "G"
    for column, row in ((7, 7), (25, 7), (7, 25), (25, 25), (17, 17)):
        tiles[row][column] = "S"
    return "\n".join("".join(row) for row in tiles)
