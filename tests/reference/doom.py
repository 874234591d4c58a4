"""A slow, simple model of one tic of Doom's player, in Python integers.

Positions and velocities are 16.16 map units, and 2**32 is a full turn. The rules are those of
ZDoom's `P_MovePlayer`, `P_XYMovement`, `FSlide` and `FPathTraverse`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from fractions import Fraction

ONE = 1 << 16
RADIUS = 16 * ONE
BLOCK = 128 * ONE

Point = tuple[int, int]


@dataclasses.dataclass(frozen=True)
class Wall:
    """An axis-parallel wall in map units, with its front on the right."""

    x0: int
    y0: int
    x1: int
    y1: int

    @property
    def vertical(self) -> bool:
        return self.x0 == self.x1

    def behind(self, point: Point) -> bool:
        x, y = point
        across = (y - self.y0 * ONE) * (self.x1 - self.x0) * ONE
        across += (self.x0 * ONE - x) * (self.y1 - self.y0) * ONE
        return across >> 32 > 0

    def touches(self, centre: Point) -> bool:
        """Whether the body's box around a centre overlaps the wall."""
        xs, ys = sorted((self.x0 * ONE, self.x1 * ONE)), sorted((self.y0 * ONE, self.y1 * ONE))
        inside = [
            low < middle + RADIUS and middle - RADIUS < high
            for (low, high), middle in zip((xs, ys), centre, strict=True)
        ]
        return all(inside)


@dataclasses.dataclass
class Player:
    """The player's body; `held` counts the tics for which a turn button has been down."""

    x: int
    y: int
    vx: int = 0
    vy: int = 0
    angle: int = 0
    held: int = 0


class World:
    """The walls in the order of the game's list, and the blocks that contain them."""

    def __init__(self, walls: Sequence[Wall]) -> None:
        self.walls = walls
        ends = [(x, y) for w in walls for x, y in ((w.x0, w.y0), (w.x1, w.y1))]
        self.west, self.south = (min(end[axis] for end in ends) * ONE for axis in (0, 1))
        self.blocks: dict[Point, list[Wall]] = {}
        for wall in walls:
            first, last = self.block(wall.x0, wall.y0), self.block(wall.x1, wall.y1)
            for bx in range(min(first[0], last[0]), max(first[0], last[0]) + 1):
                for by in range(min(first[1], last[1]), max(first[1], last[1]) + 1):
                    self.blocks.setdefault((bx, by), []).append(wall)

    def block(self, x: int, y: int) -> Point:
        return (x * ONE - self.west) // BLOCK, (y * ONE - self.south) // BLOCK

    def free(self, centre: Point) -> bool:
        return not any(wall.touches(centre) for wall in self.walls)

    def tic(self, p: Player, ahead: int, right: int, left_turn: bool, right_turn: bool) -> Player:
        """The player after one tic; `ahead` and `right` are -1, 0 or 1.

        Also lists in `tried` each position at which the body was tried.
        """
        self.tried: list[Point] = []
        p = dataclasses.replace(p, held=p.held + 1 if left_turn or right_turn else 0)
        yaw = (320 if p.held < 6 else 640) << 16
        p.angle = (p.angle + yaw * (left_turn - right_turn)) % 2**32
        index = p.angle >> 19
        p.vx += times(51200 * ahead, cosine(index)) + times(49152 * right, cosine(index - 2048))
        p.vy += times(51200 * ahead, sine(index)) + times(49152 * right, sine(index - 2048))
        if (p.vx or p.vy) and not self.move(p, p.vx, p.vy):
            self.slide(p)
        slow = abs(p.vx) < 4096 and abs(p.vy) < 4096
        if slow and not ahead and not right:
            p.vx = p.vy = 0
        else:
            p.vx, p.vy = times(p.vx, 59392), times(p.vy, 59392)
        return p

    def move(self, p: Player, dx: int, dy: int) -> bool:
        """Move if nothing is in the way."""
        target = p.x + dx, p.y + dy
        self.tried.append(target)
        if not self.free(target):
            return False
        p.x, p.y = target
        return True

    def slide(self, p: Player) -> None:
        tx, ty = p.vx, p.vy
        for _ in range(2):
            hit = self.first_hit(p, tx, ty)
            if hit is None:
                return self.stair(p, tx, ty)
            frac, wall = hit
            near = frac - 2048
            if near > 0 and not self.move(p, times(tx, near), times(ty, near)):
                return self.stair(p, tx, ty)
            if ONE - frac <= 0:
                return None
            tx, ty = times(tx, ONE - frac), times(ty, ONE - frac)
            p.vx, p.vy = (0, ty) if wall.vertical else (tx, 0)
            if self.move(p, p.vx, p.vy):
                return None
        return self.stair(p, tx, ty)

    def stair(self, p: Player, tx: int, ty: int) -> None:
        if not self.move(p, 0, ty):
            self.move(p, tx, 0)

    def first_hit(self, p: Player, tx: int, ty: int) -> tuple[int, Wall] | None:
        lead_x, lead_y = (RADIUS if t > 0 else -RADIUS for t in (tx, ty))
        best: tuple[int, Wall] | None = None
        for ox, oy in ((lead_x, lead_y), (-lead_x, lead_y), (lead_x, -lead_y)):
            start = p.x + ox, p.y + oy
            found = self.trace(start, (start[0] + tx, start[1] + ty), (p.x, p.y))
            if found is not None and (best is None or found[0] < best[0]):
                best = found
        return best

    def trace(self, start: Point, end: Point, centre: Point) -> tuple[int, Wall] | None:
        """The first wall between two points, and its distance in 65536ths of the way."""
        x, y = start
        x += ONE if (x - self.west) % BLOCK == 0 else 0
        y += ONE if (y - self.south) % BLOCK == 0 else 0
        met: list[tuple[int, Wall]] = []
        seen: set[int] = set()
        for block in self.path((x, y), end):
            for wall in self.blocks.get(block, ()):
                if id(wall) in seen:
                    continue
                seen.add(id(wall))
                if wall.behind((x, y)) == wall.behind(end):
                    continue
                axis = 0 if wall.vertical else 1
                way, gap = end[axis] - (x, y)[axis], (wall.x0, wall.y0)[axis] * ONE - (x, y)[axis]
                frac = round(Fraction(gap * ONE, way)) if way else 0
                if 0 <= frac <= ONE:
                    met.append((frac, wall))
        for frac, wall in sorted(met, key=lambda pair: pair[0]):
            if not wall.behind(centre):
                return frac, wall
        return None

    def path(self, start: Point, end: Point) -> list[Point]:
        """The blocks that a trace visits, in order."""
        x, y = start[0] - self.west, start[1] - self.south
        goal = (end[0] - self.west) // BLOCK, (end[1] - self.south) // BLOCK
        at_x, at_y = x // BLOCK, y // BLOCK
        step_x, step_y = sign(goal[0] - at_x), sign(goal[1] - at_y)
        way_x, way_y = end[0] - start[0], end[1] - start[1]
        x_cut = (x >> 7) + times(*reach(y, step_y, way_x, way_y))
        y_cut = (y >> 7) + times(*reach(x, step_x, way_y, way_x))
        x_step, y_step = reach(y, step_y, way_x, way_y)[1], reach(x, step_x, way_y, way_x)[1]
        if abs(x_step) == ONE and abs(y_step) == ONE:
            part_x, part_y = (reach(v, s, 1, 1)[0] for v, s in ((x, step_x), (y, step_y)))
            part_x = ONE - part_x if y_step < 0 else part_x
            part_y = ONE - part_y if x_step < 0 else part_y
            if part_x == part_y:
                x_cut, y_cut = at_x << 16, at_y << 16
        visited = []
        for _ in range(100):
            visited.append((at_x, at_y))
            if (at_x, at_y) == goal:
                break
            on_x, on_y = x_cut >> 16 == at_x, y_cut >> 16 == at_y
            if not on_x and not on_y:
                break
            if on_x and on_y:
                visited += [(at_x + step_x, at_y), (at_x, at_y + step_y)]
            if on_x:
                x_cut, at_y = x_cut + x_step, at_y + step_y
            if on_y:
                y_cut, at_x = y_cut + y_step, at_x + step_x
        return visited


def reach(place: int, step: int, way: int, across: int) -> Point:
    """Blocks to the next border along one axis, and the change of the other axis per block."""
    if step == 0:
        return ONE, 256 * ONE
    part = (place >> 7) % ONE
    if abs(way) >> 15 >= abs(across):
        slope = -(2**31) if (way ^ across) < 0 else 2**31 - 1
    else:
        slope = (abs(way) << 16) // abs(across) * (1 if way >= 0 else -1)
    return (ONE - part if step > 0 else part), slope


def sign(value: int) -> int:
    return (value > 0) - (value < 0)


def times(a: int, b: int) -> int:
    """The product of two 16.16 numbers, rounded down."""
    return (a * b) >> 16


def sine(index: int) -> int:
    """An entry of the table of 8192 sines."""
    index %= 8192
    if index >= 4096:
        return -sine(index - 4096)
    if index == 2048:
        return ONE
    if index > 2048:
        index = 4095 - index
    return math.floor(ONE * math.sin(2 * math.pi * index / 8192))


def cosine(index: int) -> int:
    return sine(index + 2048)
