"""`jaxenstein record`: film one episode, in first person beside the map."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..episodes.policies import GENERAL, Policy, Script, named_policy
from ..episodes.recorder import play
from ..episodes.session import Session
from ..errors import quoted
from ..files import check_writable
from ..progress import Progress
from ..spec import Spec, spec_of
from ..tasks.first_person import FirstPerson
from ..trajectory import check_trajectory
from ..view.episode import SHEET_VIEWS, Episode, Pictures, save_sheet
from ..view.recording import ANIMATIONS, check_animation, save_animation
from .arguments import (
    OF_FILES,
    OWN,
    Parser,
    UsageError,
    add_agent,
    add_environment,
    add_seed,
    flag,
    real,
    whole,
)
from .opening import baselines, drawn_by, given_options, open_environment, printing_warnings
from .own_policy import is_own, load_own

if TYPE_CHECKING:
    from ..baselines.runs.agents import TrainedPolicy

HELP = "film one episode as a GIF or MP4, beside the map"
DESCRIPTION = """\
Play one episode and film it. The left side shows the view of the agent, the right side the map with
the agent, its field of view and its path; a line below shows the step, the return and events. MP4
needs the extra 'video': pip install 'jaxenstein[video]'.

The episode stops when the task ends, at the horizon, after --steps, or after the last of --actions.

--policy RUN plays with a trained agent, by default in the environment that it was trained in.
--policy MODULE:FUNCTION plays with your own; 'jaxenstein evaluate --help' explains how to write it.
"""
EPILOG = """\
examples:
  jaxenstein record my-way-home --out home.gif
  jaxenstein record key-door --policy forward --steps 300 --out key-door.gif --sheet key-door.png
  jaxenstein record health-gathering --policy expert --steps 2100 --every 3 --out health.mp4
  jaxenstein record simple --policy random --out simple.gif --save simple.json
  jaxenstein record simple --actions "forward*20,turn right*6,forward" --out simple.gif
  jaxenstein record --map-file maze.txt --width 160 --height 120 --fov 90 --out maze.gif
  jaxenstein record --policy runs/simple-rnd --out agent.gif
  jaxenstein record t-maze --policy my_module:agent --out agent.gif

--actions takes numbers or names ('jaxenstein list' shows them), separated by commas; 2*10 repeats
action 2 ten times.

policies:
""" + "\n".join(f"  {name}: {summary}" for name, summary in GENERAL.items())
EPILOG += """
Environments have further scripted players, such as shortest_path in tasks with a goal; the error
for an unknown name lists them."""


def fill(parser: Parser) -> None:
    """Add the arguments."""
    add_environment(parser)
    out = parser.add_argument_group("output")
    add_pictures(out)
    flag(out, "--save FILE.json", "write seed, settings and actions, for 'jaxenstein replay'", Path)
    played = parser.add_argument_group("play")
    flag(played, "--steps T", "stop after T steps (default: at the horizon)", whole())
    how = played.add_mutually_exclusive_group()
    policy = f"a policy named below, or an agent: a run directory, {OF_FILES}, or {OWN}"
    flag(how, "--policy NAME", policy, policy_or_run, "forward")
    add_agent(played)
    flag(how, "--actions LIST", 'the actions to take, such as "2,2,0,1"', str)
    add_seed(played)


def add_pictures(out: argparse._ArgumentGroup) -> None:
    """Add the arguments for the pictures of an episode."""
    film = "write a film, .gif or .mp4; .png writes only a contact sheet"
    flag(out, "--out FILE", film, Path)
    flag(out, "--sheet FILE.png", f"write a contact sheet of up to {SHEET_VIEWS} views", Path)
    out.add_argument(
        "--map",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="show the map from above (default: yes)",
    )
    larger = "enlarge the view N times (default: to about 384 pixels high)"
    flag(out, "--scale N", larger, whole(1, 64))
    flag(out, "--fps RATE", "frames per second, 1 to 50", real(1, 50), 15.0)
    flag(out, "--every N", "show only every N-th step, for long episodes", whole(), 1)


def run(options: argparse.Namespace) -> None:
    """Play the episode and write its pictures."""
    run = options.policy if isinstance(options.policy, Path) else None
    agent = load_agent(run, options)
    env, params, name = open_for(agent, options)
    params = drawn_by(params, options.seed)
    check_pictures(options)
    if (options.out, options.sheet, options.save) == (None, None, None):
        raise UsageError("jaxenstein record: give at least one of --out, --sheet and --save")
    if options.save is not None:
        check_trajectory(options.save)
    spec = None if options.save is None else spec_of(env, params)
    policy, steps = _policy(env, params, options, agent)
    episode = play_shown(env, params, options.seed, policy, steps, spec)
    if options.save is not None:
        episode.save(options.save)
    written = save_pictures(episode, options)
    if options.save is not None:
        written.append(options.save)
    facts = [f"{episode.steps} steps", f"return {episode.returns[-1]:.4g}"]
    stopper = "--steps" if episode.steps == options.steps else "--actions"
    facts.append(episode.ending or f"stopped by {stopper}")
    print(f"{name}: {', '.join(facts)}, wrote {' and '.join(map(str, written))}")


def play_shown(
    env: FirstPerson[Any, Any],
    params: Any,
    seed: int,
    policy: Policy,
    steps: int,
    spec: Spec | None = None,
) -> Episode:
    """Play an episode of at most `steps` steps, with a progress line."""
    with Progress(steps, "playing", compiles=True) as progress:
        session = Session(env, params, seed)
        episode = play(session, policy, steps, spec, notify=progress.update)
        progress.total = max(episode.steps, 1)
    return episode


def policy_or_run(text: str) -> str | Path:
    """An argument type: a policy's name or MODULE:FUNCTION, or the path of a trained agent."""
    if text not in GENERAL and (text.endswith(".npz") or "/" in text or os.path.isdir(text)):
        return Path(text)
    if text.isidentifier() or is_own(text):
        return text
    kinds = f"a policy, a run directory, FILE.npz, pretrained/NAME or {OWN}"
    raise argparse.ArgumentTypeError(f"must be {kinds}, not {quoted(text)}")


def load_agent(path: Path | None, options: argparse.Namespace) -> TrainedPolicy | None:
    """The trained agent of a run directory or a file, None without one."""
    if path is None:
        if options.greedy or options.number is not None:
            missing = _missing_run(options)
            raise UsageError(
                f"jaxenstein: {missing}, which --run and --greedy need"
                if missing
                else "jaxenstein: --run and --greedy need --policy with a run directory"
            )
        return None
    with printing_warnings():
        return baselines("agents").load_policy(path, options.number, greedy=options.greedy)


def _missing_run(options: argparse.Namespace) -> str:
    """A message if --policy seems to name a missing run directory, else ""."""
    name = options.policy
    if not isinstance(name, str) or name in GENERAL or is_own(name):
        return ""
    return f"there is no run directory {quoted(name)}"


def open_for(
    agent: TrainedPolicy | None, options: argparse.Namespace
) -> tuple[FirstPerson[Any, Any], Any, str]:
    """Like `open_environment`; options not given are those of the agent's own environment.

    Raises:
        UsageError: there is no agent, and neither an ID nor a map is given.
        SettingError: the agent cannot act in the environment.
    """
    given = given_options(options)
    if agent is None:
        missing = _missing_run(options)
        if missing and not {"env", "map_file"} & set(given):
            raise UsageError(
                f"jaxenstein: {missing}; to play with a scripted player, also give the ID"
            )
        return open_environment(given, ranges=True)
    if not given:
        return agent.env, agent.params, agent.name
    env, params, name = open_environment(given, agent.environment, ranges=True)
    agent.check(env, params)
    return env, params, name if {"env", "map_file"} & set(given) else agent.name


def check_pictures(options: argparse.Namespace) -> None:
    """Raise before the episode is played if the pictures cannot be written."""
    if options.out is not None and options.out.suffix.lower() == ".png":
        if options.sheet is not None:
            raise UsageError(
                f"jaxenstein: --out {options.out} writes a contact sheet, as --sheet does; give one"
            )
        options.out, options.sheet = None, options.out
    if options.out is not None:
        if options.out.suffix.lower() not in ANIMATIONS:
            formats = f"{', '.join(ANIMATIONS)} or .png"
            raise UsageError(f"jaxenstein: {options.out} should end in {formats}")
        check_animation(options.out)
    if options.sheet is not None:
        if options.sheet.suffix.lower() != ".png":
            raise UsageError(f"jaxenstein: {options.sheet} should end in .png")
        check_writable(options.sheet)


def save_pictures(episode: Episode, options: argparse.Namespace) -> list[Path]:
    """Write the requested pictures, and return their paths."""
    if options.out is not None:
        frames = -(-episode.steps // options.every) + 1
        with Progress(frames, "drawing", unit="frames") as progress:
            pictures = Pictures(
                episode,
                with_map=options.map,
                scale=options.scale,
                every=options.every,
                notify=progress.update,
            )
            save_animation(pictures, options.out, options.fps)
    if options.sheet is not None:
        save_sheet(episode, options.sheet)
    return [path for path in (options.out, options.sheet) if path is not None]


def _policy(
    env: FirstPerson[Any, Any], params: Any, options: argparse.Namespace, agent: Policy | None
) -> tuple[Policy, int]:
    steps = options.steps or int(env.most_steps(params))
    if agent is not None:
        return agent, steps
    if options.actions is not None:
        script = parse_actions(options.actions, env.action_names)
        return Script(script), min(len(script), steps)
    if is_own(options.policy):
        return load_own(options.policy, env, params), steps
    return named_policy(options.policy, env, params, options.seed), steps


def parse_actions(text: str, names: Sequence[str]) -> list[int]:
    """Parse actions such as "2,2,forward*10".

    Args:
        text: numbers or names separated by commas, each optionally with `*` and a count.
        names: the names of the actions.

    Raises:
        UsageError: a part is not an action, or its count is not valid.
    """
    actions: list[int] = []
    for part in text.split(","):
        word, star, times = (piece.strip() for piece in part.partition("*"))
        if word in names:
            action = names.index(word)
        elif word.isdecimal() and int(word) < len(names):
            action = int(word)
        else:
            known = ", ".join(f"{i} {name}" for i, name in enumerate(names))
            raise UsageError(
                f"jaxenstein record: --actions: no action {quoted(word)}; known: {known}"
            )
        if star and not (times.isdecimal() and 0 < int(times) <= 100_000):
            raise UsageError(
                f"jaxenstein record: --actions: the count in {quoted(part.strip())} must be "
                "1 to 100000"
            )
        actions += [action] * (int(times) if star else 1)
    return actions
