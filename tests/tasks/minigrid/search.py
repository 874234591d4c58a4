"""Decide whether worlds with things and doors can be solved, by search on the host.

Many levels at once, in plain numpy, without the floods or players of the package. What can be
reached grows until it does not: the floor from the start on, things beside it, doors beside it
that need no key or whose key is had, keys in boxes that are had.

One thing at a time is carried. What lies in no way stays where it is until it is needed, and can be
put back there. What lies in the way is taken up, carried on, and put down, up to four times, on a
tile of which the search makes sure that the floor around it hangs together without it, and that no
key or box has its only neighbour there. So whatever was reached before still can be, and all that
is found is a way that can be walked.
"""

import numpy as np

KEY, BALL, BOX, GOAL, LAVA = range(5)
LYING, HELD, BOXED, GONE = range(4)
RED, YELLOW = 0, 4
MOVES = 4
# East, south-east, south and so on around a tile: rows and columns.
RING = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))


def shifted(mask, rows, columns):
    """bool[B, rows, columns], a mask shifted by a number of tiles."""
    wide = np.pad(mask, ((0, 0), (1, 1), (1, 1)))
    height, width = mask.shape[1:]
    return wide[:, 1 + rows : 1 + rows + height, 1 + columns : 1 + columns + width]


def beside(mask):
    """bool[B, rows, columns]: the tiles that share an edge with a tile of a mask."""
    return np.logical_or.reduce([shifted(mask, *way) for way in RING[::2]])


def flood(walkable, seen):
    """bool[B, rows, columns], a mask and all tiles that can be reached from it."""
    while True:
        grown = seen | (beside(seen) & walkable)
        if np.array_equal(grown, seen):
            return seen
        seen = grown


def only_neighbours(floor, things):
    """bool[B, rows, columns], tiles that are the only free neighbour of something."""
    ways = sum(shifted(floor, *way).astype(np.int8) for way in RING[::2])
    return floor & beside(things & (ways == 1))


def hangs_together(floor):
    """bool[B, rows, columns]: whether the floor beside a tile is connected around it without it."""
    ring = [shifted(floor, *way) for way in RING]
    # How many pieces there are around it that touch its edges; none too if all eight are floor.
    pieces = sum(
        ring[k].astype(np.int8) - (ring[k] & ring[k - 1] & ring[k - 2]) for k in range(0, 8, 2)
    )
    return (pieces == 1) | ((pieces == 0) & beside(floor))


def mask_of(shape, columns, rows, which):
    """bool[shape]: the tiles int[B, K] that bool[B, K] selects."""
    mask = np.zeros(shape, bool)
    mask[np.nonzero(which)[0], rows[which], columns[which]] = True
    return mask


def start_tiles(states):
    """bool[B, rows, columns], the tile where each level begins."""
    cell = np.floor(states.position).astype(int)[:, None]
    shape = len(cell), *states.level.walls.shape[-2:]
    return mask_of(shape, cell[..., 0], cell[..., 1], np.ones(cell.shape[:2], bool))


class Search:
    """The reachable tiles and things in B levels with N things and D doors.

    Attributes:
        floor: bool[B, rows, columns], where one gets to.
        had: bool[B, N], things that one gets beside.
        opened: bool[B, D], doors that are not locked, or that one gets to unlock.
        moved: int[B, N], how often things were carried off.
    """

    def __init__(self, states, carries=True, gone=False, passable=()):
        """Search.

        Args:
            states: of the levels, on the host.
            carries: whether what is in the way may be carried off.
            gone: whether what one gets beside is gone for good.
            passable: kinds that are in no way although they are solid.
        """
        things, tiles = states.things, states.level.doors
        self.carries, self.gone = carries, gone
        self.kind, self.colour, self.box = things.kind, things.colour, things.box
        self.column, self.row = things.tile[..., 0].copy(), things.tile[..., 1].copy()
        self.place, self.batch = things.place.copy(), np.arange(len(things.place))[:, None]
        self.portable = self.kind < GOAL
        self.stops = (self.portable | (self.kind == LAVA)) & ~np.isin(self.kind, passable)
        self.door_column, self.door_row = tiles[..., 0], tiles[..., 1]
        self.shade, self.opened = states.doors.colour, ~states.doors.locked
        self.real = (tiles != 0).any(axis=-1)
        self.ground = states.level.walls[:, 0] == 0
        self.floor = start_tiles(states)
        self.had, self.moved = (np.zeros(self.kind.shape, kind) for kind in (bool, np.int8))
        known = -1
        # Carrying a thing away frees at least as much floor as it takes, so the sum never shrinks.
        while known != (known := sum(x.sum() for x in self.parts())):
            self.floor = flood(self.walkable(), self.floor)
            self.touch()
            if carries:
                self.carry_off()

    def parts(self):
        """The sets that grow during the search."""
        return self.floor, self.had, self.opened, self.moved

    def tiles(self, which):
        """bool[B, rows, columns], the tiles of bool[B, N] things."""
        return mask_of(self.ground.shape, self.column, self.row, which)

    def doors(self, which):
        """bool[B, rows, columns], the tiles of bool[B, D] doors."""
        return mask_of(self.ground.shape, self.door_column, self.door_row, which & self.real)

    def walkable(self):
        """bool[B, rows, columns]: the walkable tiles."""
        stops = self.tiles(self.stops & (self.place == LYING))
        return (self.ground | self.doors(self.opened)) & ~stops

    def near(self):
        """bool[B, rows, columns]: the floor and its neighbours."""
        return self.floor | beside(self.floor)

    def touch(self):
        """Take the things beside the floor, and unlock the doors beside it."""
        near, lies = self.near(), self.place == LYING
        self.had |= lies & near[self.batch, self.row, self.column]
        # An opened box leaves its content on its tile.
        inside = np.take_along_axis(self.had, np.maximum(self.box, 0), axis=1)
        self.had |= (self.place == BOXED) & inside
        if self.gone:
            self.place = np.where(self.had & lies, GONE, self.place)
        keys = self.had & (self.kind == KEY)
        fits = (keys[:, None] & (self.colour[:, None] == self.shade[:, :, None])).any(axis=2)
        self.opened |= fits & near[self.batch, self.door_row, self.door_column]

    def carry_off(self):
        """Move taken things that block something unreached."""
        due = self.had & (self.place == LYING) & self.portable & (self.moved < MOVES)
        for slot in np.flatnonzero(due.any(axis=0)):
            beyond = (self.ground | self.doors(self.real)) & ~self.near()
            tile = self.batch[:, 0], self.row[:, slot], self.column[:, slot]
            self.put_down(slot, np.flatnonzero(due[:, slot] & beside(beyond)[tile]))

    def put_down(self, slot, levels):
        """Pick up one thing in some levels, and drop it where it does not block the way."""
        own = np.arange(self.kind.shape[1]) == slot
        here, doors = self.tiles(own & (self.place == LYING))[levels], self.doors(self.real)[levels]
        litter = self.tiles(self.place == LYING)[levels] & ~here
        # The agent may walk on with it.
        floor = flood(self.walkable()[levels] | here, self.floor[levels] | here)
        needed = self.tiles((self.place == LYING) & (self.kind != BALL) & ~own)[levels]
        spots = (
            floor
            & hangs_together(floor)
            & ~doors
            & ~litter
            & ~here
            & ~only_neighbours(floor, needed)
        )
        # Prefer tiles that are not the only access to something, at least not to a door or floor.
        for behind in (doors | self.ground[levels] & ~litter, self.ground[levels] | doors):
            apart = spots & ~beside(behind & ~floor)
            spots = np.where(apart.any(axis=(1, 2), keepdims=True), apart, spots)
        flat = spots.reshape(len(levels), self.ground[0].size)
        place, moves = flat.argmax(axis=1), flat.any(axis=1)
        floor.reshape(flat.shape)[np.arange(len(levels)), place] = False
        levels, place, floor = levels[moves], place[moves], floor[moves]
        self.row[levels, slot], self.column[levels, slot] = np.divmod(place, spots.shape[2])
        self.moved[levels, slot] += 1
        self.floor[levels] = floor

    def can_put(self, thing, other, corners):
        """bool[B]: whether one of bool[B, N] things can be put down beside another.

        Args:
            thing: of each level one.
            other: likewise.
            corners: whether the tiles at corners are beside it too.
        """
        own, around = self.tiles(thing), self.tiles(other)
        floor = flood(self.walkable() | own, self.floor | (own & self.near()))
        ways = RING if corners else RING[::2]
        spots = np.logical_or.reduce([shifted(around, *way) for way in ways])
        # From another tile.
        spots &= floor & beside(floor)
        return (self.had & thing).any(axis=1) & spots.any(axis=(1, 2))


def solvable(env, states):
    """bool[B]: whether each of many levels of a world of things and doors can be solved."""
    things, kind = states.things, type(env).__name__
    # If picking up or interacting ends the episode, nothing is carried away.
    carries = env.hands and kind not in ("Fetch", "PutNear", "GoToDoor", "GoToObject")
    # Wandering obstacles do not block the way forever.
    passable = (BALL,) if kind == "DynamicObstacles" else ()
    search = Search(states, carries, kind == "PickupObjects", passable)
    doors = search.opened & search.near()[search.batch, search.door_row, search.door_column]
    asked, other = (
        (things.kind == what[:, :1]) & (things.colour == what[:, 1:])
        for what in (states.asked[:, 0], states.asked[:, 1])
    )
    if kind in ("Unlock", "RedBlueDoors"):
        return doors.all(axis=1)
    if kind == "GoToDoor":
        return (doors & (states.doors.colour == states.asked[:, 0, 1:])).any(axis=1)
    if kind == "Memory":
        # One tile before the like thing, towards the hall.
        like = np.where(things.kind[:, 1] == things.kind[:, 0], 1, 2)
        column, row = things.tile[search.batch[:, 0], like].T
        return search.floor[search.batch[:, 0], row + np.where(like == 1, 1, -1), column]
    if kind == "PutNear":
        return search.can_put(asked, other, corners=True)
    if kind == "PutNext":
        boxes = things.colour == RED, things.colour == YELLOW
        return search.can_put(*boxes, corners=False) | search.can_put(*boxes[::-1], corners=False)
    if kind == "PickupObjects":
        return search.had.all(axis=1)
    if (states.asked[:, 0] >= 0).all():
        return (search.had & asked).any(axis=1)
    goals = search.tiles((things.kind == GOAL) & (things.place == LYING))
    return (search.floor & goals).any(axis=(1, 2))


def check_placement(env, states):
    """Whether things and the start are on free tiles, and are allowed in the world."""
    things, batch = states.things, np.arange(len(states.position))
    walls = states.level.walls[:, 0] != 0
    row, column = things.tile[..., 1], things.tile[..., 0]
    lies = things.place == LYING
    assert not (walls[batch[:, None], row, column] & lies).any()
    cell = np.floor(states.position).astype(int)
    assert not walls[batch, cell[:, 1], cell[:, 0]].any()
    here = lies & (column == cell[:, :1]) & (row == cell[:, 1:])
    assert not here.any()
    flat = np.where(lies, row * walls.shape[2] + column, -1 - np.arange(row.shape[1]))
    flat.sort(axis=1)
    assert (np.diff(flat, axis=1) > 0).all()
    assert set(np.unique(things.kind).tolist()) <= set(env.kinds)
    assert ((things.colour >= 0) & (things.colour < 6)).all()
