"""Fields that a user may set: declared once, and from that checked, read and explained.

A field is declared by the default of a dataclass' attribute: `number(64, 1, 4096)`, `choice(...)`,
`of_form(...)`, or a plain default, whose type says what its values are. The `Attributes` of the
docstring explain it. A subclass may give another default, and the values of the field stay.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import inspect
import math
import re
import typing
from collections.abc import Iterable
from typing import Any, Literal, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from .errors import SettingError, nearest, quoted
from .images import Images

Form = Literal[
    "whole",
    "number",
    "switch",
    "choice",
    "text",
    "table",
    "layers",
    "angle",
    "seeds",
    "images",
    "any",
]
_WORDS: dict[Form, str] = {
    "whole": "a whole number",
    "number": "a finite number",
    "switch": "True or False",
    "text": "a text",
    "table": "a table of names with values",
    "layers": "[kernel, stride, features] of each layer, from 1 (as a flag 8x4x32,4x2x64)",
    "angle": "degrees, or the lowest and the highest of them (as a flag -45,45)",
    "seeds": "two whole numbers from 0 to 2**32, at most 2**24 apart, the first seed and the one "
    "past the last (as a flag 0,200)",
    "images": "a folder of images, or in Python a table of names with arrays",
    "any": "",
}
_DOMAIN = "domain"
_INT32 = np.iinfo(np.int32)

R = TypeVar("R")


@dataclasses.dataclass(frozen=True)
class Domain:
    """The values that a field can have.

    Attributes:
        form: what they are.
        least: the smallest number.
        most: the largest one.
        above: what all numbers are larger than; so no number is infinite.
        below: what all numbers are smaller than.
        choices: the words of a choice; None may be among them.
        optional: whether None is a value as well.
    """

    form: Form
    least: float = -math.inf
    most: float = math.inf
    above: float = -math.inf
    below: float = math.inf
    choices: tuple[str | None, ...] = ()
    optional: bool = False

    @property
    def words(self) -> str:
        """What the values are, such as "a whole number from 1 to 64"."""
        if self.form == "choice":
            return f"one of {', '.join(map(repr, self.choices))}"
        return f"{'None or ' * self.optional}{_WORDS[self.form]}{self.range}"

    @property
    def range(self) -> str:
        """The range of numbers in words, such as " from 1 to 64"; "" if there is none."""
        low = f" from {self.least:.10g}" * (self.least > -math.inf)
        low = f" above {self.above:.10g}" if self.above > -math.inf else low
        if self.most < math.inf:
            return f"{low} to {self.most:.10g}"
        if self.below < math.inf:
            return f"{low}{' to' if low else ''} below {self.below:.10g}"
        return f"{low} on" if low.startswith(" from") else low

    def converted(self, value: Any) -> Any:
        """A value of a file in the field's own type, as it is where that cannot be.

        A whole number may be written as 3e6, any number without a point, and tuples as lists.
        """
        value = value.item() if isinstance(value, np.generic) else value
        small = isinstance(value, float) and abs(value) < 2**53
        if self.form == "whole" and small and value.is_integer():
            return int(value)
        if self.form == "number" and is_whole(value) and abs(value) < 2**1023:
            return float(value)
        return as_tuples(value) if self.form in ("layers", "angle", "seeds") else value

    def fault(self, value: Any) -> str:
        """Why a value in the field's own type is none of these: "must be ..., not ..."; or ""."""
        if (value is None and self.optional) or self._holds(value):
            return ""
        close = nearest(value, filter(None, self.choices)) if isinstance(value, str) else ""
        return f"must be {self.words}, not {quoted(value)}{close or self._rounded(value)}"

    def fault_of_array(self, value: Any) -> str:
        """As `fault`, of what becomes a float32, int32 or bool array; what is traced is right."""
        if (value is None and self.optional) or isinstance(value, Tracer):
            return ""
        if not is_array_like(value):
            wrong = value is None or isinstance(value, str | list | tuple | dict)
            return f"must be a number or an array of them, not {quoted(value)}" if wrong else ""
        array, domain = np.asarray(value), self._of_arrays
        if self.form == "switch":
            good = array.dtype == bool
        else:
            # Kinds that numpy does not know, such as bfloat16, are numbers too.
            good = array.dtype.kind in "iuf" or jnp.issubdtype(array.dtype, jnp.floating)
            good = good and (self.form != "whole" or bool(np.all(array == np.floor(array))))
            good = good and domain._within(array)
        close = "" if good else domain._rounded(value)
        return "" if good else f"must be {domain.words}, not {quoted(array.tolist())}{close}"

    @functools.cached_property
    def _of_arrays(self) -> Domain:
        """The values that arrays can have: whole numbers of 32 bits."""
        if self.form != "whole":
            return self
        least, most = max(self.least, int(_INT32.min)), min(self.most, int(_INT32.max))
        return dataclasses.replace(self, least=least, most=most)

    def _holds(self, value: Any) -> bool:
        """Whether a value is of the form, and in the range."""
        if self.form in ("whole", "number"):
            number = is_whole(value) if self.form == "whole" else is_number(value)
            return number and self._within(value)
        if self.form == "choice":
            return (value is None or isinstance(value, str)) and value in self.choices
        if self.form == "angle":
            pair = value if isinstance(value, tuple) else (value, value)
            numbers = len(pair) == 2 and all(map(is_number, pair))
            return numbers and self.least <= pair[0] <= pair[1] <= self.most
        if self.form == "seeds":
            whole = isinstance(value, tuple) and len(value) == 2 and all(map(is_whole, value))
            return whole and 0 <= value[0] < value[1] <= min(2**32, value[0] + 2**24)
        if self.form == "layers":
            return isinstance(value, tuple) and all(map(_is_layer, value))
        if self.form == "table":
            return isinstance(value, dict) and all(isinstance(name, str) for name in value)
        forms = {"switch": bool | np.bool_, "text": str, "images": str | Images}
        return isinstance(value, forms.get(self.form, object))

    def _within(self, numbers: Any) -> bool:
        """Whether all numbers are in the range, in the precision that they are used in."""
        try:
            return _between(numbers if self.form == "whole" else _float32(numbers), *self._bounds)
        except OverflowError:
            return False

    @functools.cached_property
    def _bounds(self) -> list[Any]:
        """The range in the precision that numbers are used in.

        For whole numbers without a range it is int32.
        """
        bounds = self.least, self.most, self.above, self.below
        if self.form != "whole":
            return [np.float32(bound) for bound in bounds]
        least = self.least if self.least > -math.inf else int(_INT32.min)
        most = self.most if self.most < math.inf else int(_INT32.max)
        return [least, most, self.above, self.below]

    def _rounded(self, value: Any) -> str:
        """A note where a number is refused only because of float32 or int32; else ""."""
        if self.form == "whole" and is_whole(value) and self.least <= value <= self.most:
            return ", which does not fit into int32"
        real = self.form == "number" and is_number(value)
        if real and _between(value, self.least, self.most, self.above, self.below):
            with contextlib.suppress(OverflowError):
                return f", which is {float(_float32(value)):g} in float32"
        return ""


def number(
    default: float | None,
    least: float = -math.inf,
    most: float = math.inf,
    *,
    above: float = -math.inf,
    below: float = math.inf,
    whole: bool = False,
) -> Any:
    """A number with a range; None is a value where it is the default.

    Args:
        default: its value if nothing is said; that of a whole number makes it one.
        least: the smallest value.
        most: the largest one.
        above: what all values are above, in the place of `least`.
        below: what all values are below, in the place of `most`.
        whole: whether it is a whole number, where the default is None.
    """
    form: Form = "whole" if whole or is_whole(default) else "number"
    domain = Domain(form, least, most, above, below, optional=default is None)
    return dataclasses.field(default=default, metadata={_DOMAIN: domain})


def choice(default: str | None, choices: Any) -> Any:
    """One of a few words: those of a `Literal`, or of a tuple, in which None may be."""
    words = typing.get_args(choices) or tuple(choices)
    return dataclasses.field(default=default, metadata={_DOMAIN: Domain("choice", choices=words)})


def of_form(default: Any, form: Form) -> Any:
    """A field of another form, such as "seeds"; None is a value where it is the default."""
    domain = Domain(form, optional=default is None)
    return dataclasses.field(default=default, metadata={_DOMAIN: domain})


@functools.cache
def _domains(cls: Any) -> dict[str, Domain]:
    """The values of every field, as the class nearest in the order of inheritance declares them."""
    forms: dict[type, Form] = {bool: "switch", int: "whole", float: "number", str: "text"}
    found = {}
    for field in dataclasses.fields(cls):
        owners = [vars(owner).get("__dataclass_fields__", {}) for owner in cls.__mro__]
        declared = [own[field.name].metadata.get(_DOMAIN) for own in owners if field.name in own]
        undeclared = Domain(forms.get(type(field.default), "any"))
        found[field.name] = next(filter(None, declared), undeclared)
    return found


def domain_of(cls: Any, name: str) -> Domain:
    """The values of one field of a dataclass."""
    return _domains(cls)[name]


def check(record: Any) -> None:
    """Check the fields of a dataclass of settings: numbers, switches and words.

    Seeds and layers become tuples, and numpy's numbers those of Python.

    Raises:
        SettingError: a field has a value that it cannot have.
    """
    for name, domain in _domains(type(record)).items():
        value = getattr(record, name)
        if domain.form in ("seeds", "layers", "angle") or isinstance(value, np.generic):
            value = as_tuples(value)
            object.__setattr__(record, name, value)
        _complain(name, domain.fault(value))


def check_numbers(record: Any, skip: Iterable[str] = ()) -> None:
    """Check the fields of a record of numbers, or of arrays of them; those that are traced pass.

    Raises:
        SettingError: a field has a value that it cannot have in float32, int32 or bool.
    """
    for name, domain in _domains(type(record)).items():
        if name not in skip:
            _complain(name, domain.fault_of_array(getattr(record, name)))


def as_arrays(record: R, skip: Iterable[str] = ()) -> R:
    """A record of numbers as float32, int32 or bool arrays, checked; None and what is traced stay.

    Raises:
        SettingError: as `check_numbers`.
    """
    check_numbers(record, skip)
    dtypes = {"whole": jnp.int32, "switch": jnp.bool_}
    arrays = {}
    for name, domain in _domains(type(record)).items():
        value = getattr(record, name)
        if name not in skip and is_array_like(value) and not isinstance(value, Tracer):
            arrays[name] = jnp.asarray(np.asarray(value), dtypes.get(domain.form, jnp.float32))
    return dataclasses.replace(record, **arrays)  # pyright: ignore[reportArgumentType, reportCallIssue]


def check_value(name: str, domain: Domain, value: Any) -> Any:
    """The value that a file has for a field, in the field's own type.

    Raises:
        SettingError: the field cannot have it.
    """
    value = domain.converted(value)
    _complain(name, domain.fault(value))
    return value


def check_whole(name: str, value: Any, least: float = 1, most: float = math.inf) -> int:
    """Check a whole number whose range something else decides; returns it as an int."""
    _complain(name, Domain("whole", least, most).fault(value))
    return int(value)


def check_names(given: Iterable[str], known: Iterable[str], what: str = "setting") -> None:
    """Check that there are fields of these names; the `SettingError` names the nearest."""
    names = list(known)
    for name in given:
        if name not in names:
            close = nearest(name, names)
            raise SettingError(f"unknown {what} {quoted(name)}{close}; known: {', '.join(names)}")


def _complain(name: str, fault: str) -> None:
    if fault:
        raise SettingError(f"{name} {fault}")


@dataclasses.dataclass(frozen=True)
class Option:
    """One thing that a user may set: by a flag, and by a line of a file.

    Attributes:
        name: as in a file; the flag has hyphens for underscores.
        group: what it belongs to, for the help.
        domain: its values.
        default: its value if nothing is said.
        help: what it does.
    """

    name: str
    group: str
    domain: Domain
    default: Any
    help: str

    @property
    def described(self) -> str:
        """What it does, with its range and its default, for the help of a flag."""
        default = f"{self.default:g}" if isinstance(self.default, float) else self.default
        facts = (self.domain.range.strip(), "" if default is None else f"default {default}")
        shown = "; ".join(filter(None, facts))
        help = self.help.replace("`", "").rstrip(".")
        return f"{help} ({shown})" if shown else help


def options_of(cls: Any, group: str, names: Iterable[str] | None = None) -> list[Option]:
    """The fields of a dataclass, or those of the names."""
    helps, domains = attributes(cls), _domains(cls)
    defaults = {field.name: field.default for field in dataclasses.fields(cls)}
    found = []
    for name in domains if names is None else names:
        text = helps.get(name, "(python -OO strips the explanation)")
        found.append(Option(name, group, domains[name], defaults[name], text))
    return found


def names_of(cls: Any) -> tuple[str, ...]:
    """The names of a dataclass' fields."""
    return tuple(field.name for field in dataclasses.fields(cls))


def values_of(record: Any) -> dict[str, Any]:
    """The fields of a dataclass with their values."""
    return {name: getattr(record, name) for name in names_of(record)}


def attributes(cls: type) -> dict[str, str]:
    """The documented attributes of a class with their meanings, those of its bases first.

    Empty under `python -OO`, which strips docstrings.
    """
    found: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        text = inspect.cleandoc(base.__dict__.get("__doc__") or "")
        # Up to the next part of the docstring.
        listed = re.split(r"^\S", text.partition("Attributes:\n")[2], flags=re.MULTILINE)[0]
        entries = re.findall(r"^ {4}(\w+): (.*?)(?=^ {4}\w|\Z)", listed, re.MULTILINE | re.DOTALL)
        found |= {name: " ".join(meaning.split()) for name, meaning in entries}
    return found


def as_tuples(value: Any) -> Any:
    """The value with tuples for lists and ranges of seeds, at every depth, in types of Python.

    Images become the path of their folder, if they have one. Numpy's numbers and truth values
    become those of Python, which files can keep.
    """
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, range) and value.step == 1:
        return value.start, value.stop
    if isinstance(value, Images) and value.folder is not None:
        return value.folder
    return tuple(map(as_tuples, value)) if isinstance(value, list | tuple) else value


def is_whole(value: Any) -> bool:
    """Whether it is a whole number, and not True or False."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def is_array_like(value: Any) -> bool:
    """Whether it is a number, a truth value, or an array of them."""
    return isinstance(value, bool | int | float | np.generic | np.ndarray | jax.Array)


def is_number(value: Any) -> bool:
    """Whether it is a number of Python or numpy, and not True or False."""
    return is_whole(value) or isinstance(value, float | np.floating)


def _is_layer(value: Any) -> bool:
    whole = isinstance(value, tuple) and len(value) == 3 and all(map(is_whole, value))
    return whole and min(value) >= 1


def _between(numbers: Any, least: Any, most: Any, above: Any, below: Any) -> bool:
    inside = (numbers >= least) & (numbers <= most) & (numbers > above) & (numbers < below)
    return bool(np.all(inside))


def _float32(numbers: Any) -> np.ndarray:
    array = np.asarray(numbers)
    if array.dtype == np.float32:
        return array
    with np.errstate(over="ignore"):
        return array.astype(np.float32)
