"""`record`: accepted and refused arguments, and recorded doors."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import jax
import numpy as np
import pytest

import jaxenstein
from jaxenstein import SettingError
from jaxenstein.episodes.policies import Forward
from jaxenstein.episodes.recorder import record
from jaxenstein.episodes.session import Session
from tests.episodes.world import World


def test_wrong_arguments_of_record(world: World) -> None:
    arguments: dict[str, Any]
    for arguments, words in (
        ({"policy": "exprt"}, "has no player 'exprt', did you mean 'expert'"),
        ({"policy": "greedy_medkits"}, "has no player 'greedy_medkits'"),
        ({"policy": [2, 5]}, r"action 1 \(from 0\) is 5"),
        ({"policy": [2, 0.5]}, "one whole number"),
        ({"policy": lambda session: 0.5}, "one whole number"),
        ({"seed": -1}, "a seed must be"),
        ({"steps": 0}, "steps must be"),
        ({"steps": 2.5}, "steps must be a whole number"),
        ({"policy": 5}, "policy must be a name, a function or a sequence of actions, not 5"),
    ):
        with pytest.raises(SettingError, match=words):
            record(*world, **arguments)


def test_function_policy_can_have_memory(world: World) -> None:
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


def test_opened_door_is_in_front_of_the_agent() -> None:
    """In a generated corridor, whose level has room for absent doors."""
    env, params = jaxenstein.make("key-corridor-s3r3", height=8, width=8)
    played = jaxenstein.record(env, params, "expert", seed=0)
    assert played.tilemap is not None
    doors = played.tilemap.doors
    assert played.closed.shape == (played.steps + 1, len(doors))
    assert played.closed[0].all()
    opened = 0
    for step, event in enumerate(played.events, 1):
        new = np.flatnonzero(played.closed[step - 1] & ~played.closed[step])
        assert len(new) == ("opened a door" in event)
        for slot in new:
            middle = doors[slot].column + 0.5, doors[slot].row + 0.5
            assert math.dist(played.positions[step], middle) < 1.6
            opened += 1
        # Whoever is in a doorway has opened it.
        place = tuple(np.floor(played.positions[step]).astype(int))
        for slot, door in enumerate(doors):
            assert (door.column, door.row) != place or not played.closed[step, slot]
    assert opened >= 2


NAMES = ("turn left", "turn right", "forward", "backward", "interact")


def at(x: float, actions: tuple[int, ...] = (0,)) -> Any:
    """The parts of a session that this policy uses."""
    return SimpleNamespace(state=SimpleNamespace(position=np.array([x, 0.0])), actions=actions)


def test_forward_policy_walks_then_interacts_then_turns() -> None:
    policy = Forward(NAMES, np.random.default_rng(0))
    policy.DRIFT = 0.0
    moving = [policy(at(i)) for i in range(5)]
    assert moving == [2] * 5
    stuck = [policy(at(4)) for _ in range(12)]
    assert stuck[:2] == [4, 2]
    assert stuck[2] in (0, 1)
    assert stuck.count(2) >= 2
    # In a new episode, the old plan and the old place are forgotten.
    assert [policy(at(4, ())) for _ in range(3)] == [2] * 3


def test_forward_policy_needs_only_three_actions() -> None:
    policy = Forward(NAMES[:3], np.random.default_rng(0))
    taken = {policy(at(0)) for _ in range(100)}
    assert taken == {0, 1, 2}


def test_forward_policy_names_missing_actions() -> None:
    with pytest.raises(SettingError, match="missing: turn right"):
        Forward(("turn left", "forward"), np.random.default_rng(0))
