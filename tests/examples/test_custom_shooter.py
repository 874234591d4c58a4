"""The shooter of the documentation: its scripted player wins, and loses against stronger guards."""

from __future__ import annotations

import importlib
import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from examples import custom_shooter
from jaxenstein.cli import main
from jaxenstein.players import play, player_of
from jaxenstein.tasks.shooter import Shooter


@pytest.fixture(scope="module")
def outpost():
    return jaxenstein.make("examples.custom_shooter:Outpost", height=12, width=18)


def test_exit_wins_once_the_chief_is_dead(outpost) -> None:
    """Until then, its scripted player walks to the chief."""
    env, params = outpost
    rows = custom_shooter.MAP.split()
    tiles = {tile: [y, x] for y, row in enumerate(rows) for x, tile in enumerate(row)}
    start = jax.jit(env.first_state)(jax.random.key(0), params)
    health = np.asarray(start.monsters.health)
    dead = start.monsters.replace(health=np.where(health == custom_shooter.CHIEF.health, 0, health))
    look = jax.jit(lambda s: (custom_shooter.won(env, s), custom_shooter.destination(env, s)))
    for killed, out in itertools.product((False, True), repeat=2):
        state = start.replace(monsters=dead) if killed else start
        if out:
            state = state.replace(fixed_position=jnp.asarray(env.goal_part.places[0]))
        won, goes_to = look(state)
        assert won == (killed and out)
        assert np.argwhere(goes_to).tolist() == [tiles["G" if killed else "c"]]


@pytest.mark.slow
def test_game_can_be_won_and_lost(outpost) -> None:
    """Thousands of steps, which take half a minute without optimisations."""
    env, params = outpost
    first = jax.jit(jax.vmap(lambda key: env.first_state(key, params)))
    states, shares = first(jax.random.split(jax.random.key(0), 24)), {}
    for factor in (0.0, 1.0, 6.0):
        numbers = params.replace(damage_factor=factor)
        played = play(env, player_of(env), numbers, jax.random.key(1), states)
        shares[factor] = np.asarray(played.successes).mean()
    # Who cannot be hurt may still run out of ammunition.
    assert 1 >= shares[0.0] >= shares[1.0] > 0.5
    assert 0 < shares[6.0] < 0.5


@pytest.mark.slow
def test_program_plays_and_writes_an_animation(tmp_path, capsys) -> None:
    film = tmp_path / "outpost.gif"
    shares = custom_shooter.main(["--episodes", "16", "--out", str(film)])
    assert shares["idle"] == 0 < shares["hunt"]
    assert film.stat().st_size > 0
    assert "hunt: wins" in capsys.readouterr().out


@pytest.mark.slow
def test_agent_trains_on_it(tmp_path) -> None:
    pytest.importorskip("flax")
    flags = [
        "--env=examples.custom_shooter:Outpost", "--height=8", "--width=12", "--horizon=20",
        "--total-steps=192", "--num-envs=4", "--rollout=8", "--minibatches=2", "--epochs=1",
        "--features=8", "--hidden=8", "--head=8", "--convolutions=4x4x4", "--no-tensorboard",
    ]  # fmt: skip
    assert main(["train", *flags, "--out", str(tmp_path / "run")]) == 0
    policy = importlib.import_module("jaxenstein.baselines").load_policy(tmp_path / "run")
    assert isinstance(policy.env, Shooter)
