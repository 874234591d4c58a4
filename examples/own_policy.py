"""Your own agent with memory, and its score in the T-maze.

python examples/own_policy.py
jaxenstein evaluate --policy examples.own_policy:agent --env t-maze
"""

from __future__ import annotations

import jax.numpy as jnp

import jaxenstein

JUNCTION, QUARTER = 33, 6  # steps to the end of the corridor, and turns that make 90 degrees


def agent(env, params):
    """Return a policy and its initial memory: the balance of colours, and the time."""
    left, right, forward = map(env.index_of, ("turn left", "turn right", "forward"))

    def policy(carry, obs, key):
        balance, time = carry
        red = obs[..., 0].astype(jnp.int32) - obs[..., 2].astype(jnp.int32)
        balance = balance + jnp.sum(red > 80) - jnp.sum(red < -80)  # the key is red or blue
        turning = (time >= JUNCTION) & (time < JUNCTION + QUARTER)
        action = jnp.where(turning, jnp.where(balance > 0, left, right), forward)
        return (balance, time + 1), action

    return policy, (jnp.int32(0), jnp.int32(0))


def main(episodes=100):
    """Evaluate the agent; return the `jaxenstein.Results`."""
    env, params = jaxenstein.make("t-maze")
    results = jaxenstein.evaluate(env, params, *agent(env, params), episodes, name="own_policy")
    print(results.summary())
    return results


if __name__ == "__main__":
    main()
