"""A player without a task that gets around: it keeps a plan from one step to the next."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from .walking import walking_actions


class Session(Protocol):
    """An episode in play; its state has a position."""

    state: Any


class Forward:
    """Walks on; where it is blocked it tries to open a door, and if that fails turns away.

    Now and then it also turns a little on its way, so as to come around.
    """

    DRIFT = 0.04

    def __init__(self, action_names: Sequence[str], rng: np.random.Generator) -> None:
        """Take the actions by their names; an environment without `interact` never gets it.

        Raises:
            SettingError: there is no action to walk or turn with.
        """
        self._left, self._right, self._forward = walking_actions(action_names)
        self._interact = action_names.index("interact") if "interact" in action_names else None
        self._rng = rng
        self._plan: list[int] = []
        self._walked_from: np.ndarray | None = None
        self._tried = False

    def __call__(self, session: Session) -> int:
        """Forward, unless the last step forward did not move."""
        position = np.asarray(session.state.position)
        if not self._plan:
            self._plan = self._next(position)
        action = self._plan.pop(0)
        self._walked_from = position if action == self._forward else None
        return action

    def _next(self, position: np.ndarray) -> list[int]:
        stuck = self._walked_from is not None and np.array_equal(self._walked_from, position)
        turn = (self._left, self._right)[int(self._rng.integers(2))]
        if not stuck:
            self._tried = False
            drift = self._rng.random() < self.DRIFT
            return [turn] * int(self._rng.integers(1, 4)) if drift else [self._forward]
        if self._interact is not None and not self._tried:
            self._tried = True
            return [self._interact, self._forward]
        self._tried = False
        return [turn] * int(self._rng.integers(2, 9)) + [self._forward]
