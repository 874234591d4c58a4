"""The input of the renderer: a level seen from a pose, a theme, and billboards."""

from __future__ import annotations

import jax

from ..pytree import PyTreeNode, static
from .level import Array, Level
from .shade import Light
from .textures import Textures

# Labels of floor and ceiling.
CEILING = 0
FLOOR = 1


class Theme(PyTreeNode):
    """The look of walls, floor, ceiling and sprites: tables in numpy, constants of the program.

    `wall_colours`, `wall_panels`, `floor`, `ceiling` and `floor_words` may also be arrays that
    differ between the scenes of one program, at the cost of looking them up.

    Attributes:
        wall_colours: float32[n, 3], RGB 0 to 255 of each entry of `Level.walls`.
        wall_panels: int32[n], the row of `panels` for each wall; row 0 is the empty panel.
        panels: uint32[m, 2, 32], bit planes (shadow, accent) by column; the top is the highest
            bit.
        panel_accent: float32[3], colour of the accent plane.
        floor: float32[2, 3], the floor's two colours.
        ceiling: float32[3].
        sprite_art: uint32[s, 2, 32], bit planes (shape, detail) of each sprite picture, likewise.
        sprite_colours: float32[s, 2, 3], colours of the shape and of the detail.
        sprite_radius: float32[s], half the side of the square billboard, in tiles.
        sprite_drop: float32[s], tiles from eye height down to the billboard's centre.
        sprite_labels: uint8[s], the label of each picture in the `labels` image; walls have their
            entry of `Level.walls`, ceiling and floor `CEILING` and `FLOOR`.
        panel_reach: float32[m], tiles from the eye at which the shadows of each panel have faded,
            or None if none fade.
        floor_words: uint32[2], the pattern of the floor along x and along y. Bit i, counted from
            the highest, is the i-th of 32 stripes across two tiles. The floor has its second
            colour where exactly one of the two bits is set. None for a checker of tiles.
        light: the brightness of surfaces.
        textures: pictures that replace these tables in colours and greys, or None. Labels and
            depth do not depend on them.
    """

    wall_colours: Array
    wall_panels: Array
    panels: Array
    panel_accent: Array
    floor: Array
    ceiling: Array
    sprite_art: Array
    sprite_colours: Array
    sprite_radius: Array
    sprite_drop: Array
    sprite_labels: Array
    panel_reach: Array | None = None
    floor_words: Array | None = None
    light: Light = static(default=Light())
    textures: Textures | None = None

    def __repr__(self) -> str:
        """Short, because JAX asks for the name of every function that it traces, and its tables."""
        return f"Theme({len(self.wall_colours)} walls, {len(self.sprite_art)} sprites)"


class Sprites(PyTreeNode):
    """N billboards, which always face the camera.

    Attributes:
        position: float32[N, 2], (x, y) in tiles.
        picture: int32[N], row of the theme's sprite tables.
        visible: bool[N].
    """

    position: jax.Array
    picture: jax.Array
    visible: jax.Array


class Held(PyTreeNode):
    """M pictures that lie over the image, the nearest first.

    Attributes:
        picture: int32[M], row of `textures.Stamps`.
        place: float32[M, 2], by how many columns and rows of its screen each is moved.
        shown: bool[M].
    """

    picture: jax.Array
    place: jax.Array
    shown: jax.Array


class Scene(PyTreeNode):
    """Everything that determines an image.

    Attributes:
        level: the geometry.
        closed: bool[D], which doors of the level are closed.
        position: float32[2], (x, y) of the eye in tiles.
        heading: float32[], radians, 0 along +x, growing clockwise on the map; or float32[2], the
            cosine and the sine of it.
        sprites: the billboards.
        theme: the colours and pictures.
        lift: float32[], how many tiles the eye is above the camera's eye height, within the room;
            None for 0.
        held: pictures over an image with textures, or None.
        glare: int32[], how many shades brighter everything with textures is; None for 0.
    """

    level: Level
    closed: jax.Array
    position: jax.Array
    heading: jax.Array
    sprites: Sprites
    theme: Theme
    lift: jax.Array | None = None
    held: Held | None = None
    glare: jax.Array | None = None
