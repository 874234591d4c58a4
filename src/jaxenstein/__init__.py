"""First-person, visual, partially observable environments that live entirely inside JAX."""

import importlib
from typing import TYPE_CHECKING, Any

from .adapters.registration import register_once_imported
from .environment import Environment, Params, State
from .errors import (
    DivergenceWarning,
    JAXensteinError,
    LevelWarning,
    MapError,
    MapWarning,
    SettingError,
    TrajectoryError,
    UnknownEnvironmentError,
)
from .registry import environment_ids, make, register
from .text_maps import from_ascii, from_file
from .version import __version__

if TYPE_CHECKING:
    from .episodes.recorder import Replay, record, replay
    from .episodes.session import Session
    from .episodes.trajectory_file import load_trajectory
    from .machine import use_cores
    from .maps.map_files import sample_map
    from .trajectory import Trajectory
    from .view.episode import Episode
    from .view.frames import Frame, show

register_once_imported()

# What people look at is loaded when it is first asked for: training needs none of it.
_LAZY = {
    "Episode": ".view.episode",
    "Frame": ".view.frames",
    "Replay": ".episodes.recorder",
    "Session": ".episodes.session",
    "Trajectory": ".trajectory",
    "load_trajectory": ".episodes.trajectory_file",
    "record": ".episodes.recorder",
    "replay": ".episodes.recorder",
    "sample_map": ".maps.map_files",
    "show": ".view.frames",
    "use_cores": ".machine",
}

__all__ = [
    "DivergenceWarning",
    "Environment",
    "Episode",
    "Frame",
    "JAXensteinError",
    "LevelWarning",
    "MapError",
    "MapWarning",
    "Params",
    "Replay",
    "Session",
    "SettingError",
    "State",
    "Trajectory",
    "TrajectoryError",
    "UnknownEnvironmentError",
    "__version__",
    "environment_ids",
    "from_ascii",
    "from_file",
    "load_trajectory",
    "make",
    "record",
    "register",
    "replay",
    "sample_map",
    "show",
    "use_cores",
]


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(importlib.import_module(_LAZY[name], __name__), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_LAZY})
