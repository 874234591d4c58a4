"""A description from which `make` or `from_ascii` can rebuild an environment."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import warnings
from collections.abc import Mapping
from typing import Any

import jax
import numpy as np

from . import ranged, registry, text_maps
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
from .params import Range, split_ranges
from .tasks.first_person import RESETTING, SEEN
from .tasks.navigation import Navigation

# The texts of a custom map; files store them as lists of lines.
TEXTS = ("text", "faces")


@dataclasses.dataclass(frozen=True)
class Spec:
    """A description from which an environment and its params can be rebuilt.

    Attributes:
        id: the id for `make`, or None for a custom map.
        version: the version of the environment.
        settings: the settings of `make` or `from_ascii`, including `text` for the latter.
        params: the params that differ from their defaults, by name. A range (low, high) means
            that each episode draws a number; in files it is a list.
    """

    id: str | None
    version: int
    settings: Mapping[str, Any]
    params: Mapping[str, bool | int | float | tuple[float, float]]

    @property
    def ranges(self) -> dict[str, Range]:
        """The params from whose ranges each episode draws a number."""
        return {name: Range(*ends) for name, ends in self.params.items() if isinstance(ends, tuple)}

    def to_json(self) -> dict[str, Any]:
        """Convert to plain JSON values, which `from_json` reads.

        Raises:
            SettingError: a setting has no JSON form.
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
        """Read the output of `to_json` from an untrusted file; builds nothing.

        Raises:
            SettingError: the value is not such an output.
        """
        if not isinstance(plain, dict) or set(plain) != set(names_of(cls)):
            raise SettingError(f"'environment' must be an object of {', '.join(names_of(cls))}")
        id = plain["id"]
        if id is not None and not (isinstance(id, str) and id.isprintable()):
            raise SettingError(f"'environment.id' must be one line of text, not {quoted(id)}")
        check_value("'environment.version'", Domain("whole", 0), plain["version"])
        for table in ("settings", "params"):
            check_value(f"'environment.{table}'", Domain("table"), plain[table])
        for name, value in plain["params"].items():
            if not isinstance(value, bool):
                if isinstance(value, list) and len(value) != 2:
                    raise SettingError(
                        f"'environment.params.{name}' must be a number or the two ends of a range, "
                        f"not {quoted(value)}"
                    )
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
            warn: whether to show warnings about the map. By default its author saw them.

        Raises:
            JAXensteinError: an id, setting or param does not exist or has a wrong value.
        """
        with warnings.catch_warnings():
            if not warn:
                warnings.simplefilter("ignore", MapWarning)
            if self.id is not None:
                env, params = registry.make_with(self.id, self.settings)
            else:
                env, params = text_maps.from_ascii(**self.settings)
        env = dataclasses.replace(env, autoreset=None, final_observation=False)
        return env, ranged.check_params(env, params.replace(**self.params))

    def try_out(self) -> tuple[AnyEnvironment, Any]:
        """As `build`, for a spec from an untrusted file: also checks the values of all settings.

        Traces a reset but compiles nothing.

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
    """Raise for a value that JSON does not have."""
    if isinstance(value, Images):
        raise TypeError("textures are arrays; save them as images in a folder, and give its path")
    raise TypeError(f"{quoted(value)} is a {type(value).__name__}")


def spec_of(env: AnyEnvironment, params: Any) -> Spec:
    """The spec that rebuilds an environment and its params.

    Raises:
        TrajectoryError: neither `make` nor `from_ascii` builds this environment, or the params
            have a batch axis.
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
        f"the environment {quoted(env.name)} cannot be saved in a trajectory: neither make nor "
        "from_ascii builds an equal environment"
    )


def described(env: AnyEnvironment, params: Any) -> Spec:
    """As `spec_of`, but describes an environment without an id by `module:Class` and settings.

    Raises:
        TrajectoryError: the params have a batch axis.
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
    """Ids and settings from which the environment may have been built."""
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
                f"param {quoted(field.name)} must be a single value, not of shape {value.shape}"
            )
        if field.name in ranges:
            changes[field.name] = tuple(ranges[field.name])
        elif value != other:
            changes[field.name] = value.item()
    return changes
