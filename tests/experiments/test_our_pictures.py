"""Agents in ViZDoom that see our pictures of its states."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("flax")
pytest.importorskip("vizdoom")

from experiments import our_pictures
from jaxenstein.adapters.vizdoom import GameSession

AGENT = "pretrained/doom-my-way-home-pixels"


def test_agents_play_the_game_from_our_pictures(capsys: pytest.CaptureFixture[str]) -> None:
    assert our_pictures.main([AGENT, "--episodes", "2", "--greedy"]) == 0
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
        act = our_pictures.from_our_pictures(policy)
        for _ in range(3):
            theirs = session.observation
            session.step(act(session))
            session.step(4)
            assert seen[-1] is not theirs
            assert (seen[-1] == theirs).all(axis=-1).mean() > 0.97
    assert not np.array_equal(seen[0], seen[-1])


def test_errors_are_lines(capsys: pytest.CaptureFixture[str]) -> None:
    for wrong, told in (
        (["pretrained/none"], "no pretrained agent"),
        (["pretrained/simple"], "ViZDoom has no scenario"),
        ([AGENT, "--episodes", "0"], "at least 1"),
    ):
        with pytest.raises(SystemExit):
            our_pictures.main(wrong)
        assert told in capsys.readouterr().err
