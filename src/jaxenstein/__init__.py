"""First-person, visual, partially observable environments that live entirely inside JAX."""

from .environment import Environment, Params, State
from .errors import JAXensteinError, MapError, MapWarning, SettingError, UnknownEnvironmentError
from .registry import EnvironmentId, environment_ids, from_ascii, make
from .version import __version__

__all__ = [
    "Environment",
    "EnvironmentId",
    "JAXensteinError",
    "MapError",
    "MapWarning",
    "Params",
    "SettingError",
    "State",
    "UnknownEnvironmentError",
    "__version__",
    "environment_ids",
    "from_ascii",
    "make",
]
