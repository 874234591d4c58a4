"""An agent that comes with the package does what its file says."""

from __future__ import annotations

import pytest

pytest.importorskip("flax")

import jaxenstein
from jaxenstein.baselines import load_policy


def test_one_fetches_the_key() -> None:
    policy = load_policy("pretrained/key-door")
    episode = jaxenstein.record(policy.env, policy.params, policy, seed=0)
    assert (episode.ending, episode.returns[-1], episode.steps) == ("terminated", 1, 10)


def test_one_finds_the_armour() -> None:
    policy = load_policy("pretrained/doom-my-way-home", greedy=True)
    for seed in (0, 1, 2):
        episode = jaxenstein.record(policy.env, policy.params, policy, seed=seed)
        assert (episode.ending, episode.steps < 200) == ("terminated", True)
        assert episode.returns[-1] > 0.9
