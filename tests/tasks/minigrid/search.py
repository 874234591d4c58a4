"""Whether worlds can be solved, by search on the host over what their states hold.

Many levels at once, in plain numpy, without the floods or players of the package: what can
be reached grows until it does not. What can be reached is out of the way from then on, its
box opens, and its key opens the doors of its colour.
"""

import numpy as np

KEY, BALL, BOX, GOAL, LAVA = range(5)
LYING, HELD, BOXED, GONE = range(4)


def spread(mask):
    """bool[B, rows, columns], the tiles beside those of a mask, and themselves."""
    wide = np.pad(mask, ((0, 0), (1, 1), (1, 1)))
    return mask | wide[:, 2:, 1:-1] | wide[:, :-2, 1:-1] | wide[:, 1:-1, 2:] | wide[:, 1:-1, :-2]


def reached(states, hands=True, moving=False):
    """bool[B, rows, columns] where one gets to; bool[B, N] things had; bool[B, D] doors opened.

    Args:
        states: of B worlds, on the host.
        hands: whether what can be carried can be put out of the way.
        moving: whether it goes out of the way by itself.
    """
    walls = states.level.walls[:, 0] != 0
    things, doors = states.things, states.level.doors
    batch = np.arange(len(walls))
    door_row, door_column = doors[..., 1], doors[..., 0]
    open_to = ~walls
    for slot in range(doors.shape[1]):
        real = (doors[:, slot] != 0).any(axis=-1) & ~states.doors.locked[:, slot]
        open_to[batch, door_row[:, slot], door_column[:, slot]] |= real
    column, row = things.tile[..., 0], things.tile[..., 1]
    place = things.place.copy()
    got = np.zeros(place.shape, bool)
    cell = np.floor(states.position).astype(int)
    seen = np.zeros(walls.shape, bool)
    seen[batch, cell[:, 1], cell[:, 0]] = True
    while True:
        before = seen.sum() + got.sum() + open_to.sum()
        stops = np.zeros(walls.shape, bool)
        for slot in range(place.shape[1]):
            kind, lies = things.kind[:, slot], place[:, slot] == LYING
            stays = (kind < GOAL) & ~(got[:, slot] & hands) & (not moving)
            blocks = lies & ((kind == LAVA) | stays)
            stops[batch, row[:, slot], column[:, slot]] |= blocks
        seen |= spread(seen) & open_to & ~stops
        near = spread(seen)
        for slot in range(place.shape[1]):
            lies = place[:, slot] == LYING
            got[:, slot] |= lies & near[batch, row[:, slot], column[:, slot]]
        for slot in range(place.shape[1]):
            box = things.box[:, slot]
            opened = (place[:, slot] == BOXED) & got[batch, np.maximum(box, 0)]
            place[opened, slot] = LYING
            got[:, slot] |= opened
        keys = got & (things.kind == KEY)
        for slot in range(doors.shape[1]):
            fits = (keys & (things.colour == states.doors.colour[:, slot, None])).any(axis=1)
            touched = near[batch, door_row[:, slot], door_column[:, slot]]
            open_to[batch, door_row[:, slot], door_column[:, slot]] |= touched & fits
        if seen.sum() + got.sum() + open_to.sum() == before:
            doors = batch[:, None], door_row, door_column
            return seen, got, near[doors] & open_to[doors]


def solvable(env, states):
    """bool[B]: whether each of many worlds can be solved."""
    things, kind = states.things, type(env).__name__
    # What wanders is not in the way for ever.
    seen, got, doors = reached(states, env.hands, kind == "DynamicObstacles")
    batch = np.arange(len(seen))
    there = seen[batch[:, None], things.tile[..., 1], things.tile[..., 0]]
    asked = (things.kind == states.asked[:, 0, :1]) & (things.colour == states.asked[:, 0, 1:])
    if kind in ("Unlock", "RedBlueDoors"):
        return doors.all(axis=1)
    if kind == "GoToDoor":
        return (doors & (states.doors.colour == states.asked[:, 0, 1:])).any(axis=1)
    if kind == "Memory":
        # One tile before the like thing, towards the hall.
        like = np.where(things.kind[:, 1] == things.kind[:, 0], 1, 2)
        column, row = things.tile[batch, like].T
        return seen[batch, row + np.where(like == 1, 1, -1), column]
    if kind in ("Fetch", "GoToObject", "KeyCorridorBall", "ObstructedMaze", "UnlockPickup"):
        return (got & asked).any(axis=1)
    if kind == "PutNear":
        other = (things.kind == states.asked[:, 1, :1]) & (things.colour == states.asked[:, 1, 1:])
        return (got & asked).any(axis=1) & (got & other).any(axis=1)
    return (there & (things.kind == GOAL)).any(axis=1)
