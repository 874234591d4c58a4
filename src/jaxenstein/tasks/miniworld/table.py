"""What builds MiniWorld's environments, by their ids."""

from __future__ import annotations

import importlib
from collections.abc import Callable

from ...environment import AnyEnvironment

# The modules of those that are not among the rooms.
_MODULES = {
    "maze": "box_maze",
    "collect-health": "collect_health",
    "pickup-objects": "objects",
    "put-next": "objects",
    "sign": "sign",
}


def build(id: str) -> Callable[..., AnyEnvironment]:
    """What makes one of them from the settings that all environments share."""
    name = id.removeprefix("miniworld-")
    module = next((m for start, m in _MODULES.items() if name.startswith(start)), "rooms")
    return importlib.import_module(f".{module}", __package__).build(name)
