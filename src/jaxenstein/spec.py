"""The description from which an environment is built again, by `make` or by `from_ascii`."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import warnings
from collections.abc import Mapping
from typing import Any

import jax
import numpy as np

from . import registry, text_maps
from .environment import AnyEnvironment
from .errors import (
    JAXensteinError,
    MapWarning,
    SettingError,
    TrajectoryError,
    UnknownEnvironmentError,
    one_line,
    quoted,
)
from .fields import Domain, as_tuples, check_value, names_of
from .images import Images
from .params import Range, split_ranges, with_numbers
from .tasks.first_person import RESETTING, SEEN
from .tasks.navigation import Navigation

# The texts of a custom map, which files hold line by line.
TEXTS = ("text", "faces")


@dataclasses.dataclass(frozen=True)
class Spec:
    """The description from which an environment and its params are built again.

    Attributes:
        id: what `make` takes, or None for a custom map.
        version: that the environment had.
        settings: the settings of `make`, or those of `from_ascii`, `text` among them.
        params: the params that are not the default ones, by name; a range (low, high) where each
            episode draws its number. Files have a list for it.
    """

    id: str | None
    version: int
    settings: Mapping[str, Any]
    params: Mapping[str, bool | int | float | tuple[float, float]]

    def to_json(self) -> dict[str, Any]:
        """As plain JSON values, which `from_json` reads.

        Raises:
            SettingError: a setting is none.
        """
        plain = {
            "id": self.id,
            "version": self.version,
            "settings": dict(self.settings),
            "params": dict(self.params),
        }
        try:
            return json.loads(json.dumps(plain, allow_nan=False, default=_refuse))
        except (TypeError, ValueError) as error:
            raise SettingError(
                f"a setting of {self.id or 'the map'} cannot be written as JSON: {error}"
            ) from error

    @classmethod
    def from_json(cls, plain: Any) -> Spec:
        """What `to_json` returned, from a file that anybody may have edited; nothing is built.

        Raises:
            SettingError: it is something else.
        """
        if not isinstance(plain, dict) or set(plain) != set(names_of(cls)):
            raise SettingError(f"'environment' must be an object of {', '.join(names_of(cls))}")
        id = plain["id"]
        if id is not None and not (isinstance(id, str) and id.isprintable()):
            raise SettingError(f"'environment.id' must be a text of one line, not {quoted(id)}")
        check_value("'environment.version'", Domain("whole", 0), plain["version"])
        for table in ("settings", "params"):
            check_value(f"'environment.{table}'", Domain("table"), plain[table])
        for name, value in plain["params"].items():
            if not isinstance(value, bool):
                for number in value if isinstance(value, list) else [value]:
                    check_value(f"'environment.params.{name}'", Domain("number"), number)
        settings, params = (
            {name: as_tuples(value) for name, value in plain[table].items()}
            for table in ("settings", "params")
        )
        return cls(id, plain["version"], settings, params)

    def build(self, *, warn: bool = False) -> tuple[AnyEnvironment, Any]:
        """The environment, without automatic resets, and its params, which may hold ranges.

        Args:
            warn: of what is odd about the map; its author has been warned.

        Raises:
            JAXensteinError: an id, setting or param does not exist or has a wrong value.
        """
        settings = {**self.settings, "autoreset": None}
        with warnings.catch_warnings():
            if not warn:
                warnings.simplefilter("ignore", MapWarning)
            if self.id is not None:
                env, params = registry.make_with(self.id, settings)
            else:
                env, params = text_maps.from_ascii(**settings)
        plain, ranges = split_ranges(params.replace(**self.params))
        return env, with_numbers(env.check_params(plain), ranges)

    def try_out(self) -> tuple[AnyEnvironment, Any]:
        """As `build`, for a spec of an untrusted file: looks at the values of all settings.

        A reset is traced; nothing is compiled.

        Raises:
            JAXensteinError: an id, setting or param does not exist or has a wrong value.
        """
        try:
            env, params = self.build()
            jax.eval_shape(env.reset, jax.random.key(0), split_ranges(params)[0])
        except JAXensteinError:
            raise
        except (TypeError, ValueError, IndexError, OverflowError, AttributeError) as error:
            raise SettingError(f"a setting is unusable: {one_line(str(error))}") from error
        return env, params


def _refuse(value: Any) -> Any:
    """Tell what is no value of JSON."""
    if isinstance(value, Images):
        raise TypeError("textures are arrays; keep them as files, and give their folder")
    raise TypeError(f"{quoted(value)} is a {type(value).__name__}")


def ranges_of(spec: Spec) -> dict[str, Range]:
    """The params from whose ranges each episode draws a number."""
    return {name: Range(*ends) for name, ends in spec.params.items() if isinstance(ends, tuple)}


def spec_of(env: AnyEnvironment, params: Any) -> Spec:
    """How an environment and its params can be built again.

    Raises:
        TrajectoryError: neither `make` nor `from_ascii` builds this environment, or the params
            are not those of one environment.
    """
    env = dataclasses.replace(env, autoreset=None, final_observation=False)
    changes = _changed(env, params)
    for id, settings in _candidates(env):
        spec = Spec(id, env.version, settings, {})
        try:
            built, _ = spec.build()
        except JAXensteinError:
            continue
        if built == env:
            return dataclasses.replace(spec, params=changes)
    raise TrajectoryError(
        f"the environment {quoted(env.name)} cannot be kept in a trajectory: neither make nor "
        "from_ascii builds one that is equal to it"
    )


def described(env: AnyEnvironment, params: Any) -> Spec:
    """As `spec_of`; an environment that has no id is told by `module:Class` and its settings.

    Raises:
        TrajectoryError: the params are not those of one environment.
    """
    changes = _changed(env, params)
    try:
        return spec_of(env, params)
    except TrajectoryError:
        settings = {
            field.name: as_tuples(getattr(env, field.name))
            for field in dataclasses.fields(env)
            if field.name not in (*RESETTING, "name", "version")
            and getattr(env, field.name) != field.default
        }
        kind = type(env)
        return Spec(f"{kind.__module__}:{kind.__qualname__}", env.version, settings, changes)


def _candidates(env: Any) -> list[tuple[str | None, dict[str, Any]]]:
    """The ids and settings that the environment may have been built from."""
    fields = {field.name: as_tuples(getattr(env, field.name)) for field in dataclasses.fields(env)}
    found: list[tuple[str | None, dict[str, Any]]] = []
    with contextlib.suppress(UnknownEnvironmentError):
        taken = registry.find(env.name)[1].settings
        settings = {n: fields[n] for n in taken if n in fields and n not in RESETTING}
        found.append((registry.portable_id(env.name), settings))
    if type(env) is Navigation:
        own = ("name", "heading", "floor", "ceiling")
        settings = {name: fields[name] for name in (*SEEN, *own)}
        settings["text"] = env.tilemap.tile_text()
        faces = env.tilemap.faces_text()
        found.append((None, settings if faces is None else settings | {"faces": faces}))
    return found


def _changed(env: AnyEnvironment, params: Any) -> dict[str, Any]:
    plain, ranges = split_ranges(params)
    given, usual = env.check_params(plain), env.check_params()
    changes: dict[str, Any] = {}
    for field in dataclasses.fields(usual):
        value, other = (np.asarray(getattr(numbers, field.name)) for numbers in (given, usual))
        if value.shape != ():
            raise TrajectoryError(
                f"param {quoted(field.name)} has the shape {value.shape}, not one value"
            )
        if field.name in ranges:
            changes[field.name] = tuple(ranges[field.name])
        elif value != other:
            changes[field.name] = value.item()
    return changes
