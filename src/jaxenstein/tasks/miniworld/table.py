"""What builds MiniWorld's environments, by their ids."""

from __future__ import annotations

import importlib
from collections.abc import Callable

from ...environment import AnyEnvironment

# The modules of those that are not among the rooms.
_MODULES = {
    **dict.fromkeys(("maze", "maze-s2", "maze-s3", "maze-s3-fast"), "box_maze"),
    **dict.fromkeys(("pickup-objects", "put-next"), "objects"),
    "collect-health": "collect_health",
    "sign": "sign",
}


def build(id: str) -> Callable[..., AnyEnvironment]:
    """What makes one of them from the settings that all environments share."""
    name = id.removeprefix("miniworld-")
    module = _MODULES.get(name, "rooms")
    return importlib.import_module(f".{module}", __package__).build(name)
