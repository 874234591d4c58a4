"""The warning of a training that settles without a success."""

from __future__ import annotations

import pytest

pytest.importorskip("flax")

from jaxenstein.baselines.runs.metrics import Row
from jaxenstein.baselines.runs.stalled import EPISODES, StallWatch


def rows(updates: int, entropy: float, episodes: int, successes: int = 0) -> list[Row]:
    """Updates of two runs; all successes are those of the second one."""
    one: Row = {"episodes": episodes, "successes": 0, "entropy": entropy}
    return [one, {**one, "successes": successes}] * updates


def test_a_policy_that_settles_without_success_is_told_of_once() -> None:
    watch = StallWatch(2)
    assert watch.look(rows(1, 1.6, 10)) is None
    assert watch.look(rows(1, 0.1, EPISODES // 2)) is None
    told = watch.look(rows(1, 0.04, EPISODES // 2))
    assert told is not None
    assert f"no success in {2 * EPISODES + 20:,} episodes" in told
    assert "from 1.6 to 0.04" in told
    assert watch.look(rows(5, 0.01, EPISODES)) is None


@pytest.mark.parametrize(("entropy", "successes"), [(1.5, 0), (0.01, 1)])
def test_one_that_still_looks_or_succeeded_once_is_not(entropy: float, successes: int) -> None:
    watch = StallWatch(2)
    assert watch.look(rows(1, 1.6, 10, successes)) is None
    assert watch.look(rows(20, entropy, EPISODES)) is None


def test_rows_of_before_and_without_episodes_count() -> None:
    watch = StallWatch(2)
    before = rows(1, 1.6, 0) + rows(2, 0.2, EPISODES)
    assert watch.look(before) is not None
    silent: Row = {"entropy": 0.1}
    assert StallWatch(2).look([silent] * 4) is None
