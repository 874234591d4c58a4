"""One declaration of a field defines its check, message, flag and entry in files."""

from __future__ import annotations

import argparse
import dataclasses
from typing import Any, Literal, cast

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxenstein import SettingError
from jaxenstein.cli.arguments import reader
from jaxenstein.fields import (
    Domain,
    as_arrays,
    check,
    check_names,
    check_numbers,
    check_value,
    choice,
    number,
    of_form,
    options_of,
)

Colour = Literal["red", "green"]


@dataclasses.dataclass(frozen=True)
class Sample:
    """A field of each form.

    Attributes:
        size: rows of
            the `image`.
        angle: of view, in degrees.
    """

    size: int = number(64, 1, 4096)
    layers: int = number(2, 1)
    free: int = 3
    large: int = number(5, 1, 10**12)
    angle: float = number(60.0, 30, 120)
    near: float = number(0.2, above=0)
    step: float = number(0.5, 0, below=1)
    scale: float = 1.0
    wide: bool = False
    colour: Colour = choice("red", Colour)
    mode: str | None = choice(None, (*("step", "next"), None))
    seed: int | None = number(None, 0, 9, whole=True)
    gamma: float | None = number(None, 0, 1)
    levels: Any = of_form(None, "seeds")
    convolutions: Any = of_form(None, "layers")


@dataclasses.dataclass(frozen=True)
class Derived(Sample):
    size: int = 8


SETTINGS: list[tuple[str, Any, str]] = [
    ("size", 0, "size must be a whole number from 1 to 4096, not 0"),
    ("size", None, "size must be a whole number from 1 to 4096, not None"),
    ("layers", 0, "layers must be a whole number >= 1, not 0"),
    ("free", 0.5, "free must be a whole number, not 0.5"),
    ("free", 2**31, "free must be a whole number, not 2147483648, which does not fit into int32"),
    ("free", -(2**31) - 1, "not -2147483649, which does not fit into int32"),
    ("layers", 10**400, "layers must be a whole number >= 1, not 1000"),
    ("large", 10**12 + 1, "large must be a whole number from 1 to 1e+12, not 1000000000001"),
    ("angle", 20, "angle must be a finite number from 30 to 120, not 20"),
    ("angle", "wide", "angle must be a finite number from 30 to 120, not 'wide'"),
    ("near", 0, "near must be a finite number above 0, not 0"),
    ("near", float("nan"), "near must be a finite number above 0, not nan"),
    ("near", 1e-50, "near must be a finite number above 0, not 1e-50, which is 0 in float32"),
    ("near", 1e308, "near must be a finite number above 0, not 1e+308, which is inf in float32"),
    ("near", 10**400, "near must be a finite number above 0, not 1000"),
    ("step", 1, "step must be a finite number >= 0 and below 1, not 1"),
    ("step", 1 - 1e-12, ">= 0 and below 1, not 0.999999999999, which is 1 in float32"),
    ("scale", float("inf"), "scale must be a finite number, not inf"),
    ("wide", 1, "wide must be True or False, not 1"),
    ("colour", "gren", "colour must be one of 'red', 'green', not 'gren', did you mean 'green'?"),
    ("mode", "stop", "mode must be one of 'step', 'next', None, not 'stop', did you mean 'step'?"),
    ("seed", 10, "seed must be None or a whole number from 0 to 9, not 10"),
    ("gamma", 1.5, "gamma must be None or a finite number from 0 to 1, not 1.5"),
    ("levels", (3, 3), "levels must be None or two whole numbers from 0 to 2**32"),
    ("levels", range(0, 9, 2), "levels must be None or two whole numbers from 0 to 2**32"),
    ("levels", (0, 2**24 + 1), "(as a flag: 0,200), not (0, 16777217)"),
    ("convolutions", ((8, 4),), "convolutions must be None or [kernel, stride, features]"),
    ("convolutions", 3, "convolutions must be None or [kernel, stride, features]"),
]


@pytest.mark.parametrize(("name", "value", "message"), SETTINGS)
def test_wrong_setting_gives_the_same_error_in_python_and_in_a_file(name, value, message):
    with pytest.raises(SettingError) as caught:
        check(Sample(**{name: value}))
    assert message in str(caught.value)
    options = {field.name: field for field in options_of(Sample, "x")}
    with pytest.raises(SettingError) as again:
        check_value(name, options[name].domain, value)
    assert message in str(again.value)


def test_whole_float_is_accepted_in_a_file_only():
    domain = next(field.domain for field in options_of(Sample, "x") if field.name == "size")
    assert check_value("size", domain, 4.0) == 4
    with pytest.raises(SettingError, match=r"size must be a whole number .*, not 4\.0"):
        check(Sample(size=cast(int, 4.0)))


def test_valid_settings_stay():
    values: dict[str, Any] = {
        "size": np.int64(4096), "angle": np.float32(30), "near": 1, "wide": True, "seed": 9,
        "colour": "green", "mode": "next", "levels": range(2, 5), "convolutions": [[8, 4, 2]],
    }  # fmt: skip
    sample = Sample(**values)
    check(sample)
    assert (sample.levels, sample.convolutions) == ((2, 5), ((8, 4, 2),))
    check(Derived())
    with pytest.raises(SettingError, match="size must be a whole number from 1 to 4096, not 0"):
        check(Derived(size=0))


@dataclasses.dataclass(frozen=True)
class Numbers:
    steps: Any = number(7, 1)
    bold: Any = False
    share: Any = number(0.5, 0, 1)
    above: Any = number(0.2, above=0)
    gamma: Any = number(None, 0, 1)
    free: Any = 0.0


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("steps", 0, "steps must be a whole number from 1 to 2147483647, not 0"),
        ("steps", np.int64(10**12), "from 1 to 2147483647, not 1000000000000"),
        ("steps", 10**30, "from 1 to 2147483647, not 1000"),
        ("steps", 2.5, "steps must be a whole number from 1"),
        ("steps", float("nan"), "steps must be a whole number from 1"),
        ("steps", True, "steps must be a whole number from 1"),
        ("steps", None, "steps must be a number or an array of them, not None"),
        ("bold", 1, "bold must be True or False, not 1"),
        ("share", 1.1, "share must be a finite number from 0 to 1, not 1.1"),
        (
            "share",
            np.array([0.5, -1]),
            "share must be a finite number from 0 to 1, not [0.5, -1.0]",
        ),
        ("share", [0.5], "share must be a number or an array of them, not [0.5]"),
        ("share", "much", "share must be a number or an array of them, not 'much'"),
        ("above", 1e-50, "above must be a finite number above 0, not 1e-50, which is 0 in float32"),
        ("gamma", 2, "gamma must be None or a finite number from 0 to 1, not 2"),
        ("free", 1e300, "free must be a finite number, not 1e+300, which is inf in float32"),
        ("free", 10**400, "free must be a finite number, not 1000"),
        ("free", True, "free must be a finite number, not True"),
    ],
)
def test_wrong_number_is_refused(name, value, message):
    for entry in (check_numbers, as_arrays):
        with pytest.raises(SettingError) as caught:
            entry(Numbers(**{name: value}))
        assert message in str(caught.value)
    check_numbers(Numbers(**{name: value}), skip=[name])


def test_numbers_become_arrays_and_tracers_pass():
    arrays = as_arrays(Numbers(steps=9.0, free=jnp.array([1, 2])))
    assert (arrays.steps.dtype, int(arrays.steps)) == (np.int32, 9)
    assert (arrays.free.dtype, arrays.free.shape) == (np.float32, (2,))
    assert (arrays.bold.dtype, arrays.gamma) == (np.bool_, None)
    # The nearest float32 of a limit is in the range, though it lies above the limit.
    turned = dataclasses.make_dataclass("Turned", [("angle", Any, number(0.0, 0, 2 * np.pi))])
    check_numbers(turned(np.float32(2 * np.pi)))
    doubled = jax.jit(lambda x: as_arrays(Numbers(share=x)).share * 2)
    assert doubled(4.0) == 8


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("size", "3e3", 3000),
        ("size", "3_000", 3000),
        ("angle", "60", 60.0),
        ("wide", "true", True),
        ("gamma", "none", None),
        ("colour", "green", "green"),
        ("levels", "0,200", (0, 200)),
        ("convolutions", "8x4x32,4x2x64", ((8, 4, 32), (4, 2, 64))),
    ],
)
def test_flag_text_is_parsed(name, text, value):
    read = reader(options_of(Sample, "x", [name])[0].domain)(text)
    assert (read, type(read)) == (value, type(value))


@pytest.mark.parametrize(
    ("name", "text"), [("size", "x"), ("size", "nan"), ("levels", "5"), ("convolutions", "8x4")]
)
def test_invalid_flag_text_is_refused(name, text):
    with pytest.raises(argparse.ArgumentTypeError, match=r"^must be .*, not "):
        reader(options_of(Sample, "x", [name])[0].domain)(text)


def test_fields_are_described_by_their_docstring_range_and_default():
    size, angle, free = options_of(Sample, "view", ["size", "angle", "free"])
    assert size.described == "rows of the image (from 1 to 4096; default 64)"
    assert angle.described == "of view, in degrees (from 30 to 120; default 60)"
    assert (free.help, free.group) == ("(python -OO strips the explanation)", "view")
    assert options_of(Derived, "x", ["size"])[0].described.endswith("(from 1 to 4096; default 8)")


def test_degrees_are_one_number_or_two():
    domain = Domain("angle", -3600, 3600, optional=True)
    assert [reader(domain)(text) for text in ("-45,45.5", "90", "none")] == [(-45, 45.5), 90, None]
    for text in ("90,0", "3601", "1,2,3", "north", "nan"):
        with pytest.raises(
            argparse.ArgumentTypeError, match=r"None or degrees.* from -3600 to 3600"
        ):
            reader(domain)(text)


def test_unknown_names_are_refused():
    with pytest.raises(
        SettingError, match=r"unknown option 'sise', did you mean 'size'.*known: si"
    ):
        check_names(["sise"], ["size", "layers"], "option")


def test_ranges_in_words():
    assert Domain("number", below=2).words == "a finite number below 2"
    assert Domain("number", above=0, below=2).words == "a finite number above 0 and below 2"
    assert Domain("whole", most=2).words == "a whole number <= 2"
