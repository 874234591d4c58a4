"""The numbers of an environment, and which values they can have."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, NamedTuple, Self

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from .errors import SettingError, nearest
from .pytree import PyTreeNode

Scalar = bool | int | float | jax.Array
"""A number that may be traced, and of a batch an array of numbers."""

_INT32, _FLOAT32 = np.iinfo(np.int32), float(np.finfo(np.float32).max)
_RANGE = "range"


class Range(NamedTuple):
    """The values that a param can have.

    Attributes:
        least: the smallest.
        most: the largest, or with `open` what all must be below.
        open: whether `most` itself is too large.
    """

    least: float = -math.inf
    most: float = math.inf
    open: bool = False


def number(
    default: float, least: float = -math.inf, most: float = math.inf, *, below: float | None = None
) -> Any:
    """A param or a setting with a range, which holds for subclasses with another default as well.

    Args:
        default: its value; that of a whole number, or of a bool, makes it one.
        least: the smallest value.
        most: the largest one.
        below: in the place of `most`, what all values must be below.
    """
    limits = Range(least, most) if below is None else Range(least, below, open=True)
    return dataclasses.field(default=default, metadata={_RANGE: limits})


class Params(PyTreeNode):
    """Numbers that may differ between environments of one batch: traced, never static.

    Concrete values are checked where they come in: in `replace`, and where an environment is
    given params from outside of compiled code. Traced ones pass.

    Attributes:
        max_steps_in_episode: steps after which an episode is truncated; at least 1.
        discount: the task's discount factor, 0 to 1, for the learner; the environment does not
            use it.
    """

    max_steps_in_episode: Scalar = number(1000, 1)
    discount: Scalar = number(0.99, 0, 1)

    def replace(self, **changes: Any) -> Self:
        """Return a copy with the named fields changed.

        Raises:
            SettingError: there is no such field, or a value that it cannot have.

        Examples:
            >>> Params().replace(discount=0.9)
            Params(max_steps_in_episode=1000, discount=0.9)
            >>> Params().replace(discuont=0.9)
            Traceback (most recent call last):
            jaxenstein.errors.SettingError: Params has no 'discuont', did you mean 'discount'?...
        """
        names = [field.name for field in dataclasses.fields(self)]
        for name in changes:
            if name not in names:
                raise SettingError(
                    f"{type(self).__name__} has no {name!r}{nearest(name, names)}; "
                    f"it has: {', '.join(names)}"
                )
        # The axes of `jax.vmap` and the like are trees of this class too, but no numbers.
        if all(_is_number(getattr(self, name)) for name in names):
            for name, value in changes.items():
                _check(type(self), name, value)
        return super().replace(**changes)

    def check(self) -> None:
        """Look at the values that are known already.

        Raises:
            SettingError: one is not a number in its range.
        """
        for field in dataclasses.fields(self):
            _check(type(self), field.name, getattr(self, field.name))


def _is_number(value: Any) -> bool:
    return isinstance(value, bool | int | float | np.generic | np.ndarray | jax.Array)


def _check(cls: type, name: str, value: Any) -> None:
    """Check one value, or an array of them; what is traced or stands for an array passes."""
    if isinstance(value, str | list | tuple | dict):
        raise SettingError(f"{name} must be a number or an array of them, not {value!r}")
    if not _is_number(value) or isinstance(value, Tracer):
        return
    default = cls.__dataclass_fields__[name].default  # type: ignore[attr-defined]
    kind = np.asarray(default).dtype.kind if _is_number(default) else "f"
    limits, array = range_of(cls, name), np.asarray(value)
    low, high = (_INT32.min, _INT32.max) if kind == "i" else (-_FLOAT32, _FLOAT32)
    low, high = max(low, limits.least), min(high, limits.most)
    if kind == "b" or array.dtype == bool:
        good = array.dtype == bool and kind == "b"
    elif jnp.issubdtype(array.dtype, jnp.integer) or jnp.issubdtype(array.dtype, jnp.floating):
        within = (array >= low) & ((array < high) if limits.open else (array <= high))
        good = bool(np.all(within & (kind != "i" or array == np.floor(array))))
    else:
        good = False
    if not good:
        shown = value if array.ndim == 0 else array.tolist()
        raise SettingError(f"{name} must be {in_words(kind, limits)}, not {shown!r}")


def range_of(cls: type, name: str) -> Range:
    """The values of a field, as the class nearest in the order of inheritance declares it."""
    for owner in cls.__mro__:
        field = owner.__dict__.get("__dataclass_fields__", {}).get(name)
        if field is not None and _RANGE in field.metadata:
            return field.metadata[_RANGE]
    return Range()


def in_words(kind: str, limits: Range) -> str:
    """The values of a range, of numbers of a NumPy kind: "i" whole ones, "b" truth values."""
    if kind == "b":
        return "True or False"
    what = "a whole number" if kind == "i" else "a finite number"
    if limits.least > -math.inf:
        what += (
            f" from {limits.least:g} on" if limits.most == math.inf else f" from {limits.least:g}"
        )
    if limits.most < math.inf:
        what += f" to {'below ' if limits.open else ''}{limits.most:g}"
    return what + (f", at most {_INT32.max}" if kind == "i" and limits.most == math.inf else "")
