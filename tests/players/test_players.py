"""The players of environments and of tasks, by name."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein.errors import SettingError
from jaxenstein.players import IDLE, UNIFORM, play, player_of, players_of
from tests.contract.ids import IDS

SIZE = {"height": 8, "width": 8}


@pytest.mark.parametrize("name", jaxenstein.environment_ids())
def test_every_task_names_its_expert_among_its_players(name):
    env, _ = jaxenstein.make(name, **SIZE)
    about = env.about()
    assert about.expert in about.players
    assert player_of(env) is about.players[about.expert]
    assert list(players_of(env)) == ["idle", "random", *about.players]
    assert all(player.summary for player in players_of(env).values())


@pytest.mark.parametrize("name", IDS)
def test_about_describes_exactly_the_info_entries(name):
    """`about` describes all rewards, events and variables in `info`, and no others."""
    env, params = jaxenstein.make(name, **SIZE)
    about = env.about()
    state = jax.eval_shape(env.init_state, jax.random.key(0), params)
    info = jax.eval_shape(env.advance, jax.random.key(0), state, 0, params)[3]
    common = {"position", "heading", "cell", "episode_return", "episode_length", "success"}
    assert set(info) == common | set(about.events) | set(about.variables)
    assert all(info[name].dtype in (jnp.bool_, jnp.int32) for name in about.events)
    counted = {name for name, event in about.events.items() if event.several}
    assert counted == {name for name in about.events if info[name].dtype == jnp.int32}
    assert set(about.captions) <= set(about.variables)
    for name, words in about.rewards.items():
        assert words.format(float(getattr(params, name)))


@pytest.mark.parametrize(
    ("player", "name"), [("greedy_medkits", "simple"), ("shortest_path", "health-gathering")]
)
def test_players_of_other_tasks_are_unknown(player, name):
    env, _ = jaxenstein.make(name, **SIZE)
    with pytest.raises(SettingError, match=f"{name}' has no player '{player}'.* it has idle, rand"):
        player_of(env, player)


def test_uniform_draws_every_action():
    env, params = jaxenstein.make("simple", **SIZE)
    choose = UNIFORM(env, params)
    actions = jax.vmap(lambda key: choose(key, None))(jax.random.split(jax.random.key(0), 200))
    assert actions.dtype == jnp.int32
    assert set(np.asarray(actions).tolist()) == set(range(env.num_actions))


def test_greedy_survives_and_idle_dies():
    env, params = jaxenstein.make("health-gathering", **SIZE)
    params = params.replace(max_steps_in_episode=jnp.int32(500))
    keys = jax.random.split(jax.random.key(1), 4)
    states = jax.vmap(lambda key: env.init_state(key, params))(keys)
    greedy = play(env, player_of(env), params, jax.random.key(0), states)
    lazy = play(env, IDLE, params, jax.random.key(0), states)
    assert not greedy.terminated.any()
    np.testing.assert_array_equal(greedy.returned, np.full(4, 500))
    np.testing.assert_array_equal(greedy.successes, np.ones(4))
    assert lazy.terminated.all()
    np.testing.assert_array_equal(lazy.length, np.full(4, 384))
    np.testing.assert_array_equal(lazy.returned, np.full(4, 284))
    np.testing.assert_array_equal(lazy.successes, np.zeros(4))
