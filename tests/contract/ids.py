"""All ids, with marks: the first of each class and kind of map, and their variants."""

from __future__ import annotations

import functools
from typing import Any

import pytest

from jaxenstein.catalogue import ENTRIES, MAIN_IDS

# Other kinds of map of a class: doors, many starts, goals drawn by chance, resets without an end.
KINDS = ("key-door", "my-way-home", "dmlab-random-goal-01-respawn")


def _first_of_their_class() -> set[str]:
    """The first id of each class: one id for all sizes and maps of a class."""
    found: dict[Any, str] = {}
    for name in MAIN_IDS:
        build = ENTRIES[name].build
        found.setdefault(build.func if isinstance(build, functools.partial) else build, name)
    return {*found.values(), *KINDS}


def ids(names: tuple[str, ...]) -> list[Any]:
    """The names as parameters, with their marks."""
    first, variant = pytest.mark.optimised, pytest.mark.variant
    return [pytest.param(n, marks=first if n in FIRST else variant) for n in names]


FIRST = _first_of_their_class()
IDS = ids(MAIN_IDS)
ALL_IDS = ids(tuple(ENTRIES))
