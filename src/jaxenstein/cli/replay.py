"""`jaxenstein replay`: play a trajectory file again, and compare it bit for bit."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..episodes.recorder import replay
from ..episodes.trajectory_file import load_trajectory
from ..progress import Progress
from .arguments import Parser
from .record import add_pictures, check_pictures, save_pictures

HELP = "replay a trajectory file and compare it bit for bit"
DESCRIPTION = """\
Play the episode of a trajectory file again, and compare every reward, state and observation with
the recorded one. The exit code is 0 if all are the same, bit for bit. Otherwise it is 1, and the
output names the first steps that differ, with the versions then and now.
"""
EPILOG = """\
examples:
  jaxenstein replay walk.json
  jaxenstein replay walk.json --out walk.gif --sheet walk.png

'jaxenstein record' and 'jaxenstein play' write such files with --save FILE.json. With the same
versions on the same hardware, an episode is always the same.
"""


def fill(parser: Parser) -> None:
    """Add the arguments."""
    parser.add_argument("file", type=Path, metavar="FILE", help="a trajectory file, .json")
    add_pictures(parser.add_argument_group("output"))


def run(options: argparse.Namespace) -> int:
    """Replay the file, write the pictures, and print whether it is the same."""
    check_pictures(options)
    trajectory = load_trajectory(options.file)
    steps = len(trajectory.actions)
    with Progress(steps, "playing", compiles=True) as progress:
        played = replay(trajectory, notify=progress.update)
    written = save_pictures(played.episode, options)
    print(played.report())
    if written:
        print(f"wrote {' and '.join(map(str, written))}")
    return 0 if played.identical else 1
