"""The networks against plain loops."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")

import jaxenstein
from jaxenstein.baselines import Config
from jaxenstein.baselines.networks import GRU, NATURE, SMALL, ActorCritic, layers_for
from jaxenstein.baselines.observations import ObservationSpec, Part, observation_spec
from jaxenstein.errors import SettingError

pytestmark = pytest.mark.usefixtures("plain_frames")

KEY = jax.random.key(0)


def sequence(cell_inputs=5, size=4, steps=7, batch=3):
    rng = np.random.default_rng(0)
    inputs = jnp.asarray(rng.normal(size=(steps, batch, cell_inputs)).astype(np.float32))
    hidden = jnp.asarray(rng.normal(size=(batch, size)).astype(np.float32))
    reset = np.zeros((steps, batch), bool)
    reset[0, 0] = reset[3, 1] = reset[4, 1] = reset[6, 2] = True
    gru = GRU(size, jnp.float32)
    params = gru.init(KEY, inputs, jnp.asarray(reset), hidden)
    params = jax.tree.map(
        lambda leaf: (
            leaf + 0.1 * jnp.cos(jnp.arange(leaf.size, dtype=jnp.float32)).reshape(leaf.shape)
        ),
        params,
    )
    return gru, params, inputs, reset, hidden


def by_hand(params, inputs, reset, hidden):
    """The formulas with numpy, one environment and one step at a time."""
    p = jax.tree.map(np.asarray, params["params"])
    sig = lambda v: 1 / (1 + np.exp(-v))  # noqa: E731
    size = hidden.shape[1]
    out = np.zeros((*inputs.shape[:2], size), np.float32)
    for n in range(inputs.shape[1]):
        h = np.array(hidden[n])
        for t in range(inputs.shape[0]):
            if reset[t, n]:
                h = np.zeros(size)
            x = inputs[t, n] @ p["Dense_0"]["kernel"] + p["Dense_0"]["bias"]
            u = h @ p["recurrent"]
            r, z = sig(x[:size] + u[:size]), sig(x[size : 2 * size] + u[size : 2 * size])
            new = np.tanh(x[2 * size :] + r * (u[2 * size :] + p["candidate_bias"]))
            h = (1 - z) * new + z * h
            out[t, n] = h
    return out


def test_gru_equals_a_loop_with_resets():
    gru, params, inputs, reset, hidden = sequence()
    steps, last = gru.apply(params, inputs, jnp.asarray(reset), hidden)
    np.testing.assert_allclose(steps, by_hand(params, inputs, reset, hidden), atol=1e-5)
    np.testing.assert_array_equal(last, steps[-1])


def test_no_gradient_crosses_a_reset():
    gru, params, inputs, reset, hidden = sequence()

    def after(inputs, hidden):
        return jnp.sum(gru.apply(params, inputs, jnp.asarray(reset), hidden)[0][4:, 1])

    by_input, by_hidden = jax.grad(after, (0, 1))(inputs, hidden)
    assert np.all(np.asarray(by_input)[:4, 1] == 0)
    assert np.any(np.asarray(by_input)[4:, 1] != 0)
    assert np.all(np.asarray(by_hidden) == 0)


def small_network(observation="rgb", **settings):
    env, params = jaxenstein.make("simple", height=12, width=16, observation=observation)
    config = Config(features=8, hidden=4, head=8, **settings)
    network = ActorCritic(observation_spec(env, params), 5, 1, config, config.compute_dtype)
    return env, params, network


def random_inputs(network, shape, steps=6, batch=2):
    rng = np.random.default_rng(0)
    obs = jnp.asarray(rng.integers(0, 256, (steps, batch, *shape)).astype(np.uint8))
    previous = jnp.asarray(rng.integers(0, 5, (steps, batch)).astype(np.int32))
    first = jnp.asarray(rng.random((steps, batch)) < 0.3)
    memory = jnp.asarray(rng.normal(size=(batch, 4)).astype(np.float32))
    return obs, previous, first, memory


def test_sequence_equals_single_steps():
    _, _, network = small_network()
    params = network.init(KEY)
    obs, previous, first, memory = random_inputs(network, (12, 16, 3))
    logits, values, last = jax.jit(network.unroll)(params, obs, previous, first, memory)
    step = jax.jit(network.step)
    for t in range(len(first)):
        a, b, memory = step(params, obs[t], previous[t], first[t], memory)
        np.testing.assert_allclose(a, logits[t], atol=1e-6)
        np.testing.assert_allclose(b, values[t], atol=1e-6)
    np.testing.assert_allclose(memory, last, atol=1e-6)


def test_values_can_begin_near_zero():
    largest = {}
    for near in (False, True):
        _, _, network = small_network(zero_values=near)
        logits, values, _ = network.unroll(network.init(KEY), *random_inputs(network, (12, 16, 3)))
        largest[near] = float(jnp.max(jnp.abs(values)))
        assert jnp.max(jnp.abs(logits)) < 0.05
    assert largest[False] > 0.01
    np.testing.assert_allclose(largest[True], largest[False] / 100, rtol=1e-3)


def test_contrast_changes_images_but_not_labels():
    _, _, network = small_network()
    _, _, sharp = small_network(contrast=4.0)
    params = network.init(KEY)
    obs, *rest = random_inputs(network, (12, 16, 3))
    assert obs.dtype == jnp.uint8
    # Images with the contrast already applied.
    spec = ObservationSpec((Part((12, 16, 3), True, "bounds", 0, 1),))
    plain = dataclasses.replace(network, spec=spec)
    given = 4 * (obs.astype(jnp.float32) / 255 - 0.3)
    expected = plain.unroll(params, given, *rest)
    jax.tree.map(
        lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-6),
        sharp.unroll(params, obs, *rest),
        expected,
    )
    assert not np.allclose(network.unroll(params, obs, *rest)[1], expected[1], atol=1e-3)
    (_, _, plain), (_, _, sharp) = small_network("labels"), small_network("labels", contrast=4.0)
    params, inputs = plain.init(KEY), random_inputs(plain, (12, 16))
    jax.tree.map(
        np.testing.assert_array_equal, sharp.unroll(params, *inputs), plain.unroll(params, *inputs)
    )


def test_persistence_raises_logit_of_previous_action():
    _, _, network = small_network()
    _, _, persistent = small_network(persistence=2.0)
    params = persistent.init(KEY)
    own = jnp.asarray([0.5, 1.0, 1.5, 2.0, 2.5])
    np.testing.assert_array_equal(params["persistence"], np.full(5, 2.0))
    inputs = random_inputs(network, (12, 16, 3))
    plain, values, last = network.unroll(network.init(KEY), *inputs)
    logits, *rest = persistent.unroll(params | {"persistence": own}, *inputs)
    expected = np.array(plain)
    for place in np.ndindex(plain.shape[:2]):
        if not inputs[2][place]:
            expected[place][inputs[1][place]] += own[inputs[1][place]]
    np.testing.assert_allclose(logits, expected, atol=1e-6)
    jax.tree.map(np.testing.assert_array_equal, rest, [values, last])
    # With five equal logits, the last action repeats with probability e^2 / (e^2 + 4).
    again = jax.nn.softmax(persistent.unroll(params, *inputs)[0])
    chosen = [again[p][inputs[1][p]] for p in np.ndindex(plain.shape[:2]) if not inputs[2][p]]
    np.testing.assert_allclose(chosen, np.exp(2) / (np.exp(2) + 4), atol=0.02)


def test_first_step_ignores_previous_action_and_memory():
    _, _, network = small_network()
    params = network.init(KEY)
    obs, previous, _, memory = random_inputs(network, (12, 16, 3), steps=1)
    first = jnp.ones((1, 2), bool)
    run = lambda *args: network.unroll(params, obs, *args)  # noqa: E731
    one, other = run(previous, first, memory), run(previous * 0, first, memory * 0)
    jax.tree.map(np.testing.assert_array_equal, one, other)
    again = run(previous, ~first, memory)[0], run((previous + 1) % 5, ~first, memory)[0]
    assert not np.allclose(again[0], again[1], atol=1e-7)
    forgetful = small_network(recurrent=False)[2].unroll(params, obs, previous, ~first, memory)
    jax.tree.map(np.testing.assert_array_equal, one, forgetful)


def test_bfloat16_agrees_with_float32():
    _, _, network = small_network()
    _, _, half = small_network(dtype="bfloat16")
    params = half.init(KEY)
    assert {leaf.dtype for leaf in jax.tree.leaves(params)} == {np.dtype(np.float32)}
    inputs = random_inputs(network, (12, 16, 3))
    one, other = network.unroll(params, *inputs), half.unroll(params, *inputs)
    assert all(leaf.dtype == jnp.float32 for leaf in other)
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, atol=0.03), one, other)
    assert not np.array_equal(one[1], other[1])


@pytest.mark.parametrize("observation", ["rgb", "gray", "depth", "labels", "dict"])
def test_every_kind_of_observation(observation):
    env, params, network = small_network(observation)
    obs, _ = env.reset(KEY, params)
    images, vector = network.spec.prepare(obs, jnp.float32)
    assert [image.shape for image in images] == list(network.spec.images)
    assert vector.shape == (network.spec.vector,) == ((6,) if observation == "dict" else (0,))
    assert all(np.all((np.asarray(i) >= 0) & (np.asarray(i) <= 1)) for i in images)
    weights = network.init(KEY)
    batch = jax.tree.map(lambda leaf: leaf[None], obs)
    step = network.step(
        weights, batch, jnp.zeros(1, jnp.int32), jnp.ones(1, bool), network.initial_memory(1)
    )
    assert all(np.all(np.isfinite(leaf)) for leaf in step)


def test_layers_fit_the_image():
    assert layers_for((64, 64, 3), None) == NATURE
    assert layers_for((36, 36, 3), None) == NATURE
    assert layers_for((16, 64, 3), None) == SMALL
    assert layers_for((8, 8, 1), None) == SMALL
    with pytest.raises(SettingError, match="too large for images of 16x16"):
        layers_for((16, 16, 3), NATURE)
