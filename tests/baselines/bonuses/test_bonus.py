"""RND and ICM: what they reward, what they learn, what they leave alone."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")

from jaxenstein.baselines import ICM, RND, Config, Experience, HParams
from jaxenstein.baselines.learning.observations import ObservationSpec, Part

KEY = jax.random.key(0)
SPEC = ObservationSpec((Part((8, 8), True, "bounds", 0, 255), Part((2,), False, "bounds")))
NUMBERS = HParams(bonus_gamma=0.9, bonus_reward=2.0).check()


def experience(seed=0, steps=6, batch=4):
    rng = np.random.default_rng(seed)
    frames = jnp.asarray(rng.integers(0, 256, (steps + 1, batch, 8, 8)).astype(np.uint8))
    vector = jnp.asarray(rng.random((steps + 1, batch, 2)).astype(np.float32))
    action = jnp.asarray(rng.integers(0, 3, (steps, batch)).astype(np.int32))
    return Experience((frames, vector), action, jnp.asarray(rng.random((steps, batch)) < 0.2))


def config(**settings: Any) -> Config:
    small: dict[str, Any] = {"num_envs": 4, "minibatches": 2, "rollout": 6, "total_steps": 1000}
    sizes: dict[str, Any] = dict.fromkeys(
        ("rnd_hidden", "rnd_output", "icm_latent", "icm_hidden"), 8
    )
    return Config(**(small | sizes | settings))


def leaves(tree):
    return [np.asarray(leaf) for leaf in jax.tree.leaves(tree)]


def make(kind: str, **settings: Any) -> Any:
    return RND(SPEC, config(**settings)) if kind == "rnd" else ICM(SPEC, 3, config(**settings))


def run_updates(bonus, state, data, number, numbers=NUMBERS):
    update, metrics = jax.jit(bonus.update), {}
    for key in jax.random.split(KEY, number):
        state, metrics = update(key, state, numbers, data, jnp.float32(3e-3))
    return state, metrics


@pytest.fixture(scope="module")
def trained():
    bonus = make("rnd")
    before = bonus.init(KEY)
    return bonus, before, run_updates(bonus, before, experience(), 150)[0]


def test_rnd_rewards_what_a_step_led_to(trained):
    bonus, state, _ = trained
    data = experience()
    reward, _, _ = jax.jit(bonus.reward)(state, NUMBERS, data)
    error = bonus.error(state, data.obs)
    expected = 2 * jnp.where(data.ended, 0, error[1:])
    np.testing.assert_allclose(reward, expected, rtol=1e-5)
    assert np.all(np.asarray(reward)[np.asarray(data.ended)] == 0)
    assert np.all(np.asarray(error) > 0)


def test_rnd_trains_the_predictor_alone(trained):
    _, before, after = trained
    for a, b in zip(leaves(before.target), leaves(after.target), strict=True):
        np.testing.assert_array_equal(a, b)
    pairs = zip(leaves(before.predictor), leaves(after.predictor), strict=True)
    assert all(not np.array_equal(a, b) for a, b in pairs)


def test_rnd_falls_where_it_has_been(trained):
    bonus, before, after = trained
    seen, unseen = experience(), experience(seed=1)
    wanted = ~np.asarray(seen.ended)

    def mean(state, data):
        return np.mean(np.asarray(bonus.error(state, data.obs))[1:][wanted])

    fall, other = (mean(after, data) / mean(before, data) for data in (seen, unseen))
    assert fall < 0.1
    assert fall < 0.8 * other


def test_rnd_ignores_the_observations_after_ends(trained):
    bonus, before, _ = trained
    data = experience()
    after_end = jnp.concatenate([jnp.zeros((1, 4), bool), data.ended])
    frames = jnp.where(after_end[..., None, None], jnp.uint8(7), data.obs[0])
    changed = data.replace(obs=(frames, data.obs[1]))
    one, other = (run_updates(bonus, before, d, 2)[0] for d in (data, changed))
    for a, b in zip(leaves(one.predictor), leaves(other.predictor), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-6)


def test_no_frames_at_all_train_nothing(trained):
    bonus, before, _ = trained
    state, metrics = run_updates(
        bonus, before, experience(), 1, NUMBERS.replace(rnd_fraction=jnp.float32(0))
    )
    assert float(metrics["rnd_loss"]) == 0
    for a, b in zip(leaves(before.predictor), leaves(state.predictor), strict=True):
        np.testing.assert_array_equal(a, b)


def test_pixel_statistics_are_those_of_all_frames_and_used_before_they_change():
    bonus = make("rnd", normalise_observations=True)
    state, reward = bonus.init(KEY), jax.jit(bonus.reward)
    seen = []
    for seed in range(3):
        data = experience(seed)
        frames = np.asarray(data.obs[0])[1:] / 255
        pixels = state.pixels
        _, state, metrics = reward(state, NUMBERS, data)
        seen.append(frames)
        every = np.concatenate(seen).reshape(-1, 8, 8, 1)
        np.testing.assert_allclose(state.pixels[0][0].mean, every.mean(0), atol=1e-5)
        np.testing.assert_allclose(state.pixels[0][0].variance, every.var(0), atol=1e-5)
        used = state.pixels if seed == 0 else pixels
        led_to = jax.tree.map(lambda leaf: leaf[1:], data.obs)
        error = bonus.error(state.replace(pixels=used), led_to)
        np.testing.assert_allclose(metrics["rnd_error"], jnp.mean(error), rtol=1e-4)
        (whitened,), _ = bonus._whiten(used, led_to, jnp.float32)
        mean, deviation = (np.asarray(a)[..., 0] for a in (used[0][0].mean, used[0][0].deviation))
        expected = np.clip((frames - mean) / deviation, -5, 5)
        np.testing.assert_allclose(whitened[..., 0], expected, atol=2e-3)


@pytest.mark.parametrize("kind", ["rnd", "icm"])
def test_a_normalised_bonus_has_the_size_of_its_sums(kind):
    plain, scaled = make(kind), make(kind, normalise_bonus=True)
    data, state, totals, total = experience(), scaled.init(KEY), [], np.zeros(4)
    for _ in range(2):
        bonus, _, _ = plain.reward(state, NUMBERS, data)
        result, state, _ = scaled.reward(state, NUMBERS, data)
        for row in np.asarray(bonus) / 2:
            total = 0.9 * total + row
            totals.append(total)
        np.testing.assert_allclose(result, bonus / np.std(totals), rtol=1e-3)


def test_icm_rewards_the_forward_error():
    bonus = make("icm")
    data, state = experience(), bonus.init(KEY)
    reward, _, _ = jax.jit(bonus.reward)(state, NUMBERS, data)
    losses = bonus.losses(state.params, data.obs, data.action)
    np.testing.assert_allclose(reward, 2 * jnp.where(data.ended, 0, losses.forward), rtol=1e-5)
    assert np.all(np.asarray(losses.inverse) > 0)


@pytest.mark.parametrize("trains", [False, True])
def test_the_forward_error_trains_the_embedding_only_if_told(trains):
    bonus = make("icm", icm_forward_trains_encoder=trains)
    data, state = experience(), bonus.init(KEY)

    def total(params):
        return jnp.mean(bonus.losses(params, data.obs, data.action).forward)

    gradients = jax.jit(jax.grad(total))(state.params)
    moved = {name: any(np.any(leaf != 0) for leaf in leaves(g)) for name, g in gradients.items()}
    assert moved == {"encoder": trains, "latent": trains, "inverse": False, "forward": True}


def test_icm_learns_the_actions_of_a_simple_world():
    """Action 0 keeps the frame, 1 inverts it, 2 blackens it."""
    rng = np.random.default_rng(0)
    steps, batch = 12, 16
    action = rng.integers(0, 3, (steps, batch)).astype(np.int32)
    frames = [rng.integers(40, 216, (batch, 8, 8)).astype(np.uint8)]
    ended = np.zeros((steps, batch), bool)
    for t, chosen in enumerate(action):
        last = frames[-1]
        following = np.select(
            [(chosen == k)[:, None, None] for k in range(3)], [last, 255 - last, 0 * last]
        )
        ended[t] = chosen == 2
        frames.append(following.astype(np.uint8))
    # Black frames stay black or turn white, so the episode ends there and the truth is hidden.
    vector = np.zeros((steps + 1, batch, 2), np.float32)
    data = Experience(
        (jnp.asarray(np.stack(frames)), jnp.asarray(vector)),
        jnp.asarray(action),
        jnp.asarray(np.concatenate([np.zeros((1, batch), bool), np.cumsum(ended, 0)[:-1] > 0])),
    )
    bonus = ICM(SPEC, 3, config(num_envs=batch, icm_hidden=32, icm_latent=16))
    state, before = run_updates(bonus, bonus.init(KEY), data, 1)
    state, after = run_updates(bonus, state, data, 150)
    assert float(after["icm_inverse_accuracy"]) > 0.95
    assert float(after["icm_inverse_loss"]) < 0.3 * float(before["icm_inverse_loss"])
