"""Registration with Gymnasium, in either order of import."""

from __future__ import annotations

import importlib.abc
import importlib.machinery
import importlib.util
import sys
from collections.abc import Sequence
from types import ModuleType
from typing import Any

from ..registry import ALIASES, ENTRIES, LISTENERS

NAMESPACE = "jaxenstein"
_SINGLE = "jaxenstein.adapters.gymnasium:GymnasiumEnv"
_VECTOR = "jaxenstein.adapters.gymnasium_vector:GymnasiumVectorEnv"
_VIZDOOM = "jaxenstein.adapters.vizdoom_ids:vizdoom_{}env"
VIZDOOM_VERSION = 1
VIZDOOM_SCENARIOS: dict[str, tuple[str, tuple[str, ...]]] = {
    "Basic": ("doom-basic", ("ammo",)),
    "DeadlyCorridor": ("doom-deadly-corridor", ("health",)),
    "DefendCenter": ("doom-defend-the-center", ("ammo", "health")),
    "DefendLine": ("doom-defend-the-line", ("ammo", "health")),
    "HealthGathering": ("doom-health-gathering", ("health",)),
    "MyWayHome": ("doom-my-way-home", ()),
    "PredictPosition": ("doom-predict-position", ()),
    "TakeCover": ("doom-take-cover", ("health",)),
    "Deathmatch": ("doom-deathmatch", ("killed", "health", "armour", "weapon", "ammo")),
    "HealthGatheringSupreme": ("doom-health-gathering-supreme", ("health",)),
}
"""The names of scenarios in ViZDoom's ids, with our ids and our names of the game variables."""


def gymnasium_ids() -> dict[str, str]:
    """The ids of all environments in Gymnasium, such as `jaxenstein/simple-v0`, with ours."""
    names = {name: name for name in ENTRIES} | ALIASES
    return {f"{NAMESPACE}/{new}-v{ENTRIES[ours].version}": ours for new, ours in names.items()}


def vizdoom_ids() -> dict[str, dict[str, Any]]:
    """ViZDoom's ids, such as `jaxenstein/VizdoomBasic-v1`, with their arguments."""
    return {
        f"{NAMESPACE}/Vizdoom{name}{end}-v{VIZDOOM_VERSION}": {
            "scenario": name,
            "max_buttons_pressed": most,
        }
        for name in VIZDOOM_SCENARIOS
        for end, most in (("", 1), ("-MultiBinary", 0))
    }


def register() -> None:
    """Register all environments with Gymnasium, except those already registered; drop old ids."""
    import gymnasium

    kinds = (
        (_SINGLE, _VECTOR, {id: {"env": name} for id, name in gymnasium_ids().items()}),
        (_VIZDOOM.format(""), _VIZDOOM.format("vector_"), vizdoom_ids()),
    )
    current = {id for _, _, ids in kinds for id in ids}
    for id, spec in [*gymnasium.registry.items()]:
        # A task that was registered again with another version.
        ours = spec.entry_point == _SINGLE and spec.namespace == NAMESPACE
        if ours and id not in current:
            del gymnasium.registry[id]
    for single, vector, ids in kinds:
        for id, kwargs in ids.items():
            if id not in gymnasium.registry:
                # The environment has its own time limit, so there is no `max_episode_steps`.
                gymnasium.register(id, entry_point=single, vector_entry_point=vector, kwargs=kwargs)


def register_once_imported() -> None:
    """Register now if Gymnasium is already imported, otherwise when it is; never import it here.

    Since 1.0, Gymnasium has no plugins that could load environments.
    """
    gymnasium = sys.modules.get("gymnasium")
    if hasattr(gymnasium, "register"):
        register()
    elif gymnasium is None and not any(isinstance(finder, _Watch) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Watch())


LISTENERS.append(register_once_imported)


class _Watch(importlib.abc.MetaPathFinder):
    """Registers at the end of `import gymnasium`; other finders do the import."""

    def __init__(self) -> None:
        self._asking = False

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if fullname != "gymnasium" or self._asking:
            return None
        self._asking = True
        try:
            spec = importlib.util.find_spec(fullname)
        finally:
            self._asking = False
        if spec is not None and spec.loader is not None:
            spec.loader = _Loader(spec.loader, self)
        return spec


class _Loader(importlib.abc.Loader):
    """Loads a module with another loader, then registers."""

    def __init__(self, loader: importlib.abc.Loader, watch: _Watch) -> None:
        self._loader = loader
        self._watch = watch

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> ModuleType | None:
        return self._loader.create_module(spec)

    def exec_module(self, module: ModuleType) -> None:
        # Restore the real loader, which the module should report.
        module.__loader__ = self._loader
        if module.__spec__ is not None:
            module.__spec__.loader = self._loader
        self._loader.exec_module(module)
        if self._watch in sys.meta_path:
            sys.meta_path.remove(self._watch)
        register()
