"""The pictures of docs/architecture.md, drawn from results of the engine.

    python -m docs.pictures engine     # writes docs/images/engine/*.png

Each picture is drawn twice, for light and for dark pages.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import matplotlib as mpl
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from jaxenstein.engine.camera import Camera
from jaxenstein.engine.level import compile_level, occupancy
from jaxenstein.engine.raycast import cast
from jaxenstein.engine.raycast import rays as rays_of
from jaxenstein.engine.render import render
from jaxenstein.engine.scene import Scene, Sprites
from jaxenstein.engine.shade import ImageKind
from jaxenstein.files import atomic
from jaxenstein.maps.ascii import parse_ascii
from jaxenstein.maps.things import GOAL, KEY
from jaxenstein.tasks.appearance import build_theme

# The map of the pictures.
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
# The eye looks through the open door at the goal.
EYE, HEADING = (1.8, 1.9), 0.4
SPRITE = (7.5, 4.5)
DOTS = 130


@dataclasses.dataclass(frozen=True)
class Ink:
    """The colours of one kind of page."""

    page: str
    text: str
    faint: str
    wall: str
    floor: str
    vertical: str = "#2f7ed8"
    crosswise: str = "#d9652b"
    mark: str = "#c2185b"


INKS = {
    "light": Ink("#ffffff", "#222222", "#b9bec7", "#8b929e", "#f0eee9"),
    "dark": Ink(
        "#131416", "#e2e4e8", "#4d535e", "#6a7280", "#24272d", "#63a9f5", "#f08a52", "#f06292"
    ),
}


class View:
    """An image of the map, and its rays."""

    def __init__(self, *, width: int, height: int) -> None:
        """Choose the size of the image."""
        self.camera = Camera(height, width, 60.0)
        self.eye, self.heading = jnp.array(EYE, jnp.float32), jnp.float32(HEADING)
        self.closed = jnp.array([False])

    @functools.cached_property
    def hits(self) -> Any:
        """The hits of the rays."""
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
            position=jnp.array([SPRITE], jnp.float32),
            picture=jnp.array([0], jnp.int32),
            visible=jnp.array([things]),
        )
        scene = Scene(LEVEL, self.closed, self.eye, self.heading, sprites, THEME)
        return np.asarray(render(scene, self.camera, kind))

    def crossings(self, column: int) -> tuple[list[Any], list[Any]]:
        """The crossings of a ray with vertical and horizontal lines: ((x, y, depth), solid).

        Computed by geometry; the occupancy words of the engine tell which are solid. The lists end
        with the first solid crossing.
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
                # Everything outside the map is solid.
                inside = 0 <= entered < len(words[kind])
                solid = not inside or bool(words[kind][entered] >> across & 1)
                line.append(((*place.tolist(), float(depth)), solid))
                grid += step
        return found


def rays(ink: Ink) -> Figure:
    """One ray per column, and the resulting image."""
    view = View(width=32, height=24)
    figure, (above, seen) = _figure(ink, 2, (9.4, 3.6), ratios=(1.35, 1))
    _ground(above, ink)
    ends = view.ends()
    colours = np.where(view.hits.horizontal, ink.crosswise, ink.vertical)
    for end, colour in zip(ends, colours, strict=True):
        above.plot((EYE[0], end[0]), (EYE[1], end[1]), color=colour, lw=0.7)
    above.scatter(*ends.T, c=colours, s=9, zorder=3)
    _eye(above, ink)
    above.set_title("32 rays, one per column", color=ink.text)
    seen.imshow(view.image(), interpolation="nearest", extent=(0, 32, 24, 0))
    half = 0.5 * view.camera.focal / view.hits.depth
    centres = np.arange(32) + 0.5
    for sign in (-1, 1):
        seen.step(centres, 12 + sign * half, where="mid", color=ink.mark, lw=1.0)
    seen.set(xlim=(0, 32), ylim=(24, 0))
    seen.set_title("wall height: focal / depth", color=ink.text)
    return figure


def lines(ink: Ink) -> Figure:
    """The two kinds of grid lines that one ray crosses."""
    view = View(width=32, height=24)
    column = 27
    figure, panels = _figure(ink, 2, (9.4, 3.3))
    crossed = view.crossings(column)
    titles = "vertical lines: one word per column", "horizontal lines: one word per row"
    nearest = min(next(place for place, solid in line if solid)[2] for line in crossed)
    for panel, line, title, kind in zip(panels, crossed, titles, (0, 1), strict=True):
        colour = (ink.vertical, ink.crosswise)[kind]
        _ground(panel, ink)
        for at in range((COLUMNS if kind == 0 else ROWS) + 1):
            ends = ((at, at), (0, ROWS)) if kind == 0 else ((0, COLUMNS), (at, at))
            panel.plot(*ends, color=colour, lw=0.6, alpha=0.6)
        places = np.array([place for place, _ in line])
        panel.plot((EYE[0], places[-1, 0]), (EYE[1], places[-1, 1]), color=ink.text, lw=0.9)
        solid = np.array([is_solid for _, is_solid in line])
        panel.scatter(*places[~solid, :2].T, s=34, c=ink.page, edgecolors=colour, zorder=3)
        panel.scatter(*places[solid, :2].T, s=34, c=colour, zorder=3)
        first = places[solid][0]
        says = "nearest hit: the wall" if first[2] == nearest else "farther hit: hidden"
        panel.annotate(
            says, first[:2], (6.3, 5.6), color=ink.text,
            arrowprops={"arrowstyle": "->", "color": ink.text},
        )  # fmt: skip
        _eye(panel, ink)
        panel.set_title(title, color=ink.text)
    return figure


def layers(ink: Ink) -> Figure:
    """The stages of painting."""
    view = View(width=96, height=72)
    figure, panels = _figure(ink, 4, (9.4, 2.1))
    bare, full = view.image(things=False), view.image()
    labels = view.image(kind="labels", things=False)
    ground = np.dstack([bare, np.where(labels <= 1, 255, 0).astype(np.uint8)])
    depth = 1 / view.image(kind="depth")
    titles = "floor and ceiling", "+ walls", "+ things", "depth image"
    for panel, image, title in zip(panels, (ground, bare, full, depth), titles, strict=True):
        panel.imshow(image, interpolation="nearest", cmap="magma", extent=(0, 96, 72, 0))
        panel.set_title(title, color=ink.text, fontsize=9)
    return figure


PICTURES: dict[str, Callable[[Ink], Figure]] = {
    "rays": rays,
    "lines": lines,
    "layers": layers,
}


def _figure(
    ink: Ink, panels: int, size: tuple[float, float], ratios: tuple[float, ...] | None = None
) -> tuple[Figure, Any]:
    """A figure with panels side by side, without axes."""
    figure = Figure(figsize=size, dpi=DOTS, facecolor=ink.page, layout="constrained")
    axes = figure.subplots(1, panels, width_ratios=ratios)
    for panel in axes:
        panel.set_axis_off()
        panel.set_aspect("equal")
    return figure, axes


def _ground(panel: Any, ink: Ink) -> None:
    """The map from above: solid tiles, an open door, and a grid."""
    walls = np.array([[tile != 0 for tile in row] for row in TILES])
    panel.imshow(
        walls, cmap=ListedColormap([ink.floor, ink.wall]), extent=(0, COLUMNS, ROWS, 0),
        interpolation="nearest",
    )  # fmt: skip
    panel.add_patch(Rectangle((5, 3), 1, 1, fc=ink.floor, ec=ink.mark, lw=1.0, ls=":"))
    for x in range(COLUMNS + 1):
        panel.plot((x, x), (0, ROWS), color=ink.faint, lw=0.4)
    for y in range(ROWS + 1):
        panel.plot((0, COLUMNS), (y, y), color=ink.faint, lw=0.4)
    panel.plot(*SPRITE, marker="*", color="#e6a700", ms=11)
    panel.set(xlim=(0, COLUMNS), ylim=(ROWS, 0))


def _eye(panel: Any, ink: Ink) -> None:
    ahead = 0.6 * np.cos(HEADING), 0.6 * np.sin(HEADING)
    panel.annotate(
        "", (EYE[0] + ahead[0], EYE[1] + ahead[1]), EYE,
        arrowprops={"arrowstyle": "-|>", "color": ink.mark, "lw": 1.6},
    )  # fmt: skip
    panel.plot(*EYE, marker="o", color=ink.mark, ms=6, zorder=4)


def draw_all(folder: Path) -> None:
    """Draw all pictures into a folder."""
    mpl.rcParams.update({"font.size": 9.5, "axes.titlesize": 10})
    for name, draw in PICTURES.items():
        for page, ink in INKS.items():
            with atomic(folder / f"{name}-{page}.png") as temporary:
                draw(ink).savefig(temporary, format="png", metadata={"Software": None})
