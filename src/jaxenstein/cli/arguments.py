"""What the commands share: the parser, kinds of arguments, and making an environment from them."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NoReturn

from ..errors import nearest

if TYPE_CHECKING:
    from ..settings import Option


class UsageError(Exception):
    """Wrong arguments; the message is one line."""


class Parser(argparse.ArgumentParser):
    """An argument parser that reports mistakes as `UsageError` and keeps the layout of texts."""

    def __init__(self, *, fill: Callable[[Parser], None] | None = None, **kwargs: Any) -> None:
        """Build.

        Args:
            fill: adds the arguments when they are needed, for a command whose arguments take
                long to find out.
            **kwargs: those of `argparse.ArgumentParser`.
        """
        kwargs.setdefault("formatter_class", argparse.RawDescriptionHelpFormatter)
        super().__init__(allow_abbrev=False, **kwargs)
        self._fill = fill

    def parse_known_args(  # type: ignore[override]
        self, args: Any = None, namespace: Any = None
    ) -> Any:
        """Parse; the nearest flag is named for one that there is not."""
        self._filled()
        known, unknown = super().parse_known_args(args, namespace)
        for word in unknown:
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


def whole(least: int = 1, most: int | None = None) -> Callable[[str], int]:
    """An argument type: a whole number of at least `least` and at most `most`."""

    def convert(text: str) -> int:
        try:
            number = int(text)
        except ValueError:
            number = None
        if number is None or number < least or (most is not None and number > most):
            bounds = f"at least {least}" if most is None else f"from {least} to {most}"
            raise argparse.ArgumentTypeError(f"must be a whole number {bounds}, not {text!r}")
        return number

    return convert


def real(least: float, most: float) -> Callable[[str], float]:
    """An argument type: a number from `least` to `most`."""

    def convert(text: str) -> float:
        try:
            number = float(text)
        except ValueError:
            number = float("nan")
        if not least <= number <= most:
            raise argparse.ArgumentTypeError(
                f"must be a number from {least:g} to {most:g}, not {text!r}"
            )
        return number

    return convert


def size(text: str) -> tuple[int, int]:
    """An argument type: WIDTHxHEIGHT in pixels, such as 160x120, as (height, width)."""
    parts = text.lower().split("x")
    if len(parts) == 2 and all(part.isdecimal() and 0 < int(part) <= 4096 for part in parts):
        return int(parts[1]), int(parts[0])
    raise argparse.ArgumentTypeError(f"must be WIDTHxHEIGHT in pixels like 64x64, not {text!r}")


def heading(text: str) -> float | tuple[float, float]:
    """An argument type: DEGREES, or LOW,HIGH with LOW no larger than HIGH."""
    try:
        parts = [float(part) for part in text.split(",")]
    except ValueError:
        parts = []
    if len(parts) == 1 and math.isfinite(parts[0]):
        return parts[0]
    if len(parts) == 2 and -math.inf < parts[0] <= parts[1] < math.inf:
        return parts[0], parts[1]
    raise argparse.ArgumentTypeError(f"must be DEGREES, or LOW,HIGH like -45,45, not {text!r}")


def count(text: str) -> int:
    """An argument type: a whole number, also as 3e6 or 3_000_000."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if value != value or abs(value) >= 2**53 or value != int(value):
        raise argparse.ArgumentTypeError(f"must be a whole number, not {text!r}")
    return int(value)


def number(text: str) -> float:
    """An argument type: a number; its range is checked with the others."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a number, not {text!r}") from None


def layers(text: str) -> list[list[int]]:
    """An argument type: convolutions like 8x4x32,4x2x64, kernel, stride and features of each."""
    parts = [part.split("x") for part in text.lower().split(",")]
    if not all(len(part) == 3 and all(n.isdecimal() for n in part) for part in parts):
        raise argparse.ArgumentTypeError(
            f"must be KERNELxSTRIDExFEATURES of each layer, like 8x4x32,4x2x64, not {text!r}"
        )
    return [[int(n) for n in part] for part in parts]


def seeds(text: str) -> tuple[int, int]:
    """An argument type: FIRST,STOP, two whole numbers."""
    parts = text.split(",")
    if len(parts) == 2 and all(part.strip().isdecimal() for part in parts):
        return int(parts[0]), int(parts[1])
    raise argparse.ArgumentTypeError(f"must be FIRST,STOP like 0,200, not {text!r}")


# How arguments of each kind are read, and what the help calls them.
CONVERT: dict[str, tuple[Callable[[str], Any], str]] = {
    "count": (count, "N"),
    "number": (number, "X"),
    "layers": (layers, "KxSxF,..."),
    "angle": (heading, "DEGREES"),
    "text": (str, "TEXT"),
    "seeds": (seeds, "FIRST,STOP"),
}
# Flags of options that are tables, and what one entry looks like; other names of others.
TABLES = {
    "settings": ("--set", "NAME=VALUE"),
    "params": ("--param", "NAME=VALUE"),
    "grid": ("--grid", "NAME=V,V"),
}
ALIASES = {"field_of_view": ("--fov",)}
# Where the parsed arguments keep the options that were given.
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
        parser: where.
        words: the flag, and the word that its value has in the help.
        help: what it does, to which the default is added.
        convert: what makes the value of its text; None for a switch.
        default: its value if it is not given.
        **more: as of `argparse`.
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
    """Add a flag for every option, but for those named; one that is not given leaves no trace."""
    groups: dict[str, argparse._ArgumentGroup] = {}
    for option in options.values():
        # A map as text is for files.
        if option.name not in (*without, "map"):
            if option.group not in groups:
                groups[option.group] = parser.add_argument_group(option.group)
            _add_option(groups[option.group], option)


def _add_option(group: argparse._ArgumentGroup, option: Option) -> None:
    flags = (f"--{option.name.replace('_', '-')}", *ALIASES.get(option.name, ()))
    default = f"{option.default:g}" if isinstance(option.default, float) else option.default
    shown = "" if default is None else f" (default {default})"
    common: dict[str, Any] = {
        "dest": f"{PREFIX}{option.name}",
        "default": argparse.SUPPRESS,
        "help": (option.help + shown).replace("%", "%%"),
    }
    if option.kind == "table":
        flag, metavar = TABLES[option.name]
        group.add_argument(flag, action="append", metavar=metavar, **common)
    elif option.kind == "flag":
        group.add_argument(*flags, action=argparse.BooleanOptionalAction, **common)
    elif option.kind == "choice":
        group.add_argument(*flags, choices=option.choices, metavar="NAME", **common)
    else:
        convert, metavar = CONVERT[option.kind]
        group.add_argument(*flags, type=convert, metavar=metavar, **common)


def add_environment(parser: argparse.ArgumentParser, without: Sequence[str] = ()) -> None:
    """Add ID, and the flags of everything that can be set of an environment."""
    from ..settings import environment_options

    if "env" not in without:
        parser.add_argument(
            "id",
            nargs="?",
            metavar="ID",
            default=argparse.SUPPRESS,
            help="an environment, see 'jaxenstein list', or MODULE:NAME",
        )
    add_options(parser, environment_options(), (*without, "env"))


OF_FILES = "FILE.npz or pretrained/NAME"


def add_agent(parser: argparse._ActionsContainer) -> None:
    """Add --run and --greedy, for an agent of a run directory."""
    add_run(parser)
    flag(parser, "--greedy", "the agent takes its most likely actions (default: drawn ones)")


def add_run(parser: argparse._ActionsContainer) -> None:
    """Add --run."""
    help = "which run of the directory acts, from 0 (default: the best one)"
    flag(parser, "--run N", help, whole(0), dest="number")


def add_seed(parser: argparse._ActionsContainer) -> None:
    """Add --seed."""
    help = "seed of all random choices; the same seed gives the same result"
    flag(parser, "--seed S", help, whole(0, 2**32 - 1), 0)
