"""The program that speed is measured with: a random policy inside one compiled scan.

Two things make such numbers lie. A frame that nothing reads is deleted by the compiler together
with the renderer, and reducing a frame to a checksum costs more than drawing it. Here every
observation is carried whole through the scan, and one pixel of it shifts its environment's next
action, so that no frame can be left out and none is read twice.

Resets count as well. Episodes that begin together mostly end together, by their time limit, so
their clocks are set apart at the start: ends are then spread over the steps, as in training.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from ..environment import AnyEnvironment
from ..errors import SettingError
from ..pytree import PyTreeNode


class RolloutCarry(PyTreeNode):
    """What a rollout hands from one step to the next; `B` environments side by side.

    Attributes:
        key: the random key of the steps to come.
        obs: the latest observations, each leaf with a leading axis `B`.
        state: the states, each leaf with a leading axis `B`.
        reward: float32[B], the sum of all rewards so far.
        episodes: int32[B], the number of episodes ended so far.
        world_steps: int32[B], the steps of the world so far: `frame_skip` of them in a step that
            ends no episode.
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
        env: an environment whose `autoreset` is not `None`, so that it can go on for ever.
        params: its parameters, the same for every environment; fixed into the program.
        batch: the number of environments `B`, at least 1.
        steps: the number of steps of each environment in one call, at least 1.

    Returns:
        `(rollout, start)`, both jitted. `start(key)` resets the environments and returns a
        `RolloutCarry`. `rollout(carry)` plays `batch * steps` steps and returns the next carry,
        on which it is meant to be called again: it reuses the buffers of the carry it is given,
        which must not be used afterwards.

    Raises:
        SettingError: if `batch` or `steps` is below 1, or `env` does not reset itself.

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
        # A step that resets first has no time of its own.
        taken = jnp.maximum(info["episode_length"] - carry.state.time, 0)
        counts = carry.reward + reward, carry.episodes + ended, carry.world_steps + taken
        return RolloutCarry(key, obs, state, *counts), None

    def rollout(carry: RolloutCarry) -> RolloutCarry:
        return jax.lax.scan(advance, carry, length=steps)[0]

    return jax.jit(rollout, donate_argnums=0), jax.jit(start)


def _middle_pixel(obs: Any) -> jax.Array:
    """Return one element of every leaf of each environment's observation, summed: int32[B]."""
    total = jnp.int32(0)
    for leaf in jax.tree.leaves(obs):
        total += leaf[:, *(size // 2 for size in leaf.shape[1:])].astype(jnp.int32)
    return total
