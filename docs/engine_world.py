"""The small world of docs/engine.md, and what the engine computes for one pose in it."""

from __future__ import annotations

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxenstein.engine.camera import Camera
from jaxenstein.engine.level import compile_level, occupancy
from jaxenstein.engine.raycast import cast
from jaxenstein.engine.raycast import rays as rays_of
from jaxenstein.engine.render import render
from jaxenstein.engine.scene import Scene, Sprites
from jaxenstein.engine.shade import ImageKind
from jaxenstein.maps.ascii import parse_ascii
from jaxenstein.maps.things import GOAL, KEY
from jaxenstein.tasks.appearance import build_theme

WORLD = """
############
#....2.....#
#S...2..4..#
#....R.....#
#..r.2.G.4.#
#....2.....#
############
"""
MAP = parse_ascii(WORLD, "engine")
LEVEL = compile_level(MAP.walls, MAP.door_tiles)
THEME = build_theme((GOAL.label, KEY.labels[0]), doors=True)
TILES = [list(row) for row in MAP.tiles]
for door in MAP.doors:
    TILES[door.row][door.column] = 0
ROWS, COLUMNS = len(TILES), len(TILES[0])
# The eye looks through the open door, at the goal behind it.
EYE, HEADING = (1.8, 1.9), 0.4
SPRITE = (7.5, 4.5)
# For the picture of the sprite's words: a key right ahead.
NEAR_EYE, NEAR_KEY = (1.5, 3.5), (2.35, 3.42)


def bits(*, closed: bool) -> np.ndarray:
    """uint32[columns]: the occupancy word of each column."""
    return np.asarray(occupancy(LEVEL, jnp.array([closed]))[0])[:, 0]


class View:
    """An image of the world, and the rays that it is made of."""

    def __init__(self, *, width: int, height: int, near: bool = False) -> None:
        """Choose the size; `near` looks at a key in front of the closed door."""
        self.camera = Camera(height, width, 60.0)
        eye, heading = (NEAR_EYE, 0.0) if near else (EYE, HEADING)
        self.eye, self.heading = jnp.array(eye, jnp.float32), jnp.float32(heading)
        self.closed = jnp.array([near])
        self.thing, self.look = (NEAR_KEY, 1) if near else (SPRITE, 0)

    @functools.cached_property
    def hits(self) -> Any:
        """What the rays hit."""
        found = cast(self.eye, self.heading, self.closed, LEVEL, self.camera)
        return jax.tree.map(np.asarray, found)

    def directions(self) -> np.ndarray:
        """float[2, width]: the rays, scaled to depth one."""
        return np.stack([np.asarray(part) for part in rays_of(self.heading, self.camera)])

    def ends(self) -> np.ndarray:
        """float[width, 2]: where the rays end."""
        return (np.asarray(self.eye)[:, None] + self.directions() * self.hits.depth).T

    def image(self, kind: ImageKind = "rgb", *, things: bool = True) -> np.ndarray:
        """The image, with or without the billboard."""
        sprites = Sprites(
            position=jnp.array([self.thing], jnp.float32),
            look=jnp.array([self.look], jnp.int32),
            visible=jnp.array([things]),
        )
        scene = Scene(LEVEL, self.closed, self.eye, self.heading, sprites, THEME)
        return np.asarray(render(scene, self.camera, kind))

    def texel(self, column: int) -> int:
        """Which of a billboard's 32 columns an image column sees."""
        dx, dy = np.subtract(self.thing, np.asarray(self.eye))
        cos, sin = np.cos(float(self.heading)), np.sin(float(self.heading))
        depth, side = dx * cos + dy * sin, dy * cos - dx * sin
        radius = float(np.asarray(THEME.sprite_radius)[self.look])
        place = depth * self.camera.column_slopes()[column] - side
        return int((place / radius + 1) * 16)

    def crossings(self, column: int) -> tuple[list[Any], list[Any]]:
        """Where a ray crosses vertical and horizontal lines: ((x, y, depth), whether solid).

        Worked out from the ray by geometry; the engine's words say what is solid. Up to the first
        solid crossing of each kind.
        """
        direction, eye = self.directions()[:, column], np.asarray(self.eye)
        words = [np.asarray(part)[:, 0] for part in occupancy(LEVEL, self.closed)]
        found: tuple[list[Any], list[Any]] = ([], [])
        for kind, line in enumerate(found):
            step = int(np.sign(direction[kind]))
            grid = np.floor(eye[kind]) + (step > 0)
            while not line or not line[-1][1]:
                depth = (grid - eye[kind]) / direction[kind]
                place = eye + depth * direction
                entered = int(grid) if step > 0 else int(grid) - 1
                across = int(np.floor(place[1 - kind]))
                # Past the map's edge everything is solid.
                inside = 0 <= entered < len(words[kind])
                solid = not inside or bool(words[kind][entered] >> across & 1)
                line.append(((*place.tolist(), float(depth)), solid))
                grid += step
        return found
