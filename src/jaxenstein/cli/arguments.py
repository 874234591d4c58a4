"""The parser that all commands share, argument types, and functions that add common flags."""

from __future__ import annotations

import argparse
import contextlib
import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NoReturn

from ..errors import nearest, quoted
from ..fields import Domain, Option
from ..settings import environment_options
from ..suite import SUITES


class UsageError(Exception):
    """The arguments are wrong; the message is one line."""


class Parser(argparse.ArgumentParser):
    """An argument parser that raises `UsageError` and keeps the line breaks of help texts."""

    def __init__(self, *, fill: Callable[[Parser], None] | None = None, **kwargs: Any) -> None:
        """Build the parser.

        Args:
            fill: adds the arguments on first use; useful where finding them out takes long.
            **kwargs: passed to `argparse.ArgumentParser`.
        """
        kwargs.setdefault("formatter_class", argparse.RawDescriptionHelpFormatter)
        super().__init__(allow_abbrev=False, **kwargs)
        self._fill = fill

    def parse_known_args(  # type: ignore[override]
        self, args: Any = None, namespace: Any = None
    ) -> Any:
        """Parse; the error for an unknown flag suggests the nearest one."""
        self._filled()
        known, unknown = super().parse_known_args(args, namespace)
        # The parser of a command has seen these arguments before the parser of all commands.
        for word in unknown if self._subparsers is None else ():
            close = nearest(word.partition("=")[0], self._option_string_actions)
            if word.startswith("--") and close:
                self.error(f"unrecognized argument: {word}{close}")
            if not word.startswith("-") and "--env" in self._option_string_actions:
                self.error(f"unrecognized argument: {word}; an environment is given as --env ID")
        return known, unknown

    def format_help(self) -> str:
        """The help text."""
        self._filled()
        return super().format_help()

    def _filled(self) -> None:
        if self._fill is not None:
            fill, self._fill = self._fill, None
            fill(self)

    def error(self, message: str) -> NoReturn:
        """Raise `UsageError` instead of printing the usage."""
        raise UsageError(f"{self.prog}: {message} (see '{self.prog} --help')")


def plain_value(text: str) -> Any:
    """Parse a number, true, false, none, or a list with commas; other text is returned as is."""
    if "," in text:
        return [plain_value(part) for part in text.split(",")]
    words: dict[str, Any] = {"true": True, "false": False, "none": None}
    if text.strip() in words:
        return words[text.strip()]
    for kind in (int, float):
        with contextlib.suppress(ValueError):
            return kind(text)
    return text.strip()


def reader(domain: Domain) -> Callable[[str], Any]:
    """An argument type for the values of a field, checked like those in a file."""

    def read(text: str) -> Any:
        value: Any = text if domain.form in ("text", "choice", "images") else plain_value(text)
        if domain.form == "layers" and re.fullmatch(r"\d+x\d+x\d+(,\d+x\d+x\d+)*", text.lower()):
            value = [[int(n) for n in part.split("x")] for part in text.lower().split(",")]
        value = domain.converted(value)
        if fault := domain.fault(value):
            raise argparse.ArgumentTypeError(fault)
        return value

    return read


def whole(least: int = 1, most: float = math.inf) -> Callable[[str], int]:
    """An argument type: a whole number of at least `least` and at most `most`."""
    return reader(Domain("whole", least, most))


def real(least: float, most: float) -> Callable[[str], float]:
    """An argument type: a number from `least` to `most`."""
    return reader(Domain("number", least, most))


def size(text: str) -> tuple[int, int]:
    """An argument type: WIDTHxHEIGHT in pixels, such as 160x120, as (height, width)."""
    parts = text.lower().split("x")
    if len(parts) == 2 and all(part.isdecimal() and 0 < int(part) <= 4096 for part in parts):
        return int(parts[1]), int(parts[0])
    raise argparse.ArgumentTypeError(
        f"must be WIDTHxHEIGHT in pixels like 64x64, not {quoted(text)}"
    )


# The placeholder of a value in the help, by the form of the value, or by the name of its option.
METAVARS = {
    "whole": "N", "number": "X", "choice": "NAME", "text": "TEXT", "layers": "KxSxF,...",
    "angle": "DEGREES", "seeds": "FIRST,STOP", "images": "FOLDER",
}  # fmt: skip
METAVARS_BY_NAME = {"env": "ID", "map_file": "FILE"}
# Options that are tables: their flag and the form of one entry. Then aliases of other flags.
TABLES = {
    "settings": ("--set", "NAME=VALUE"),
    "params": ("--param", "NAME=VALUE"),
    "grid": ("--grid", "NAME=V,V"),
}
ALIASES = {"field_of_view": ("--fov",)}
# Prefix of option names in the parsed arguments.
PREFIX = "option_"


def flag(
    parser: argparse._ActionsContainer,
    words: str,
    help: str,
    convert: Callable[[str], Any] | None = None,
    default: Any = None,
    **more: Any,
) -> None:
    """Add a flag such as "--steps T", or a switch such as "--native".

    Args:
        parser: the parser or group to add to.
        words: the flag and the placeholder of its value.
        help: the help text; the default is appended.
        convert: converts the text to the value; None for a switch.
        default: the value without the flag.
        **more: passed to `add_argument`.
    """
    name, _, metavar = words.partition(" ")
    if convert is None:
        more["action"] = "store_true"
    else:
        more |= {"type": convert, "metavar": metavar, "default": default}
    if default is not None:
        help += f" (default %(default){'g' if isinstance(default, float) else 's'})"
    parser.add_argument(name, help=help, **more)


def add_options(
    parser: argparse.ArgumentParser, options: Mapping[str, Option], without: Sequence[str] = ()
) -> None:
    """Add a flag for every option not in `without`; a flag not given sets no attribute."""
    groups: dict[str, argparse._ArgumentGroup] = {}
    for option in options.values():
        # Only files hold a map as text.
        if option.name not in (*without, "map"):
            if option.group not in groups:
                groups[option.group] = parser.add_argument_group(option.group)
            _add_option(groups[option.group], option)


def flag_of(name: str) -> str:
    """The flag of an option."""
    return TABLES[name][0] if name in TABLES else f"--{name.replace('_', '-')}"


def _add_option(group: argparse._ArgumentGroup, option: Option) -> None:
    flags = (flag_of(option.name), *ALIASES.get(option.name, ()))
    common: dict[str, Any] = {
        "dest": f"{PREFIX}{option.name}",
        "default": argparse.SUPPRESS,
        "help": option.described.replace("%", "%%"),
    }
    if option.domain.form == "table":
        group.add_argument(*flags, action="append", metavar=TABLES[option.name][1], **common)
    elif option.domain.form == "switch":
        group.add_argument(*flags, action=argparse.BooleanOptionalAction, **common)
    else:
        metavar = METAVARS_BY_NAME.get(option.name, METAVARS[option.domain.form])
        group.add_argument(*flags, type=reader(option.domain), metavar=metavar, **common)


def add_environment(parser: argparse.ArgumentParser, without: Sequence[str] = ()) -> None:
    """Add ID and the flags for all options of an environment."""
    if "env" not in without:
        parser.add_argument(
            "id",
            nargs="?",
            metavar="ID",
            default=argparse.SUPPRESS,
            help="an environment id ('jaxenstein list' shows all) or MODULE:NAME",
        )
    add_options(parser, environment_options(), (*without, "env"))


OF_FILES, OWN = "FILE.npz or pretrained/NAME", "MODULE:FUNCTION"


def add_agent(parser: argparse._ActionsContainer) -> None:
    """Add --run and --greedy, which choose an agent in a run directory and how it acts."""
    add_run(parser)
    flag(parser, "--greedy", "take the most likely actions (default: sample them)")


def add_run(parser: argparse._ActionsContainer) -> None:
    """Add --run."""
    help = "number of the run to use, from 0 (default: the best run)"
    flag(parser, "--run N", help, whole(0), dest="number")


def add_seed(parser: argparse._ActionsContainer) -> None:
    """Add --seed."""
    help = "seed of all random choices; the same seed gives the same result"
    flag(parser, "--seed S", help, whole(0, 2**32 - 1), 0)


def add_suite(parser: argparse._ActionsContainer, help: str) -> None:
    """Add --suite, with an optional value."""
    parser.add_argument(
        "--suite",
        nargs="?",
        const="small",
        type=_suite,
        metavar=f"{{{','.join(SUITES)}}}",
        help=f"{help}: small (default; for a CPU) or large (for a GPU or TPU)",
    )


def _suite(text: str) -> str:
    """An argument type: the name of a suite."""
    if text in SUITES:
        return text
    raise argparse.ArgumentTypeError(
        f"must be {' or '.join(SUITES)}, not {quoted(text)}; files and folders go before --suite"
    )


def add_tasks(parser: argparse._ActionsContainer) -> None:
    """Add --tasks, which goes with --suite."""
    parser.add_argument(
        "--tasks", nargs="+", metavar="ID", help="with --suite: only these tasks (default: all)"
    )
