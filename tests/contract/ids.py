"""The ids, those that repeat others among the slow tests: each takes seconds to compile."""

from __future__ import annotations

import re

import pytest

from jaxenstein.catalogue import MAIN_IDS

# They differ from another one by map, size or look alone.
ALIKE = re.compile(
    r".*-colorless|key-corridor-s(3r[23]|5r3|6r3)|dmlab-.*-0[23](-respawn)?|doom-.*-sparse"
)
IDS = [
    pytest.param(name, marks=pytest.mark.slow) if ALIKE.fullmatch(name) else name
    for name in MAIN_IDS
]
