"""Fields that a user may set: one declaration to check, read and document each of them.

A field is declared by the default of a dataclass attribute: `number(64, 1, 4096)`, `choice(...)`,
`of_form(...)`, or a plain default, whose type gives the form of its values. The `Attributes`
section of the docstring describes it. A subclass may change the default but not the valid values.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import inspect
import math
import operator
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
    "text": "a string",
    "table": "a table of names and values",
    "layers": "[kernel, stride, features] for each layer, all >= 1 (as a flag: 8x4x32,4x2x64)",
    "angle": "degrees, or the lowest and highest degrees (as a flag: -45,45)",
    "seeds": "two whole numbers from 0 to 2**32, at most 2**24 apart: the first seed and the one "
    "after the last (as a flag: 0,200)",
    "images": "a folder of images, or in Python a table of names and arrays",
    "any": "",
}
_DOMAIN = "domain"
_INT32 = np.iinfo(np.int32)

R = TypeVar("R")


@dataclasses.dataclass(frozen=True)
class Domain:
    """The valid values of a field.

    Attributes:
        form: the kind of value.
        least: the smallest valid number.
        most: the largest valid number.
        above: all numbers are larger than this, and finite.
        below: all numbers are smaller than this.
        choices: the words of a choice, possibly with None.
        optional: whether None is valid too.
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
        """The valid values in words, such as "a whole number from 1 to 64"."""
        if self.form == "choice":
            return f"one of {', '.join(map(repr, self.choices))}"
        return f"{'None or ' * self.optional}{_WORDS[self.form]}{self.range}"

    @property
    def range(self) -> str:
        """The range in words, such as " from 1 to 64" or " >= 1"; "" if there is none."""
        if math.isfinite(self.least) and math.isfinite(self.most):
            return f" from {self.least:.10g} to {self.most:.10g}"
        bounds = {">=": self.least, "above": self.above, "<=": self.most, "below": self.below}
        words = [f"{word} {bound:.10g}" for word, bound in bounds.items() if math.isfinite(bound)]
        return f" {' and '.join(words)}" if words else ""

    def converted(self, value: Any) -> Any:
        """Convert a value from a file to the type of the field, if possible.

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
        """Why a converted value is invalid, as "must be ..., not ..."; "" if it is valid."""
        if (value is None and self.optional) or self._holds(value):
            return ""
        close = nearest(value, filter(None, self.choices)) if isinstance(value, str) else ""
        return f"must be {self.words}, not {quoted(value)}{close or self._rounded(value)}"

    def fault_of_array(self, value: Any) -> str:
        """As `fault`, for what becomes a float32, int32 or bool array; traced values are valid."""
        if (value is None and self.optional) or isinstance(value, Tracer):
            return ""
        if not is_array_like(value):
            wrong = value is None or isinstance(value, str | list | tuple | dict)
            return f"must be a number or an array of them, not {quoted(value)}" if wrong else ""
        array, domain = np.asarray(value), self._of_arrays
        if self.form == "switch":
            good = array.dtype == bool
        else:
            # Types that numpy does not know, such as bfloat16, are numbers too.
            good = array.dtype.kind in "iuf" or jnp.issubdtype(array.dtype, jnp.floating)
            good = good and (self.form != "whole" or bool(np.all(array == np.floor(array))))
            good = good and domain._within(array)
        close = "" if good else domain._rounded(value)
        return "" if good else f"must be {domain.words}, not {quoted(array.tolist())}{close}"

    @functools.cached_property
    def _of_arrays(self) -> Domain:
        """The domain of the elements of an array: whole numbers have 32 bits."""
        if self.form != "whole":
            return self
        least, most = max(self.least, int(_INT32.min)), min(self.most, int(_INT32.max))
        return dataclasses.replace(self, least=least, most=most)

    def _holds(self, value: Any) -> bool:
        """Whether a value has the right form and range."""
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
        """Whether all numbers are in the range, in the precision in which they are used."""
        try:
            return _between(numbers if self.form == "whole" else _float32(numbers), *self._bounds)
        except OverflowError:
            return False

    @functools.cached_property
    def _bounds(self) -> list[Any]:
        """The range in the precision of the field; whole numbers without a range are int32."""
        bounds = self.least, self.most, self.above, self.below
        if self.form != "whole":
            return [np.float32(bound) for bound in bounds]
        least = self.least if self.least > -math.inf else int(_INT32.min)
        most = self.most if self.most < math.inf else int(_INT32.max)
        return [least, most, self.above, self.below]

    def _rounded(self, value: Any) -> str:
        """A note if a number is only invalid because of float32 or int32, else ""."""
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
    """Declare a number with a range; None is valid if it is the default.

    Args:
        default: the default; if it is an int, the field is a whole number.
        least: the smallest value.
        most: the largest value.
        above: an exclusive lower bound, instead of `least`.
        below: an exclusive upper bound, instead of `most`.
        whole: makes the field a whole number if the default is None.
    """
    form: Form = "whole" if whole or is_whole(default) else "number"
    domain = Domain(form, least, most, above, below, optional=default is None)
    return dataclasses.field(default=default, metadata={_DOMAIN: domain})


def choice(default: str | None, choices: Any) -> Any:
    """Declare one of several words, given by a `Literal` or by a tuple, which may contain None."""
    words = typing.get_args(choices) or tuple(choices)
    return dataclasses.field(default=default, metadata={_DOMAIN: Domain("choice", choices=words)})


def of_form(default: Any, form: Form) -> Any:
    """Declare a field of another form, such as "seeds"; None is valid if it is the default."""
    domain = Domain(form, optional=default is None)
    return dataclasses.field(default=default, metadata={_DOMAIN: domain})


@functools.cache
def _domains(cls: Any) -> dict[str, Domain]:
    """The domains of all fields; the class nearest in the method resolution order decides."""
    forms: dict[type, Form] = {bool: "switch", int: "whole", float: "number", str: "text"}
    found = {}
    for field in dataclasses.fields(cls):
        owners = [vars(owner).get("__dataclass_fields__", {}) for owner in cls.__mro__]
        declared = [own[field.name].metadata.get(_DOMAIN) for own in owners if field.name in own]
        undeclared = Domain(forms.get(type(field.default), "any"))
        found[field.name] = next(filter(None, declared), undeclared)
    return found


def domain_of(cls: Any, name: str) -> Domain:
    """The domain of one field of a dataclass."""
    return _domains(cls)[name]


def check(record: Any) -> None:
    """Check the settings in a dataclass.

    Converts seeds and layers to tuples, and numpy numbers to Python numbers.

    Raises:
        SettingError: the value of a field is invalid.
    """
    for name, domain in _domains(type(record)).items():
        value = getattr(record, name)
        if domain.form in ("seeds", "layers", "angle") or isinstance(value, np.generic):
            value = as_tuples(value)
            object.__setattr__(record, name, value)
        _complain(name, domain.fault(value))


def check_numbers(record: Any, skip: Iterable[str] = ()) -> None:
    """Check the fields of a record of numbers or arrays; traced values are not checked.

    Raises:
        SettingError: the value of a field is invalid in float32, int32 or bool.
    """
    for name, domain in _domains(type(record)).items():
        if name not in skip:
            _complain(name, domain.fault_of_array(getattr(record, name)))


def as_arrays(record: R, skip: Iterable[str] = ()) -> R:
    """Convert numbers in a record to float32, int32 or bool arrays; keep None and traced values.

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
    """Convert the value of a field from a file to the type of the field, and check it.

    Raises:
        SettingError: the value is invalid.
    """
    value = domain.converted(value)
    _complain(name, domain.fault(value))
    return value


def check_whole(name: str, value: Any, least: float = 1, most: float = math.inf) -> int:
    """Check a whole number that is not a declared field; returns an int."""
    _complain(name, Domain("whole", least, most).fault(value))
    return int(value)


def check_seed(seed: Any, bits: int = 32) -> int:
    """Check a seed; returns an int.

    Raises:
        SettingError: the seed is not a whole number from 0 to 2**bits - 1.
    """
    try:
        number = operator.index(seed)
    except TypeError:
        number = -1
    if isinstance(seed, bool) or not 0 <= number < 2**bits:
        wanted = f"a whole number from 0 to 2**{bits} - 1"
        raise SettingError(f"a seed must be {wanted}, not {quoted(seed)}")
    return number


def check_names(given: Iterable[str], known: Iterable[str], what: str = "setting") -> None:
    """Raise a `SettingError` that suggests the nearest name if a given name is unknown."""
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
    """An option that a user may set by a flag or in a config file.

    Attributes:
        name: the name in a file; the flag has hyphens instead of underscores.
        group: its group in the help.
        domain: its valid values.
        default: its default.
        help: what it does.
    """

    name: str
    group: str
    domain: Domain
    default: Any
    help: str

    @property
    def described(self) -> str:
        """The help of its flag: what it does, with range and default."""
        default = f"{self.default:g}" if isinstance(self.default, float) else self.default
        facts = (self.domain.range.strip(), "" if default is None else f"default {default}")
        shown = "; ".join(filter(None, facts))
        help = self.help.replace("`", "").rstrip(".")
        return f"{help} ({shown})" if shown else help


def options_of(cls: Any, group: str, names: Iterable[str] | None = None) -> list[Option]:
    """The options of a dataclass: for all fields, or for the named ones."""
    helps, domains = attributes(cls), _domains(cls)
    defaults = {field.name: field.default for field in dataclasses.fields(cls)}
    found = []
    for name in domains if names is None else names:
        text = helps.get(name, "(python -OO strips the explanation)")
        found.append(Option(name, group, domains[name], defaults[name], text))
    return found


def names_of(cls: Any) -> tuple[str, ...]:
    """The names of the fields of a dataclass."""
    return tuple(field.name for field in dataclasses.fields(cls))


def values_of(record: Any) -> dict[str, Any]:
    """The fields of a dataclass by name, with their values."""
    return {name: getattr(record, name) for name in names_of(record)}


def attributes(cls: type) -> dict[str, str]:
    """The documented attributes of a class and its bases, bases first, with their descriptions.

    Empty under `python -OO`, which strips docstrings.
    """
    found: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        text = inspect.cleandoc(base.__dict__.get("__doc__") or "")
        # Up to the next section of the docstring.
        listed = re.split(r"^\S", text.partition("Attributes:\n")[2], flags=re.MULTILINE)[0]
        entries = re.findall(r"^ {4}(\w+): (.*?)(?=^ {4}\w|\Z)", listed, re.MULTILINE | re.DOTALL)
        found |= {name: " ".join(meaning.split()) for name, meaning in entries}
    return found


def as_tuples(value: Any) -> Any:
    """Convert lists and ranges of seeds to tuples, at every depth, and numpy values to Python's.

    Images become the path of their folder, if they have one.
    """
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, range) and value.step == 1:
        return value.start, value.stop
    if isinstance(value, Images) and value.folder is not None:
        return value.folder
    return tuple(map(as_tuples, value)) if isinstance(value, list | tuple) else value


def is_whole(value: Any) -> bool:
    """Whether a value is a whole number and not a bool."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def is_array_like(value: Any) -> bool:
    """Whether a value is a number, a bool, or an array of them."""
    return isinstance(value, bool | int | float | np.generic | np.ndarray | jax.Array)


def is_number(value: Any) -> bool:
    """Whether a value is a Python or numpy number and not a bool."""
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
