"""The warning of a training that settles without a success."""

from __future__ import annotations

import pytest

pytest.importorskip("flax")

from jaxenstein.baselines.runs.metrics import Row
from jaxenstein.baselines.runs.training import EPISODES, StallWatch


def rows(updates: int, entropy: float, episodes: int, successes: int = 0) -> list[Row]:
    """Updates of two runs; all successes are those of the second one."""
    one: Row = {"episodes": episodes, "successes": 0, "entropy": entropy}
    return [one, {**one, "successes": successes}] * updates


def test_a_policy_that_settles_without_success_is_told_of_once() -> None:
    watch = StallWatch(2)
    assert watch.check(rows(1, 1.6, 10)) is None
    assert watch.check(rows(1, 0.1, EPISODES // 2)) is None
    told = watch.check(rows(1, 0.04, EPISODES // 2))
    assert told is not None
    assert f"no success in {2 * EPISODES + 20:,} episodes" in told
    assert "from 1.6 to 0.04" in told
    assert watch.check(rows(5, 0.01, EPISODES)) is None


@pytest.mark.parametrize(("entropy", "successes"), [(1.5, 0), (0.01, 1)])
def test_one_that_still_looks_or_succeeded_once_is_not(entropy: float, successes: int) -> None:
    watch = StallWatch(2)
    assert watch.check(rows(1, 1.6, 10, successes)) is None
    assert watch.check(rows(20, entropy, EPISODES)) is None


def test_one_whose_returns_rise_is_not() -> None:
    """A task that has no success, such as monsters to shoot."""
    first: Row = {"episodes": 100, "successes": 0, "entropy": 1.6}
    first |= {"return_sum": 200.0, "return_square_sum": 500.0}
    rising: Row = {**first, "entropy": 0.01, "return_sum": 600.0, "return_square_sum": 3700.0}
    for later, told in ((rising, False), ({**first, "entropy": 0.01}, True)):
        watch = StallWatch(2)
        looked = [watch.check([first] * 2), *(watch.check([later] * 2) for _ in range(20))]
        assert any(looked) == told


def test_rows_of_before_and_without_episodes_count() -> None:
    watch = StallWatch(2)
    before = rows(1, 1.6, 0) + rows(2, 0.2, EPISODES)
    assert watch.check(before) is not None
    silent: Row = {"entropy": 0.1}
    assert StallWatch(2).check([silent] * 4) is None
