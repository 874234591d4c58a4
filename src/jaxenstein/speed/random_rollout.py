"""The program for speed measurements: a random policy in one compiled scan.

Two mistakes make such numbers wrong. If nothing reads a frame, the compiler removes it together
with the renderer. And reducing a frame to a checksum costs more than rendering it. Here every
observation is carried whole through the scan, and one pixel of it shifts the next action of its
environment, so that every frame is needed and none is read twice.

Resets count too. Episodes that start together mostly reach the time limit together, so their clocks
are spread at the start. Ends of episodes are then spread over the steps, as in training.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from ..environment import AnyEnvironment
from ..errors import SettingError
from ..pytree import PyTreeNode


class RolloutCarry(PyTreeNode):
    """The carry between steps of a rollout of B parallel environments.

    Attributes:
        key: the random key of the following steps.
        obs: the latest observations, each leaf with a leading axis B.
        state: the states, each leaf with a leading axis B.
        reward: float32[B], the sum of all rewards so far.
        episodes: int32[B], the number of finished episodes.
        world_steps: int32[B], the number of world steps: `frame_skip` for each step that does not
            end an episode.
    """

    key: jax.Array
    obs: Any
    state: Any
    reward: jax.Array
    episodes: jax.Array
    world_steps: jax.Array


def make_random_rollout(
    env: AnyEnvironment, params: Any, batch: int, steps: int
) -> tuple[jax.stages.Wrapped, jax.stages.Wrapped]:
    """Make a rollout of a uniform random policy, and the function that starts it.

    Args:
        env: an environment whose `autoreset` is not `None`, so that it can run forever.
        params: its params, the same for every environment; constants of the program.
        batch: the number of environments B, at least 1.
        steps: the number of steps of each environment per call, at least 1.

    Returns:
        `(rollout, start)`, both jitted. `start(key)` resets the environments and returns a
        `RolloutCarry`. `rollout(carry)` plays `batch * steps` steps and returns the next carry,
        on which you can call it again. It reuses the buffers of its argument, which must not be
        used afterwards.

    Raises:
        SettingError: `batch` or `steps` is below 1, or `env` does not reset itself.

    Examples:
        >>> import jaxenstein
        >>> env, params = jaxenstein.make("simple", height=8, width=8)
        >>> rollout, start = make_random_rollout(env, params, batch=4, steps=10)
        >>> carry = rollout(start(jax.random.key(0)))
        >>> carry.state.position.shape
        (4, 2)
    """
    if batch < 1 or steps < 1:
        raise SettingError(f"batch and steps must be at least 1, not {batch} and {steps}")
    if env.autoreset is None:
        raise SettingError("a rollout needs an environment with autoreset, not autoreset=None")
    reset = jax.vmap(lambda key: env.reset(key, params))
    step = jax.vmap(lambda key, state, action: env.step(key, state, action, params))

    def start(key: jax.Array) -> RolloutCarry:
        key, reset_key, clock_key = jax.random.split(key, 3)
        obs, state = reset(jax.random.split(reset_key, batch))
        limit = jnp.asarray(params.max_steps_in_episode, jnp.int32)
        time = jax.random.randint(clock_key, (batch,), 0, jnp.maximum(limit, 1), jnp.int32)
        state = state.replace(time=time)
        nothing = jnp.zeros(batch, jnp.int32)
        return RolloutCarry(key, obs, state, nothing.astype(jnp.float32), nothing, nothing)

    def advance(carry: RolloutCarry, _: None) -> tuple[RolloutCarry, None]:
        key, policy_key, step_key = jax.random.split(carry.key, 3)
        sampled = jax.random.randint(policy_key, (batch,), 0, env.num_actions, jnp.int32)
        # Still uniform: a uniform sample, shifted by a number that does not depend on it.
        action = (sampled + _middle_pixel(carry.obs)) % env.num_actions
        obs, state, reward, terminated, truncated, info = step(
            jax.random.split(step_key, batch), carry.state, action
        )
        ended = (terminated | truncated).astype(jnp.int32)
        # A step that only resets takes no time.
        taken = jnp.maximum(info["episode_length"] - carry.state.time, 0)
        counts = carry.reward + reward, carry.episodes + ended, carry.world_steps + taken
        return RolloutCarry(key, obs, state, *counts), None

    def rollout(carry: RolloutCarry) -> RolloutCarry:
        return jax.lax.scan(advance, carry, length=steps)[0]

    return jax.jit(rollout, donate_argnums=0), jax.jit(start)


def _middle_pixel(obs: Any) -> jax.Array:
    """The sum over all leaves of one element of each environment's observation: int32[B]."""
    total = jnp.int32(0)
    for leaf in jax.tree.leaves(obs):
        total += leaf[:, *(size // 2 for size in leaf.shape[1:])].astype(jnp.int32)
    return total
