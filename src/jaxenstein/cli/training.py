"""The options of the baselines as flags, from files, and together; their modules on demand."""

from __future__ import annotations

import argparse
import contextlib
import importlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..maps.map_files import read_map
from .arguments import Parser, UsageError, heading, import_module_of

if TYPE_CHECKING:
    from ..baselines.runs.options import Option

# Flags of options that are tables: their flag, and what one entry looks like.
TABLES = {
    "settings": ("--set", "NAME=VALUE"),
    "params": ("--param", "NAME=VALUE"),
    "grid": ("--grid", "NAME=V,V"),
}


def baselines(module: str) -> Any:
    """A module of `jaxenstein.baselines.runs`.

    Raises:
        UsageError: the extra is not installed.
    """
    hint = "pip install 'jaxenstein[baselines]'"
    try:
        return importlib.import_module(f"jaxenstein.baselines.runs.{module}")
    except ImportError as error:
        text = str(error)
        if hint not in text and not isinstance(error, ModuleNotFoundError):
            raise
        raise UsageError(f"jaxenstein: {text if hint in text else f'{text}: {hint}'}") from error


def add_options(parser: Parser, without: Sequence[str] = ()) -> None:
    """Add a flag for every option of the baselines, but for those named."""
    options = baselines("options")
    groups: dict[str, Any] = {}
    for option in options.all_options().values():
        if option.name in without or option.name == "map":
            continue
        group = groups.setdefault(option.group, parser.add_argument_group(option.group))
        _add_option(group, option)


def _add_option(group: Any, option: Option) -> None:
    flag = f"--{option.name.replace('_', '-')}"
    default = f"{option.default:g}" if isinstance(option.default, float) else option.default
    shown = "" if default is None else f" (default {default})"
    common: dict[str, Any] = {
        "dest": f"option_{option.name}",
        "default": argparse.SUPPRESS,
        "help": (option.help + shown).replace("%", "%%"),
    }
    if option.kind == "table":
        flag, metavar = TABLES[option.name]
        group.add_argument(flag, action="append", metavar=metavar, **common)
    elif option.kind == "flag":
        group.add_argument(flag, action=argparse.BooleanOptionalAction, **common)
    elif option.kind == "choice":
        group.add_argument(flag, choices=option.choices, metavar="NAME", **common)
    else:
        kinds: dict[str, tuple[Callable[[str], Any], str]] = {
            "count": (count, "N"),
            "number": (number, "X"),
            "layers": (layers, "KxSxF,..."),
            "angle": (heading, "DEGREES"),
            "text": (str, "TEXT"),
        }
        convert, metavar = kinds[option.kind]
        group.add_argument(flag, type=convert, metavar=metavar, **common)


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


def given_options(options: argparse.Namespace) -> dict[str, Any]:
    """The options of the file and of the flags together."""
    parsing = baselines("options")
    file: dict[str, Any] = {}
    if options.config is not None:
        file = parsing.read_file(options.config)
        if "map_file" in file:
            file["map_file"] = str(options.config.parent / file["map_file"])
    flags = {
        name.removeprefix("option_"): value
        for name, value in vars(options).items()
        if name.startswith("option_")
    }
    for name in TABLES:
        if name in flags:
            flags[name] = dict(_entry(name, text) for text in flags[name])
    import_module_of(flags.get("env"))
    given = parsing.merge(file, parsing.check(flags))
    if "map_file" in given:
        texts = read_map(Path(given.pop("map_file")))
        given |= {"map" if name == "text" else name: text for name, text in texts.items()}
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
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        with contextlib.suppress(ValueError):
            return kind(text)
    return text
