"""Losses and advantages against hand computation, brute force and finite differences."""

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")

import optax

from jaxenstein.baselines import Config, HParams, optimiser, ppo
from jaxenstein.baselines.networks import ActorCritic
from jaxenstein.baselines.observations import ObservationSpec, Part
from jaxenstein.baselines.optimiser import passes, sample_minibatches, take
from jaxenstein.baselines.rollout import Steps, log_prob
from tests.x64 import enable_x64


def make_batch(rng, steps=4, batch=3, heads=2, dtype: Any = np.float32):
    shape = (steps, batch)
    real = lambda *extra: jnp.asarray(rng.normal(size=(*shape, *extra)).astype(dtype))  # noqa: E731
    whole = lambda n: jnp.asarray(rng.integers(0, n, shape).astype(np.int32))  # noqa: E731
    flags = lambda p: jnp.asarray(rng.random(shape) < p)  # noqa: E731
    played = Steps(
        obs=real(3),
        previous=whole(2),
        first=flags(0.3),
        action=whole(2),
        log_prob=-jnp.abs(real()) - 0.3,
        value=real(heads),
        reward=real(),
        terminated=flags(0.1),
        truncated=flags(0.1),
    )
    memory = jnp.asarray(rng.normal(size=(1, batch, 4)).astype(dtype))
    return ppo.Batch(played, memory, real(), real(heads))


def by_hand(logits, value, batch, h, floor=1e-8):
    """The loss, step by step in numpy."""
    clips = [h.value_clip, h.value_clip if h.bonus_value_clip is None else h.bonus_value_clip]
    p = jax.tree.map(np.asarray, batch)
    advantage = (p.advantage - p.advantage.mean()) / (p.advantage.std() + floor)
    steps, count = p.advantage.shape
    policy, entropy, clipped = 0.0, 0.0, 0
    errors = np.zeros(value.shape[-1])
    for t in range(steps):
        for n in range(count):
            prob = np.exp(logits[t, n]) / np.exp(logits[t, n]).sum()
            ratio = prob[p.steps.action[t, n]] / np.exp(p.steps.log_prob[t, n])
            bounded = min(max(ratio, 1 - h.clip), 1 + h.clip)
            policy -= min(ratio * advantage[t, n], bounded * advantage[t, n])
            clipped += abs(ratio - 1) > h.clip
            entropy -= (prob * np.log(prob)).sum()
            for v in range(len(errors)):
                old, target, new = p.steps.value[t, n, v], p.target[t, n, v], value[t, n, v]
                near = old + min(max(new - old, -clips[v]), clips[v])
                errors[v] += max((new - target) ** 2, (near - target) ** 2)
    size = steps * count
    total = policy / size + h.value * errors.sum() / size - h.entropy * entropy / size
    return total, policy / size, errors.sum() / size, entropy / size, clipped / size


class Fixed:
    """A network that returns given outputs."""

    def __init__(self, logits, value):
        self.result = logits, value, None

    def unroll(self, params, obs, previous, first, memory):
        return self.result


@pytest.mark.parametrize("seed", [0, 1])
def test_loss_matches_a_hand_computation(seed):
    rng = np.random.default_rng(seed)
    batch = make_batch(rng)
    logits, value = rng.normal(size=(4, 3, 2)), rng.normal(size=(4, 3, 2))
    h = HParams(entropy=0.3, clip=0.25, value_clip=0.4)
    network: Any = Fixed(jnp.asarray(logits, jnp.float32), jnp.asarray(value, jnp.float32))
    total, parts = ppo.loss(network, Config(), {}, batch, h)
    expected = by_hand(logits, value, batch, h)
    got = (total, *(parts[n] for n in ("policy_loss", "value_loss", "entropy", "clip_fraction")))
    np.testing.assert_allclose(got, expected, rtol=1e-5)
    half, _ = ppo.loss(network, Config(value_loss_half=True), {}, batch, h)
    np.testing.assert_allclose(total - half, h.value * expected[2] / 2, rtol=1e-4)
    apart = h.replace(bonus_value_clip=1e3)
    total, _ = ppo.loss(network, Config(), {}, batch, apart)
    np.testing.assert_allclose(total, by_hand(logits, value, batch, apart)[0], rtol=1e-5)
    assert float(total) < expected[0]


@functools.cache
def small():
    """A config, its network with parameters, and a batch of four environments."""
    spec = ObservationSpec((Part((3,), False, "log"),))
    config = Config(
        num_envs=4, minibatches=2, rollout=4, total_steps=16, epochs=3, features=5, hidden=4,
        head=5,
    )  # fmt: skip
    network = ActorCritic(spec, 2, 2, config)
    batch = make_batch(np.random.default_rng(3), batch=4)
    return config, network, network.init(jax.random.key(0)), batch


def replayed(network, params, batch):
    steps = batch.steps
    return network.unroll(params, steps.obs, steps.previous, steps.first, batch.memory[0])[:2]


def trained(config, network, params, batch, rate, **numbers):
    networks, h = (params, optimiser.init(params)), HParams(**numbers).check()
    args = (jax.random.key(1), networks, batch, h, jnp.float32(rate))
    return jax.jit(ppo.train, static_argnums=(0, 1))(network, config, *args)


def test_advantages_are_normalised_over_minibatches():
    config, network, params, batch = small()

    def expected(batch):
        logits, value = replayed(network, params, batch)
        return by_hand(np.asarray(logits), np.asarray(value), batch, HParams())[1]

    # The network stays as it is, so every pass over the data has the losses of its minibatches.
    passed = [sample_minibatches(k, config) for k in jax.random.split(jax.random.key(1), 3)]
    parts = np.mean([expected(take(batch, part)) for chosen in passed for part in chosen])
    assert abs(parts - expected(batch)) > 1e-3
    metrics = trained(config, network, params, batch, 0)[2]
    np.testing.assert_allclose(metrics["policy_loss"], parts, rtol=1e-4)


def test_update_stops_at_target_kl():
    config, network, params, batch = small()
    played = log_prob(replayed(network, params, batch)[0], batch.steps.action)
    batch = batch.replace(steps=batch.steps.replace(log_prob=played))
    near, far, free = (
        trained(config, network, params, batch, 0.01, target_kl=target)[:2]
        for target in (1e-9, 1e9, None)
    )
    # The first minibatch finds the policy unchanged, and the second does not.
    key, adam = jax.random.split(jax.random.key(1), 3)[0], optimiser.init(params)
    part = take(batch, sample_minibatches(key, config)[0])
    loss = lambda p: ppo.loss(network, config, p, part, HParams())[0]  # noqa: E731
    gradients = jax.jit(jax.grad(loss))(params)
    once = optimiser.step(gradients, adam, params, jnp.float32(0.01), jnp.float32(0.5))[:2]
    close = functools.partial(np.testing.assert_allclose, rtol=1e-5, atol=1e-7)
    jax.tree.map(close, near, once)
    jax.tree.map(close, far, free)
    moved = jax.tree.map(lambda a, b: float(jnp.max(jnp.abs(a - b))), free, once)
    assert max(jax.tree.leaves(moved[0])) > 0.01


@pytest.mark.parametrize(
    ("advantage", "moved", "gradient"),
    [(1.0, 0.5, 0.0), (1.0, -0.5, 1.0), (-1.0, 0.5, 1.0), (-1.0, -0.5, 0.0)],
)
def test_clipping_stops_the_gradient(advantage, moved, gradient):
    batch = make_batch(np.random.default_rng(0), 1, 1)
    steps = batch.steps.replace(
        action=jnp.zeros((1, 1), jnp.int32), log_prob=jnp.log(0.5) * jnp.ones((1, 1)) - moved
    )

    def surrogate(logits):
        return ppo.policy_loss(logits, steps, jnp.full((1, 1), advantage), HParams())[0]

    slope = jax.grad(surrogate)(jnp.zeros((1, 1, 2)))
    assert bool(jnp.any(slope != 0)) == bool(gradient)


def test_advantage_floor_keeps_small_advantages_small():
    advantage = jnp.array([[1e-3, -1e-3]])
    np.testing.assert_allclose(ppo.normalise(advantage, HParams()), [[1, -1]], rtol=1e-4)
    floored = ppo.normalise(advantage, HParams(advantage_floor=0.1))
    np.testing.assert_allclose(floored, advantage / 0.101, rtol=1e-4)
    np.testing.assert_array_equal(ppo.normalise(jnp.ones((2, 2)), HParams()), np.zeros((2, 2)))


def test_gradient_matches_finite_differences():
    with enable_x64(True):
        spec = ObservationSpec((Part((3,), False, "log"),))
        config = Config(features=5, hidden=4, head=5)
        network = ActorCritic(spec, 2, 2, config, jnp.float64, jnp.float64)
        params = jax.tree.map(lambda a: a.astype(jnp.float64), network.init(jax.random.key(0)))
        batch = make_batch(np.random.default_rng(4), dtype=np.float64)

        @jax.jit
        @jax.value_and_grad
        def both(params):
            return ppo.loss(network, config, params, batch, HParams(entropy=0.3))[0]

        gradients = both(params)[1]
        rng = np.random.default_rng(5)
        direction = jax.tree.map(lambda a: jnp.asarray(rng.normal(size=a.shape)), params)
        slope = sum(
            jnp.sum(a * b)
            for a, b in zip(jax.tree.leaves(gradients), jax.tree.leaves(direction), strict=True)
        )
        move = lambda e: jax.tree.map(lambda a, b: a + e * b, params, direction)  # noqa: E731
        expected = (both(move(1e-6))[0] - both(move(-1e-6))[0]) / 2e-6
        np.testing.assert_allclose(slope, expected, rtol=1e-6)
        assert abs(float(expected)) > 1e-3


def test_minibatches_cover_each_environment_once():
    config = Config(num_envs=12, minibatches=3, shards=2)
    chosen = sample_minibatches(jax.random.key(0), config)
    assert chosen.shape == (3, 2, 2)
    env = jnp.arange(12, dtype=jnp.int32)
    data = (jnp.stack([env, env + 100]), jnp.arange(24, dtype=jnp.int32).reshape(2, 12, 1))
    seen = []
    for part in chosen:
        sequences, wide = take(data, part)
        rows = sequences[0]
        assert sorted(r // 6 for r in rows.tolist()) == [0, 0, 1, 1]
        np.testing.assert_array_equal(sequences, [rows, rows + 100])
        np.testing.assert_array_equal(wide[..., 0], [rows, rows + 12])
        seen += rows.tolist()
    assert sorted(seen) == list(range(12))


def test_each_epoch_shuffles_anew():
    config = Config(num_envs=8, minibatches=2)
    _, mean = passes(jax.random.key(0), config, 3, lambda c, e: (c, e.astype(jnp.float32)), 0)
    np.testing.assert_allclose(mean, 3.5)
    orders = [sample_minibatches(k, config) for k in jax.random.split(jax.random.key(0), 3)]
    assert not np.array_equal(orders[0], orders[1])


def test_optimiser_matches_optax():
    rng = np.random.default_rng(0)
    draw = lambda: {"a": jnp.asarray(rng.normal(size=(3, 2)).astype(np.float32)), "b": jnp.ones(2)}  # noqa: E731
    params = mine = draw()
    reference = optax.chain(optax.clip_by_global_norm(0.5), optax.adam(1e-2, eps=1e-5))
    state, adam, gradients = reference.init(params), optimiser.init(mine), {}
    rate, highest = jnp.float32(1e-2), jnp.float32(0.5)
    for _ in range(3):
        gradients = draw()
        with jax.numpy_dtype_promotion("standard"):
            updates, state = reference.update(gradients, state, params)
            params = optax.apply_updates(params, updates)
        mine, adam, size = optimiser.step(gradients, adam, mine, rate, highest)
        np.testing.assert_allclose(
            size, np.sqrt(sum((np.asarray(g) ** 2).sum() for g in gradients.values())), rtol=1e-6
        )
        jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-5), mine, params)
    clipped, _ = optimiser.clip(gradients, highest)
    np.testing.assert_allclose(optimiser.norm(clipped), 0.5, rtol=1e-6)
    small, _ = optimiser.clip(gradients, jnp.float32(1e3))
    jax.tree.map(np.testing.assert_array_equal, small, gradients)


def brute_force(rewards, values, following, ended, gamma, lam):
    """A_t as the sum of (gamma lambda)^k delta_{t+k} up to the end of the episode."""
    steps, batch = rewards.shape
    result = np.zeros_like(rewards)
    for n in range(batch):
        for t in range(steps):
            weight = 1.0
            for k in range(t, steps):
                delta = rewards[k, n] + gamma * following[k, n] - values[k, n]
                result[t, n] += weight * delta
                if ended[k, n]:
                    break
                weight *= gamma * lam
    return result


def random_rollout(seed, steps=9, batch=6):
    rng = np.random.default_rng(seed)
    sample = lambda *shape: rng.normal(size=shape)  # noqa: E731
    kind = rng.choice(3, size=(steps, batch), p=[0.6, 0.2, 0.2])
    # An end in the first step, one in the last, several in a row, none at all.
    kind[0, 0], kind[-1, 1], kind[2:5, 2], kind[:, 3] = 1, 2, 1, 0
    return sample(steps, batch), sample(steps, batch), sample(batch), sample(steps, batch), kind


@pytest.mark.parametrize("lam", [0.0, 0.7, 1.0])
@pytest.mark.parametrize("gamma", [0.9, 1.0])
def test_advantages_are_sums_over_the_later_steps(gamma, lam):
    rewards, values, last, finals, kind = random_rollout(0)
    expected = np.vstack([values[1:], last])
    expected[kind == 2] = finals[kind == 2]
    expected[kind == 1] = 0
    with enable_x64(True):
        arrays = [jnp.asarray(array) for array in (values, last, kind == 1, kind == 2, finals)]
        following = ppo.next_values(*arrays)
        np.testing.assert_array_equal(following, expected)
        ended = jnp.asarray(kind > 0)
        result = ppo.advantages(jnp.asarray(rewards), arrays[0], following, ended, gamma, lam)
        assert result.dtype == jnp.float64
    wanted = brute_force(rewards, values, expected, kind > 0, gamma, lam)
    np.testing.assert_allclose(result, wanted, rtol=1e-12, atol=1e-12)
