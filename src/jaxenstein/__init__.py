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
    from .convolution import patch_convolution
    from .episodes.recorder import Replay, record, replay
    from .episodes.session import Session
    from .episodes.trajectory_file import load_trajectory
    from .evaluation import evaluate
    from .machine import use_cores
    from .maps.map_files import sample_map
    from .results import Results, read_results, write_results
    from .trajectory import Trajectory
    from .view.episode import Episode
    from .view.frames import Frame, show

register_once_imported()

# Training does not need these names, so they are loaded on first use.
_LAZY = {
    "Episode": ".view.episode",
    "Frame": ".view.frames",
    "Replay": ".episodes.recorder",
    "Results": ".results",
    "Session": ".episodes.session",
    "Trajectory": ".trajectory",
    "evaluate": ".evaluation",
    "load_trajectory": ".episodes.trajectory_file",
    "patch_convolution": ".convolution",
    "read_results": ".results",
    "record": ".episodes.recorder",
    "replay": ".episodes.recorder",
    "sample_map": ".maps.map_files",
    "show": ".view.frames",
    "use_cores": ".machine",
    "write_results": ".results",
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
    "Results",
    "Session",
    "SettingError",
    "State",
    "Trajectory",
    "TrajectoryError",
    "UnknownEnvironmentError",
    "__version__",
    "environment_ids",
    "evaluate",
    "from_ascii",
    "from_file",
    "load_trajectory",
    "make",
    "patch_convolution",
    "read_results",
    "record",
    "register",
    "replay",
    "sample_map",
    "show",
    "use_cores",
    "write_results",
]


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(importlib.import_module(_LAZY[name], __name__), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_LAZY})
