"""Watching an agent play, with the keys of a game that do not act."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..episodes.policies import Policy
from .controls import Controls
from .game import COMMANDS, Game


class AgentControls(Controls):
    """An agent in the place of keys: it acts whenever time allows."""

    def __init__(self, choose: Callable[[], int], fps: float) -> None:
        """Take what chooses the next action, and the most actions a second."""
        super().__init__((), fps)
        self._choose = choose

    def due(self, now: float) -> float | None:
        """Seconds until the next action."""
        return max(0.0, self._ready - now)

    def take(self, now: float) -> int | None:
        """The action to take now, if one is due."""
        if now < self._ready:
            return None
        self._ready = now + self._interval
        return self._choose()


class AgentGame(Game):
    """A game that a policy plays; people pause it, look at the map, and begin the next episode."""

    def __init__(self, env: Any, params: Any, policy: Policy, **kwargs: Any) -> None:
        """Take the policy; the other arguments are those of `Game`."""
        super().__init__(env, params, **kwargs)
        self._controls = AgentControls(lambda: int(policy(self.session)), kwargs.get("fps", 15.0))
        # Compiles what the policy needs, before anything is shown.
        policy(self.session)

    def help(self) -> list[str]:
        """What the keys do."""
        return [f"{key}: {what}" for key, what in COMMANDS.items()]
