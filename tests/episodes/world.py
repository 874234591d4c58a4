"""The small world of the tests of episodes."""

from __future__ import annotations

from typing import Any

MAP = "########\n#S.rR.G#\n#......#\n########\n"
FACES = "west\n########\n#      #\n#      #\n11111111\n"
World = tuple[Any, Any]
