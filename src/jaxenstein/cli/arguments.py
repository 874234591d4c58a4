"""What the commands share: the parser, kinds of arguments, and making an environment from them."""

from __future__ import annotations

import argparse
import importlib
import math
import os
import sys
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, cast

from ..errors import MapWarning, nearest

if TYPE_CHECKING:
    from ..tasks.first_person import FirstPerson

OBSERVATIONS = ("rgb", "gray", "depth", "labels", "dict")


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


def add_environment(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that say which environment, and how it is seen."""
    parser.add_argument(
        "id", nargs="?", metavar="ID", help="an environment, see 'jaxenstein list', or MODULE:NAME"
    )
    parser.add_argument(
        "--map-file",
        metavar="FILE",
        type=Path,
        help="a map as text instead of ID; 'jaxenstein list --symbols' explains the symbols",
    )
    parser.add_argument(
        "--heading",
        metavar="DEGREES",
        type=heading,
        help="first heading on the map of --map-file, 0 east, 90 south; --heading=-45,45 draws it "
        "between the two (default: any)",
    )
    view = parser.add_argument_group("what the agent sees")
    view.add_argument(
        "--height",
        type=whole(1, 4096),
        default=64,
        metavar="PX",
        help="image height in pixels (default %(default)s)",
    )
    view.add_argument(
        "--width",
        type=whole(1, 4096),
        default=64,
        metavar="PX",
        help="image width in pixels (default %(default)s)",
    )
    view.add_argument(
        "--fov",
        type=real(30, 120),
        metavar="DEGREES",
        help="horizontal field of view, 30 to 120 (default: the environment's own, mostly 60)",
    )
    view.add_argument(
        "--observation",
        choices=OBSERVATIONS,
        default="rgb",
        metavar="KIND",
        help=f"one of {', '.join(OBSERVATIONS)} (default %(default)s)",
    )
    add_frame_skip(view)


def add_frame_skip(parser: argparse._ActionsContainer) -> None:
    """Add --frame-skip."""
    parser.add_argument(
        "--frame-skip",
        type=whole(1, 64),
        default=1,
        metavar="N",
        help="take each action for N steps of the world, and draw the last (default %(default)s)",
    )


def add_seed(parser: argparse.ArgumentParser) -> None:
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
    options: argparse.Namespace, **settings: Any
) -> tuple[FirstPerson[Any, Any], Any, str]:
    """The environment that the arguments name, its default params, and a name for files.

    Warnings about the map are printed, one line each.
    """
    import jaxenstein

    from ..maps.map_files import read_map

    if (options.id is None) == (options.map_file is None):
        raise UsageError("jaxenstein: give either the ID of an environment or --map-file FILE")
    settings = {
        "height": options.height,
        "width": options.width,
        "observation": options.observation,
        "frame_skip": options.frame_skip,
        **({} if options.fov is None else {"field_of_view": options.fov}),
        **settings,
    }
    if options.heading is not None and options.map_file is None:
        raise UsageError(
            "jaxenstein: --heading goes with --map-file; an ID has headings of its own"
        )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", MapWarning)
        if options.map_file is None:
            import_module_of(options.id)
            made, params = jaxenstein.make(options.id, **settings)
            env = cast("FirstPerson[Any, Any]", made)
            name = options.id.rpartition(":")[2]
        else:
            texts = read_map(options.map_file)
            env, params = jaxenstein.from_ascii(**texts, heading=options.heading, **settings)
            name = options.map_file.stem
    for warning in caught:
        print(f"jaxenstein: warning: {' '.join(str(warning.message).split())}", file=sys.stderr)
    return env, params, name


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
