"""The options of an environment, shared by flags and config files, and the spec they describe."""

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

# Texts that belong to a map: its name, and what is stored in files beside it.
MAP_TEXTS = ("name", "regions", "faces")
# The options that name an environment, and those that belong to its map.
PLACES = ("env", "map", "map_file")
OF_MAP = ("heading", *MAP_TEXTS)


@functools.cache
def environment_options() -> dict[str, Option]:
    """All options that choose an environment and its observations."""
    text, table = Domain("text"), Domain("table")
    place = (
        ("env", text, "id of the environment, see 'jaxenstein list'"),
        ("map", text, "a map as text, instead of env"),
        (
            "map_file",
            text,
            "a file with a map, or samples/NAME, instead of an id; 'jaxenstein list --symbols' "
            "explains the symbols, 'jaxenstein list --samples' prints the sample maps",
        ),
        ("heading", HEADING, "heading at the start: 0 east, 90 south; default any"),
        (
            "horizon",
            Domain("whole", 1),
            "maximum number of world steps of an episode; a decision takes frame_skip of them",
        ),
        ("settings", table, "other settings of jaxenstein.make"),
        (
            "params",
            table,
            "params of the environment; with LOW:HIGH each episode draws a number from that range",
        ),
    )
    fields = [Option(name, "environment", domain, None, help) for name, domain, help in place]
    fields += options_of(FirstPerson, "what the agent sees", SEEN)
    return {field.name: field for field in fields}


def checked(given: Mapping[str, Any], known: Mapping[str, Option]) -> dict[str, Any]:
    """Convert option values from a file or from flags to the types of their fields.

    Raises:
        SettingError: an option does not exist, or its value is invalid.
    """
    values = {}
    for name, value in given.items():
        if name not in (*known, *MAP_TEXTS):
            raise SettingError(f"unknown option {quoted(name)}{nearest(name, known)}")
        values[name] = check_value(name, known[name].domain, value) if name in known else value
    return values


def merge(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Merge options; those of `above` win, such as flags over a config file.

    Tables are merged entry by entry. An environment in `above` replaces the one in `below`, with
    its `horizon`, `params` and `settings`.
    """
    gone = set()
    if any(name in above for name in PLACES):
        gone = {*PLACES, *OF_MAP, "horizon", "params", "settings"}
    # Options that can also stand in a table.
    if "max_steps_in_episode" in (above.get("params") or {}):
        gone |= {"horizon"}
    merged = {name: value for name, value in below.items() if name not in gone}
    if merged.get("settings"):
        merged["settings"] = {n: v for n, v in merged["settings"].items() if n not in above}
    for name, value in above.items():
        before = merged.get(name)
        if isinstance(value, dict) and isinstance(before, dict):
            merged[name] = {**before, **value}
        else:
            merged[name] = value
    return merged


def changed(spec: Spec, given: Mapping[str, Any]) -> Spec:
    """Change some options of a spec; a new environment keeps the observation settings.

    Raises:
        JAXensteinError: the environment cannot be built.
    """
    before = given_by(spec)
    if any(name in given for name in PLACES):
        before = {name: value for name, value in before.items() if name in SETTINGS}
    merged = merge(before, given)
    # Drop the options of a look or split that is no longer set.
    asked = {**given, **(given.get("settings") or {})}
    gone = {"look_seeds", "look_range"} if asked.get("look", "random") != "random" else set()
    gone |= {"textures"} if asked.get("look", "plain") != "plain" else set()
    gone |= {"wad"} if asked.get("look", "game") != "game" else set()
    gone |= {"samples"} if asked.get("look", "game") not in ("game", "random") else set()
    gone |= {"test_fraction"} if asked.get("split", "") is None else set()
    for table in (merged, merged.get("settings") or {}):
        for name in gone - set(asked):
            table.pop(name, None)
    return spec_from(merged)


def spec_from(given: Mapping[str, Any]) -> Spec:
    """The spec of the environment that the options describe.

    Raises:
        JAXensteinError: the environment cannot be built, or the options name none.
    """
    if ("env" in given) == ("map" in given):
        raise SettingError("give exactly one of env and map")
    if "heading" in given and "map" not in given:
        raise SettingError("heading needs a map (--map-file); an env has its own headings")
    for name in MAP_TEXTS:
        if name in given and "map" not in given:
            raise SettingError(f"{name} needs a map; an env has its own")
    settings = {name: given[name] for name in SEEN if name in given}
    settings |= {name: as_tuples(v) for name, v in (given.get("settings") or {}).items()}
    params = {name: as_tuples(value) for name, value in (given.get("params") or {}).items()}
    if "horizon" in given:
        params["max_steps_in_episode"] = given["horizon"]
    if "map" in given:
        own = {name: given[name] for name in OF_MAP if name in given}
        settings = own | settings | {"text": given["map"]}
    spec = Spec(given.get("env"), 0, settings, {})
    env, defaults = spec.build(warn=True)
    check_levels(env)
    for name in ("textures", "wad"):
        if name in settings:
            # The whole path, so that the spec can be used in another folder.
            settings[name] = as_tuples(getattr(env, name, None))
    _check_params(params, env, defaults)
    spec = dataclasses.replace(spec, params=params, version=env.version)
    spec.build()
    # The id may be an alias, or registered only in this process.
    id = None if spec.id is None else registry.portable_id(spec.id)
    return dataclasses.replace(spec, id=id)


def _check_params(params: Mapping[str, Any], env: Any, defaults: Any) -> None:
    """Raise for params that do not exist, with a hint if they are settings."""
    numbers, settings = names_of(defaults), names_of(env)
    for name, value in params.items():
        if name not in numbers and name in settings:
            raise SettingError(
                f"{quoted(name)} is a setting, not a param: use --set {name}={value}, or "
                "'settings' in a file"
            )
    check_names(params, numbers, "param")


def given_by(spec: Spec) -> dict[str, Any]:
    """The options from which `spec_from` makes this spec."""
    settings = dict(spec.settings)
    given: dict[str, Any] = {"env": spec.id}
    if spec.id is None:
        given = {"map": settings.pop("text")}
    for name in (*OF_MAP, *SETTINGS):
        if settings.get(name) is not None:
            given[name] = settings.pop(name)
    return given | {"settings": settings, "params": dict(spec.params)}
