"""A random policy in one compiled scan, and how fast it is.

    python examples/random_rollout.py [--env ID] [--envs N] [--steps N]

A compiled program never computes what nobody asks for. If the rollout ignored its frames, they
would not be drawn and the speed would be a lie. So the scan carries the whole observation from
step to step, and one pixel of it takes part in the choice of the next action.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence

import jax
import jax.numpy as jnp

import jaxenstein


def main(argv: Sequence[str] | None = None) -> tuple[float, float]:
    """Run and report; returns steps a second and the mean return of the episodes that ended."""
    parser = argparse.ArgumentParser(description="A random rollout in a scan.")
    parser.add_argument("--env", default="simple", help="an id of `jaxenstein list`")
    parser.add_argument("--envs", type=int, default=256)
    parser.add_argument("--steps", type=int, default=1000)
    parser.add_argument("--size", type=int, default=64, help="pixels a side")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(argv)
    env, params = jaxenstein.make(options.env, height=options.size, width=options.size)
    reset = jax.vmap(env.reset, (0, None))
    step = jax.vmap(env.step, (0, 0, 0, None))
    middle = options.size // 2

    def act(carry, key):
        obs, state, ended, total = carry
        policy_key, step_key = jax.random.split(key)
        drawn = jax.random.randint(policy_key, (options.envs,), 0, env.num_actions)
        # Still uniform: what is added does not depend on what was drawn.
        action = (drawn + obs[:, middle, middle, 0]) % env.num_actions
        keys = jax.random.split(step_key, options.envs)
        obs, state, _reward, terminated, truncated, info = step(keys, state, action, params)
        done = terminated | truncated
        total += jnp.sum(jnp.where(done, info["episode_return"], 0))
        return (obs, state, ended + jnp.sum(done), total), None

    @jax.jit
    def rollout(key):
        reset_key, key = jax.random.split(key)
        obs, state = reset(jax.random.split(reset_key, options.envs), params)
        carry = obs, state, jnp.int32(0), jnp.float32(0)
        return jax.lax.scan(act, carry, jax.random.split(key, options.steps))[0]

    key = jax.random.key(options.seed)
    began = time.perf_counter()
    compiled = rollout.lower(key).compile()
    print(f"compiled in {time.perf_counter() - began:.1f} s")
    jax.block_until_ready(compiled(key))  # once to warm up, uncounted
    began = time.perf_counter()
    # Without waiting, the clock would stop before the work is done.
    _, _, ended, total = jax.block_until_ready(compiled(key))
    rate = options.envs * options.steps / (time.perf_counter() - began)
    print(f"{options.env}, {options.envs} environments: {rate:,.0f} steps/s")
    mean = float(total / ended)
    print(f"{int(ended)} episodes ended, mean return {mean:.3f}")
    return rate, mean


if __name__ == "__main__":
    main()
