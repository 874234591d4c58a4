"""The custom world: all levels are solvable, and the planner solves them."""

import runpy
from pathlib import Path

import jax
import pytest

from examples import custom_world
from examples.custom_world import BringBack
from jaxenstein.players import play, player_of
from tests.tasks.minigrid.search import Search


@pytest.fixture(scope="module")
def levels():
    env = BringBack(height=8, width=8)
    draw = jax.jit(jax.vmap(lambda key: env.init_state(key, env.default_params)))
    return env, draw(jax.random.split(jax.random.key(0), 256))


def test_planner_solves_the_levels(levels):
    env, states = levels
    some = jax.tree.map(lambda leaf: leaf[:64], states)
    played = play(env, player_of(env), env.default_params, jax.random.key(1), some)
    assert (played.successes > 0).all()


def test_program_runs(capsys):
    runpy.run_path(str(Path(custom_world.__file__)), run_name="__main__")
    assert "return 1" in capsys.readouterr().out


def test_everything_is_reachable(levels):
    _, states = levels
    search = Search(jax.device_get(states), carries=True)
    assert search.had.all()
    assert search.opened.all()
    assert search.floor[:, 1:5, 6:10].any(axis=(1, 2)).all()
