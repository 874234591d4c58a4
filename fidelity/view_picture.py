"""Pairs of views side by side: ViZDoom's screen, the same pose drawn by the engine, the errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from PIL import Image, ImageDraw

from fidelity.doom_map import heading_of
from fidelity.view_errors import Projection, jumps
from fidelity.vizdoom_screen import View
from jaxenstein.engine.camera import Camera
from jaxenstein.engine.render import render
from jaxenstein.engine.scene import Scene, Sprites, Theme
from jaxenstein.files import atomic
from jaxenstein.tasks.appearance import build_theme
from jaxenstein.tasks.doom.lattice import WALL, Tiles

GAP = 6
STRIP = 60
# Rows of error that the strip shows up and down.
STRIP_ROWS = 3.0
LINE = (255, 0, 255)
CAPTION = 14
LABELS = (
    "ViZDoom",
    "engine, eye at half height",
    "ViZDoom, edges by the engine",
    "errors, -3 to 3 rows",
)
BRIGHTEN = 2.2
# Poses shown are farther apart than this, in map units.
APART = 150


def save_picture(
    path: Path,
    views: Sequence[View],
    tiles: Tiles,
    depths: np.ndarray,
    screen: Projection,
    colours: Mapping[str, Sequence[float] | None],
    pairs: int = 4,
) -> None:
    """Write a PNG of poses with many jumps of depth, one column of pictures each.

    From above: the real screen; the engine's image; the real screen with the edges of the walls
    that follow from the engine's depths; the errors of the lower edges (white) and upper ones
    (yellow) between -3 and 3 rows. The engine's eye is at half the height of the walls, Doom's at
    41 of 128 units, so its horizon-to-floor part is higher by construction.

    Args:
        path: the file.
        views: the poses.
        tiles: the map.
        depths: float64[N, W], the engine's depths in map units.
        screen: how the game draws walls.
        colours: mean RGB of each texture, None if it was never seen.
        pairs: how many poses.
    """
    chosen = _choose(views, depths, pairs)
    theme = _theme(tiles, colours)
    columns = []
    for i in chosen:
        view = views[i]
        parts = [view.screen, draw(view, tiles, theme, screen)]
        parts += [_with_edges(view, depths[i], screen), _strip(view, depths[i], screen)]
        columns.append([Image.fromarray(part) for part in parts])
    width = columns[0][0].width
    heights = [part.height + CAPTION for part in columns[0]]
    size = len(columns) * (width + GAP) + GAP, sum(heights) + GAP
    sheet = Image.new("RGB", size, (24, 24, 28))
    pen = ImageDraw.Draw(sheet)
    for number, parts in enumerate(columns):
        x, y = GAP + number * (width + GAP), 0
        view = views[chosen[number]]
        pose = f"({view.x:.0f}, {view.y:.0f}) {view.angle:.0f} deg"
        for part, label in zip(parts, LABELS, strict=True):
            pen.text((x, y + 1), f"{label}  {pose}", fill=(220, 220, 220))
            sheet.paste(part, (x, y + CAPTION))
            y += part.height + CAPTION
    with atomic(path) as temporary:
        sheet.save(temporary, "PNG")


def draw(view: View, tiles: Tiles, theme: Theme, screen: Projection) -> np.ndarray:
    """uint8[H, W, 3], the engine's image, with walls as high as Doom's.

    Its walls are one tile high, 16 units instead of 128. So it draws that many more columns, with
    as much more focal length, and every so manieth column is kept.
    """
    width = view.screen.shape[1]
    focal = screen.focal * screen.ceiling / tiles.unit
    wide = round(2 * focal)
    camera = Camera(screen.height, wide, 90.0)
    nothing = Sprites(
        position=jnp.zeros((0, 2), jnp.float32),
        look=jnp.zeros(0, jnp.int32),
        visible=jnp.zeros(0, bool),
    )
    scene = Scene(
        level=tiles.level(),
        closed=jnp.zeros(0, bool),
        position=jnp.asarray(np.array(tiles.to_position(view.x, view.y), np.float32)),
        heading=jnp.float32(heading_of(view.angle)),
        sprites=nothing,
        theme=theme,
    )
    image = np.asarray(jax.jit(lambda: render(scene, camera))())
    kept = ((np.arange(width) + 0.5) * wide / width).astype(int)
    return image[:, kept]


def _theme(tiles: Tiles, colours: Mapping[str, Sequence[float] | None]) -> Theme:
    """Walls in the mean colours of the real screens.

    Brighter by a common factor, since the engine darkens by tiles of distance and these are small.
    """
    plain = build_theme((), doors=False)
    walls = np.array(plain.wall_colours, np.float32)
    for number, name in enumerate(tiles.textures):
        walls[WALL + 1 + number] = colours[name] or walls[WALL]
    return plain.replace(wall_colours=np.minimum(walls * BRIGHTEN, 255))


def _choose(views: Sequence[View], depths: np.ndarray, pairs: int) -> list[int]:
    """The poses with the most jumps of depth, none near another one."""
    chosen: list[int] = []
    for i in sorted(range(len(views)), key=lambda i: -len(jumps(depths[i]))):
        here = np.array([views[i].x, views[i].y])
        others = [np.array([views[j].x, views[j].y]) for j in chosen]
        if all(np.abs(here - other).max() > APART for other in others):
            chosen.append(i)
    return chosen[:pairs]


def _with_edges(view: View, depth: np.ndarray, screen: Projection) -> np.ndarray:
    """The real screen with both edges of the walls drawn in."""
    image = view.screen.copy()
    columns = np.arange(len(depth))
    for edge in screen.edges(depth, view.eye):
        row = np.floor(edge).astype(int)
        seen = (row >= 0) & (row < screen.height)
        image[row[seen], columns[seen]] = LINE
    return image


def _strip(view: View, depth: np.ndarray, screen: Projection) -> np.ndarray:
    """The errors of the edges of one view as a plot."""
    image = np.full((STRIP, len(depth), 3), 40, np.uint8)
    image[STRIP // 2] = 90
    top, bottom = screen.edges(depth, view.eye)
    lines = (
        (view.top - top, view.top > 0, (240, 220, 80)),
        (view.bottom - bottom, view.bottom < screen.height, (240, 240, 240)),
    )
    for error, seen, colour in lines:
        place = (0.5 - np.clip(error, -STRIP_ROWS, STRIP_ROWS) / (2 * STRIP_ROWS)) * (STRIP - 1)
        columns = np.flatnonzero(seen & ~view.sprite & (view.value > 0))
        image[np.rint(place[columns]).astype(int), columns] = colour
    return image
