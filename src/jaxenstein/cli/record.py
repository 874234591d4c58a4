"""`jaxenstein record`: one episode as an animation, first person beside the map."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..view.files import check_writable
from ..view.progress import Progress
from ..view.recording import (
    Episode,
    caption,
    compose_side_by_side,
    contact_sheet,
    evenly,
    save_gif,
    scale_to,
)
from ..view.topdown import MapPicture, draw_map
from .arguments import (
    UsageError,
    add_environment,
    add_seed,
    open_environment,
    real,
    whole,
)
from .playing import play
from .policies import POLICIES, Policy, Script, parse_actions

if TYPE_CHECKING:
    from ..tasks.first_person import FirstPerson

DESCRIPTION = """\
Play one episode and write it as a GIF: what the agent sees, beside the map from above with
the agent, its field of view and its path so far, over a line with step, return and events.
The episode stops at the goal, at the horizon, after --steps, or after the last of --actions.
"""
EPILOG = """\
examples:
  jaxenstein record my-way-home --out home.gif
  jaxenstein record key-door --policy forward --steps 300 --out key-door.gif --sheet key-door.png
  jaxenstein record simple --actions "forward*20,turn right*6,forward" --out simple.gif
  jaxenstein record --map-file maze.txt --width 160 --height 120 --fov 90 --out maze.gif

actions are numbers or names (see 'jaxenstein list'), separated by commas; 2*10 is ten times 2.
policies:
""" + "\n".join(f"  {name}: {policy.summary}" for name, policy in POLICIES.items())
# The side of the map in pixels, and the least height of the first-person view.
MAP_SIZE, VIEW_HEIGHT = 448, 384
SHEET_VIEWS, SHEET_COLUMNS, SHEET_HEIGHT = 32, 8, 112


def add_command(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "record",
        help="write one episode as a GIF, with the map from above",
        description=DESCRIPTION,
        epilog=EPILOG,
    )
    add_environment(parser)
    out = parser.add_argument_group("what is written")
    out.add_argument("--out", type=Path, required=True, metavar="FILE.gif", help="the animation")
    out.add_argument(
        "--sheet",
        type=Path,
        metavar="FILE.png",
        help=f"also write a contact sheet of up to {SHEET_VIEWS} views",
    )
    out.add_argument(
        "--map",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="show the map from above (default: yes)",
    )
    out.add_argument(
        "--scale",
        type=whole(1, 64),
        metavar="N",
        help="enlarge the view N times (default: to a height of about 384 pixels)",
    )
    out.add_argument(
        "--fps",
        type=real(1, 50),
        default=15.0,
        metavar="RATE",
        help="frames a second, 1 to 50 (default %(default)g)",
    )
    out.add_argument(
        "--every",
        type=whole(),
        default=1,
        metavar="N",
        help="show every N-th step, for long episodes (default %(default)s)",
    )
    played = parser.add_argument_group("what is played")
    played.add_argument(
        "--steps",
        type=whole(),
        default=300,
        metavar="T",
        help="stop after T steps (default %(default)s)",
    )
    how = played.add_mutually_exclusive_group()
    how.add_argument(
        "--policy",
        choices=tuple(POLICIES),
        default="forward",
        metavar="NAME",
        help="who acts, see below (default %(default)s)",
    )
    how.add_argument("--actions", metavar="LIST", help='the actions to take, such as "2,2,0,1"')
    add_seed(played)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Play the episode and write its pictures."""
    env, params, name = open_environment(options, autoreset=None)
    for path, suffix in ((options.out, ".gif"), (options.sheet, ".png")):
        if path is not None and path.suffix.lower() != suffix:
            raise UsageError(f"jaxenstein record: {path} should end in {suffix}")
        if path is not None:
            check_writable(path)
    policy, steps = _policy(env, params, options)
    episode = play(env, params, policy, steps, options.seed)
    frames = []
    with Progress(-(-episode.steps // options.every) + 1, "drawing", unit="frames") as progress:
        pictures = compose(
            episode,
            env.field_of_view,
            with_map=options.map,
            scale=options.scale,
            every=options.every,
        )
        for i, frame in enumerate(pictures, 1):
            frames.append(frame)
            progress.update(i)
    save_gif(frames, options.out, options.fps)
    if options.sheet is not None:
        times = evenly(len(episode.frames), SHEET_VIEWS)
        scale = scale_to(episode.frames.shape[1], SHEET_HEIGHT)
        columns = min(SHEET_COLUMNS, len(times))
        contact_sheet(episode.frames[times], columns, options.sheet, scale=scale)
    written = " and ".join(str(path) for path in (options.out, options.sheet) if path is not None)
    print(f"{name}: {episode.steps} steps, return {episode.returns[-1]:.4g}, wrote {written}")


def _policy(
    env: FirstPerson[Any, Any], params: Any, options: argparse.Namespace
) -> tuple[Policy, int]:
    if options.actions is not None:
        script = parse_actions(options.actions, env.action_names)
        return Script(script), min(len(script), options.steps)
    rng = np.random.default_rng(options.seed)
    return POLICIES[options.policy].make(env, params, rng), options.steps


def compose(
    episode: Episode, field_of_view: float, *, with_map: bool, scale: int | None, every: int = 1
) -> Iterator[np.ndarray]:
    """The pictures of an episode: uint8[h, w, 3], one a frame.

    Args:
        episode: the episode; without a tile map there is no map picture.
        field_of_view: of the environment, in degrees.
        with_map: whether to show the map.
        scale: factor by which the view is enlarged, None for a good size.
        every: show every so many steps; the first and the last frame always.
    """
    scale = scale or scale_to(episode.frames.shape[1], VIEW_HEIGHT)
    tilemap = episode.tilemap if with_map else None
    ground = None if tilemap is None else draw_map(tilemap, size=MAP_SIZE)
    for i, frame in enumerate(episode.frames):
        if ground is not None:
            ground.path(episode.positions[max(0, i - 1) : i + 1], max(0, i - 1), episode.steps)
        if i % every and i < episode.steps:
            continue
        shot = None if ground is None else overview(ground, episode, i, field_of_view).image()
        yield compose_side_by_side(frame, shot, caption(episode, i), scale=scale)


def overview(ground: MapPicture, episode: Episode, step: int, field_of_view: float) -> MapPicture:
    """A map with the doors, the things and the agent of one frame added."""
    position, heading = episode.positions[step], episode.headings[step]
    shot = ground.copy().doors(episode.closed[step])
    shot.sight(position, heading, field_of_view, episode.closed[step])
    shot.sprites(episode.sprites[step], episode.labels[step], episode.visible[step])
    return shot.agent(position, heading)
