"""`jaxenstein convert`: convert maps of other projects to text maps."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
import warnings
from pathlib import Path

from ..errors import MapWarning
from ..files import atomic, check_apart, check_writable
from ..maps.importers.dmlab import build_tilemap, read_maze
from ..maps.importers.minigrid import convert_id
from ..maps.map_files import beside, read_text
from ..maps.reach import problems, summarised
from ..maps.tilemap import TileMap
from .arguments import Parser, UsageError, add_seed, flag
from .opening import printing_warnings

HELP = "convert maps of DeepMind Lab and MiniGrid to text"
DESCRIPTION = """\
Convert a .map file of a DeepMind Lab maze, or the layout of a MiniGrid environment after a reset,
to a text map, which other commands read with --map-file. If the sides of a wall look different, for
example because of pictures on it, NAME.faces.txt is written beside NAME.txt.
"""
EPILOG = """\
examples:
  jaxenstein convert nav_maze_static_01.map --out maze.txt
  jaxenstein convert --minigrid MiniGrid-FourRooms-v0 --seed 3 --out rooms.txt
  jaxenstein record --map-file maze.txt --out maze.gif
"""


def fill(parser: Parser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "file", nargs="?", metavar="FILE", type=Path, help="a .map file of a DeepMind Lab maze"
    )
    other = "convert a MiniGrid environment, such as MiniGrid-FourRooms-v0"
    flag(parser, "--minigrid ID", other, str)
    add_seed(parser)
    flag(parser, "--out FILE", "file for the map (default: print it)", Path)


def run(options: argparse.Namespace) -> None:
    """Convert one map."""
    if (options.file is None) == (options.minigrid is None):
        raise UsageError("jaxenstein convert: give either a FILE.map or --minigrid ID")
    if options.out is not None:
        check_writable(options.out)
    with printing_warnings():
        convert = _convert_maze if options.minigrid is None else _convert_minigrid
        tilemap, summary = convert(options)
    text, faces = tilemap.tile_text(), tilemap.faces_text()
    if options.out is None:
        sys.stdout.write(text)
        if faces is not None:
            summary.append("the sides of walls differ: --out also writes how they look")
    else:
        _check_out(options.out, options.file, faces is not None)
        written = _write(options.out, text, faces)
        summary.append(f"wrote {' and '.join(map(str, written))}")
    for line in summary:
        print(line, file=sys.stderr if options.out is None else sys.stdout)


def _convert_maze(options: argparse.Namespace) -> tuple[TileMap, list[str]]:
    """The map of a .map file, and lines of summary."""
    maze = read_maze(read_text(options.file, "map"), options.file.stem, source=str(options.file))
    tilemap = build_tilemap(maze)
    for problem, (column, row) in summarised(problems(tilemap)):
        place = f"line {row + 1}, column {column + 1} of the text"
        warnings.warn(f"{place}: {problem}", MapWarning, stacklevel=2)
    decals = {"decal": len(maze.decals)}
    return tilemap, _summary(tilemap, f"{maze.columns} x {maze.rows} cells, ", decals)


def _convert_minigrid(options: argparse.Namespace) -> tuple[TileMap, list[str]]:
    """The map of a MiniGrid environment, and lines of summary."""
    found = convert_id(options.minigrid, options.seed)
    tilemap = found.tilemap
    things = {"key": len(tilemap.keys), "door": len(tilemap.doors)}
    summary = _summary(tilemap, "", things)
    heading = f"{found.heading:g}"
    summary.append(f"first heading: {heading} degrees; with --map-file add --heading {heading}")
    return tilemap, summary


def _summary(tilemap: TileMap, cells: str, more: dict[str, int]) -> list[str]:
    """Lines that give the size of a map and count its contents."""
    counts = {"start": len(tilemap.spawns), "goal": len(tilemap.goals)}
    others = {"apple": len(tilemap.apples), **more}
    counts |= {noun: count for noun, count in others.items() if count}
    things = ", ".join(f"{count} {noun}{'s' * (count != 1)}" for noun, count in counts.items())
    lines = [f"{tilemap.name}: {cells}{tilemap.columns} x {tilemap.rows} tiles; {things}"]
    if not tilemap.goals:
        lines.append(
            "it has no goal: put a G on a tile before you use it with --map-file; for a task "
            "without a goal, read it with parse_ascii(text, goal_required=False)"
        )
    return lines


def _check_out(out: Path, file: Path | None, with_faces: bool) -> None:
    """Raise if the output would overwrite the source, or be read together with old files."""
    check_apart([out], [file])
    for kind in ("regions",) if with_faces else ("regions", "faces"):
        other = beside(out, kind)
        if os.path.exists(other):
            raise UsageError(
                f"jaxenstein convert: {other} exists and would be read together with {out}; "
                "remove it or choose another name for --out"
            )


def _write(out: Path, text: str, faces: str | None) -> list[Path]:
    """Write the map and, if given, the looks of its walls; each file is complete or unchanged."""
    texts = {out: text} if faces is None else {out: text, beside(out, "faces"): faces}
    with contextlib.ExitStack() as files:
        for path, content in texts.items():
            files.enter_context(atomic(path)).write_text(content, encoding="utf-8", newline="\n")
    return list(texts)
