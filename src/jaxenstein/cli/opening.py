"""Turns parsed arguments into options, environments and trainings, and prints warnings."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import importlib
import json
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from ..errors import (
    DivergenceWarning,
    LevelWarning,
    MapWarning,
    SettingError,
    concise,
    one_line,
    quoted,
)
from ..files import atomic
from ..maps.map_files import read_map
from ..params import drawn, ranges_of
from ..registry import import_fault
from ..settings import changed, checked, merge, spec_from
from ..spec import Spec
from ..tasks.first_person import FirstPerson
from .arguments import PREFIX, TABLES, Parser, UsageError, add_options, flag, plain_value
from .compile_cache import forget

IMPORT = "--import"
"""The flag that names a module with the user's own tasks or bonuses."""


def given_options(options: argparse.Namespace) -> dict[str, Any]:
    """The options that the user gave, by name."""
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
    """Split NAME=VALUE; the value is a number, true, false, a list or a text."""
    flag, metavar = TABLES[option]
    name, equals, value = text.partition("=")
    if not equals or not name or not value:
        raise UsageError(f"jaxenstein: {flag} must be {metavar}, not {quoted(text)}")
    if option == "params" and ":" in value:
        return name.replace("-", "_"), [plain_value(end) for end in value.split(":")]
    values = plain_value(value)
    if option == "grid" and not isinstance(values, list):
        values = [values]
    return name.replace("-", "_"), values


def open_environment(
    given: Mapping[str, Any],
    instead_of: Spec | None = None,
    *,
    ranges: bool = False,
    seen: bool = True,
) -> tuple[FirstPerson[Any, Any], Any, str]:
    """Build an environment without automatic resets, and print warnings about its map.

    Args:
        given: options from `given_options`.
        instead_of: supplies the options that are not in `given`.
        ranges: whether params may be ranges; `drawn_by` then draws from them.
        seen: whether its pictures are needed.

    Returns:
        The environment, its params, and a name for files.

    Raises:
        UsageError: neither an ID nor a map is given, or the environment has no pictures.
        JAXensteinError: the environment cannot be built.
    """
    spec, name = open_spec(given, instead_of, ranges=ranges)
    env, params = spec.build()
    if seen and not isinstance(env, FirstPerson):
        raise UsageError(f"jaxenstein: {name} has no pictures: it is not a first-person task")
    return cast("FirstPerson[Any, Any]", env), params, name


def open_spec(
    given: Mapping[str, Any], instead_of: Spec | None = None, *, ranges: bool = False
) -> tuple[Spec, str]:
    """The spec of the environment of `open_environment`, and its name for files."""
    named = len({"env", "map_file"} & set(given))
    if named == 2 or (named == 0 and instead_of is None):
        raise UsageError("jaxenstein: give either the ID of an environment or --map-file FILE")
    name = (
        Path(given["map_file"]).stem
        if "map_file" in given
        else given.get("env", "").rpartition(":")[2]
    )
    with printing_warnings():
        options = with_map(given)
        spec = changed(instead_of, options) if instead_of else spec_from(options)
    for param, range in spec.ranges.items() if not ranges else ():
        raise UsageError(
            f"jaxenstein: --param {param} must be one number in this command, not the range {range}"
        )
    return spec, name


def drawn_by(params: Any, seed: int) -> Any:
    """The params of one episode; prints the numbers that it draws from ranges."""
    numbers = drawn(params, seed)
    for name, range in ranges_of(params).items():
        print(f"{name} {float(getattr(numbers, name)):.4g}, drawn from {range} by --seed {seed}")
    return numbers


@contextlib.contextmanager
def handling(names: Iterable[str], handler: Callable[[int, object], None]) -> Iterator[None]:
    """Install a handler for these signals, if the system has them; restore the old ones after.

    Signals that the process ignores, as under `nohup`, stay ignored. Only the main thread can
    handle signals, so this does nothing in other threads.
    """
    main = threading.current_thread() is threading.main_thread()
    numbers = [getattr(signal, name) for name in names if main and hasattr(signal, name)]
    heard = [number for number in numbers if signal.getsignal(number) != signal.SIG_IGN]
    before = {number: signal.signal(number, handler) for number in heard}
    try:
        yield
    finally:
        for number, old in before.items():
            signal.signal(number, old)


@contextlib.contextmanager
def printing_warnings() -> Iterator[None]:
    """Print warnings about maps, levels and agents at the end, each once and on one line."""
    caught: list[warnings.WarningMessage] = []
    try:
        with warnings.catch_warnings(record=True) as caught:
            for kind in (MapWarning, LevelWarning, DivergenceWarning):
                warnings.simplefilter("always", kind)
            yield
    finally:
        # An error may follow from what a warning says.
        for text in dict.fromkeys(str(warning.message) for warning in caught):
            print_warning(text)


@contextlib.contextmanager
def plain_warnings() -> Iterator[None]:
    """Print every other `UserWarning` as one line, without its place in the code."""
    with warnings.catch_warnings():
        others = warnings.showwarning

        def show(message: Any, category: type[Warning], *place: Any, **more: Any) -> None:
            if issubclass(category, UserWarning):
                print_warning(str(message))
            else:
                others(message, category, *place, **more)

        warnings.showwarning = show
        yield


@contextlib.contextmanager
def written_anyway(path: Path | None, write: Callable[[Path], object]) -> Iterator[None]:
    """Write a file, if a path is given, after a block that prints its content.

    The file is written even if printing fails.
    """
    try:
        yield
    finally:
        if path is not None:
            write(path)
    if path is not None:
        print(f"wrote {path}")


def write_json(path: Path, plain: object) -> None:
    """Write plain values as JSON; the file is complete or absent.

    Raises:
        OutputError: the file cannot be written.
    """
    with atomic(path) as temporary:
        temporary.write_text(json.dumps(plain, indent=2) + "\n", encoding="utf-8")


def print_warning(warning: str) -> None:
    """Print a warning as one line on standard error, unless `forget` takes it."""
    if not forget(warning):
        print(f"jaxenstein: warning: {concise(one_line(warning))}", file=sys.stderr)


def with_map(given: Mapping[str, Any], folder: Path = Path()) -> dict[str, Any]:
    """Replace the option `map_file` by the texts of that file; paths are relative to `folder`."""
    given = dict(given)
    if given.get("textures"):
        given["textures"] = str(folder / given["textures"])
    if "map_file" in given:
        texts = read_map(Path(given.pop("map_file")), folder)
        texts["map"] = texts.pop("text")
        for name in texts:
            if name in given:
                raise SettingError(f"give either {name} or map_file, which sets {name}, not both")
        given |= texts
    return given


def named_modules(arguments: Sequence[str]) -> list[str]:
    """The modules that `--import` names in the arguments of any command."""
    found = []
    for place, word in enumerate(arguments):
        flag, equals, name = word.partition("=")
        if flag == IMPORT:
            found += [name] if equals else arguments[place + 1 : place + 2]
    return found


def import_modules(names: Sequence[str]) -> None:
    """Import modules with the user's own tasks or bonuses; the current folder is searched last.

    Raises:
        UsageError: a module does not exist.
    """
    if names and os.getcwd() not in sys.path:
        # Last, so that files in the folder cannot shadow a library.
        sys.path.append(os.getcwd())
    for name in names:
        if fault := import_fault(name):
            raise UsageError(f"jaxenstein: {fault}")


def import_module_of(id: str | None) -> None:
    """Import the module of an id such as my_module:my-task; do nothing for other ids."""
    module, colon, _ = (id or "").rpartition(":")
    import_modules([module] * bool(colon))


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


def add_config(parser: argparse._ActionsContainer) -> None:
    """Add --config."""
    help = "a .toml or .yaml file with options, or a config from 'jaxenstein list --configs'"
    flag(parser, "--config FILE", help, Path)


def add_training_options(
    parser: Parser, without: Sequence[str] = (), seeds: int | None = None
) -> None:
    """Add a flag for every option of a training not in `without`; `seeds` is another default."""
    options = dict(baselines("options").all_options())
    if seeds is not None:
        options["seeds"] = dataclasses.replace(options["seeds"], default=seeds)
    add_options(parser, options, without)


def named(given: dict[str, Any], command: str) -> dict[str, Any]:
    """Return the options of a command if they name an environment or a map.

    Raises:
        UsageError: they name neither.
    """
    if not {"env", "map", "map_file"} & set(given):
        raise UsageError(
            f"jaxenstein {command}: give an environment with --env ID ('jaxenstein list' shows "
            "all ids) or a map with --map-file FILE"
        )
    return given


def check_effect(options: argparse.Namespace, algos: Sequence[str]) -> None:
    """Raise a `SettingError` if a flag of a training has no effect on these algorithms.

    A config file may have options of several algorithms.
    """
    baselines("options").check_effect(given_options(options), algos)


def given_training(options: argparse.Namespace) -> dict[str, Any]:
    """The options of the config file, overridden by the flags."""
    parsing = baselines("options")
    file: dict[str, Any] = {}
    if options.config is not None:
        path = baselines("configs").find_config(options.config)
        file = with_map(parsing.read_file(path), path.parent)
    flags = checked(given_options(options), parsing.all_options())
    return merge(file, with_map(flags))
