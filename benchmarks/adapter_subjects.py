"""The subjects of `benchmarks.adapters`, built by `subjects.py` in a process of its own.

All play `my-way-home` at 64x64 under the same random policy, which reads one pixel of every
environment's frame: an adapter that only promised its frames would not be measured.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jaxenstein

Chunk = Callable[[], int]

ENVIRONMENT_ID = "my-way-home"
SIZE = 64
MIDDLE = SIZE // 2
STEPS_A_CALL = 2**15
ROWS_DRAWN = 256


def prepare(name: str) -> Chunk:
    """Build the subject `KIND-B`, with B environments."""
    kind, _, batch = name.rpartition("-")
    # As for the plain loop: waiting for each frame, one only pays for another thread.
    jax.config.update("jax_cpu_enable_async_dispatch", kind in SCANS)
    return SUBJECTS[kind](int(batch))


def make(**settings: Any) -> tuple[Any, Any]:
    """The environment that all subjects play."""
    return jaxenstein.make(ENVIRONMENT_ID, height=SIZE, width=SIZE, **settings)


def drawn_actions(batch: int, count: int) -> Iterator[np.ndarray]:
    """int32[batch] uniform actions, drawn beforehand, round and round for ever."""
    rng = np.random.default_rng(0)
    return itertools.cycle(rng.integers(count, size=(ROWS_DRAWN, batch), dtype=np.int32))


def loop_over(batch: int, first: Any, step: Callable[[np.ndarray], Any], count: int) -> Chunk:
    """A loop on the host: `step` takes int32[B] and gives NumPy's uint8[B, H, W, 3]."""
    drawn = drawn_actions(batch, count)
    observation = first
    calls = max(8, 1024 // batch)

    def chunk() -> int:
        nonlocal observation
        for _ in range(calls):
            observation = step((next(drawn) + observation[:, MIDDLE, MIDDLE, 0]) % count)
        return calls * batch

    return chunk


def loop(batch: int) -> Chunk:
    """The native environments under `jax.vmap`, one jitted call a step."""
    env, params = make()

    @jax.jit
    def step(key: jax.Array, state: Any, actions: Any) -> Any:
        key, step_key = jax.random.split(key)
        keys = jax.random.split(step_key, batch)
        observation, state, *rest = jax.vmap(env.step, (0, 0, 0, None))(
            keys, state, actions, params
        )
        return key, state, observation, rest

    key = jax.random.key(0)
    reset = jax.jit(lambda keys: jax.vmap(env.reset, (0, None))(keys, params))
    observation, state = reset(jax.random.split(key, batch))

    def advance(actions: np.ndarray) -> np.ndarray:
        nonlocal key, state
        key, state, observation, _ = step(key, state, actions)
        return np.asarray(observation)

    return loop_over(batch, np.asarray(observation), advance, env.num_actions)


def gymnasium_vector(batch: int, mode: str) -> Chunk:
    """Gymnasium's vector interface."""
    from jaxenstein.adapters.gymnasium_vector import GymnasiumVectorEnv

    env = GymnasiumVectorEnv(*make(), batch, autoreset_mode=mode)
    observation, _ = env.reset(seed=0)
    return loop_over(batch, observation, lambda actions: env.step(actions)[0], 5)


def gymnasium_single(batch: int) -> Chunk:
    """Gymnasium's plain interface: one environment, reset by the loop."""
    from jaxenstein.adapters.gymnasium import GymnasiumEnv

    assert batch == 1
    env = GymnasiumEnv(*make())
    first, _ = env.reset(seed=0)

    def step(actions: np.ndarray) -> np.ndarray:
        observation, _, terminated, truncated, _ = env.step(int(actions[0]))
        if terminated or truncated:
            observation, _ = env.reset()
        return observation[None]

    return loop_over(1, first[None], step, 5)


def torch_tensors(batch: int) -> Chunk:
    """Torch: the policy computes on tensors."""
    import torch  # pyright: ignore[reportMissingImports]

    from jaxenstein.adapters.torch import TorchBatch

    torch.set_num_threads(1)
    env = TorchBatch(*make(), batch)
    drawn = map(torch.from_numpy, drawn_actions(batch, env.num_actions))
    observation, _ = env.reset(0)
    calls = max(8, 1024 // batch)

    def chunk() -> int:
        nonlocal observation
        for _ in range(calls):
            pixel = observation[:, MIDDLE, MIDDLE, 0]
            observation = env.step((next(drawn) + pixel) % env.num_actions).observation
        return calls * batch

    return chunk


def sb3(batch: int) -> Chunk:
    """Stable-Baselines3's `VecEnv`."""
    from jaxenstein.adapters.sb3 import SB3VecEnv

    env = SB3VecEnv(*make(), batch)
    env.seed(0)
    return loop_over(batch, env.reset(), lambda actions: env.step(actions)[0], 5)


def scan_over(
    batch: int,
    reset: Callable[[jax.Array], tuple[Any, jax.Array]],
    step: Callable[[jax.Array, Any, jax.Array], tuple[Any, jax.Array, jax.Array]],
    count: int,
) -> Chunk:
    """A compiled scan over an adapter that lives in JAX, in the manner of `random_rollout`.

    Args:
        batch: B.
        reset: of keys [B]: states and images [B, H, W, 3].
        step: of keys, states and int32[B] actions: states, images and rewards.
        count: number of actions.
    """
    steps = max(1, STEPS_A_CALL // batch)

    def advance(carry: Any, _: None) -> tuple[Any, None]:
        key, state, image, total = carry
        key, policy_key, step_key = jax.random.split(key, 3)
        drawn = jax.random.randint(policy_key, (batch,), 0, count, jnp.int32)
        action = (drawn + image[:, MIDDLE, MIDDLE, 0].astype(jnp.int32)) % count
        state, image, reward = step(jax.random.split(step_key, batch), state, action)
        return (key, state, image, total + reward), None

    rollout = jax.jit(lambda carry: jax.lax.scan(advance, carry, length=steps)[0], donate_argnums=0)
    state, image = jax.jit(reset)(jax.random.split(jax.random.key(0), batch))
    carry = jax.random.key(1), state, image, jnp.zeros(batch, jnp.float32)

    def chunk() -> int:
        nonlocal carry
        carry = jax.block_until_ready(rollout(carry))
        return batch * steps

    return chunk


def gymnax(batch: int) -> Chunk:
    """gymnax' contract, of five or six values."""
    from jaxenstein.adapters.gymnax import from_env

    env, params = from_env(*make())

    def reset(keys: jax.Array) -> Any:
        observation, state = jax.vmap(env.reset, (0, None))(keys, params)
        return state, observation

    def step(keys: jax.Array, state: Any, action: jax.Array) -> Any:
        values = jax.vmap(env.step, (0, 0, 0, None))(keys, state, action, params)
        return values[1], values[0], values[2]

    return scan_over(batch, reset, step, env.num_actions)


def stoa(batch: int) -> Chunk:
    """Stoa's interface, with the resets of the environment inside."""
    from jaxenstein.adapters.stoa import from_env

    env = from_env(*make())

    def reset(keys: jax.Array) -> Any:
        state, first = jax.vmap(env.reset)(keys)
        return state, first.observation

    def step(keys: jax.Array, state: Any, action: jax.Array) -> Any:
        del keys
        state, told = jax.vmap(env.step)(state, action)
        return state, told.observation, told.reward

    return scan_over(batch, reset, step, env.env.num_actions)


def brax(batch: int) -> Chunk:
    """Brax' interface in the wrappers that its training puts around it."""
    from jaxenstein.adapters.brax import PIXELS, from_env, wrap

    inner = from_env(*make(autoreset=None))
    env = wrap(inner, episode_length=inner.episode_length)

    def reset(keys: jax.Array) -> Any:
        # Brax' wrappers know old keys alone.
        state = env.reset(jax.vmap(jax.random.key_data)(keys))
        return state, state.obs[PIXELS]

    def step(keys: jax.Array, state: Any, action: jax.Array) -> Any:
        del keys
        state = env.step(state, action)
        return state, state.obs[PIXELS], state.reward

    return scan_over(batch, reset, step, inner.action_size)


SCANS: dict[str, Callable[[int], Chunk]] = {"gymnax": gymnax, "stoa": stoa, "brax": brax}
SUBJECTS: dict[str, Callable[[int], Chunk]] = SCANS | {
    "loop": loop,
    "gymnasium-single": gymnasium_single,
    "gymnasium-same-step": lambda batch: gymnasium_vector(batch, "SameStep"),
    "gymnasium-next-step": lambda batch: gymnasium_vector(batch, "NextStep"),
    "torch": torch_tensors,
    "sb3": sb3,
}
