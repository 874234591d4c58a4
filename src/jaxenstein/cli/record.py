"""`jaxenstein record`: one episode as an animation, first person beside the map."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..episodes.policies import GENERAL, Policy, Script, named_policy
from ..errors import quoted
from ..files import check_writable
from ..progress import Progress
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
from .opening import baselines, drawn_by, given_options, open_environment, telling_warnings
from .own_policy import is_own, load_own

if TYPE_CHECKING:
    from ..baselines.runs.agents import TrainedPolicy
    from ..spec import Spec
    from ..tasks.first_person import FirstPerson

HELP = "write one episode as a GIF or MP4, with the map from above"
DESCRIPTION = """\
Play one episode and write it as a GIF or MP4: what the agent sees, beside the map from above
with the agent, its field of view and its path so far, over a line with step, return and events.
MP4 needs the extra 'video': pip install 'jaxenstein[video]'.
The episode stops at the goal, at the horizon, after --steps, or after the last of --actions.
An agent that 'jaxenstein train' made acts with --policy RUN, its run directory; without ID it
does so in the environment that it was trained in. One of your own acts with --policy
MODULE:FUNCTION, as 'jaxenstein evaluate --help' explains.
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

actions are numbers or names (see 'jaxenstein list'), separated by commas; 2*10 is ten times 2.
policies:
""" + "\n".join(f"  {name}: {summary}" for name, summary in GENERAL.items())
EPILOG += """
and the other players that an environment has, such as shortest_path where there is a goal; a name
that it does not have is answered with those it has."""


def fill(parser: Parser) -> None:
    """Add the arguments."""
    add_environment(parser)
    out = parser.add_argument_group("what is written")
    add_pictures(out)
    flag(out, "--save FILE.json", "seed, settings and actions, for 'jaxenstein replay'", Path)
    played = parser.add_argument_group("what is played")
    flag(played, "--steps T", "stop after T steps (default: at the horizon)", whole())
    how = played.add_mutually_exclusive_group()
    policy = f"what acts, see below, or an agent: a run directory, {OF_FILES}, {OWN}"
    flag(how, "--policy NAME", policy, policy_or_run, "forward")
    add_agent(played)
    flag(how, "--actions LIST", 'the actions to take, such as "2,2,0,1"', str)
    add_seed(played)


def add_pictures(out: argparse._ArgumentGroup) -> None:
    """Add the arguments that say what pictures of an episode are written, and their looks."""
    film = "the animation, .gif or .mp4; .png writes the contact sheet alone"
    flag(out, "--out FILE", film, Path)
    flag(out, "--sheet FILE.png", f"a contact sheet of up to {SHEET_VIEWS} views", Path)
    out.add_argument(
        "--map",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="show the map from above (default: yes)",
    )
    larger = "enlarge the view N times (default: to a height of about 384 pixels)"
    flag(out, "--scale N", larger, whole(1, 64))
    flag(out, "--fps RATE", "frames a second, 1 to 50", real(1, 50), 15.0)
    flag(out, "--every N", "show every N-th step, for long episodes", whole(), 1)


def run(options: argparse.Namespace) -> None:
    """Play the episode and write its pictures."""
    run = options.policy if isinstance(options.policy, Path) else None
    agent = load_agent(run, options)
    env, params, name = open_for(agent, options)
    params = drawn_by(params, options.seed)
    check_pictures(options)
    if (options.out, options.sheet, options.save) == (None, None, None):
        raise UsageError("jaxenstein record: give at least one of --out, --sheet and --save")
    from ..spec import spec_of
    from ..trajectory import check_trajectory

    if options.save is not None:
        check_trajectory(options.save)
    spec = None if options.save is None else spec_of(env, params)
    policy, steps = _policy(env, params, options, agent)
    episode = play_shown(env, params, options.seed, policy, steps, spec)
    written = save_pictures(episode, options)
    if options.save is not None:
        episode.save(options.save)
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
    """Play an episode, of at most so many steps, under a progress line."""
    from ..episodes.recorder import play
    from ..episodes.session import Session

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
                else "jaxenstein: --run and --greedy go with the run directory of --policy"
            )
        return None
    with telling_warnings():
        return baselines("agents").load_policy(path, options.number, greedy=options.greedy)


def _missing_run(options: argparse.Namespace) -> str:
    """A phrase if --policy may mean a run directory that is missing, else ""."""
    name = options.policy
    if not isinstance(name, str) or name in GENERAL or is_own(name):
        return ""
    return f"there is no run directory {quoted(name)}"


def open_for(
    agent: TrainedPolicy | None, options: argparse.Namespace
) -> tuple[FirstPerson[Any, Any], Any, str]:
    """As `open_environment`; what is not given is that of the agent's own environment.

    Raises:
        UsageError: there is no agent, and neither an ID nor a map is given.
        SettingError: the agent cannot act there.
    """
    given = given_options(options)
    if agent is None:
        missing = _missing_run(options)
        if missing and not {"env", "map_file"} & set(given):
            raise UsageError(
                f"jaxenstein: {missing}, and a policy of an environment needs the ID of one"
            )
        return open_environment(given, ranges=True)
    if not given:
        return agent.env, agent.params, agent.name
    env, params, name = open_environment(given, agent.environment, ranges=True)
    agent.check(env, params)
    return env, params, name if {"env", "map_file"} & set(given) else agent.name


def check_pictures(options: argparse.Namespace) -> None:
    """Find out before anything is played whether the pictures can be written."""
    if options.out is not None and options.out.suffix.lower() == ".png" and not options.sheet:
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
    """Write what was asked for; returns the paths."""
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
    """The actions of a text like "2,2,forward*10".

    Args:
        text: numbers or names separated by commas, each optionally with `*` and a count.
        names: the names of the actions.

    Raises:
        UsageError: if the text names no action, or one that there is not.
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
            raise UsageError(f"jaxenstein record: --actions: {quoted(part.strip())} is not a count")
        actions += [action] * (int(times) if star else 1)
    return actions
