"""The custom world: all levels are solvable, and the planner solves them."""

import jax
import pytest

from examples.custom_world import BringBack
from tests.tasks.minigrid.search import Search


@pytest.fixture(scope="module")
def levels():
    env = BringBack(height=8, width=8)
    draw = jax.jit(jax.vmap(lambda key: env.init_state(key, env.default_params)))
    return env, draw(jax.random.split(jax.random.key(0), 256))


def test_everything_is_reachable(levels):
    _, states = levels
    search = Search(jax.device_get(states), carries=True)
    assert search.had.all()
    assert search.opened.all()
    assert search.floor[:, 1:5, 6:10].any(axis=(1, 2)).all()
