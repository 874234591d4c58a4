"""The same pose in ViZDoom's My Way Home and in the engine: what is seen, compared.

    python -m fidelity.vizdoom_view [--poses N] [--size WxH] [--json FILE]

Needs the extra `bench`. The engine's level is the exact map on tiles of 16 units. Half of
the poses are random places with a random heading, the others come some steps of random walking
later. The game's variables tell the pose that it drew (place, angle, height of the eye, which
bobs in walking), and the engine casts its rays from there with the same 90 degrees of view.

What the real screen tells of the walls:

- With the console's `r_drawflat 1` the game leaves floor and ceiling out of its depth buffer
  (0), so the rows of each column that are not 0 are its wall, to the row. From an eye `e` units
  above the floor, at depth `d`, the wall's lower edge lies `focal * e / d` below the horizon.
  Doom's pixels stand for rectangles 1.2 times as high as wide, so `focal` is 1.2 times the
  distance of the image plane in columns, 192 at 320x240.
- The depth buffer's value at the horizon: 8 bits, perpendicular depth. The scale is fitted here
  from places of known distance in the northern corridor (the walls' own value; those of floors
  are on another scale): about 7.15 units a step from 5.4 units on, so that 255 would stand for
  1830 units, farther than anything in this map. It is used to tell at which columns the depth
  jumps, and as a second measure of depth.

The skill is lowered from 5 to 3, since the game allows no warping at 5; that changes nothing here.
Columns that show the armour are left out, and so are those of walls too near for the depth
buffer, whose value 0 reaches up to 12.5 units on screens of 240 rows, 18 on 480 rows and 36
on 960 rows (where it also has half the resolution).

Where the two differ: Doom takes a column's ray through its left edge, the engine through its
centre; Doom computes where walls end to whole columns and edges in between by
steps of fixed point, which moves edges by up to a few rows where they are steep; and beside a
corner one column may show the near wall here and the far one there, which makes the largest errors.
"""

from __future__ import annotations

import argparse
import functools
import importlib.metadata
import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from fidelity.view_errors import (
    Projection,
    around,
    match_jumps,
    near_jumps,
)
from fidelity.vizdoom_game import complaint
from fidelity.vizdoom_screen import VARIABLES, DepthScale, View, calibrate, collect, prepare
from jaxenstein.adapters.vizdoom_buffers import running
from jaxenstein.engine.camera import Camera
from jaxenstein.engine.level import Level
from jaxenstein.engine.raycast import cast
from jaxenstein.errors import JAXensteinError
from jaxenstein.files import atomic, check_writable
from jaxenstein.tasks.doom.lattice import Tiles, rasterise
from jaxenstein.tasks.doom.walls import load_map

FIELD_OF_VIEW = 90.0
# Doom's world is drawn this much higher than wide.
PIXEL_ASPECT = 1.2
SIZES = ("160x120", "320x240", "640x480", "1280x960")
# Degrees by which the poses of the control are wrong, to show what the figures would notice.
CONTROL = 1.0
# The fewest poses of which something can be said.
LEAST = 10

Figures = dict[str, float]
"""What was measured, by words for people."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the comparison, print the figures, return the exit code."""
    options = _parser().parse_args(argv)
    try:
        if options.json:
            check_writable(options.json)
        report = run(options.poses, options.seed, options.size)
        if options.json:
            with atomic(options.json) as path:
                path.write_text(json.dumps(report, indent=1))
    except JAXensteinError as error:
        return complaint(error)
    return 0


def run(poses: int, seed: int, size: str) -> dict[str, object]:
    """Collect the views, compare, print; all figures."""
    doom_map = load_map("my-way-home")
    tiles = rasterise(doom_map)
    width, height = map(int, size.split("x"))
    chosen = {"seed": seed, "variables": VARIABLES, "prepare": prepare}
    with running("my_way_home", size=(width, height), **chosen) as game:
        game.new_episode()
        game.send_game_command("r_drawflat 1")
        scale = calibrate(game, tiles)
        views = collect(game, doom_map, tiles, poses, seed)
    screen = Projection(height, PIXEL_ASPECT * width / 2, doom_map.ceiling - doom_map.floor)
    ours, wrong = (
        errors_of(views, cast_views(views, tiles, width, turned), scale, screen)
        for turned in (0.0, CONTROL)
    )
    eyes = [view.eye for view in views]
    print(
        f"{poses} poses at {size}, eye {min(eyes):.1f} to {max(eyes):.1f} units above the floor.\n"
        f"Depth buffer: {scale.step:.3f} units a step from {scale.offset:.2f} on, by "
        f"{scale.samples} distances (farthest border from the line {scale.worst:.2f}).\n\n"
        f"| ours against the real screen | | heading {CONTROL:g} degree off |\n|---|---:|---:|"
    )
    for name, value in ours.items():
        print(f"| {name} | {value:.6g} | {wrong[name]:.6g} |")
    about = {"vizdoom": importlib.metadata.version("vizdoom"), "size": size, "seed": seed}
    return about | {"poses": poses, "scale": vars(scale), "ours": ours, "control": wrong}


def heading_of(angle: float) -> float:
    """Doom's angle (degrees, counterclockwise from east) as a heading in radians, 0 to 2 pi."""
    return math.radians(-angle % 360.0)


def cast_views(views: Sequence[View], tiles: Tiles, width: int, turned: float = 0.0) -> np.ndarray:
    """float64[N, width]: perpendicular depth in map units that the engine sees from each pose.

    Args:
        views: the poses, N of them.
        tiles: the map.
        width: columns of the image.
        turned: degrees by which to turn every pose to the left.
    """
    position = np.array([tiles.to_position(view.x, view.y) for view in views], np.float32)
    heading = np.array([heading_of(view.angle + turned) for view in views], np.float32)
    camera = Camera(1, width, FIELD_OF_VIEW)
    depth = _cast(tiles.level(), jnp.asarray(position), jnp.asarray(heading), camera)
    return np.asarray(depth, np.float64) * tiles.unit


@functools.partial(jax.jit, static_argnames="camera")
def _cast(level: Level, position: jax.Array, heading: jax.Array, camera: Camera) -> jax.Array:
    def look(position: jax.Array, heading: jax.Array) -> jax.Array:
        return cast(position, heading, jnp.zeros(0, bool), level, camera).depth

    return jax.vmap(look)(position, heading)


def errors_of(
    views: Sequence[View], depths: np.ndarray, scale: DepthScale, screen: Projection
) -> Figures:
    """The errors of one set of depths, float64[N, W] in map units.

    Columns that show a sprite, and those nearer than the depth buffer's value 1, are left out.
    """
    rows, outside, relative, steps = (list[np.ndarray]() for _ in range(4))
    shifts: list[int | None] = []
    for view, depth in zip(views, depths, strict=True):
        clear = ~view.sprite & (view.value > 0)
        upper, lower = screen.edges(depth, view.eye)
        for real, edge, seen in (
            (view.top, upper, clear & (view.top > 0)),
            (view.bottom, lower, clear & (view.bottom < screen.height)),
        ):
            rows.append(np.abs(real - edge)[seen])
            outside.append(around(real, edge)[seen])
        real = screen.depth_of(view.top, view.bottom, view.eye)
        known = clear & ~np.isnan(real) & ~near_jumps(depth, within=2)
        relative.append(np.abs(depth / real - 1)[known])
        steps.append(np.abs(scale.value_of(depth) - view.value)[clear])
        shifts += match_jumps(np.where(clear, scale.middle(view.value), np.nan), depth)
    row, far, share, step = map(np.concatenate, (rows, outside, relative, steps))
    matched = [shift for shift in shifts if shift is not None]
    return {
        "edges of walls on the screen (a column has up to two)": len(row),
        "share of them within one row": float((row <= 1).mean()),
        "share of them within one row and one column": float((far <= 1).mean()),
        "rows by which they are off, median": float(np.median(row)),
        "rows by which they are off, 95 %": float(np.percentile(row, 95)),
        "relative error of depth away from jumps, median": float(np.median(share)),
        "relative error of depth away from jumps, 95 %": float(np.percentile(share, 95)),
        "columns in the depth buffer": len(step),
        "share of them with the same value": float((step == 0).mean()),
        "share of them at most one value off": float((step <= scale.quantum).mean()),
        "jumps of depth": len(shifts),
        "jumps of depth that were found": len(matched),
        "columns by which jumps are off, mean": float(np.mean(matched)) if matched else math.nan,
    }


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Compare views of ViZDoom's My Way Home.")
    parser.add_argument(
        "--poses", type=_enough, default=200, help=f"how many, at least {LEAST} (default 200)"
    )
    parser.add_argument("--seed", type=int, default=0, help="of game and poses (default 0)")
    parser.add_argument("--size", choices=SIZES, default="320x240", help="of the screen")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures here")
    return parser


def _enough(text: str) -> int:
    value = int(text)
    if value < LEAST:
        raise argparse.ArgumentTypeError(f"must be at least {LEAST}, not {value}")
    return value


if __name__ == "__main__":
    sys.exit(main())
