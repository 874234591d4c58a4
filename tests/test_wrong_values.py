"""Everything that a user can set refuses values outside its declaration, by name.

The values come from the declarations: those just beyond a range, and those of other forms. How
messages are worded is in test_fields.py.
"""

from __future__ import annotations

import dataclasses
import functools
import importlib
import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import jaxenstein
from jaxenstein import SettingError, registry
from jaxenstein.fields import Domain, options_of
from jaxenstein.settings import spec_from

EnterValue = Callable[[str, Any], object]
INT32 = np.iinfo(np.int32)
# Forms that accept any value, or have their own tests.
UNRESTRICTED = {"any", "text", "table"}


def values_outside(domain: Domain, *, array: bool) -> list[Any]:
    """The values just outside a range of numbers."""
    if domain.form == "whole":
        # Whole numbers are used in int32, unless their range says otherwise.
        least, most = domain.least, domain.most
        if array or math.isinf(least):
            least = max(least, INT32.min)
        if array or math.isinf(most):
            most = min(most, INT32.max)
        return [int(least) - 1, int(most) + 1]
    low, high = np.float32(domain.least), np.float32(domain.most)
    ends = [np.nextafter(low, np.float32(-np.inf)), np.nextafter(high, np.float32(np.inf))]
    return [float(end) for end in (*ends, np.float32(domain.above), np.float32(domain.below))]


def wrong_values(domain: Domain, *, array: bool) -> list[Any]:
    """Values outside a domain; with `array`, a domain whose values become arrays."""
    of_numbers = [math.nan, math.inf, -math.inf, True, "4", [3.0], (2, 1)]
    values: dict[str, list[Any]] = {
        "whole": [1.5, *of_numbers],
        "number": of_numbers,
        "switch": [1, 0.0, "yes", [True]],
        "choice": ["smell", "", True, 3, ["plain"]],
        "seeds": [3, (3, 3), (5, 2), (-1, 3), (0.0, 2), (False, True), "ab", range(0, 9, 2),
                  (0, 2**24 + 1)],
        "images": [3, True, ["wall.png"], "no/such/folder", {}],
        "layers": [3, "8x4x32", ((8, 4),), ((8, 4, 0),), ((8, 4, 1.5),)],
    }  # fmt: skip
    found = values[domain.form]
    if domain.form in ("whole", "number"):
        found = [*values_outside(domain, array=array), *found]
    return found if domain.optional or None in domain.choices else [*found, None]


def right_values(domain: Domain) -> list[Any]:
    """The ends of a range of numbers, in int32 and float32."""
    if domain.form == "whole":
        return [int(max(domain.least, INT32.min)), int(min(domain.most, INT32.max))]
    if domain.form != "number":
        return [False, True]
    above, below = np.float32(domain.above), np.float32(domain.below)
    low = max(np.float32(domain.least), np.nextafter(above, np.float32(np.inf)))
    high = min(np.float32(domain.most), np.nextafter(below, np.float32(-np.inf)))
    return [float(low), float(high)]


def domains(cls: type, names: Any = None) -> dict[str, Domain]:
    """The fields of a class that refuse some values."""
    found = {option.name: option.domain for option in options_of(cls, "", names)}
    return {name: domain for name, domain in found.items() if domain.form not in UNRESTRICTED}


def accepted_values(
    fields: dict[str, Domain], enter: EnterValue, *, array: bool = False
) -> list[Any]:
    """Wrong values that are accepted, or whose error does not name the field."""
    found = []
    for name, domain in fields.items():
        for value in wrong_values(domain, array=array):
            try:
                enter(name, value)
            except SettingError as error:
                if re.match(rf"{name} must be .*, not ", str(error)):
                    continue
            found.append((name, value))
    return found


def check_numbers(fields: dict[str, Domain], enter: EnterValue) -> None:
    """Check that wrong numbers are refused and the ends of the ranges accepted."""
    assert accepted_values(fields, enter, array=True) == []
    for name, domain in fields.items():
        for value in right_values(domain):
            enter(name, value)


@functools.cache
def one_of_each_class() -> dict[str, tuple[Any, Any]]:
    """One environment and its params, by id, for each class, settings and params."""
    kinds = {}
    for id in jaxenstein.environment_ids():
        env, params = jaxenstein.make(id)
        kinds.setdefault(
            (type(env), registry.find(id)[1].settings, type(params)), (id, env, params)
        )
    return {id: (env, params) for id, env, params in kinds.values()}


def test_settings_of_environments() -> None:
    for id, (env, _) in one_of_each_class().items():
        fields = domains(type(env), registry.find(id)[1].settings)
        assert {"height", "observation", "look_seeds"} <= set(fields)
        assert accepted_values(fields, lambda n, v, id=id: jaxenstein.make(id, **{n: v})) == [], id


def test_params_of_environments() -> None:
    for params in {type(params): params for _, params in one_of_each_class().values()}.values():
        fields = domains(type(params))
        assert {"max_steps_in_episode", "discount"} <= set(fields)
        check_numbers(fields, lambda n, v, p=params: p.replace(**{n: v}))


@pytest.fixture
def baselines() -> Any:
    pytest.importorskip("flax")
    return importlib.import_module("jaxenstein.baselines")


def test_settings_of_trainings(baselines: Any) -> None:
    make = baselines.Config
    assert accepted_values(domains(make), lambda n, v: make(**{n: v})) == []
    whole = baselines.Experiment(spec_from({"env": "simple"}), make(), {}, (0,))
    fields = domains(baselines.Experiment, ["recipe", "network"])
    assert accepted_values(fields, lambda n, v: dataclasses.replace(whole, **{n: v})) == []


def test_numbers_of_trainings(baselines: Any) -> None:
    make = baselines.HParams
    check_numbers(domains(make), lambda n, v: make(**{n: v}).check())


def test_options_of_bonuses(baselines: Any) -> None:
    known = importlib.import_module("jaxenstein.baselines.config").algorithms()
    assert {"ppo", "rnd", "icm", "e3b"} <= set(known)
    config, hparams = baselines.Config, baselines.HParams
    for algo, row in known.items():
        settings, numbers = domains(row.options, row.settings), domains(row.options, row.numbers)
        assert accepted_values(settings, lambda n, v, a=algo: config(algo=a, bonus={n: v})) == []
        check_numbers(numbers, lambda n, v, a=algo: hparams(bonus={n: v}).check(a))
