"""A recurrent PPO on gymnax' interface in one `jax.lax.scan`, as a client to test with.

It does what such loops (purejaxrl is the best known) do to an environment: wrap it in gymnax'
`LogWrapper`, step a vmapped batch inside of a scan with old keys, keep every value of `info` of
every step, reset the memory where an episode ended. Networks and Adam are a few lines of JAX here.
"""

# The partner is an extra, which need not be there to check the types.
# pyright: reportMissingImports=false

from __future__ import annotations

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from gymnax.wrappers.purerl import LogWrapper

HIDDEN = 16


class Config(NamedTuple):
    envs: int = 4
    steps: int = 8
    updates: int = 3
    epochs: int = 2
    discount: float = 0.99
    trace: float = 0.95
    clip: float = 0.2
    entropy: float = 0.01
    rate: float = 1e-3


class Transition(NamedTuple):
    obs: jax.Array
    start: jax.Array
    action: jax.Array
    log_prob: jax.Array
    value: jax.Array
    reward: jax.Array
    done: jax.Array
    info: dict[str, jax.Array]


def train(env: Any, env_params: Any, seed: int = 0, config: Config | None = None) -> Any:
    """Run all updates in one compiled call: transitions [U, T, N, ...], losses [U, E], weights."""
    settings = config or Config()
    return jax.jit(lambda key: _train(LogWrapper(env), env_params, key, settings))(
        jax.random.PRNGKey(seed)
    )


def init_weights(key: jax.Array, pixels: int, actions: int) -> dict[str, jax.Array]:
    shapes = {
        "encode": (pixels, HIDDEN),
        "gates": (2 * HIDDEN, 2 * HIDDEN),
        "candidate": (2 * HIDDEN, HIDDEN),
        "actor": (HIDDEN, actions),
        "critic": (HIDDEN, 1),
    }
    keys = jax.random.split(key, len(shapes))
    return {
        name: jax.random.normal(k, shape) / jnp.sqrt(shape[0])
        for k, (name, shape) in zip(keys, shapes.items(), strict=True)
    }


def network(
    weights: dict[str, jax.Array], memory: jax.Array, obs: jax.Array, start: jax.Array
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """A GRU over encoded pixels: memory [N, H], logits [N, A], value [N]."""
    memory = jnp.where(start[:, None], 0.0, memory)
    pixels = obs.reshape(obs.shape[0], -1).astype(jnp.float32) / 255.0
    x = jnp.tanh(pixels @ weights["encode"])
    gates = jax.nn.sigmoid(jnp.concatenate([x, memory], -1) @ weights["gates"])
    update, forget = jnp.split(gates, 2, axis=-1)
    candidate = jnp.tanh(jnp.concatenate([x, forget * memory], -1) @ weights["candidate"])
    memory = (1.0 - update) * memory + update * candidate
    return memory, memory @ weights["actor"], (memory @ weights["critic"])[:, 0]


def advantages(batch: Transition, last_value: jax.Array, config: Config) -> jax.Array:
    """Generalised advantage estimates [T, N] that stop at the end of an episode."""

    def back(carry: Any, step: Transition) -> Any:
        following, advantage = carry
        alive = 1.0 - step.done
        delta = step.reward + config.discount * following * alive - step.value
        advantage = delta + config.discount * config.trace * alive * advantage
        return (step.value, advantage), advantage

    start = (last_value, jnp.zeros_like(last_value))
    return jax.lax.scan(back, start, batch, reverse=True)[1]


def loss(
    weights: Any, memory: jax.Array, batch: Transition, advantage: jax.Array, config: Config
) -> jax.Array:
    def forward(memory: jax.Array, step: Transition) -> Any:
        memory, logits, value = network(weights, memory, step.obs, step.start)
        return memory, (logits, value)

    logits, value = jax.lax.scan(forward, memory, batch)[1]
    log_probs = jax.nn.log_softmax(logits)
    taken = jnp.take_along_axis(log_probs, batch.action[..., None], -1)[..., 0]
    ratio = jnp.exp(taken - batch.log_prob)
    scaled = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
    clipped = jnp.clip(ratio, 1.0 - config.clip, 1.0 + config.clip)
    policy = -jnp.minimum(ratio * scaled, clipped * scaled).mean()
    critic = jnp.square(value - (advantage + batch.value)).mean()
    entropy = -(jnp.exp(log_probs) * log_probs).sum(-1).mean()
    return policy + 0.5 * critic - config.entropy * entropy


def adam(weights: Any, grads: Any, moments: Any, rate: float) -> tuple[Any, Any]:
    first, second, count = moments
    first = jax.tree.map(lambda m, g: 0.9 * m + 0.1 * g, first, grads)
    second = jax.tree.map(lambda v, g: 0.999 * v + 0.001 * g**2, second, grads)
    count = count + 1.0
    weights = jax.tree.map(
        lambda w, m, v: (
            w - rate * (m / (1 - 0.9**count)) / (jnp.sqrt(v / (1 - 0.999**count)) + 1e-8)
        ),
        weights,
        first,
        second,
    )
    return weights, (first, second, count)


def _train(env: Any, env_params: Any, key: jax.Array, config: Config) -> Any:
    key, weights_key, reset_key = jax.random.split(key, 3)
    shape = env.observation_space(env_params).shape
    actions = env.action_space(env_params).n
    weights = init_weights(weights_key, math.prod(shape), actions)
    zeros = jax.tree.map(jnp.zeros_like, weights)
    obs, state = jax.vmap(env.reset, (0, None))(
        jax.random.split(reset_key, config.envs), env_params
    )

    def act(carry: Any, key: jax.Array) -> Any:
        weights, memory, obs, start, state = carry
        act_key, step_key = jax.random.split(key)
        memory, logits, value = network(weights, memory, obs, start)
        action = jax.random.categorical(act_key, logits)
        log_prob = jnp.take_along_axis(jax.nn.log_softmax(logits), action[:, None], -1)[:, 0]
        after, state, reward, *ends, info = jax.vmap(env.step, (0, 0, 0, None))(
            jax.random.split(step_key, config.envs), state, action, env_params
        )
        done = ends[0] if len(ends) == 1 else ends[0] | ends[1]
        kept = Transition(obs, start, action, log_prob, value, reward, done, info)
        return (weights, memory, after, done, state), kept

    def update(carry: Any, key: jax.Array) -> Any:
        weights, moments, memory, obs, start, state = carry
        first = memory
        (_, memory, obs, start, state), batch = jax.lax.scan(
            act, (weights, memory, obs, start, state), jax.random.split(key, config.steps)
        )
        last_value = network(weights, memory, obs, start)[2]
        advantage = advantages(batch, last_value, config)

        def epoch(carry: Any, _: None) -> Any:
            weights, moments = carry
            value, grads = jax.value_and_grad(loss)(weights, first, batch, advantage, config)
            return adam(weights, grads, moments, config.rate), value

        (weights, moments), losses = jax.lax.scan(epoch, (weights, moments), None, config.epochs)
        return (weights, moments, memory, obs, start, state), (batch, losses)

    memory = jnp.zeros((config.envs, HIDDEN))
    start = jnp.ones(config.envs, bool)
    carry = (weights, (zeros, zeros, jnp.float32(0.0)), memory, obs, start, state)
    carry, (batches, losses) = jax.lax.scan(update, carry, jax.random.split(key, config.updates))
    return batches, losses, carry[0]
