"""The command line, with its files, as a target of fuzzing. Needs the extra `baselines`.

What the parser accepts is run, with the sizes and numbers of steps reduced to what takes no time;
training, playing and measuring end where they would begin, most of what must be compiled too.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import functools
import io
import os
import re
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest import mock

from jaxenstein import cli
from jaxenstein.baselines.runs import agents
from jaxenstein.cli import bench, play, rollout, sweep, train
from jaxenstein.cli.arguments import Parser, UsageError
from jaxenstein.episodes.session import Session
from jaxenstein.errors import SettingError

from .cases import Case
from .mutate import NUMBERS, WORDS, Rng
from .run_targets import MAP, TOML, Runs, bounded
from .targets import DOORS, FACES, Lab, Trajectories, spoil_one

LINES = (
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
COMMANDS = tuple(dict.fromkeys(line.split()[0] for line in LINES))
NAMES = (
    *("map.txt", "maze.map", "walk.json", "c.toml", "m.toml", "run", "run/config.json", ".", ".."),
    *("no/such/x.gif", "x.gif", "x.png", "x.mp4", "x.jpg", "x.json", "map.txt/x.gif", "../x.gif"),
    *("\udcff.txt", "\udcff.gif", "a" * 300 + ".gif"),
)
# What a case may ask for at most, once the arguments have been taken.
MOST = {"envs": 2, "steps": 2, "episodes": 1, "height": 64, "width": 64, "scale": 2, "points": 50}

BEGINS = "here it would begin"
# One in so many cases is compiled and run.
SELDOM = 12


class Stopped(SettingError):
    """Here the long part would begin."""


class Arguments:
    """Command lines over some valid and some spoilt files."""

    name, named, quiet = "arguments", False, False

    @functools.cached_property
    def _files(self) -> dict[str, bytes]:
        run = Runs().seeds()[1]
        return {
            "map.txt": DOORS.encode(),
            "map.faces.txt": FACES.encode(),
            "maze.map": Lab().seeds()[0].files["maze.map"],
            "walk.json": Trajectories().seeds()[1].files["walk.json"],
            "c.toml": TOML.encode(),
            "m.toml": MAP.encode(),
            **run.files,
        }

    def seeds(self) -> list[Case]:
        """Every command with most of its arguments."""
        return [Case(self._files, tuple(line.split())) for line in LINES]

    def spoil(self, case: Case, rng: Rng) -> Case:
        """A change of the arguments, now and then of a file."""
        if rng.random() < 0.1:
            return spoil_one(case, rng, {})
        args = list(case.args) or ["list"]
        place, kind = rng.randrange(len(args)), rng.randrange(7)
        if kind == 0:
            del args[place]
        elif kind == 1:
            args.insert(place, rng.choice(args))
        elif kind == 2:
            args.insert(place, rng.choice(flags()))
        elif kind == 3:
            args[place] = rng.choice((*NUMBERS, *WORDS, *NAMES)).replace("\0", "0")
        elif kind == 4:
            args[place] = rng.choice(COMMANDS if place == 0 else NAMES)
        elif kind == 5:
            args[place] = args[place] + rng.choice(("=", ",", "x", "0", "-", *NUMBERS))
        else:
            name, _, value = args[place].partition("=")
            args[place] = f"{name}={rng.choice((value, *NUMBERS))}"
        return dataclasses.replace(case, args=tuple(map(_argument, args)))

    def run(self, case: Case, folder: Path) -> None:
        """Run the command as a process would, and look at its exit status and messages."""
        out, err = io.StringIO(), io.StringIO()
        whole = zlib.crc32(repr(case.args).encode()) % SELDOM == 0
        streams = contextlib.redirect_stdout(out), contextlib.redirect_stderr(err)
        with streams[0], streams[1], short(whole), mock.patch.dict(os.environ, {"TERM": "dumb"}):
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
        if status not in (1, 2, 130) or not (message or out.getvalue()):
            raise AssertionError(f"exit status {status!r} with {err.getvalue()!r}")
        if "Traceback" in err.getvalue():
            raise AssertionError(err.getvalue())
        raise UsageError(f"status {status}: {message or out.getvalue()}")


@functools.cache
def flags() -> tuple[str, ...]:
    """All flags of all commands."""
    parser = cli.build_parser()
    (commands,) = (
        action for action in parser._actions if isinstance(action, argparse._SubParsersAction)
    )
    found = set()
    for command in commands.choices.values():
        command.format_help()
        found |= set(command._option_string_actions)
    return tuple(sorted(found))


@contextlib.contextmanager
def short(whole: bool) -> Iterator[None]:
    """Reduce what commands do, and stop those that would take long or wait for somebody.

    Args:
        whole: whether what is to be compiled, which takes seconds, is compiled and run.
    """
    parse = Parser.parse_args

    def reduced(self: Parser, *args: Any, **kwargs: Any) -> argparse.Namespace:
        options = parse(self, *args, **kwargs)
        for name, most in MOST.items():
            value = getattr(options, name, None)
            if isinstance(value, int) and value > most:
                setattr(options, name, most)
        return options

    def stop(*args: Any, **kwargs: Any) -> Any:
        raise Stopped(BEGINS)

    given = train.given_options

    def few(options: argparse.Namespace) -> dict[str, Any]:
        return bounded(given(options))

    with contextlib.ExitStack() as stack:
        for where, name, value in (
            (Parser, "parse_args", reduced),
            (play, "_open_terminal", stop),
            (play, "_open_window", stop),
            (train, "given_options", few),
            (sweep, "given_options", few),
            (train, "carry_out", lambda *_: 0),
            (sweep, "carry_out", stop),
            (bench, "table", lambda results: f"{len(results)} results"),
            *(() if whole else ((agents, "evaluate", stop), (rollout, "compile_rollout", stop))),
            *(() if whole else ((Session, "__init__", stop),)),
        ):
            stack.enter_context(mock.patch.object(where, name, value))
        stack.enter_context(mock.patch("jaxenstein.speed.measuring.measure_apart", return_value={}))
        yield


def _argument(text: str) -> str:
    """What a system hands over, without paths that lead out of the scratch folder."""
    kept = text.replace("\0", "").encode("utf-8", "surrogatepass")
    shown = kept.decode("utf-8", "surrogateescape")[:4000]
    return re.sub(r"(^|[^\w.])/+", r"\1./", re.sub(r"(\.\./+)+", "../", shown))
