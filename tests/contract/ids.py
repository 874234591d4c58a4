"""The ids, those that repeat others among the slow tests: each takes seconds to compile."""

from __future__ import annotations

import re
from typing import Any

import pytest

from jaxenstein.catalogue import MAIN_IDS

# They differ from another one by map, size or look alone.
ALIKE = r".*-colorless|key-corridor-s(3r[23]|5r3|6r3)|dmlab-.*-0[23](-respawn)?|doom-.*-sparse"
# Worlds of one class with other rules, which have tests of their own.
RELATED = r"minigrid-(?!door-key).*"


def slow_where(pattern: str) -> list[Any]:
    """All ids, marked as slow where a pattern fits."""
    return [
        pytest.param(name, marks=pytest.mark.slow) if re.fullmatch(pattern, name) else name
        for name in MAIN_IDS
    ]


IDS = slow_where(f"{ALIKE}|{RELATED}")
GOLDEN_IDS = slow_where(ALIKE)
