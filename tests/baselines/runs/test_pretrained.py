"""The agents that come with the package: they load anywhere, and do what their files say."""

from __future__ import annotations

import pytest

pytest.importorskip("flax")

import jaxenstein
from jaxenstein.baselines import load_policy
from jaxenstein.baselines.runs.trained import HERE, pretrained

NAMES = sorted(path.stem for path in HERE.glob("*.npz"))


def test_they_are_small_and_listed() -> None:
    assert NAMES
    assert sorted(pretrained()) == NAMES
    assert all((HERE / f"{name}.npz").stat().st_size <= 300_000 for name in NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_each_is_of_an_environment_that_there_is(name: str) -> None:
    policy = load_policy(f"pretrained/{name}")
    assert policy.env.name in jaxenstein.environment_ids()
    policy.check(policy.env, policy.params)


def test_one_finds_the_armour() -> None:
    policy = load_policy("pretrained/doom-my-way-home", greedy=True)
    for seed in (0, 1, 2):
        episode = jaxenstein.record(policy.env, policy.params, policy, seed=seed)
        assert (episode.ending, episode.steps < 200) == ("terminated", True)
        assert episode.returns[-1] > 0.9
