"""The player that walks on."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from jaxenstein.errors import SettingError
from jaxenstein.players.forward import Forward

NAMES = ("turn left", "turn right", "forward", "backward", "interact")


def at(x: float, y: float = 0.0) -> Any:
    """A session as far as this policy looks at it."""
    return SimpleNamespace(state=SimpleNamespace(position=np.array([x, y])))


def test_forward_policy_walks_then_tries_the_door_then_turns() -> None:
    policy = Forward(NAMES, np.random.default_rng(0))
    policy.DRIFT = 0.0
    moving = [policy(at(i)) for i in range(5)]
    assert moving == [2] * 5
    stuck = [policy(at(4)) for _ in range(12)]
    assert stuck[:2] == [4, 2]
    assert stuck[2] in (0, 1)
    assert stuck.count(2) >= 2


def test_forward_policy_needs_three_actions_only() -> None:
    policy = Forward(NAMES[:3], np.random.default_rng(0))
    taken = {policy(at(0)) for _ in range(100)}
    assert taken == {0, 1, 2}


def test_forward_policy_says_what_it_lacks() -> None:
    with pytest.raises(SettingError, match="missing: turn right"):
        Forward(("turn left", "forward"), np.random.default_rng(0))
