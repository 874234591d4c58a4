"""The position in the message of a map error, and suggested names."""

from __future__ import annotations

import pytest

from jaxenstein.errors import (
    JAXensteinError,
    MapError,
    SettingError,
    UnknownEnvironmentError,
    nearest,
)


@pytest.mark.parametrize(
    ("place", "message"),
    [
        ({}, "no"),
        ({"line": 3}, "line 3: no"),
        ({"line": 3, "column": 7}, "line 3, column 7: no"),
        ({"line": 3, "column": 7, "source": "other"}, "other, line 3, column 7: no"),
        ({"source": "other"}, "other: no"),
    ],
)
def test_map_error_states_its_place(place: dict, message: str) -> None:
    error = MapError("no", **place)
    assert str(error) == message
    assert (error.line, error.column) == (place.get("line"), place.get("column"))


def test_errors_are_value_errors() -> None:
    for kind in (MapError, SettingError, UnknownEnvironmentError):
        assert issubclass(kind, JAXensteinError)
        assert issubclass(kind, ValueError)


@pytest.mark.parametrize("word", ["my-way-hom", "MY-WAY-HOME", "my_way_home"])
def test_nearest_finds_the_intended_name(word: str) -> None:
    assert nearest(word, ("simple", "my-way-home")) == ", did you mean 'my-way-home'?"


def test_nearest_is_empty_if_nothing_is_similar() -> None:
    assert nearest("zzz", ("simple", "my-way-home")) == ""
    assert nearest("zzz", ()) == ""


def test_nearest_orders_by_similarity() -> None:
    assert nearest("heigth", ("weight", "height")) == ", did you mean 'height' or 'weight'?"
