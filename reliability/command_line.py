"""The command line, with its files, as a target of fuzzing. Needs the extra `baselines`.

What the parser accepts is run up to where something would be compiled, trained, played or measured.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import io
import os
import re
from collections.abc import Iterator
from typing import Any
from unittest import mock

from jaxenstein import cli
from jaxenstein.baselines.runs import agents
from jaxenstein.cli import bench, play, rollout, sweep, train
from jaxenstein.cli.arguments import UsageError
from jaxenstein.episodes.session import Session
from jaxenstein.errors import SettingError

from . import targets
from .fuzz import Case, Target
from .spoil import NUMBERS, WORDS, Rng

COMMANDS = (
    "list",
    "list --symbols",
    "--version",
    "play key-door --terminal --seed 3 --fov 90 --native",
    "rollout key-door --envs 2 --steps 2 --height 12 --width 16 --seed 1",
    "rollout --map-file map.txt --observation depth --horizon 3 --envs 1 --steps 1 --out pictures",
    "record key-door --out x.gif --steps 2 --height 12 --width 16 --policy forward --sheet x.png",
    "record simple --out x.gif --save x.json --actions 2,forward*3 --no-map --scale 2 --every 2",
    "record --map-file map.txt --heading=-45,45 --out x.gif --fps 10 --seed 7 --steps 1",
    "record --policy run --out x.gif --steps 1",
    "replay walk.json",
    "replay walk.json --out y.gif --sheet y.png",
    "convert maze.map --out other.txt --name maze",
    "convert maze.map",
    "bench simple key-door --batch 1,2 --size 16x12 --steps 1 --repeats 1 --json b.json",
    "train --out new --env simple --algo rnd --seeds 2 --total-steps 1e4 --grid gamma=0.9,0.8",
    "train --out new --config c.toml --learning-rate 1e-4 --set height=12 --param move_distance=.2",
    "train --out new --map-file map.txt --heading 90 --convolutions 4x4x4,2x1x8 --no-anneal",
    "train --out run --resume --chunk 2 --save-every 1 --no-tensorboard",
    "sweep --out some --algo ppo rnd --at-once 2 --env simple --total-steps 1e4 --num-envs 4",
    "evaluate run --episodes 1 --json e.json --seed 2 --run 1 --greedy",
    "plot run --out p.png --metric success --points 3 --title x",
)
NAMES = (
    *("map.txt", "maze.map", "walk.json", "c.toml", "m.toml", "run", "run/config.json", ".", ".."),
    *("no/such/x.gif", "x.gif", "x.png", "x.mp4", "x.jpg", "x.json", "map.txt/x.gif", "../x.gif"),
    *("\udcff.txt", "\udcff.gif", "a" * 300 + ".gif"),
)
BEGINS = "here it would begin"


def target() -> Target:
    """Every command with most of its arguments."""
    files = {
        "map.txt": targets.DOORS.encode(),
        "map.faces.txt": targets.FACES.encode(),
        "c.toml": targets.TOML.encode(),
        "m.toml": targets.MAP.encode(),
        **targets.lab().seeds[0].files,
        **targets.trajectories().seeds[1].files,
        **targets.trained_run().files,
    }
    seeds = [Case(files, tuple(line.split())) for line in COMMANDS]
    return Target(seeds, run, quiet=False, spoil_args=spoil)


def spoil(args: tuple[str, ...], rng: Rng) -> tuple[str, ...]:
    """A change of the arguments."""
    changed = list(args) or ["list"]
    place, kind = rng.randrange(len(changed)), rng.randrange(7)
    if kind == 0:
        del changed[place]
    elif kind == 1:
        changed.insert(place, rng.choice(changed))
    elif kind == 2:
        changed.insert(place, rng.choice(flags()))
    elif kind == 3:
        changed[place] = rng.choice((*NUMBERS, *WORDS, *NAMES))
    elif kind == 4:
        commands = [line.split()[0] for line in COMMANDS]
        changed[place] = rng.choice(commands if place == 0 else NAMES)
    elif kind == 5:
        changed[place] += rng.choice(("=", ",", "x", "0", "-", *NUMBERS))
    else:
        name, _, value = changed[place].partition("=")
        changed[place] = f"{name}={rng.choice((value, *NUMBERS))}"
    return tuple(map(_argument, changed))


def _argument(text: str) -> str:
    """What a system hands over, without paths that lead out of the scratch folder."""
    kept = text.replace("\0", "0").encode("utf-8", "surrogatepass")
    shown = kept.decode("utf-8", "surrogateescape")[:4000]
    return re.sub(r"(^|[^\w.])/+", r"\1./", re.sub(r"(\.\./+)+", "../", shown))


@functools.cache
def flags() -> tuple[str, ...]:
    """All flags of all commands."""
    (commands,) = (
        action
        for action in cli.build_parser()._actions
        if isinstance(action, argparse._SubParsersAction)
    )
    for command in commands.choices.values():
        command.format_help()
    return tuple(sorted({f for c in commands.choices.values() for f in c._option_string_actions}))


def run(case: Case) -> None:
    """Run the command as a process would, and look at its exit status and messages."""
    out, err = io.StringIO(), io.StringIO()
    streams = contextlib.redirect_stdout(out), contextlib.redirect_stderr(err)
    with streams[0], streams[1], short(), mock.patch.dict(os.environ, {"TERM": "dumb"}):
        try:
            status = cli.main(list(case.args))
        except SystemExit as error:
            # `--help` and `--version` end so.
            status = error.code
    lines = err.getvalue().splitlines()
    complaints = [line for line in lines if not line.startswith("jaxenstein: warning:")]
    message = complaints[-1] if complaints else ""
    if status == 0 or BEGINS in message:
        return
    assert status in (1, 2, 130), f"exit status {status!r} with {err.getvalue()!r}"
    assert message or out.getvalue(), f"exit status {status} without a word"
    assert "Traceback" not in err.getvalue(), err.getvalue()
    raise UsageError(f"status {status}: {message or out.getvalue()}")


@contextlib.contextmanager
def short() -> Iterator[None]:
    """Stop commands where they would take long or wait for somebody."""

    def stop(*args: Any, **kwargs: Any) -> Any:
        raise SettingError(BEGINS)

    def few(options: argparse.Namespace, given: Any = train.given_training) -> dict[str, Any]:
        return targets.bounded(given(options))

    with contextlib.ExitStack() as stack:
        for where, name, value in (
            (play, "_open_terminal", stop),
            (play, "_open_window", stop),
            (train, "given_training", few),
            (sweep, "given_training", few),
            (train, "carry_out", lambda *_: 0),
            (sweep, "carry_out", stop),
            (bench, "table", lambda results: f"{len(results)} results"),
            (agents, "evaluate", stop),
            (rollout, "compile_rollout", stop),
            (Session, "__init__", stop),
        ):
            stack.enter_context(mock.patch.object(where, name, value))
        stack.enter_context(mock.patch("jaxenstein.speed.measuring.measure_apart", return_value={}))
        yield
