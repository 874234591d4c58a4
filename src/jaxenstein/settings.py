"""What can be set of an environment, for flags and files alike, and the spec that it makes."""

from __future__ import annotations

import dataclasses
import functools
import math
import sys
import typing
from collections.abc import Iterable, Mapping
from typing import Any, Literal

from . import registry
from .docstrings import attributes
from .errors import SettingError, nearest
from .spec import Spec, as_tuples
from .tasks.first_person import SEEN, SETTINGS, FirstPerson

Kind = Literal["count", "number", "flag", "choice", "layers", "angle", "text", "table", "seeds"]

KINDS: dict[Kind, str] = {
    "count": "a whole number",
    "number": "a number",
    "flag": "true or false",
    "choice": "a word",
    "text": "a text",
    "layers": "a list of [kernel, stride, features]",
    "table": "a table of names with values",
    "angle": "a number or two, in degrees",
    "seeds": "two whole numbers, the first seed and the one past the last",
}
# Texts that come with a map, in files of their own beside it.
MAP_TEXTS = ("regions", "faces")
# What names an environment.
PLACES = ("env", "map", "map_file", "heading", *MAP_TEXTS)


@dataclasses.dataclass(frozen=True)
class Option:
    """One thing that may be set.

    Attributes:
        name: as in a file; the flag has hyphens for underscores.
        group: what it belongs to, for the help.
        kind: what its values are.
        default: its value if nothing is said.
        help: what it does.
        choices: the values there are, if they are few.
    """

    name: str
    group: str
    kind: Kind
    default: Any
    help: str
    choices: tuple[str, ...] = ()


def options_of(
    cls: type, group: str, names: Iterable[str] | None = None, kind: Kind | None = None
) -> list[Option]:
    """The options that the fields of a dataclass are, or those of the names, of a kind if given."""
    helps, hints = attributes(cls), typing.get_type_hints(cls)
    fields = {field.name: field for field in dataclasses.fields(cls)}
    found = []
    for name in fields if names is None else names:
        found_kind, choices = (kind, ()) if kind else _kind(hints[name])
        text = helps.get(name, "(python -OO strips the explanation)")
        text = text.replace("`", "").rstrip(".")
        found.append(Option(name, group, found_kind, fields[name].default, text, choices))
    return found


def _kind(hint: Any) -> tuple[Kind, tuple[str, ...]]:
    if typing.get_origin(hint) is Literal:
        return "choice", typing.get_args(hint)
    kinds: dict[Any, Kind] = {bool: "flag", int: "count", float: "number", str: "text"}
    kinds[tuple[int, int] | range | None] = "seeds"
    return kinds.get(hint, "layers"), ()


@functools.cache
def environment_options() -> dict[str, Option]:
    """Every option that says which environment there is, and how it is seen."""
    place, view = "environment", "what the agent sees"
    options = (
        Option("env", place, "text", None, "id of the environment, see 'jaxenstein list'"),
        Option("map", place, "text", None, "a map as text, instead of env"),
        Option(
            "map_file",
            place,
            "text",
            None,
            "a file with a map, instead of an id, or samples/NAME; 'jaxenstein list' explains with "
            "--symbols the symbols, and prints with --samples those maps",
        ),
        Option(
            "heading",
            place,
            "angle",
            None,
            "first heading on that map in degrees, 0 east, 90 south, or LOW,HIGH (default: any)",
        ),
        Option("horizon", place, "count", None, "most steps of an episode"),
        Option("settings", place, "table", None, "any other setting of jaxenstein.make"),
        Option("params", place, "table", None, "any number of the environment's params"),
        *options_of(FirstPerson, view, SEEN),
    )
    return {option.name: option for option in options}


def check(given: Mapping[str, Any], known: Mapping[str, Option]) -> dict[str, Any]:
    """Check names and kinds of options; whole numbers may be written as 3e6.

    Raises:
        SettingError: there is no such option, or its value is of another kind.
    """
    checked = {}
    for name, value in given.items():
        if name in MAP_TEXTS:
            checked[name] = value
        elif name not in known:
            raise SettingError(f"unknown option {name!r}{nearest(name, known)}")
        else:
            checked[name] = coerce(known[name], value)
    return checked


def coerce(option: Option, value: Any) -> Any:
    """A value of an option from a file, as its kind.

    Raises:
        SettingError: it is of another kind.
    """
    name, kind = option.name, option.kind
    # A whole number may be too large for a float.
    whole = isinstance(value, int) and not isinstance(value, bool)
    number = isinstance(value, float) or (whole and abs(value) <= sys.float_info.max)
    if kind == "count" and number and math.isfinite(value) and value == int(value):
        return int(value)
    if kind == "number" and number:
        return float(value)
    table = isinstance(value, dict) and all(isinstance(key, str) for key in value)
    if (kind == "flag" and isinstance(value, bool)) or (kind == "table" and table):
        return value
    if kind in ("text", "choice") and isinstance(value, str):
        if kind == "choice" and value not in option.choices:
            close = nearest(value, option.choices)
            known = ", ".join(map(repr, option.choices))
            raise SettingError(f"{name} must be one of {known}, not {value!r}{close}")
        return value
    listed = isinstance(value, list | tuple)
    if kind == "layers" and listed and all(isinstance(layer, list | tuple) for layer in value):
        return as_tuples(value)
    if kind == "seeds" and listed and len(value) == 2:
        return as_tuples(value)
    if kind == "angle" and (number or (listed and len(value) == 2)):
        return as_tuples(value)
    raise SettingError(f"{name} must be {KINDS[kind]}, not {value!r}")


def merge(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Options with others on top, such as those of a file with those of flags.

    Tables are merged; an environment named above replaces the one below.
    """
    gone = PLACES if any(name in above for name in PLACES) else ()
    merged: dict[str, Any] = {name: value for name, value in below.items() if name not in gone}
    for name, value in above.items():
        before = merged.get(name)
        if isinstance(value, dict) and isinstance(before, dict):
            merged[name] = {**before, **value}
        else:
            merged[name] = value
    return merged


def changed(spec: Spec, given: Mapping[str, Any]) -> Spec:
    """A spec with some options changed; another environment is seen as the one before was.

    Raises:
        JAXensteinError: it cannot be built.
    """
    before = given_by(spec)
    if any(name in given for name in PLACES):
        before = {name: value for name, value in before.items() if name in SETTINGS}
    merged = merge(before, given)
    # Seeds and range of a look go with it.
    asked = {**given, **(given.get("settings") or {})}
    if asked.get("look", "random") != "random":
        for table in (merged, merged.get("settings") or {}):
            for name in {"look_seeds", "look_range"} - set(asked):
                table.pop(name, None)
    return spec_from(merged)


def spec_from(given: Mapping[str, Any]) -> Spec:
    """How to build the environment that the options name.

    Raises:
        JAXensteinError: it cannot be built, or no environment is named.
    """
    if ("env" in given) == ("map" in given):
        raise SettingError("give either env or a map, not both")
    if "heading" in given and "map" not in given:
        raise SettingError("heading goes with a map (--map-file); an env has headings of its own")
    settings = {name: given[name] for name in SEEN if name in given}
    settings |= {name: as_tuples(v) for name, v in (given.get("settings") or {}).items()}
    params = dict(given.get("params") or {})
    if "horizon" in given:
        if given["horizon"] < 1:
            raise SettingError(f"horizon must be a whole number from 1, not {given['horizon']}")
        params["max_steps_in_episode"] = given["horizon"]
    if "map" in given:
        settings |= {name: given[name] for name in (*MAP_TEXTS, "heading") if name in given}
        settings["text"] = given["map"]
    spec = Spec(given.get("env"), 0, settings, {})
    env, defaults = spec.build(warn=True)
    _check_params(params, env, defaults)
    spec = dataclasses.replace(spec, params=params, version=env.version)
    spec.build()
    # An id may have been an alias, or known to this process alone.
    id = None if spec.id is None else registry.portable_id(spec.id)
    return dataclasses.replace(spec, id=id)


def _check_params(params: Mapping[str, Any], env: Any, defaults: Any) -> None:
    """Tell params that there are not, settings among them."""
    numbers = [field.name for field in dataclasses.fields(defaults)]
    settings = {field.name for field in dataclasses.fields(env)}
    for name, value in params.items():
        if name not in numbers and name in settings:
            raise SettingError(
                f"{name!r} is a setting, not a param: --set {name}={value}, or 'settings' of a file"
            )
        if name not in numbers:
            raise SettingError(
                f"unknown param {name!r}{nearest(name, numbers)}; known: {', '.join(numbers)}"
            )


def given_by(spec: Spec) -> dict[str, Any]:
    """The options that `spec_from` makes a spec of."""
    settings = dict(spec.settings)
    given: dict[str, Any] = {"env": spec.id}
    if spec.id is None:
        given = {"map": settings.pop("text")}
    for name in ("heading", *MAP_TEXTS, *SETTINGS):
        if settings.get(name) is not None:
            given[name] = settings.pop(name)
    return given | {"settings": settings, "params": dict(spec.params)}
