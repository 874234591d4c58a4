"""The registry of environment ids: look up an id, build its environment, register your own."""

from __future__ import annotations

import dataclasses
import functools
import importlib
import inspect
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from . import catalogue
from .catalogue import Build, Row
from .environment import AnyEnvironment, Environment
from .errors import JAXensteinError, SettingError, UnknownEnvironmentError, nearest, quoted
from .fields import is_whole, names_of
from .level_counts import check_levels

ENTRIES: dict[str, Row] = dict(catalogue.ENTRIES)
"""The environments by id: first those of the package, then those registered by other modules."""
ALIASES = catalogue.ALIASES

LISTENERS: list[Callable[[], None]] = []
"""Functions called after each registration."""

_ID = re.compile(r"[A-Za-z0-9]+(?:[-_.][A-Za-z0-9]+)*")
_VERSIONED = re.compile(r".*-v\d+")
_OF_GYMNASIUM = re.compile(r"jaxenstein/(.+)-v\d+")


def register(id: str, build: Build, *, summary: str = "", version: int = 0) -> None:
    """Give your own task an id, which `make`, every command and Gymnasium then accept.

    An id lasts as long as the process. In another process, put the name of the module that
    registers it in front: `make("my_module:my-task")`, `jaxenstein train --env my_module:my-task`
    and `gymnasium.make("my_module:jaxenstein/my-task-v0")` import the module first. A module may
    register an id again, so you can rerun a notebook cell.

    Args:
        id: letters, digits, and single "-", "_" or "." between them.
        build: a subclass of `Environment`, or a function that returns an environment. The names
            of its parameters are the settings of the id. In a function, `**settings` stands for
            the settings that all first-person environments take.
        summary: a one-line description. Default: the first line of the docstring of `build`.
        version: raise it when the behaviour of the task changes.

    Raises:
        SettingError: the id is malformed or taken, `build` cannot build an environment, or the
            version is not a whole number.
    """
    module = str(sys._getframe(1).f_globals.get("__name__", ""))
    if not isinstance(id, str) or not _ID.fullmatch(id) or _VERSIONED.fullmatch(id):
        raise SettingError(
            f"an id is letters, digits, and single '-', '_' or '.' between them, without a version "
            f"'-v0' at its end, not {quoted(id)}"
        )
    if not (_builds(build) if isinstance(build, type) else callable(build)):
        raise SettingError(
            "build must be a subclass of jaxenstein.Environment without abstract methods, or a "
            f"function that returns an environment, not {quoted(build)}"
        )
    if not is_whole(version) or version < 0:
        raise SettingError(f"version must be a whole number from 0, not {quoted(version)}")
    module = "" if module == "__main__" else module
    if id in ALIASES or id in catalogue.ENTRIES:
        raise SettingError(f"the id {quoted(id)} is taken by an environment of the package")
    if id in ENTRIES and ENTRIES[id].module != module:
        owner = f"the module {quoted(ENTRIES[id].module)}" if ENTRIES[id].module else "this program"
        raise SettingError(f"the id {quoted(id)} is already registered by {owner}")
    told = summary or _first_line(build)
    ENTRIES[id] = Row(id, "", build, told, version=int(version), module=module)
    for listener in LISTENERS:
        listener()


def environment_ids() -> tuple[str, ...]:
    """All ids that `make` knows.

    Examples:
        >>> environment_ids()[:3]
        ('simple', 'key-door', 't-maze')
    """
    return tuple(ENTRIES)


def make(id: str, **settings: Any) -> tuple[AnyEnvironment, Any]:
    """Build an environment.

    Args:
        id: one of `environment_ids()`, "module:id" or "module:Class". The last two import the
            module and use an id that it registers or a subclass of `Environment` that it defines.
        **settings: static settings. All first-person environments take `height`, `width`,
            `field_of_view`, `observation`, `autoreset`, `final_observation`, `frame_skip`,
            `sprite_layers`, `look`, `look_range`, `look_seeds` and `textures`; see
            `jaxenstein.tasks.first_person.FirstPerson` and `jaxenstein.Environment`. A task may
            have more, such as `hud` of health-gathering. Tasks that draw a level at each reset
            take `levels`, `split` and `test_fraction`.

    Returns:
        The environment and its default params. `params.replace(...)` changes their values.

    Raises:
        UnknownEnvironmentError: the id, module or class does not exist.
        SettingError: a setting does not exist, its value is out of range, or a side of the
            split has no levels.

    Warns:
        LevelWarning: without a split, `levels` covers a tenth of all levels or more.

    Examples:
        >>> env, params = make("my-way-home", width=84, height=84)
        >>> env.observation_space().shape, env.action_names
        ((84, 84, 3), ('turn left', 'turn right', 'forward', 'backward', 'interact'))
        >>> int(params.replace(max_steps_in_episode=500).max_steps_in_episode)
        500
        >>> make("my-way-hom")
        Traceback (most recent call last):
        jaxenstein.errors.UnknownEnvironmentError: unknown environment 'my-way-hom', did you...
    """
    import_module_of(id)
    env, params = make_with(id, settings)
    check_levels(env)
    return env, params


def make_with(id: Any, settings: Mapping[str, Any]) -> tuple[AnyEnvironment, Any]:
    """As `make`, for settings from a file, which may have any names, even `"id"`.

    Reading a file runs no code, so the module of "module:id" must already be imported. Does not
    check that each side of a split has levels.
    """
    name, row = find(id)
    check_settings(settings, row.settings, lambda: _param_names(row, settings))
    parameters = inspect.signature(row.build).parameters.values()
    needed = {one.name for one in parameters if one.default is one.empty} - {*settings}
    if missing := [one for one in row.settings if one in needed]:
        raise SettingError(f"{quoted(name)} needs the setting {', '.join(missing)}")
    env = row.build(**settings)
    if not isinstance(env, Environment):
        raise SettingError(f"{quoted(name)} must build an environment, not {quoted(env)}")
    env = dataclasses.replace(env, name=name, version=row.version)
    return env, env.check_params()


def import_module_of(id: Any) -> None:
    """Import the module of "module:id"; does nothing for a plain id.

    Raises:
        UnknownEnvironmentError: the module does not exist.
    """
    module, colon, _ = id.rpartition(":") if isinstance(id, str) else ("", "", "")
    if not colon:
        return
    if fault := import_fault(module):
        raise UnknownEnvironmentError(f"unknown environment {quoted(id)}: {fault}")


def import_fault(name: str) -> str:
    """Import a module of the user; returns "", or why there is no such module."""
    if not all(part.isidentifier() for part in name.split(".")):
        return f"{quoted(name)} is not the name of a module"
    try:
        importlib.import_module(name)
    except ModuleNotFoundError as error:
        # An import inside the module failed: let that error through.
        if not f"{name}.".startswith(f"{error.name}."):
            raise
        return f"there is no module {quoted(error.name)} to import"
    return ""


def find(id: Any) -> tuple[str, Row]:
    """The name and row of an id or alias.

    Raises:
        UnknownEnvironmentError: the id does not exist, or its module has not been imported.
    """
    module, colon, rest = id.rpartition(":") if isinstance(id, str) else ("", "", id)
    if colon and module not in sys.modules:
        raise UnknownEnvironmentError(
            f"the module of the environment {quoted(id)} has not been imported, and reading a file "
            f"runs no code: import {module} first, or on the command line add --import "
            f"{module}"
        )
    name = ALIASES.get(rest, rest) if isinstance(rest, str) else rest
    row = ENTRIES.get(name) if isinstance(name, str) else None
    # The module may register its ids in another one of its package.
    if row is not None and (not colon or row.module.split(".")[0] == module.split(".")[0]):
        return name, row
    if colon:
        return id, _row_of_class(id, sys.modules[module], rest)
    versioned = _OF_GYMNASIUM.fullmatch(id) if isinstance(id, str) else None
    if versioned and versioned[1] in {**ENTRIES, **ALIASES}:
        raise UnknownEnvironmentError(
            f"{quoted(id)} is an id of gymnasium.make; here it is {quoted(versioned[1])}"
        )
    if isinstance(id, str | Path) and (Path(id).suffix == ".txt" or len(Path(id).parts) > 1):
        raise UnknownEnvironmentError(
            f"unknown environment {quoted(str(id))}: to read a map from a file use "
            "jaxenstein.from_file, or --map-file on the command line"
        )
    close = nearest(str(id), [*ENTRIES, *ALIASES])
    some = "" if close else f"there are {', '.join(catalogue.MAIN_IDS[:6])} and others; "
    raise UnknownEnvironmentError(
        f"unknown environment {quoted(id)}{close}; {some}'jaxenstein list' shows all {len(ENTRIES)}"
    )


def portable_id(id: str) -> str:
    """The id by which another process finds the same environment, with its module if needed."""
    name, row = find(id)
    return f"{row.module}:{name}" if row.module and ":" not in name else name


def _row_of_class(id: str, module: ModuleType, name: str) -> Row:
    """The row for "module:Class"."""
    there = vars(module)
    if name not in there:
        classes = [key for key, value in there.items() if _builds(value)]
        own = [key for key, row in ENTRIES.items() if row.module == module.__name__]
        raise UnknownEnvironmentError(
            f"{module.__name__} has no environment and no class named "
            f"{quoted(name)}{nearest(name, [*own, *classes])}"
        )
    if not _builds(there[name]):
        raise UnknownEnvironmentError(
            f"{id} must be a concrete subclass of jaxenstein.Environment or a functools.partial of "
            f"one, not {quoted(there[name])}; use jaxenstein.register to give an id to a function "
            "that builds an environment"
        )
    build = there[name]
    summary, version = _first_line(build), _class_of(build).version
    return Row(name, "", build, summary, version=version, module=module.__name__)


def _class_of(build: Any) -> Any:
    """The class inside a `functools.partial`; other values unchanged."""
    return build.func if isinstance(build, functools.partial) else build


def _builds(value: Any) -> bool:
    """Whether a value is a concrete subclass of `Environment`, or a partial of one."""
    cls = _class_of(value)
    return isinstance(cls, type) and issubclass(cls, Environment) and not inspect.isabstract(cls)


def _first_line(build: Build) -> str:
    """The first line of the docstring of a class or function."""
    text = inspect.getdoc(_class_of(build)) or ""
    return text.partition("\n")[0].rstrip(".")


def check_settings(
    settings: Mapping[str, Any], known: Sequence[str], params: Callable[[], Sequence[str]]
) -> None:
    """Raise for an unknown setting; `params` returns the names of the params, for the message."""
    unknown = [name for name in settings if name not in known]
    if not unknown:
        return
    name, numbers = unknown[0], params()
    if name in numbers:
        raise SettingError(
            f"{quoted(name)} is a param, not a setting: use params.replace({name}=...) on the "
            f"params that make returns, --param {name}=... in a command"
        )
    near = nearest(name, known) or nearest(name, numbers).replace("you mean", "you mean the param")
    raise SettingError(f"unknown setting {quoted(name)}{near}; known: {', '.join(known)}")


def _param_names(row: Row, settings: Mapping[str, Any]) -> tuple[str, ...]:
    """The names of the params of a row's environment, or () if it cannot be built."""
    known = {name: value for name, value in settings.items() if name in row.settings}
    try:
        return names_of(type(row.build(**known).default_params))
    except (JAXensteinError, TypeError):
        return ()
