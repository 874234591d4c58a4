"""What can be set of an environment, for flags and files alike, and the spec that it makes."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping
from typing import Any

from . import registry
from .errors import SettingError, nearest, quoted
from .fields import Domain, Option, as_tuples, check_names, check_value, names_of, options_of
from .level_counts import check_levels
from .spec import Spec
from .tasks.first_person import SEEN, SETTINGS, FirstPerson
from .tasks.steering import HEADING

# Texts that come with a map, in files of their own beside it.
MAP_TEXTS = ("regions", "faces")
# What names an environment.
PLACES = ("env", "map", "map_file", "heading", *MAP_TEXTS)


@functools.cache
def environment_options() -> dict[str, Option]:
    """Every field that says which environment there is, and how it is seen."""
    text, table = Domain("text"), Domain("table")
    place = (
        ("env", text, "id of the environment, see 'jaxenstein list'"),
        ("map", text, "a map as text, instead of env"),
        (
            "map_file",
            text,
            "a file with a map, instead of an id, or samples/NAME; 'jaxenstein list' explains with "
            "--symbols the symbols, and prints with --samples those maps",
        ),
        ("heading", HEADING, "first heading on that map, 0 east, 90 south; else any"),
        ("horizon", Domain("whole", 1), "most steps of an episode"),
        ("settings", table, "any other setting of jaxenstein.make"),
        (
            "params",
            table,
            "any number of the environment's params; LOW:HIGH is a range from which each episode "
            "draws one",
        ),
    )
    fields = [Option(name, "environment", domain, None, help) for name, domain, help in place]
    fields += options_of(FirstPerson, "what the agent sees", SEEN)
    return {field.name: field for field in fields}


def checked(given: Mapping[str, Any], known: Mapping[str, Option]) -> dict[str, Any]:
    """Values of fields that a file or flags gave, each in its field's own type.

    Raises:
        SettingError: there is no such field, or it cannot have the value.
    """
    values = {}
    for name, value in given.items():
        if name not in (*known, *MAP_TEXTS):
            raise SettingError(f"unknown option {quoted(name)}{nearest(name, known)}")
        values[name] = check_value(name, known[name].domain, value) if name in known else value
    return values


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
    # Drop the options of a look or split that is no longer set.
    asked = {**given, **(given.get("settings") or {})}
    gone = {"look_seeds", "look_range"} if asked.get("look", "random") != "random" else set()
    gone |= {"test_fraction"} if asked.get("split", "") is None else set()
    for table in (merged, merged.get("settings") or {}):
        for name in gone - set(asked):
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
    for name in MAP_TEXTS:
        if name in given and "map" not in given:
            raise SettingError(f"{name} goes with a map; an env has a map of its own")
    settings = {name: given[name] for name in SEEN if name in given}
    settings |= {name: as_tuples(v) for name, v in (given.get("settings") or {}).items()}
    params = {name: as_tuples(value) for name, value in (given.get("params") or {}).items()}
    if "horizon" in given:
        params["max_steps_in_episode"] = given["horizon"]
    if "map" in given:
        settings |= {name: given[name] for name in (*MAP_TEXTS, "heading") if name in given}
        settings["text"] = given["map"]
    spec = Spec(given.get("env"), 0, settings, {})
    env, defaults = spec.build(warn=True)
    check_levels(env)
    if "textures" in settings:
        # The whole path, so that the spec can be used in another folder.
        settings["textures"] = as_tuples(getattr(env, "textures", None))
    _check_params(params, env, defaults)
    spec = dataclasses.replace(spec, params=params, version=env.version)
    spec.build()
    # An id may have been an alias, or known to this process alone.
    id = None if spec.id is None else registry.portable_id(spec.id)
    return dataclasses.replace(spec, id=id)


def _check_params(params: Mapping[str, Any], env: Any, defaults: Any) -> None:
    """Tell params that there are not, settings among them."""
    numbers, settings = names_of(defaults), names_of(env)
    for name, value in params.items():
        if name not in numbers and name in settings:
            raise SettingError(
                f"{quoted(name)} is a setting, not a param: --set {name}={value}, or 'settings' of "
                "a file"
            )
    check_names(params, numbers, "param")


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
