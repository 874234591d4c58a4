"""A run that diverges keeps its last state, and other runs are not affected."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")

from jaxenstein.baselines import Config, HParams, Learner
from jaxenstein.baselines.divergence import Divergence, guard, of_state, updates_that_count
from jaxenstein.baselines.state import TrainState
from tests.baselines.worlds import BONUS_SIZES, SMALL, Countdown

STEADY = SMALL | {"anneal": False}
BONUSES = [pytest.param(algo, marks=pytest.mark.variant) for algo in ("rnd", "icm", "e3b")]
HUGE = 1e38


def bits(tree: Any) -> list[bytes]:
    return [np.asarray(leaf).tobytes() for leaf in jax.tree.leaves(tree)]


def one_of(tree: Any, run: int) -> Any:
    return jax.tree.map(lambda leaf: leaf[run], tree)


def learner_of(algo: str, **settings: Any) -> Learner:
    env = Countdown()
    config = Config(**STEADY, algo=algo, bonus=BONUS_SIZES[algo], **settings)
    return Learner(env, env.default_params, config)


@pytest.mark.parametrize("algo", ["ppo", *BONUSES])
def test_one_run_stops_and_the_other_is_unchanged_bit_for_bit(algo: str) -> None:
    many = learner_of(algo).many
    rate = "learning_rate" if algo == "ppo" else "bonus_learning_rate"

    def train(state: TrainState, first: float) -> tuple[TrainState, Any]:
        numbers = HParams(gamma=0.9).replace(**{rate: np.array([first, 1e-3])})
        return many.train_chunk(state, numbers, 2)

    start = many.init(jax.random.split(jax.random.key(0), 2))
    good, early = train(start, 1e-3)
    assert not np.asarray(early["diverged"]).any()
    fine, expected = train(good, 1e-3)
    state, metrics = train(good, HUGE)
    # Its state is unchanged except for the record of the divergence.
    assert state.diverged is not None
    code = int(state.diverged[0])
    assert 1 <= code <= 7
    assert bits(one_of(state, 0).replace(diverged=None)) == bits(
        one_of(good, 0).replace(diverged=None)
    )
    assert of_state(np.asarray(state.update), np.asarray(state.diverged)) == {
        0: Divergence(3, code)
    }
    assert metrics["diverged"].tolist() == [[code, code], [0, 0]]
    for name, values in metrics.items():
        if name != "diverged":
            stopped = np.asarray(values[0])
            assert np.all(stopped == 0 if stopped.dtype.kind == "i" else np.isnan(stopped)), name
    assert bits(one_of(state, 1)) == bits(one_of(fine, 1))
    assert bits(one_of(metrics, 1)) == bits(one_of(expected, 1))
    # Nothing starts it again.
    later, _ = train(state, 1e-3)
    assert bits(one_of(later, 0)) == bits(one_of(state, 0))


@pytest.mark.parametrize("learning_rate", [0.1, HUGE])
def test_non_finite_numbers_spread_with_continue(learning_rate: float) -> None:
    learner = learner_of("ppo", on_divergence="continue")
    state, metrics = learner.train_chunk(
        learner.init(jax.random.key(0)), HParams(learning_rate=learning_rate), 2
    )
    assert (state.diverged, int(state.update)) == (None, 2)
    assert "diverged" not in metrics
    finite = [bool(np.all(np.isfinite(leaf))) for leaf in jax.tree.leaves(state.params)]
    assert all(finite) == (learning_rate == 0.1)


def state_of(value: float, params: float, bonus: float, diverged: int = 0) -> TrainState:
    """A state with a leaf of each kind, all of which `value` changes."""
    nothing: Any = None
    return TrainState(
        key=jnp.uint32([value, 7]),
        update=jnp.int32(value),
        params={"a": jnp.float32([1, params]), "b": jnp.zeros((2, 2), jnp.bfloat16)},
        optimiser=jnp.full((2, 3), value, jnp.float32),
        bonus=(jnp.float32(bonus), jnp.int32(value)),
        scale=None,
        reward_scale=None,
        recent=None,
        actors=nothing,
        diverged=jnp.int32(diverged),
    )


@pytest.mark.parametrize(
    ("learnt", "params", "bonus", "code", "words"),
    [
        ({"value_loss": np.nan}, 1, 1, 1, "loss was"),
        ({"gradient_norm": np.inf}, 1, 1, 2, "gradient was"),
        ({"own_gradient_norm": -np.inf, "own_loss": np.nan}, 1, 1, 3, "loss and gradient were"),
        ({"loss": 3.0}, np.nan, 1, 4, "parameters were"),
        ({"loss": 3.0}, 1, np.inf, 4, "parameters were"),
        ({"loss": np.nan, "gradient_norm": np.nan}, np.inf, 1, 7, "loss, gradient and parameters"),
        # Other metrics need not be finite.
        ({"loss": 3.0, "kl": np.nan, "loss_ratio": np.inf}, 1, 1, 0, ""),
    ],
)
def test_guard_stops_on_non_finite_values(
    learnt: dict[str, float], params: float, bonus: float, code: int, words: str
) -> None:
    before, after = state_of(4, 1, 1), state_of(5, params, bonus)
    trained = {name: jnp.float32(value) for name, value in learnt.items()}
    metrics = {"episodes": jnp.int32(3), "kl": jnp.float32(0.5)}
    state, measured = jax.jit(guard)(before, after, trained, metrics)
    assert int(measured["diverged"]) == code
    expected = (before if code else after).replace(diverged=jnp.int32(code))
    assert bits(state) == bits(expected)
    assert jax.tree.structure(state) == jax.tree.structure(expected)
    assert int(measured["episodes"]) == (0 if code else 3)
    np.testing.assert_equal(float(measured["kl"]), np.nan if code else 0.5)
    if code:
        told = Divergence(5, code).message("seed-3")
        assert told.startswith(f"seed-3 diverged at update 5: its {words}")
        assert told.endswith("It keeps the parameters of update 4, the last finite ones")
    # The first cause is kept.
    state, _ = guard(before.replace(diverged=jnp.int32(2)), after, trained, metrics)
    assert bits(state) == bits(before.replace(diverged=jnp.int32(2)))


@pytest.mark.parametrize("code", [8, -1, 2**40])
def test_unknown_divergence_code_has_a_description(code: int) -> None:
    assert "seed-0 diverged at update 1: its " in Divergence(1, code).message("seed-0")


def test_updates_are_counted_until_all_runs_have_diverged() -> None:
    def count(*codes: list[int]) -> int:
        return updates_that_count({"diverged": np.array(codes), "loss": np.zeros((2, 4))})

    assert count([0, 0, 0, 0], [0, 0, 0, 0]) == 4
    assert count([1, 1, 1, 1], [0, 0, 0, 0]) == 4
    assert count([0, 0, 4, 4], [0, 2, 2, 2]) == 3
    assert count([1, 1, 1, 1], [2, 2, 2, 2]) == 1
    assert updates_that_count({"loss": np.zeros((2, 4))}) == 4
