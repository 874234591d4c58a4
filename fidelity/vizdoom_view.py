"""The same pose in ViZDoom's My Way Home and in the engine: what is seen, compared.

    python -m fidelity.vizdoom_view [--poses N] [--size WxH] [--json FILE] [--picture FILE]

Needs the extra `bench`. The engine's level is the exact map of 16-unit tiles (`doom_map`). Half of
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
Columns that show the armour are left out and counted, and so are those of walls too near for the
depth buffer, whose value 0 reaches up to 12.5 units on screens of 240 rows, 18 on 480 rows and 36
on 960 rows (where it also has half the resolution).

Where the two differ: Doom takes a column's ray through its left edge, the engine through its
centre, so both are shown; Doom computes where walls end to whole columns and edges in between by
steps of fixed point, which moves edges by up to a few rows where they are steep; and beside a
corner one column may show the near wall here and the far one there, which makes the largest errors.
"""

from __future__ import annotations

import argparse
import functools
import importlib.metadata
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from fidelity.doom_map import heading_of, load_my_way_home
from fidelity.view_errors import Projection
from fidelity.view_picture import save_picture
from fidelity.view_report import FINE, OUTLIER, compare, texture_report
from fidelity.vizdoom_game import complaint, running
from fidelity.vizdoom_screen import VARIABLES, View, calibrate, collect, prepare
from jaxenstein.engine.camera import Camera
from jaxenstein.engine.level import Level
from jaxenstein.engine.raycast import cast
from jaxenstein.errors import JAXensteinError
from jaxenstein.files import atomic, check_writable
from jaxenstein.tasks.doom.lattice import Tiles

FIELD_OF_VIEW = 90.0
# Doom's world is drawn this much higher than wide.
PIXEL_ASPECT = 1.2
SIZES = ("160x120", "320x240", "640x480", "1280x960")
# Degrees by which the poses of the control are wrong, to show what the figures would notice.
CONTROL = 1.0
# The fewest poses of which something can be said.
LEAST = 10


def main(argv: Sequence[str] | None = None) -> int:
    """Run the comparison, print the figures, return the exit code."""
    arguments = _parser().parse_args(argv)
    try:
        for path in (arguments.json, arguments.picture):
            if path:
                check_writable(path)
        report = run(arguments)
        if arguments.json:
            with atomic(arguments.json) as path:
                path.write_text(json.dumps(report, indent=1))
    except JAXensteinError as error:
        return complaint(error)
    return 0


def run(arguments: argparse.Namespace) -> dict[str, Any]:
    """Collect the views, compare, print; the figures."""
    doom_map, tiles = load_my_way_home()
    size = arguments.size.upper()
    settings = {"seed": arguments.seed, "variables": VARIABLES, "size": size}
    with running("my_way_home", prepare=prepare, **settings) as game:
        game.new_episode()
        game.send_game_command("r_drawflat 1")
        scale = calibrate(game, tiles)
        views = collect(game, doom_map, tiles, arguments.poses, arguments.seed)
    report = {
        "vizdoom": importlib.metadata.version("vizdoom"),
        "size": arguments.size,
        "seed": arguments.seed,
    }
    height, width, _ = views[0].screen.shape
    screen = Projection(height, PIXEL_ASPECT * width / 2, doom_map.ceiling - doom_map.floor)
    depth, wall = cast_views(views, tiles, width * FINE)
    control, _ = cast_views(views, tiles, width * FINE, turned=CONTROL)
    report |= compare(views, depth, control, scale, screen)
    depth, wall = depth[:, FINE // 2 :: FINE], wall[:, FINE // 2 :: FINE]
    report["textures"] = textures = texture_report(views, depth, wall, tiles)
    print_report(report)
    if arguments.picture:
        colours = {name: found["mean_rgb"] for name, found in textures["by_name"].items()}
        save_picture(arguments.picture, views, tiles, depth, screen, colours)
    return report


def cast_views(
    views: Sequence[View], tiles: Tiles, width: int, turned: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """What the engine sees from each pose.

    Args:
        views: the poses, N of them.
        tiles: the map.
        width: columns of the image.
        turned: degrees by which to turn every pose to the left.

    Returns:
        float64[N, width], perpendicular depth in map units; uint8[N, width], labels of the faces.
    """
    position = np.array([tiles.to_position(view.x, view.y) for view in views], np.float32)
    heading = np.array([heading_of(view.angle + turned) for view in views], np.float32)
    camera = Camera(1, width, FIELD_OF_VIEW)
    depth, wall = _cast(tiles.level(), jnp.asarray(position), jnp.asarray(heading), camera)
    return np.asarray(depth, np.float64) * tiles.unit, np.asarray(wall)


@functools.partial(jax.jit, static_argnames="camera")
def _cast(
    level: Level, position: jax.Array, heading: jax.Array, camera: Camera
) -> tuple[jax.Array, jax.Array]:
    def look(position: jax.Array, heading: jax.Array) -> tuple[jax.Array, jax.Array]:
        hits = cast(position, heading, jnp.zeros(0, bool), level, camera)
        return hits.depth, hits.wall

    return jax.vmap(look)(position, heading)


def print_report(report: dict[str, Any]) -> None:
    """Print the figures as a Markdown table, one column for each set of rays."""
    scale = report["depth_scale"]
    sides = [report[side] for side in ("centre", "left", "control")]
    print(
        f"{report['poses']} poses, {report['columns']} columns at {report['size']}, of which "
        f"{report['columns_with_sprites']} show a sprite and {report['columns_too_near']} a wall "
        f"too near for the depth buffer; eye {report['eye_lowest']:.1f} to "
        f"{report['eye_highest']:.1f} units above the floor.\n"
        f"Depth buffer: {scale['step']:.3f} units a step from {scale['offset']:.2f} on, by "
        f"{scale['samples']} distances (farthest border from the line {scale['worst']:.2f}).\n"
    )
    print(
        "| ours against the real screen | rays through pixel centres | through left edges | "
        f"control: centres, heading {CONTROL:g} degree off |"
    )
    print("|---|---:|---:|---:|")
    for label, cells in _lines(sides):
        print(f"| {label} | {' | '.join(cells)} |")
    textures = report["textures"]
    print(
        f"\nTextures: of {textures['judged']} columns of every second pose, "
        f"{textures['recognised']:.2%} have the colours on the real screen that the texture seen "
        "by the engine has in the other poses (by five nearest neighbours)."
    )


def _lines(sides: Sequence[dict[str, Any]]) -> list[tuple[str, list[str]]]:
    """Label and cells of each line of the table."""

    def cells(show: Any) -> list[str]:
        return [show(side) for side in sides]

    lines = [
        ("edges of walls on the screen (a column has up to two)", cells(lambda s: str(s["edges"]))),
        ("edges within one row", cells(lambda s: f"{s['within_one_row']:.2%}")),
        ("edges within one row and one column", cells(lambda s: f"{s['within_one_pixel']:.2%}")),
    ]
    for edge in ("upper", "lower"):
        label = f"{edge} edge, rows: median / 95 % / max"
        lines.append((label, cells(lambda s, e=edge: _spread(s["rows"][e], "{:.2f}"))))
    for why in ("next to a jump", "steep edge", "other"):
        label = f"edges more than {OUTLIER:g} rows off: {why}"
        lines.append((label, cells(lambda s, w=why: str(s["outliers"][w]))))
    lines += [
        (
            "relative error of depth by edges: median / 95 % / max",
            cells(lambda s: _spread(s["relative_depth"], "{:.2%}")),
        ),
        (
            "relative error of depth away from jumps: median / 95 % / max",
            cells(lambda s: _spread(s["relative_depth_away"], "{:.2%}")),
        ),
        ("same value in the depth buffer", cells(lambda s: f"{s['depth_value_equal']:.2%}")),
        ("at most one value off", cells(lambda s: f"{s['depth_value_within_one']:.2%}")),
        ("jumps of depth, found", cells(lambda s: f"{s['jumps_matched']} of {s['jumps']}")),
        (
            "jumps, columns: median / 95 % / max",
            cells(lambda s: _spread(s["jump_columns"], "{:g}")),
        ),
        ("jumps, columns: mean", cells(lambda s: f"{s['jump_columns'].get('mean', 0):+.2f}")),
    ]
    return lines


def _spread(found: dict[str, float], form: str) -> str:
    if not found["n"]:
        return "none"
    return " / ".join(form.format(found[key]) for key in ("median_size", "p95_size", "max_size"))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Compare views of ViZDoom's My Way Home.")
    parser.add_argument(
        "--poses", type=_enough, default=200, help=f"how many, at least {LEAST} (default 200)"
    )
    parser.add_argument("--seed", type=int, default=0, help="of game and poses (default 0)")
    parser.add_argument("--size", choices=SIZES, default="320x240", help="of the screen")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures here")
    parser.add_argument("--picture", type=Path, metavar="FILE", help="a PNG of some pairs")
    return parser


def _enough(text: str) -> int:
    value = int(text)
    if value < LEAST:
        raise argparse.ArgumentTypeError(f"must be at least {LEAST}, not {value}")
    return value


if __name__ == "__main__":
    sys.exit(main())
