"""`rnd_optimizer="joint"`: RND's predictor in PPO's minibatches and in its optimiser."""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")

import optax

from jaxenstein.baselines import RND, Config, Experience, HParams
from jaxenstein.baselines.learning import optimiser, ppo
from jaxenstein.baselines.learning.bonus import trained
from jaxenstein.baselines.learning.networks import ActorCritic
from jaxenstein.baselines.learning.observations import ObservationSpec, Part
from jaxenstein.baselines.learning.rollout import Steps

KEY = jax.random.key(0)
STEPS, BATCH = 5, 4
SPEC = ObservationSpec((Part((3,), False, "log"),))
CONFIG = Config(
    algo="rnd", rnd_optimizer="joint", num_envs=BATCH, rollout=STEPS, minibatches=1, epochs=1,
    features=6, hidden=4, head=6, rnd_hidden=6, rnd_output=5, total_steps=1000,
)  # fmt: skip
NETWORK = ActorCritic(SPEC, 2, 2, CONFIG, jnp.float32)
RATE = 1e-2


@functools.cache
def make_batch() -> ppo.Batch:
    """A rollout of random numbers in which some episodes end."""
    rng = np.random.default_rng(0)
    shape = (STEPS, BATCH)
    real = lambda *s: jnp.asarray(rng.normal(size=s).astype(np.float32))  # noqa: E731
    whole = lambda: jnp.asarray(rng.integers(0, 2, shape).astype(np.int32))  # noqa: E731
    obs, ended = real(STEPS + 1, BATCH, 3), jnp.asarray(rng.random(shape) < 0.3)
    steps = Steps(
        obs=obs[:-1],
        previous=whole(),
        first=jnp.asarray(rng.random(shape) < 0.3),
        action=whole(),
        log_prob=-jnp.abs(real(*shape)) - 0.3,
        value=real(*shape, 2),
        reward=real(*shape),
        terminated=ended,
        truncated=jnp.zeros(shape, bool),
    )
    experience = Experience(obs, steps.action, ended)
    return ppo.Batch(steps, real(BATCH, 4), real(*shape), real(*shape, 2), experience)


@functools.cache
def begin() -> tuple[RND, Any, Any]:
    """The bonus, its state, and the policy's parameters."""
    bonus = RND(SPEC, CONFIG)
    return bonus, bonus.init(KEY), NETWORK.init(jax.random.key(1))


@functools.cache
def program(config: Config, joint: bool) -> Any:
    """`ppo.train` of the first state and the batch, compiled once for all numbers."""
    bonus, state, policy = begin()
    auxiliary = bonus.auxiliary(state) if joint else None
    params, batch = trained(policy, auxiliary), make_batch()
    adam = optimiser.init(params)
    return jax.jit(
        lambda numbers: ppo.train(
            NETWORK, config, KEY, params, adam, batch, numbers, jnp.float32(RATE), auxiliary
        )
    )


def learn(numbers: HParams, config: Config = CONFIG, joint: bool = True) -> tuple[Any, Any, Any]:
    """What `ppo.train` makes of the first parameters."""
    return program(config, joint)(numbers.check())


def predictor_loss(predictor: Any, numbers: HParams) -> jax.Array:
    """The mean error over the steps that ended no episode, one after another."""
    bonus, state, _ = begin()
    experience = make_batch().experience
    assert experience is not None
    led_to = experience.obs[1:][~np.asarray(experience.ended)]
    assert 0 < len(led_to) < STEPS * BATCH
    embed = lambda params: bonus._embed(params, led_to[:, None], None)  # noqa: E731
    errors = jnp.mean((embed(predictor) - embed(state.target)) ** 2, axis=-1)
    return numbers.rnd_loss * jnp.sum(errors) / len(led_to)


@functools.cache
def gradients_by_hand() -> tuple[Any, Any]:
    """Of the policy's loss and of the predictor's, each for itself."""
    (_, state, policy), batch = begin(), make_batch()
    own = jax.grad(lambda p: ppo.loss(NETWORK, CONFIG, p, batch, HParams())[0])
    added = jax.grad(lambda p: predictor_loss(p, HParams(rnd_loss=2.0)))
    return jax.jit(own)(policy), jax.jit(added)(state.predictor)


def close(one: Any, other: Any, **tolerance: Any) -> None:
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, **tolerance), one, other)


@pytest.mark.parametrize("highest", [0.1, 1e6])
def test_a_step_is_one_clip_and_one_adam_of_both_gradients(highest: float) -> None:
    _, state, policy = begin()
    params, adam, metrics = learn(HParams(rnd_loss=2.0, gradient_norm=highest))
    own, added = gradients_by_hand()
    size = np.sqrt(sum(np.sum(np.square(leaf)) for leaf in jax.tree.leaves((own, added))))
    alone = np.sqrt(sum(np.sum(np.square(leaf)) for leaf in jax.tree.leaves(own)))
    # Both parts count, and the lower limit cuts.
    assert 0.1 < alone < 0.99 * size
    np.testing.assert_allclose(metrics["gradient_norm"], size, rtol=1e-5)
    # Adam's first moment after one step is a tenth of what came out of the clip.
    factor = min(1.0, highest / size)
    expected = jax.tree.map(lambda g: 0.1 * factor * np.asarray(g), (own, added))
    close(adam.mu, expected, rtol=1e-3, atol=1e-7)
    reference = optax.chain(optax.clip_by_global_norm(highest), optax.adam(RATE, eps=1e-5))
    before = {"policy": policy, "predictor": state.predictor}
    with jax.numpy_dtype_promotion("standard"):
        updates, _ = reference.update(
            {"policy": own, "predictor": added}, reference.init(before), before
        )
        after: Any = optax.apply_updates(before, updates)
    close(params, (after["policy"], after["predictor"]), rtol=1e-4, atol=2e-5)
    np.testing.assert_allclose(
        metrics["rnd_loss"], predictor_loss(state.predictor, HParams(rnd_loss=2.0)), rtol=1e-5
    )


def test_without_a_clip_the_policy_learns_as_if_alone() -> None:
    numbers = HParams(gradient_norm=1e6)
    (policy, _), adam, metrics = learn(numbers)
    alone, alone_adam, alone_metrics = learn(numbers, joint=False)
    close(adam.mu[0], alone_adam.mu, rtol=1e-3, atol=1e-7)
    close(policy, alone, rtol=1e-4, atol=2e-5)
    assert set(metrics) - set(alone_metrics) == {"rnd_loss"}
    for name in set(alone_metrics) - {"gradient_norm"}:
        np.testing.assert_allclose(metrics[name], alone_metrics[name], rtol=1e-4, atol=1e-6)


def test_the_predictor_learns_and_the_target_stays() -> None:
    bonus, state, _ = begin()
    batch = make_batch()
    assert batch.experience is not None
    config = CONFIG.replace(epochs=150, minibatches=2)
    (_, predictor), adam, _ = learn(HParams(rnd_fraction=0.5), config)
    auxiliary = bonus.auxiliary(state)
    assert auxiliary is not None
    after = auxiliary.store(predictor)
    assert int(adam.count) == 300
    assert after.predictor is predictor
    assert after.target is state.target
    wanted = ~np.asarray(batch.experience.ended)
    errors = [np.asarray(bonus.error(s, batch.experience.obs[1:]))[wanted] for s in (state, after)]
    assert errors[1].mean() < 0.2 * errors[0].mean()


def test_a_minibatch_draws_its_share_of_the_steps_anew() -> None:
    bonus, state, _ = begin()
    auxiliary = bonus.auxiliary(state)
    assert auxiliary is not None
    obs = jnp.asarray(np.random.default_rng(1).normal(size=(2, 1, 3)).astype(np.float32))
    whole = 2.0 * float(bonus.error(state, obs)[1, 0])
    numbers = HParams(rnd_fraction=0.25, rnd_loss=2.0).check()

    def losses(ended: bool) -> np.ndarray[Any, Any]:
        data = Experience(obs, jnp.zeros((1, 1), jnp.int32), jnp.full((1, 1), ended))
        draw = jax.vmap(lambda k: auxiliary.loss(state.predictor, k, numbers, data)[0])
        return np.asarray(draw(jax.random.split(KEY, 400)))

    drawn = losses(ended=False)
    kept = drawn > 0
    np.testing.assert_allclose(drawn[kept], whole, rtol=1e-5)
    # Four deviations of a binomial of 400 draws around a quarter.
    assert abs(kept.mean() - 0.25) < 4 * np.sqrt(0.25 * 0.75 / 400)
    assert not np.any(losses(ended=True))


def test_nothing_is_left_to_learn_after_the_policy() -> None:
    bonus, state, _ = begin()
    experience = make_batch().experience
    assert experience is not None
    same, metrics = bonus.update(KEY, state, HParams(), experience, jnp.float32(1))
    assert same is state
    assert metrics == {}
    assert state.optimiser == ()
    separate = RND(SPEC, CONFIG.replace(rnd_optimizer="separate"))
    assert separate.auxiliary(separate.init(KEY)) is None


def test_a_joint_run_stopped_and_resumed_is_the_same(tmp_path: Path) -> None:
    pytest.importorskip("orbax.checkpoint")
    from jaxenstein.baselines.runs.folder import RunFolder, train
    from tests.baselines.tiny import tiny

    small = {"rnd_hidden": 8, "rnd_output": 8, "total_steps": 3 * 4 * 8, "seeds": 1}
    experiment = tiny(algo="rnd", rnd_optimizer="joint", **small)
    whole = RunFolder.create(tmp_path / "whole", experiment)
    parts = RunFolder.create(tmp_path / "parts", experiment)
    done: list[int] = []
    train(whole)
    train(parts, notify=lambda update, _: done.append(update), stop=lambda: done[-1] >= 1)
    assert done == [0, 1]
    assert train(parts) == 3
    tables = [(run.path / "metrics.csv").read_bytes() for run in (whole, parts)]
    notes = [(run.path / "checkpoints/3/checkpoint.json").read_text() for run in (whole, parts)]
    assert tables[0] == tables[1]
    # Of all bits of the state.
    assert json.loads(notes[0])["digest"] == json.loads(notes[1])["digest"]
    separate = tiny(algo="rnd", **small)
    assert separate.differences(experiment) == ['config.rnd_optimizer ("separate", not "joint")']


def test_a_run_from_before_the_option_is_a_separate_one(tmp_path: Path) -> None:
    pytest.importorskip("orbax.checkpoint")
    from jaxenstein.baselines.runs.folder import CONFIG, RunFolder
    from tests.baselines.tiny import tiny

    folder = RunFolder.create(tmp_path / "run", tiny(algo="rnd"))
    plain = json.loads((folder.path / CONFIG).read_text())
    del plain["config"]["rnd_optimizer"]
    (folder.path / CONFIG).write_text(json.dumps(plain))
    opened = RunFolder.open(folder.path)
    assert opened.experiment.config.rnd_optimizer == "separate"
    opened.check_same(folder.experiment)
