"""What the commands share: the parser, kinds of arguments, and making an environment from them."""

from __future__ import annotations

import argparse
import contextlib
import importlib
import math
import os
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, cast

from ..errors import MapWarning, nearest

if TYPE_CHECKING:
    from ..recipe import Recipe
    from ..settings import Option
    from ..tasks.first_person import FirstPerson


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
        for flag in unknown:
            close = nearest(flag.partition("=")[0], self._option_string_actions)
            if flag.startswith("--") and close:
                self.error(f"unrecognized argument: {flag}{close}")
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


# How arguments of each kind are read, and what the help calls them.
CONVERT: dict[str, tuple[Callable[[str], Any], str]] = {
    "count": (count, "N"),
    "number": (number, "X"),
    "layers": (layers, "KxSxF,..."),
    "angle": (heading, "DEGREES"),
    "text": (str, "TEXT"),
}
# Flags of options that are tables, and what one entry looks like; other names of others.
TABLES = {
    "settings": ("--set", "NAME=VALUE"),
    "params": ("--param", "NAME=VALUE"),
    "grid": ("--grid", "NAME=V,V"),
}
ALIASES = {
    "field_of_view": ("--fov",),
    "rnd_normalise_observations": ("--normalise-observations",),
}
# Where the parsed arguments keep the options that were given.
PREFIX = "option_"


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


def given_options(options: argparse.Namespace) -> dict[str, Any]:
    """The options that were given as arguments, by name; those of a map file are its texts."""
    given = {
        name.removeprefix(PREFIX): value
        for name, value in vars(options).items()
        if name.startswith(PREFIX)
    }
    if getattr(options, "id", None) is not None:
        given["env"] = options.id
    import_module_of(given.get("env"))
    for name in TABLES:
        if name in given:
            given[name] = dict(_entry(name, text) for text in given[name])
    return given


def _entry(option: str, text: str) -> tuple[str, Any]:
    """NAME and the value of NAME=VALUE, which is a number, true, false, a list or a text."""
    flag, metavar = TABLES[option]
    name, equals, value = text.partition("=")
    if not equals or not name or not value:
        raise UsageError(f"jaxenstein: {flag} must be {metavar}, not {text!r}")
    parts = [_value(part.strip()) for part in value.split(",")]
    return name.replace("-", "_"), parts if option == "grid" or len(parts) > 1 else parts[0]


def _value(text: str) -> Any:
    if text in ("true", "false", "none"):
        return {"true": True, "false": False, "none": None}[text]
    for kind in (int, float):
        with contextlib.suppress(ValueError):
            return kind(text)
    return text


def add_agent(parser: argparse._ActionsContainer) -> None:
    """Add --run and --greedy, for an agent of a run directory."""
    add_run(parser)
    parser.add_argument(
        "--greedy",
        action="store_true",
        help="the agent takes its most likely actions (default: drawn ones)",
    )


def add_run(parser: argparse._ActionsContainer) -> None:
    """Add --run."""
    parser.add_argument(
        "--run",
        dest="number",
        type=whole(0),
        metavar="N",
        help="which run of the directory acts, from 0 (default: the best one)",
    )


def add_seed(parser: argparse._ActionsContainer) -> None:
    """Add --seed."""
    parser.add_argument(
        "--seed",
        type=whole(0, 2**32 - 1),
        default=0,
        metavar="S",
        help="seed of all random choices; the same seed gives the same result "
        "(default %(default)s)",
    )


def open_environment(
    given: Mapping[str, Any], instead_of: Recipe | None = None
) -> tuple[FirstPerson[Any, Any], Any, str]:
    """An environment, without automatic resets; warnings about its map are printed.

    Args:
        given: as `given_options` returns it.
        instead_of: what is not given is as in this one.

    Returns:
        The environment, its params, and a name for files.

    Raises:
        UsageError: neither an ID nor a map is given.
        JAXensteinError: it cannot be built.
    """
    recipe, name = open_recipe(given, instead_of)
    env, params = recipe.build()
    return cast("FirstPerson[Any, Any]", env), params, name


def open_recipe(given: Mapping[str, Any], instead_of: Recipe | None = None) -> tuple[Recipe, str]:
    """How to build that environment, and the name for files."""
    from ..settings import changed, recipe_from

    named = len({"env", "map_file"} & set(given))
    if named == 2 or (named == 0 and instead_of is None):
        raise UsageError("jaxenstein: give either the ID of an environment or --map-file FILE")
    name = (
        Path(given["map_file"]).stem
        if "map_file" in given
        else given.get("env", "").rpartition(":")[2]
    )
    with telling_warnings():
        options = with_map(given)
        return (changed(instead_of, options) if instead_of else recipe_from(options)), name


@contextlib.contextmanager
def telling_warnings() -> Iterator[None]:
    """Print the warnings about maps, one line each."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", MapWarning)
        yield
    for warning in {str(warning.message): warning for warning in caught}.values():
        print(f"jaxenstein: warning: {' '.join(str(warning.message).split())}", file=sys.stderr)


def with_map(given: Mapping[str, Any], folder: Path = Path()) -> dict[str, Any]:
    """The options with the texts of a map file, which may be relative to a folder, for its name."""
    from ..maps.map_files import read_map

    given = dict(given)
    if "map_file" in given:
        texts = read_map(folder / given.pop("map_file"))
        given |= {"map" if name == "text" else name: text for name, text in texts.items()}
    return given


def import_modules(names: Iterable[str]) -> None:
    """Import modules of tasks of one's own, also from the current folder.

    Raises:
        UsageError: there is no such module.
    """
    if os.getcwd() not in sys.path:
        # At the end, so that nothing there takes the place of a library.
        sys.path.append(os.getcwd())
    for name in names:
        try:
            importlib.import_module(name)
        except ModuleNotFoundError as error:
            # A module that the named one asks for is missing: that is its own error.
            if not f"{name}.".startswith(f"{error.name}."):
                raise
            raise UsageError(f"jaxenstein: there is no module {error.name!r} to import") from error


def import_module_of(id: str | None) -> None:
    """Import the module of an ID such as my_module:my-task; of others there is none."""
    module, colon, _ = (id or "").rpartition(":")
    import_modules([module] * bool(colon and module))
