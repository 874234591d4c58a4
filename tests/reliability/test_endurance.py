"""A short endurance run, and that it detects violations."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import pytest

from jaxenstein.tasks import goals, navigation
from jaxenstein.tasks.navigation import Navigation
from reliability import endurance


@pytest.fixture(autouse=True)
def _clear_caches() -> Any:
    yield
    jax.clear_caches()


SLOW = [
    pytest.param(name, marks=pytest.mark.slow)
    for name in ("health-gathering", "key-corridor-s3r1", "doom-basic")
]


@pytest.mark.parametrize("name", ["key-door", *SLOW])
def test_short_endurance_run(name: str) -> None:
    report = endurance.endure(name, 4000, batch=20)
    assert report.steps >= 4000
    assert report.problems == []
    assert report.events.pop(endurance.PIXELS) > 0
    assert sum(report.events.values()) > 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["key-door", "dmlab-static-01-respawn", "key-corridor-s3r1"])
def test_short_endurance_run_with_every_operation_checked(name: str) -> None:
    assert endurance.endure(name, 1000, batch=10, checked=True).problems == []


@pytest.mark.slow
def test_index_out_of_range_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(navigation, "sample_index", lambda bits, count: jnp.int32(count))
    jax.clear_caches()
    (problem,) = endurance.endure("simple", 100, batch=10, checked=True).problems
    assert "out-of-bounds" in problem


def test_step_into_a_wall_and_nan_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """With collisions switched off, and NaN distances."""

    def walk(level: Any, closed: Any, position: Any, heading: Any, action: Any, params: Any) -> Any:
        del level, closed
        ahead = jnp.stack([jnp.cos(heading), jnp.sin(heading)])
        forward = (action == 2).astype(jnp.float32)
        return position + forward * params.move_distance * ahead, heading

    def nowhere(self: Any, state: Any) -> Any:
        del self
        return jnp.float32(jnp.nan) * state.heading

    monkeypatch.setattr(goals, "steer", walk)
    monkeypatch.setattr(Navigation, "_distance", nowhere)
    jax.clear_caches()
    problems = endurance.endure("simple", 2000, batch=10).problems
    assert any("on an open tile" in problem for problem in problems)
    assert any("reward and info are finite" in problem for problem in problems)
