"""A slow, simple model of the game's renderer in Python integers: walls, floors, light, things.

It follows the rules of ZDoom's software renderer for maps with one floor and one ceiling height,
and uses the nodes stored with a scenario's map. Numbers are 16.16 map units unless stated
otherwise; depths and sides in the view have 12 fractional bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jaxenstein.tasks.doom.wad import Wad

from .doom import ONE, Point, cosine, sine, times
from .doom_nodes import GameMap, Line, Seg
from .doom_things import Stamp, Thing, Weapon, paint

# The least depth of walls and of things, and the most light that nearness adds.
NEAR_WALL, NEAR_THING, MOST_LIGHT = 32, 2 << 12, 24 * ONE
SHADES = 32
# The colour that tints the screen after a pickup.
GOLD = 215, 186, 69


@dataclass(frozen=True)
class Pose:
    """The eye: its position in 16.16, and its angle, where 2**32 is a full turn."""

    x: int
    y: int
    z: int
    angle: int


def cut(numerator: int, denominator: int) -> int:
    """The quotient rounded towards zero, as processors divide."""
    quotient = abs(numerator) // abs(denominator)
    return quotient if (numerator < 0) == (denominator < 0) else -quotient


def signed(value: int) -> int:
    """The low 32 bits of a number as an int32."""
    return (value + 2**31) % 2**32 - 2**31


def shade_of(darkness: int, nearness: int) -> int:
    """A row of COLORMAP; both 16.16."""
    return min(max((darkness - min(MOST_LIGHT, nearness)) >> 16, 0), SHADES - 1)


def darkness_of(light: int) -> int:
    """The shade of a light level far away, in 16.16."""
    return 64 * ONE - (light + 12) * (ONE // 4)


@dataclass(frozen=True)
class Extent:
    """The visible part of a piece of a wall: columns x1 to x2 (exclusive), and depths there."""

    x1: int
    x2: int
    depth1: int
    depth2: int


@dataclass(frozen=True)
class Fragment:
    """The drawn columns of a piece of a wall."""

    start: int
    stop: int
    extent: Extent
    seg: Seg


class Renderer:
    """Draws a map with the pictures of a WAD file, at one screen size of aspect ratio 4:3."""

    def __init__(self, game_map: GameMap, pictures: Wad, height: int, width: int) -> None:
        if 4 * height != 3 * width:
            raise ValueError(f"screens are of the shape 4 to 3, not {width} by {height}")
        self.map, self.height, self.width = game_map, height, width
        self.palette, self.colormap = pictures.palette(), pictures.colormap()
        names = {seg.line.texture for piece in game_map.pieces for seg in piece}
        self.textures = {name: pictures.texture(name) for name in names}
        for name, texture in self.textures.items():
            if texture.shape[0] & texture.shape[0] - 1:
                raise ValueError(f"texture {name} is {texture.shape[0]} rows high")
        # The last pose and light that were drawn, and the last things with the frame they gave.
        self.drawn: tuple[Pose, int] | None = None
        self.dressed: tuple[object, Sequence[Thing], np.ndarray] = None, (), np.zeros(0)
        self.floor, self.ceiling = (
            pictures.flat(name) if name in pictures.names("F") else pictures.texture(name)
            for name in (game_map.floor_flat, game_map.ceiling_flat)
        )
        # Half the screen; the height in pixels of a map unit at depth 1; how light falls off.
        self.cx, self.cy = width // 2, height // 2
        self.stretch = (320 * ONE) * height // (200 * width)
        self.focal = self.stretch * self.cx
        # Nearness adds 1280 / depth to the light of walls, and likewise to the rows of floors.
        visible = self.focal * (width * 600) // (width * height * 3)
        self.wall_light = times(visible, 8 * ONE)
        self.floor_light = 160 * ONE * (8 * ONE) // self.focal
        self.slope = [
            cut(self.focal * ONE, abs(2 * (self.cy - y) - 1) * (ONE // 2)) for y in range(height)
        ]

    def draw(
        self,
        pose: Pose,
        things: Sequence[Thing] = (),
        weapons: Sequence[Weapon] = (),
        *,
        gold: int = 0,
        flash: int = 0,
    ) -> np.ndarray:
        """uint8[height, width, 3]: the frame.

        Args:
            pose: the pose of the eye.
            things: the things in the map.
            weapons: the pictures of the weapon, from far to near.
            gold: the share of gold in the frame, in 256ths.
            flash: the light that a shot adds.
        """
        self.light = self.map.light + flash
        palette = (self.palette.astype(int) * (256 - gold) + np.array(GOLD) * gold) >> 8
        return palette.astype(np.uint8)[self.indices(pose, things, weapons)]

    def indices(self, pose: Pose, things: Sequence[Thing], weapons: Sequence[Weapon]) -> np.ndarray:
        """uint8[height, width]: the frame as palette indices."""
        if (pose, self.light) != self.drawn:
            self.empty(pose)
            self.drawn, self.dressed = (pose, self.light), (None, (), self.frame)
        key = [(id(t.picture), t.x, t.y, t.z, t.bright, t.blend) for t in things]
        if self.dressed[0] != key:
            frame = self.frame.copy()
            for sprite in self.far_first(things):
                paint(frame, sprite.stamp, self.hidden(sprite), self.colormap, self.palette)
            self.dressed = key, things, frame
        frame, seen = self.dressed[2].copy(), np.zeros(self.width, bool)
        for weapon in weapons:
            paint(frame, self.held(weapon), seen, self.colormap, self.palette)
        return frame

    def empty(self, pose: Pose) -> None:
        """Draw walls, floor and ceiling."""
        self.pose = pose
        self.sin, self.cos = sine(pose.angle >> 19), cosine(pose.angle >> 19)
        self.frame = np.zeros((self.height, self.width), np.uint8)
        self.top = np.zeros(self.width, np.int64)
        self.bottom = np.full(self.width, self.height)
        self.fragments: list[Fragment] = []
        free = np.ones(self.width, bool)
        for seg in self.map.near_first(pose.x, pose.y):
            extent = self.extent(seg)
            if extent is not None:
                self.fragments += self.wall(seg, extent, free)
        self.plane(self.ceiling, self.map.ceiling, np.zeros(self.width, np.int64), self.top)
        self.plane(self.floor, self.map.floor, self.bottom, np.full(self.width, self.height))

    def turned(self, point: Point, bits: int = 20) -> Point:
        """Side (to the right) and depth of a point, relative to the eye."""
        dx, dy = point[0] - self.pose.x, point[1] - self.pose.y
        return (dx * self.sin - dy * self.cos) >> bits, (dx * self.cos + dy * self.sin) >> 20

    def extent(self, seg: Seg) -> Extent | None:
        """The visible part of a piece of a wall; None if there is none."""
        (ax, ay), (bx, by) = (
            (end[0] - self.pose.x, end[1] - self.pose.y) for end in (seg.start, seg.end)
        )
        if (ay * (ax - bx) + ax * (by - ay)) >> 32 >= 0:
            return None
        (t1, d1), (t2, d2) = self.turned(seg.start), self.turned(seg.end)
        inside1, inside2 = t1 >= -d1, t2 <= d2
        if (t1 > d1 and (inside1 or not inside2)) or (t2 < -d2 and (inside2 or not inside1)):
            return None
        # If an end is outside the view, the wall is cut where it crosses the border of the view.
        way1 = d1 if inside1 else t1 - t2 - d2 + d1
        way2 = d2 if inside2 else t1 - t2 + d2 - d1
        if way1 == 0 or way2 == 0:
            return None
        x1, depth1 = 0, d1 + cut((d2 - d1) * (t1 + d1), way1)
        x2, depth2 = self.width, d1 + cut((d2 - d1) * (t1 - d1), way2)
        if inside1:
            x1, depth1 = self.column(t1, d1), d1
        if inside2:
            x2, depth2 = self.column(t2, d2), d2
        if min(depth1, depth2) < NEAR_WALL or x2 <= x1:
            return None
        return Extent(x1, x2, depth1, depth2)

    def column(self, side: int, depth: int) -> int:
        """The first column whose left edge is not to the left of a point."""
        half = self.cx * ONE
        found = (half + cut(side * half, depth)) >> 16
        return min(self.width, found + 1) if side >= 0 else found

    def edge(self, z: int, extent: Extent) -> np.ndarray:
        """int64[x2 - x1]: the screen rows of a wall's edge, at height z above the eye."""
        x1, x2, depth1, depth2 = extent.x1, extent.x2, extent.depth1, extent.depth2
        rows = np.zeros(x2 - x1, np.int64)
        z = -(z >> 4)
        ends = -self.cy, self.height - self.cy
        limits = [cut(end * ONE * ONE, self.focal) for end in ends]
        at1, at2 = (([times(limit, depth) for limit in limits]) for depth in (depth1, depth2))
        above, below = (z < at1[0], z < at2[0]), (z > at1[1], z > at2[1])
        if all(above):
            return rows
        if all(below):
            return rows + self.height
        left, right, near, far = x1, x2, depth1, depth2
        for outside, value, number in ((above, 0, 0), (below, self.height, 1)):
            if not any(outside):
                continue
            # Where the edge crosses the border of the screen.
            share = cut((z - at1[number]) << 30, at2[number] - at1[number])
            depth = depth1 + (((depth2 - depth1) * share) >> 30)
            cross = x1 + cut(((depth2 * share) >> 30) * (x2 - x1), depth)
            if outside[1]:
                if x1 <= cross:
                    right, far = cross, depth
                rows[max(cross - x1, 0) :] = value
            else:
                if cross <= x2:
                    left, near = cross, depth
                rows[: max(cross - x1, 0)] = value
        first = cut(z * self.focal, near)
        middle = self.cy * ONE
        step = cut(cut(z * self.focal, far) - first, right - left) if right > left else 0
        columns = np.arange(x1, x2)
        part = (columns >= left) & (columns < max(right, left + 1))
        rows[part] = (first + middle + step * (columns[part] - left)) >> 16
        return np.clip(rows, 0, self.height)

    def wall(self, seg: Seg, extent: Extent, free: np.ndarray) -> list[Fragment]:
        """Draw a piece of a wall in the columns that are still free."""
        x1, x2 = extent.x1, extent.x2
        columns = np.flatnonzero(free[x1:x2]) + x1
        if not columns.size:
            return []
        top = self.edge(self.map.ceiling - self.pose.z, extent)
        bottom = self.edge(self.map.floor - self.pose.z, extent)
        self.top[columns], self.bottom[columns] = top[columns - x1], bottom[columns - x1]
        free[x1:x2] = False
        texels, steps = self.paper(seg.line, extent)
        shades = self.shades(seg.line, extent)
        runs = np.split(columns, np.flatnonzero(np.diff(columns) > 1) + 1)
        for run in runs:
            below = self.same_shade_below(run, top, bottom, x1)
            for x in run.tolist():
                i, rows = x - x1, np.arange(int(top[x - x1]), int(bottom[x - x1]))
                border, first = below.get(x, (self.height, x))
                shade = np.where(rows < border, shades[i], shades[first - x1])
                column = self.textured(seg.line, texels[i], steps[i], rows)
                self.frame[rows, x] = self.colormap[shade, column]
        return [Fragment(int(run[0]), int(run[-1]) + 1, extent, seg) for run in runs]

    def shades(self, line: Line, extent: Extent) -> list[int]:
        """The shade of each column of a wall."""
        darkness, width = darkness_of(self.light + line.contrast), extent.x2 - extent.x1
        near1, near2 = (cut(self.wall_light << 12, d) for d in (extent.depth1, extent.depth2))
        step = cut(near2 - near1, width)
        return [shade_of(darkness, near1 + step * i) for i in range(width)]

    def textured(self, line: Line, along: int, step: int, rows: np.ndarray) -> np.ndarray:
        """int16[rows]: texels of a column `along` a line, in 16.16."""
        texture = self.textures[line.texture]
        height, width = texture.shape
        bits = height.bit_length() - 1
        if line.from_below:
            middle = self.map.floor - self.pose.z + height * ONE + line.offset[1]
        else:
            offset = line.offset[1]
            middle = self.map.ceiling - self.pose.z + offset + (height * ONE if offset < 0 else 0)
        down = signed(step * (ONE >> (2 + bits)))
        places = ((middle << (16 - bits)) + down * (rows - self.cy + 1)) % 2**32 >> (32 - bits)
        return np.maximum(texture[places, ((along + line.offset[0]) >> 16) % width], 0)

    @staticmethod
    def same_shade_below(
        run: np.ndarray, top: np.ndarray, bottom: np.ndarray, x1: int
    ) -> dict[int, tuple[int, int]]:
        """The row from which a column has the shade of another one, an error of the game.

        The game draws four columns at a time. Below the end of the shortest, all have the shade of
        the first.
        """
        found = {}
        start, stop = int(run[0]), int(run[-1]) + 1
        for x in range(-(-start // 4) * 4, stop - 3, 4):
            four = slice(x - x1, x - x1 + 4)
            upper, lower = top[four].max(), bottom[four].min()
            if (top[four] < bottom[four]).all() and upper < lower:
                found |= {x + i: (int(lower), x) for i in range(4)}
        return found

    def paper(self, line: Line, extent: Extent) -> tuple[list[int], list[int]]:
        """For each column, the position along the line in 16.16, and the step down the texture."""
        (t1, d1), (t2, d2) = self.turned(line.start), self.turned(line.end)
        single = np.float32
        u0, u1 = single(t1) * single(self.cx), single(-d1)
        v0, v1 = single(t1 - t2) * single(self.cx), single(d2 - d1)
        scale = single(self.width) * single(200) / single(320) / single(self.height)
        scale = scale * single(64) / single(self.cx)
        x = np.arange(extent.x1, extent.x2) - self.cx
        part = (float(u0) + float(u1) * x) / (float(v0) + float(v1) * x)
        whole = line.length * ONE
        along = np.rint(part * whole).astype(np.int64)
        steps = np.rint(part * float(v1 * scale) + float(-u1 * scale)).astype(np.int64)
        # Positions beyond an end move to the end, except at the left border of the screen.
        inside = np.flatnonzero((along >= 0) & (along < whole))
        first, last = (inside[0], inside[-1]) if inside.size else (len(along), -1)
        if extent.x1 > 0:
            along[:first] = 0
        if not inside.size and extent.x1 > 0:
            last = len(along) - 1
        along[last + 1 :] = whole - 1
        return along.tolist(), steps.tolist()

    def plane(self, flat: np.ndarray, height: int, tops: np.ndarray, bottoms: np.ndarray) -> None:
        """Fill rows from `tops` to `bottoms` of each column with a flat."""
        pose = self.pose
        away = abs(height - pose.z)
        near = cut(self.floor_light << 16, away)
        # The texels of a flat are the highest bits of 32: six of 64 texels.
        rows, columns = flat.shape
        bits_x, bits_y = columns.bit_length() - 1, rows.bit_length() - 1
        unit_x, unit_y, focal = 1 << (32 - bits_x), 1 << (32 - bits_y), self.cx * ONE
        right = (pose.angle - (1 << 30)) % 2**32 >> 19
        step_x, step_y = cut(unit_x * cosine(right), focal), cut(unit_y * -sine(right), focal)
        ahead = right + 2048
        ahead_x, ahead_y = times(unit_x, cosine(ahead)), times(unit_y, -sine(ahead))
        eye_x, eye_y = times(unit_x, pose.x), times(unit_y, -pose.y)
        darkness = darkness_of(self.light)
        for y in range(self.height):
            covered = np.flatnonzero((tops <= y) & (y < bottoms))
            if not covered.size:
                continue
            distance = times(away, self.slope[y])
            shade = shade_of(darkness, times(near, abs(self.cy - y) * ONE))
            dx, dy = times(distance, signed(step_x)), times(distance, signed(step_y))
            for span in np.split(covered, np.flatnonzero(np.diff(covered) > 1) + 1):
                first = int(span[0]) + 1 - self.cx
                x = times(distance, signed(ahead_x + first * step_x)) + eye_x
                y_ = times(distance, signed(ahead_y + first * step_y)) + eye_y
                count = np.arange(len(span))
                u = (x % 2**32 + dx * count) % 2**32 >> (32 - bits_x)
                v = (y_ % 2**32 + dy * count) % 2**32 >> (32 - bits_y)
                self.frame[y, span] = self.colormap[shade, flat[v, u]]

    def far_first(self, things: Sequence[Thing]) -> list[Sprite]:
        """The visible things, from far to near."""
        seen = [sprite for thing in things if (sprite := self.project(thing)) is not None]
        seen.sort(key=lambda sprite: -(2**31 // sprite.depth))
        # Of things at equal depth, the last is drawn first.
        return seen[::-1]

    def project(self, thing: Thing) -> Sprite | None:
        """A thing on the screen; None if it is not visible."""
        side, depth = self.turned((thing.x, thing.y), 16)
        if depth < NEAR_THING or abs(side) >> 6 > depth:
            return None
        picture, width = thing.picture, thing.picture.pixels.shape[1]
        across = cut(self.cx * ONE << 12, depth)
        left = side - picture.left * ONE
        x1 = self.cx + (left * across >> 32)
        x2 = self.cx + ((left + width * ONE) * across >> 32)
        if x1 >= self.width or x2 < 0 or x2 <= x1:
            return None
        shade = shade_of(darkness_of(self.light), cut(self.wall_light << 12, depth))
        stamp = Stamp(
            picture,
            x1,
            x2,
            along=cut(width * ONE, x2 - x1),
            middle=picture.top * ONE - (self.pose.z - thing.z),
            scale=cut(self.focal * ONE, depth << 4),
            shade=0 if thing.bright else shade,
            blend=thing.blend,
        )
        return Sprite(thing, depth, stamp)

    def held(self, weapon: Weapon) -> Stamp:
        """A weapon on the screen."""
        picture, across = weapon.picture, self.cx * ONE // 160
        left = weapon.x - (160 + picture.left) * ONE
        middle = self.cx * ONE
        return Stamp(
            picture,
            x1=(middle + times(left, across)) >> 16,
            x2=(middle + times(left + picture.pixels.shape[1] * ONE, across)) >> 16,
            along=cut(ONE * ONE, across),
            middle=(100 + picture.top) * ONE - weapon.y,
            scale=times(across, self.stretch),
            shade=0 if weapon.bright else shade_of(darkness_of(self.light) - MOST_LIGHT, 0),
        )

    def hidden(self, sprite: Sprite) -> np.ndarray:
        """bool[width]: where walls hide a thing."""
        columns = np.zeros(self.width, bool)
        for wall in self.fragments:
            near, far = sorted((wall.extent.depth1, wall.extent.depth2))
            (ax, ay), (bx, by) = wall.seg.start, wall.seg.end
            x, y = sprite.thing.x, sprite.thing.y
            before = ((y - ay) * (bx - ax) + (ax - x) * (by - ay)) >> 32 <= 0
            if near <= sprite.depth and (far <= sprite.depth or not before):
                columns[wall.start : wall.stop] = True
        return columns


@dataclass(frozen=True)
class Sprite:
    """A thing on the screen."""

    thing: Thing
    depth: int
    stamp: Stamp
