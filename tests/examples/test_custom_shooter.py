"""The shooter of the documentation: its scripted player wins, and loses against stronger guards."""

from __future__ import annotations

import importlib

import jax
import numpy as np
import pytest

import jaxenstein
from examples import custom_shooter
from jaxenstein.cli import main
from jaxenstein.players import play, player_of
from jaxenstein.tasks.shooter import Shooter


@pytest.fixture(scope="module")
def outpost():
    env, params = jaxenstein.make("examples.custom_shooter:Outpost", height=12, width=18)
    first = jax.jit(jax.vmap(lambda key: env.first_state(key, params)))
    return env, params, first(jax.random.split(jax.random.key(0), 24))


def test_it_is_won_and_lost(outpost) -> None:
    env, params, states = outpost
    shares = {}
    for factor in (0.0, 1.0, 6.0):
        numbers = params.replace(damage_factor=factor)
        played = play(env, player_of(env), numbers, jax.random.key(1), states)
        shares[factor] = np.asarray(played.successes).mean()
    # Who cannot be hurt may still run out of ammunition.
    assert 1 >= shares[0.0] >= shares[1.0] > 0.5
    assert 0 < shares[6.0] < 0.5


@pytest.mark.slow
def test_its_program_plays_and_writes_a_film(tmp_path, capsys) -> None:
    film = tmp_path / "outpost.gif"
    shares = custom_shooter.main(["--episodes", "16", "--out", str(film)])
    assert shares["idle"] == 0 < shares["hunt"]
    assert film.stat().st_size > 0
    assert "hunt: wins" in capsys.readouterr().out


@pytest.mark.slow
def test_an_agent_trains_on_it(tmp_path) -> None:
    pytest.importorskip("flax")
    flags = [
        "--env=examples.custom_shooter:Outpost", "--height=8", "--width=12", "--horizon=20",
        "--total-steps=192", "--num-envs=4", "--rollout=8", "--minibatches=2", "--epochs=1",
        "--features=8", "--hidden=8", "--head=8", "--convolutions=4x4x4", "--no-tensorboard",
    ]  # fmt: skip
    assert main(["train", *flags, "--out", str(tmp_path / "run")]) == 0
    policy = importlib.import_module("jaxenstein.baselines").load_policy(tmp_path / "run")
    assert isinstance(policy.env, Shooter)
