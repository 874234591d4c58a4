"""What a field of settings or numbers may hold, told by its declaration."""

from __future__ import annotations

import dataclasses
import math
import typing
from collections.abc import Collection, Iterable
from typing import Any, Literal, TypeVar

import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from ..errors import SettingError, nearest

_Numbers = TypeVar("_Numbers")


def share(default: float | None) -> Any:
    """A number from 0 to 1; None may be said where it is the default."""
    return dataclasses.field(default=default, metadata={"highest": 1.0})


def positive(default: float | None) -> Any:
    """A number above 0; None may be said where it is the default."""
    return dataclasses.field(default=default, metadata={"positive": True})


def count(default: int, least: int = 1) -> Any:
    """A whole number from `least`, where it is not 1."""
    return dataclasses.field(default=default, metadata={"least": least})


def names(cls: Any) -> tuple[str, ...]:
    """The names of a dataclass' fields."""
    return tuple(field.name for field in dataclasses.fields(cls))


def values_of(record: Any) -> dict[str, Any]:
    """The fields of a dataclass with their values."""
    return {name: getattr(record, name) for name in names(record)}


def check_settings(settings: Any) -> None:
    """Check the fields of a dataclass that are int, float, bool or Literal; no others.

    Raises:
        SettingError: a value is of another kind.
    """
    hints = typing.get_type_hints(type(settings))
    for field in dataclasses.fields(settings):
        name, hint, value = field.name, hints[field.name], getattr(settings, field.name)
        least = field.metadata.get("least", 1)
        if hint is int and not (is_whole(value) and value >= least):
            raise SettingError(f"{name} must be a whole number from {least}, not {value!r}")
        if hint is float and not (_is_number(value) and _within(field, value)):
            raise SettingError(f"{name} must be a finite number {_range(field)}, not {value!r}")
        if hint is bool and not isinstance(value, bool | np.bool_):
            raise SettingError(f"{name} must be True or False, not {value!r}")
        if typing.get_origin(hint) is Literal:
            check_choice(name, value, typing.get_args(hint))


def check_choice(name: str, value: Any, choices: tuple[str, ...]) -> None:
    """Check that a value is one of a few; the `SettingError` names the nearest."""
    if value not in choices:
        close = nearest(str(value), choices)
        known = ", ".join(map(repr, choices))
        raise SettingError(f"{name} must be one of {known}, not {value!r}{close}")


def check_known(given: Iterable[str], known: Collection[str]) -> None:
    """Check that there are settings of these names; the `SettingError` names the nearest."""
    for name in given:
        if name not in known:
            raise SettingError(
                f"unknown setting {name!r}{nearest(name, known)}; known: {', '.join(known)}"
            )


def is_whole(value: Any) -> bool:
    """Whether it is a whole number, and not True or False."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def _is_number(value: Any) -> bool:
    return is_whole(value) or isinstance(value, float | np.floating)


def check_numbers(numbers: _Numbers, skip: tuple[str, ...] = ()) -> _Numbers:
    """The record with its fields, but for `skip`, as float32 arrays; traced ones pass.

    Raises:
        SettingError: a value is no number, or out of the range that `share`, `positive` or,
            without either, 0 sets it.
    """
    record: Any = numbers
    checked = {
        field.name: _checked(field, getattr(record, field.name))
        for field in dataclasses.fields(record)
        if field.name not in skip
    }
    return dataclasses.replace(record, **checked)


def _checked(field: dataclasses.Field[Any], value: Any) -> Any:
    name = field.name
    if (value is None and field.default is None) or isinstance(value, Tracer):
        return value
    try:
        numbers = np.asarray(value, np.float64)
    except (TypeError, ValueError, OverflowError):
        raise SettingError(f"{name} must be a number, not {value!r}") from None
    if not np.all(_within(field, numbers)):
        raise SettingError(f"{name} must be a finite number {_range(field)}, not {value!r}")
    return jnp.asarray(numbers, jnp.float32)


def _within(field: dataclasses.Field[Any], numbers: Any) -> Any:
    """Where numbers are finite and in the field's range."""
    highest = field.metadata.get("highest", math.inf)
    least = numbers > 0 if field.metadata.get("positive") else numbers >= 0
    return (numbers <= highest) & (numbers < math.inf) & least


def _range(field: dataclasses.Field[Any]) -> str:
    """The field's range in words."""
    if "highest" in field.metadata:
        return f"from 0 to {field.metadata['highest']:g}"
    return "above 0" if field.metadata.get("positive") else "at least 0"
