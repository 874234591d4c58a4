"""`jaxenstein record`: one episode as an animation, first person beside the map."""

from __future__ import annotations

import argparse
import dataclasses
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
from ..view.topdown import draw_map
from .arguments import (
    UsageError,
    add_environment,
    add_seed,
    open_environment,
    real,
    whole,
)
from .frames import image_of, picture
from .policies import Forward, Policy, RandomPolicy, Script, parse_actions

if TYPE_CHECKING:
    from ..environment import Environment

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
policies: random draws every action uniformly; forward walks on and turns where it is blocked.
"""
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
    play = parser.add_argument_group("what is played")
    play.add_argument(
        "--steps",
        type=whole(),
        default=300,
        metavar="T",
        help="stop after T steps (default %(default)s)",
    )
    how = play.add_mutually_exclusive_group()
    how.add_argument(
        "--policy",
        choices=("random", "forward"),
        default="forward",
        help="who acts (default %(default)s)",
    )
    how.add_argument("--actions", metavar="LIST", help='the actions to take, such as "2,2,0,1"')
    add_seed(play)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Play the episode and write its pictures."""
    env, params, name = open_environment(options, autoreset=None)
    for path, suffix in ((options.out, ".gif"), (options.sheet, ".png")):
        if path is not None and path.suffix.lower() != suffix:
            raise UsageError(f"jaxenstein record: {path} should end in {suffix}")
        if path is not None:
            check_writable(path)
    policy, steps = _policy(env, options)
    episode = play(env, params, policy, steps, options.seed)
    pictures = compose(env, episode, with_map=options.map, scale=options.scale)
    frames = []
    with Progress(episode.steps + 1, "drawing", unit="frames") as progress:
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


def _policy(env: Environment[Any, Any], options: argparse.Namespace) -> tuple[Policy, int]:
    if options.actions is not None:
        script = parse_actions(options.actions, env.action_names)
        return Script(script), min(len(script), options.steps)
    rng = np.random.default_rng(options.seed)
    if options.policy == "random":
        return RandomPolicy(env.num_actions, rng), options.steps
    return Forward(env.action_names, rng), options.steps


def play(env: Environment[Any, Any], params: Any, policy: Policy, steps: int, seed: int) -> Episode:
    """Play one episode, or the first `steps` steps of it.

    Args:
        env: an environment made with `autoreset=None`.
        params: its params.
        policy: chooses the actions.
        steps: the most steps to take, at least 1.
        seed: of the reset and the steps.
    """
    import jax

    key = jax.random.key(seed)
    key, reset_key = jax.random.split(key)
    obs, state = env.reset(reset_key, params)
    tape = Tape()
    tape.look(image_of(obs), state)
    with Progress(steps, "playing") as progress:
        for i in range(steps):
            key, step_key = jax.random.split(key)
            action = np.int32(policy.choose(tape.positions[-1]))
            obs, state, reward, terminated, truncated, info = env.step(
                step_key, state, action, params
            )
            tape.look(image_of(obs), state)
            tape.act(float(reward), jax.device_get(info), over=bool(truncated & ~terminated))
            progress.update(i + 1)
            if bool(terminated) or bool(truncated):
                break
        progress.total = len(tape.rewards)
    return tape.episode(getattr(env, "observation", "rgb"))


@dataclasses.dataclass
class Tape:
    """Collects an episode step by step."""

    frames: list[np.ndarray] = dataclasses.field(default_factory=list)
    positions: list[np.ndarray] = dataclasses.field(default_factory=list)
    headings: list[float] = dataclasses.field(default_factory=list)
    opened: list[np.ndarray] = dataclasses.field(default_factory=list)
    taken: list[np.ndarray] = dataclasses.field(default_factory=list)
    goals: list[int] = dataclasses.field(default_factory=list)
    rewards: list[float] = dataclasses.field(default_factory=list)
    events: list[str] = dataclasses.field(default_factory=list)

    def look(self, image: Any, state: Any) -> None:
        """Add what is seen in a state, and what the map needs of it."""
        nothing = np.zeros(0, bool)
        self.frames.append(np.asarray(image))
        self.positions.append(np.asarray(state.position))
        self.headings.append(float(state.heading))
        self.opened.append(np.asarray(getattr(state, "opened", nothing)))
        self.taken.append(np.asarray(getattr(state, "taken", nothing)))
        self.goals.append(int(getattr(state, "goal", -1)))

    def act(self, reward: float, info: dict[str, Any], *, over: bool) -> None:
        """Add what a step brought."""
        self.rewards.append(reward)
        words = [text for name, text in EVENTS.items() if np.any(info.get(name, False))]
        self.events.append(", ".join(words + ["time is up"] * over))

    def episode(self, kind: str) -> Episode:
        """The finished episode; `kind` is the environment's `observation`."""
        return Episode(
            frames=picture(np.stack(self.frames), kind),
            positions=np.stack(self.positions),
            headings=np.array(self.headings, np.float32),
            rewards=np.array(self.rewards, np.float32),
            opened=np.stack(self.opened),
            taken=np.stack(self.taken),
            goals=np.array(self.goals, np.int32),
            events=tuple(self.events),
        )


EVENTS = {
    "picked_key": "picked up a key",
    "opened_door": "opened a door",
    "reached_goal": "reached the goal",
}


def compose(
    env: Environment[Any, Any], episode: Episode, *, with_map: bool, scale: int | None
) -> Iterator[np.ndarray]:
    """The pictures of an episode: uint8[h, w, 3], one a frame.

    Args:
        env: the environment it was played in; without a tile map there is no map picture.
        episode: the episode.
        with_map: whether to show the map.
        scale: factor by which the view is enlarged, None for a good size.
    """
    tilemap = getattr(env, "tilemap", None) if with_map else None
    fov = getattr(env, "field_of_view", 60.0)
    scale = scale or scale_to(episode.frames.shape[1], VIEW_HEIGHT)
    ground = None if tilemap is None else draw_map(tilemap, size=MAP_SIZE)
    for i, frame in enumerate(episode.frames):
        overview = None
        if ground is not None:
            ground.path(episode.positions[max(0, i - 1) : i + 1], max(0, i - 1), episode.steps)
            opened, goal = episode.opened[i], int(episode.goals[i])
            overview = ground.copy()
            overview.objects(opened, episode.taken[i], goal if goal >= 0 else None)
            overview.agent(episode.positions[i], episode.headings[i], fov, opened)
        shot = None if overview is None else overview.image()
        yield compose_side_by_side(frame, shot, caption(episode, i), scale=scale)
