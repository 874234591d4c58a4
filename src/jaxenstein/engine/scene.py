"""What the renderer draws: a level seen from a pose, its look, and billboards."""

from __future__ import annotations

import jax

from ..pytree import PyTreeNode, static
from .level import Array, Level
from .shade import Light
from .textures import Textures

# Labels of what is neither wall nor sprite.
CEILING = 0
FLOOR = 1


class Theme(PyTreeNode):
    """How walls, floor, ceiling and sprites look: tables, constants of the program in numpy.

    `wall_colours`, `wall_panels`, `floor`, `ceiling` and `floor_words` may differ between the
    scenes of one program, at the price of looking them up.

    Attributes:
        wall_colours: float32[n, 3], RGB 0 to 255 of each entry of `Level.walls`.
        wall_panels: int32[n], row of `panels` drawn on each; 0 is the empty panel.
        panels: uint32[m, 2, 32], bit planes (shadow, accent) by column, greatest bit on top.
        panel_accent: float32[3], colour of the accent plane.
        floor: float32[2, 3], the floor's two colours.
        ceiling: float32[3].
        sprite_art: uint32[s, 2, 32], bit planes (shape, detail) of each sprite picture, likewise.
        sprite_colours: float32[s, 2, 3], colours of the shape and of the detail.
        sprite_radius: float32[s], half the side of the square billboard, in tiles.
        sprite_drop: float32[s], tiles from the eye's height down to the billboard's centre.
        sprite_labels: uint8[s], what the `labels` image says of each; of a wall it says the
            entry of `Level.walls`, of ceiling and floor `CEILING` and `FLOOR`.
        panel_reach: float32[m], tiles from the eye at which the shadows of each panel have faded,
            or None if none does.
        floor_words: uint32[2], where the floor has its second colour: bit i, counted from the
            greatest, is that of the i-th of 32 stripes across two tiles, along x and along y; it
            is where one of the two is set. None for a checker of tiles.
        light: how bright they are.
        textures: pictures for colours and greys in the place of these tables, or None. Labels and
            depth stay as they are.
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
        """Short: JAX asks for the words of every function that it traces, and of its tables."""
        return f"Theme({len(self.wall_colours)} walls, {len(self.sprite_art)} sprites)"


class Sprites(PyTreeNode):
    """Billboards, which always face the camera. N is their number.

    Attributes:
        position: float32[N, 2], (x, y) in tiles.
        picture: int32[N], row of the theme's sprite tables.
        visible: bool[N].
    """

    position: jax.Array
    picture: jax.Array
    visible: jax.Array


class Scene(PyTreeNode):
    """All that one image depends on.

    Attributes:
        level: the geometry.
        closed: bool[D], which doors of the level are closed.
        position: float32[2], (x, y) of the eye in tiles.
        heading: float32[], radians, 0 along +x, growing clockwise on the map; or float32[2], the
            cosine and the sine of it.
        sprites: the billboards.
        theme: how everything looks.
        lift: float32[], tiles by which the eye is higher than the camera's, within the room; None
            for none.
    """

    level: Level
    closed: jax.Array
    position: jax.Array
    heading: jax.Array
    sprites: Sprites
    theme: Theme
    lift: jax.Array | None = None
