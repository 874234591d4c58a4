"""What `record` takes, and what it refuses."""

from __future__ import annotations

from typing import Any

import jax
import pytest

from jaxenstein import SettingError
from jaxenstein.episodes.recorder import record
from jaxenstein.episodes.session import Session
from tests.episodes.world import World


def test_wrong_arguments_of_record(world: World) -> None:
    arguments: dict[str, Any]
    for arguments, words in (
        ({"policy": "exprt"}, "unknown policy 'exprt', did you mean 'expert'"),
        ({"policy": "greedy_medkits"}, "plays health-gathering"),
        ({"policy": [2, 5]}, r"action 1 \(from 0\) is 5"),
        ({"policy": [2, 0.5]}, "one whole number"),
        ({"policy": lambda session: 0.5}, "one whole number"),
        ({"seed": -1}, "a seed must be"),
        ({"steps": 0}, "steps must be"),
        ({"steps": 2.5}, "one whole number"),
    ):
        with pytest.raises(SettingError, match=words):
            record(*world, **arguments)


def test_a_function_may_act_and_remember(world: World) -> None:
    lengths = []

    def policy(session: Session) -> jax.Array:
        lengths.append(len(session.actions))
        assert session.observation.shape == (12, 16, 3)
        return jax.random.randint(session.policy_key(), (), 0, 5)

    episode = record(*world, policy, steps=12, seed=3)
    assert episode.steps == 12
    assert lengths == list(range(12))
    again = record(*world, policy, steps=12, seed=3)
    assert again.trajectory == episode.trajectory
