"""ICM: its rewards and its training."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")

from tests.baselines.bonuses.rollouts import (
    ACTIONS,
    KEY,
    bonus_of,
    experience,
    leaves,
    numbers_of,
    simple_world,
    train,
)  # fmt: skip


def perceptron(params, inputs):
    """Dense layers with rectifiers between them."""
    layers = [params["params"][f"Dense_{n}"] for n in range(len(params["params"]))]
    for number, layer in enumerate(layers):
        inputs = inputs @ np.asarray(layer["kernel"]) + np.asarray(layer["bias"])
        inputs = np.maximum(inputs, 0) if number < len(layers) - 1 else inputs
    return inputs


def test_icm_rewards_the_forward_error():
    bonus = bonus_of("icm")
    data, state = experience(), bonus.init(KEY)
    reward, _, metrics = jax.jit(bonus.reward)(state, numbers_of("icm"), data)
    latent = np.asarray(bonus._embedding.embed(state.params, data.obs))
    taken = np.eye(ACTIONS)[np.asarray(data.action)]
    predicted = perceptron(state.params["forward"], np.concatenate([latent[:-1], taken], -1))
    error = np.mean((predicted - latent[1:]) ** 2, axis=-1)
    np.testing.assert_allclose(reward, error, rtol=1e-4)
    np.testing.assert_allclose(metrics["icm_error"], error.mean(), rtol=1e-4)
    assert error.min() > 0


def test_icm_trains_only_on_steps_within_episodes():
    bonus = bonus_of("icm", minibatches=1)
    data, state = experience(), bonus.init(KEY)
    _, metrics = train(bonus, state, data, numbers_of("icm"), 1)
    latent = np.asarray(bonus._embedding.embed(state.params, data.obs))
    logits = perceptron(state.params["inverse"], np.concatenate([latent[:-1], latent[1:]], -1))
    entropies = np.log(np.sum(np.exp(logits), -1))
    action, wanted = np.asarray(data.action), ~np.asarray(data.ended)
    assert not wanted.all()
    lost = entropies - np.take_along_axis(logits, action[..., None], -1)[..., 0]
    right = np.argmax(logits, -1) == action
    np.testing.assert_allclose(metrics["icm_inverse_loss"], lost[wanted].mean(), rtol=1e-4)
    np.testing.assert_allclose(metrics["icm_inverse_accuracy"], right[wanted].mean(), rtol=1e-5)


@pytest.mark.parametrize("trains", [False, True])
def test_forward_error_trains_the_embedding_only_if_enabled(trains):
    bonus = bonus_of("icm", icm_forward_trains_encoder=trains)
    data, state = experience(), bonus.init(KEY)

    def total(params):
        latent = bonus._embedding.embed(params, data.obs)
        return jnp.mean(bonus.forward_error(params, latent, data.action))

    gradients = jax.jit(jax.grad(total))(state.params)
    moved = {name: any(np.any(leaf != 0) for leaf in leaves(g)) for name, g in gradients.items()}
    assert moved == {"encoder": trains, "latent": trains, "inverse": False, "forward": True}


@pytest.mark.parametrize("algo", ["icm", pytest.param("e3b", marks=pytest.mark.slow)])
def test_inverse_models_learn_actions_in_a_simple_world(algo):
    data, numbers = simple_world(), numbers_of(algo)
    sizes = {f"{algo}_hidden": 32, f"{algo}_latent": 16}
    bonus = bonus_of(algo, num_envs=data.action.shape[1], **sizes)
    state, before = train(bonus, bonus.init(KEY), data, numbers, 1)
    state, after = train(bonus, state, data, numbers, 150)
    assert float(after[f"{algo}_inverse_accuracy"]) > 0.95
    loss = f"{algo}_inverse_loss"
    assert float(after[loss]) < 0.3 * float(before[loss])
