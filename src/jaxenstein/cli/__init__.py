"""The command line: `jaxenstein list | play | rollout | record | train | ...`.

A command imports an optional package only when it runs and needs it.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import NoReturn

from ..errors import JAXensteinError, concise, one_line
from ..files import OutputError, reason_of
from ..version import __version__
from . import (
    bench,
    convert,
    evaluate,
    export,
    listing,
    play,
    plot,
    record,
    replay,
    rollout,
    score,
    sweep,
    train,
)
from .arguments import Parser, UsageError
from .compile_cache import keep_programs
from .opening import IMPORT, handling, import_modules, named_modules, plain_warnings
from .train import INTERRUPTED

FAILED, WRONG_ARGUMENTS, BROKEN_PIPE = 1, 2, 141
ENDING = ("SIGTERM", "SIGHUP")

COMMANDS = {
    "list": listing,
    "play": play,
    "rollout": rollout,
    "record": record,
    "replay": replay,
    "convert": convert,
    "bench": bench,
    "train": train,
    "sweep": sweep,
    "evaluate": evaluate,
    "export": export,
    "plot": plot,
    "score": score,
}

EXAMPLES = """\
examples:
  jaxenstein list
  jaxenstein play key-door
  jaxenstein rollout my-way-home --envs 512 --steps 500 --out demo
  jaxenstein record key-door --policy forward --out key-door.gif
  jaxenstein record simple --out simple.mp4 --save simple.json
  jaxenstein replay simple.json
  jaxenstein convert nav_maze_static_01.map --out maze.txt
  jaxenstein bench my-way-home --batch 64,256,1024 --json bench.json
  jaxenstein train --env simple --algo rnd --seeds 5 --out runs/simple-rnd
  jaxenstein evaluate runs/simple-rnd --gif agent.gif
  jaxenstein plot runs/simple-rnd --out curves.png
  jaxenstein score simple-rnd.json simple-ppo.json

'jaxenstein COMMAND --help' explains a command and all its options.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Args:
        argv: the arguments; `sys.argv[1:]` by default.

    Returns:
        The exit code: 0 for success; 1 if something could not be written or run, or a replay
        differs; 2 for wrong arguments; 3 if all runs of a training diverged; 130 after Ctrl-C or
        --minutes; 141 if the reader closed the pipe.
    """
    try:
        given = sys.argv[1:] if argv is None else argv
        # Import first: a module may register bonuses, whose options become flags.
        import_modules(named_modules(given))
        options = build_parser().parse_args(given)
        # A program that passes arguments to `main` configures JAX itself.
        if argv is None and not options.no_cache:
            keep_programs()
        with plain_warnings(), handling(ENDING, _end):
            code = options.run(options)
        sys.stdout.flush()
    except UsageError as error:
        return _complain(str(error), WRONG_ARGUMENTS)
    except OutputError as error:
        return _complain(f"jaxenstein: {error}", FAILED)
    except JAXensteinError as error:
        return _complain(f"jaxenstein: {error}", WRONG_ARGUMENTS)
    except UnicodeEncodeError as error:
        shown = f"cannot print {error.object[error.start]!a} as {error.encoding}"
        return _complain(f"jaxenstein: {shown}; set PYTHONIOENCODING=utf-8", FAILED)
    except BrokenPipeError:
        _drop_output()
        return BROKEN_PIPE
    except OSError as error:
        _drop_output()
        return _complain(f"jaxenstein: {reason_of(error)}", FAILED)
    except KeyboardInterrupt:
        return _complain("interrupted", INTERRUPTED)
    except (MemoryError, RuntimeError) as error:
        # JAX's own errors (out of memory, no such device) are RuntimeErrors of several lines.
        return _complain(f"jaxenstein: {str(error) or 'out of memory'}", FAILED)
    return code or 0


def _drop_output() -> None:
    """Without this, Python would complain at exit about output that it could not write."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def build_parser() -> Parser:
    """Build the parser of all commands."""
    parser = Parser(
        prog="jaxenstein",
        description="First-person visual environments for reinforcement learning, in JAX.",
        epilog=EXAMPLES,
    )
    parser.add_argument("--version", action="version", version=f"jaxenstein {__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND")
    parser.set_defaults(run=lambda _: parser.print_help(), no_cache=True)
    for name, command in COMMANDS.items():
        sub = commands.add_parser(
            name,
            help=command.HELP,
            description=command.DESCRIPTION,
            epilog=command.EPILOG,
            fill=command.fill,
        )
        sub.set_defaults(run=command.run)
        sub.add_argument(
            IMPORT,
            dest="modules",
            action="append",
            metavar="MODULE",
            help="import a module that defines tasks or bonuses of your own",
        )
        sub.add_argument(
            "--no-cache",
            action="store_true",
            help="do not keep compiled programs for the next call",
        )
    return parser


def _end(number: int, frame: object) -> NoReturn:
    """Turn a signal that ends a process into an ordinary exit, which leaves nothing half done."""
    del frame
    raise SystemExit(128 + number)


def _complain(message: str, code: int) -> int:
    print(concise(one_line(message)), file=sys.stderr)
    return code


__all__ = ["build_parser", "main"]
