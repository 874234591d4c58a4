"""What counts as success where a task says nothing of it."""

import jax
import jax.numpy as jnp
import pytest

from examples.custom_task import TMaze


@pytest.mark.parametrize(
    ("arm", "there", "success"), [(0, True, True), (1, True, False), (0, False, False)]
)
def test_an_end_with_a_reward_is_success(arm, there, success):
    """The western end pays +1 where the arm is 0, -1 where it is 1."""
    env = TMaze(height=8, width=8)
    params = env.check_params()
    state = env.init_state(jax.random.key(0), params).replace(arm=jnp.int32(arm))
    if there:
        state = state.replace(position=jnp.array([1.5, 1.5], jnp.float32))
    _, reward, terminated, info = env.advance(jax.random.key(0), state, -1, params)
    assert bool(terminated) == there
    assert float(reward) == (0 if not there else 1 if success else -1)
    assert bool(info["success"]) == success
