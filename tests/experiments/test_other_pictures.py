"""Agents in ViZDoom that see other pictures than the game's."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

pytest.importorskip("flax")
pytest.importorskip("vizdoom")

import jaxenstein
from experiments import other_pictures
from jaxenstein.adapters.vizdoom import GameSession
from jaxenstein.baselines.runs.agents import evaluate_in_game
from jaxenstein.baselines.runs.trained import load_trained

AGENT = "pretrained/doom-my-way-home-pixels"


def test_agents_play_the_game_from_our_pictures(capsys: pytest.CaptureFixture[str]) -> None:
    assert other_pictures.main([AGENT, "--episodes", "2", "--greedy"]) == 0
    # An agent that does not find the armour gets -0.21.
    assert float(capsys.readouterr().out.split()[0]) > 0.8


def test_the_agent_sees_our_picture_of_the_state() -> None:
    from jaxenstein.baselines import load_policy

    seen: list[np.ndarray] = []

    class Watched:
        env = load_policy(AGENT).env

        def __call__(self, session: Any) -> int:
            seen.append(session.observation)
            return 4

    policy: Any = Watched()
    with GameSession(policy.env) as session:
        act = other_pictures.from_our_pictures(policy)
        for _ in range(3):
            theirs = session.observation
            session.step(act(session))
            session.step(4)
            assert seen[-1] is not theirs
            assert (seen[-1] == theirs).all(axis=-1).mean() > 0.97
    assert not np.array_equal(seen[0], seen[-1])


def shots(**settings: Any) -> tuple[np.ndarray, list[int]]:
    """uint8[20, 120, 160, 3], the game's screen after each of 20 steps that fire, and the ammo."""
    env, params = jaxenstein.make("doom-basic", look="game", height=120, width=160)
    shown, ammo = [], []
    with GameSession(env, params, 1, **settings) as session:
        for _ in range(20):
            session.step(env.action_names.index("attack"))
            shown.append(session.screen.copy())
            ammo.append(int(session.state.trigger.ammo))
    return np.stack(shown), ammo


def test_clean_pictures_lack_only_what_flies_off_a_hit() -> None:
    def smoky(game: Any) -> None:
        game.set_render_particles(False)
        game.set_render_decals(False)

    # The smoke of the bullet is left, and only the WAD file can remove it.
    shown, ammo = shots(prepare=smoky)
    with other_pictures.without_blood() as clean:
        bare, same = shots(prepare=clean)
    assert ammo == same
    changed = (shown != bare).any(axis=-1).mean(axis=(1, 2))
    fired = ammo.index(49)
    assert not changed[:fired].any()
    assert 0.0001 < changed[fired:].max() < 0.02


def test_ranges_of_params_do_not_matter_in_the_game() -> None:
    """The game has its own rules; so do results in the game."""
    trained = load_trained("pretrained/doom-deadly-corridor-pixels")
    about = trained.experiment
    found = []
    for other in ({}, {"damage_factor": (0.0, 2.0)}):
        spec = dataclasses.replace(about.environment, params={"max_steps_in_episode": 40, **other})
        agents = dataclasses.replace(
            trained, experiment=dataclasses.replace(about, environment=spec)
        )
        clean = other_pictures.returns(agents, "clean", 1, False)
        found.append((evaluate_in_game(agents, episodes=1), clean))
    (plain, plain_clean), (ranged, ranged_clean) = found
    assert (plain.returns == ranged.returns).all()
    assert (plain_clean == ranged_clean).all()
    assert ranged.environment.params == {"max_steps_in_episode": 40}
    assert ranged.in_game


def test_errors_are_lines(capsys: pytest.CaptureFixture[str]) -> None:
    for wrong, told in (
        (["pretrained/none"], "no pretrained agent"),
        (["pretrained/simple"], "ViZDoom has no scenario"),
        ([AGENT, "--episodes", "0"], "at least 1"),
    ):
        with pytest.raises(SystemExit):
            other_pictures.main(wrong)
        assert told in capsys.readouterr().err
