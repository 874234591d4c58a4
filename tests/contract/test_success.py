"""The default definition of success."""

import jax
import jax.numpy as jnp
import pytest

from examples.custom_task import Fruit


@pytest.mark.parametrize(
    ("apple", "there", "success"), [(0, True, True), (1, True, False), (0, False, False)]
)
def test_termination_with_reward_is_success(apple, there, success):
    """The western place pays +1 if the apple is there, else -1."""
    env = Fruit(height=8, width=8)
    params = env.check_params()
    state = env.init_state(jax.random.key(0), params).replace(apple=jnp.int32(apple))
    if there:
        state = state.replace(position=jnp.array([2.5, 1.5], jnp.float32))
    _, reward, terminated, info = env.advance(jax.random.key(0), state, -1, params)
    assert bool(terminated) == there
    assert float(reward) == (0 if not there else 1 if success else -1)
    assert bool(info["success"]) == success
