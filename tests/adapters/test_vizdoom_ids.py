"""ViZDoom's Gymnasium environments: their spaces and episodes are those of ViZDoom's wrapper.

`vizdoom_wrapper.json` has what the wrapper says; `python -m fidelity.vizdoom_clients --record FILE`
makes it. The last tests play in the game where ViZDoom is installed (`make partners`).
"""

from __future__ import annotations

import importlib.util
import json
import re
from pathlib import Path
from typing import Any
from unittest import mock

import jax
import numpy as np
import pytest

from jaxenstein.adapters import vizdoom_buffers, vizdoom_ids
from jaxenstein.adapters.registration import VIZDOOM_SCENARIOS
from jaxenstein.engine.render import render
from jaxenstein.errors import SettingError

gymnasium = pytest.importorskip("gymnasium")
env_checker = pytest.importorskip("gymnasium.utils.env_checker")
clients = pytest.importorskip("fidelity.vizdoom_clients")
FORMS = clients.FORMS

pytestmark = pytest.mark.usefixtures("plain_frames")
RECORDED: dict[str, Any] = json.loads((Path(__file__).parent / "vizdoom_wrapper.json").read_text())
INSTALLED = importlib.util.find_spec("vizdoom") is not None
PLAIN: dict[str, Any] = {"look": "plain"}
LIMIT = {"episode_timeout": clients.SHORT["episode_timeout"]}
SMALL: dict[str, Any] = PLAIN | {
    "height": 12,
    "width": 16,
    "frame_skip": clients.SHORT["frame_skip"],
}
# Our names of buttons that are not the game's in small letters.
BUTTONS = {"FORWARD": "MOVE_FORWARD", "BACKWARD": "MOVE_BACKWARD", "PREVIOUS": "PREV"}
BUTTONS |= {f"WEAPON_{number}": f"SELECT_WEAPON{number}" for number in range(1, 7)}
BUTTONS |= {"NEXT_WEAPON": "SELECT_NEXT_WEAPON", "PREVIOUS_WEAPON": "SELECT_PREV_WEAPON"}


def made(scenario: str, form: str = "one", **settings: Any) -> Any:
    return gymnasium.make(clients.name_of(scenario, form, ours=True), **(FORMS[form][1] | settings))


def test_the_record_has_all_scenarios() -> None:
    assert list(RECORDED) == list(VIZDOOM_SCENARIOS)
    assert set(RECORDED["Basic"]) == {"buttons", *FORMS}


@pytest.mark.parametrize("scenario", RECORDED)
@pytest.mark.parametrize("form", FORMS)
def test_spaces_and_numbers_of_actions(scenario: str, form: str) -> None:
    told = RECORDED[scenario][form]
    env = made(scenario, form, **PLAIN)
    assert clients.described(env.action_space) == told["action"]
    assert clients.described(env.observation_space) == told["observation"]
    assert env.metadata["render_fps"] == told["fps"]
    plain = env.unwrapped
    names = [name.upper().replace(" ", "_") for name in plain.env.button_names]
    assert [BUTTONS.get(name, name) for name in names] == RECORDED[scenario]["buttons"]

    def held(action: Any) -> str:
        """The buttons of an action, in the game's order."""
        batch = np.asarray(action)[None]
        if isinstance(env.action_space, gymnasium.spaces.Dict):
            batch = {"binary": batch, "continuous": np.zeros((1, 3), np.float32)}
        (number,) = plain._interface.actions(batch, 1)
        bits = plain.env.action_buttons[number]
        return "".join(str(bits >> i & 1) for i in range(len(names)))

    for number, row in enumerate(told.get("held", ())):
        assert held(number) == row
    if "held" not in told:
        for row in (
            "1" + "0" * (len(names) - 1),
            "01" * (len(names) // 2) + "0" * (len(names) % 2),
        ):
            assert held([int(digit) for digit in row]) == row


@pytest.mark.parametrize(
    ("scenario", "form"),
    [
        ("HealthGathering", "one"),
        *(
            pytest.param(name, form, marks=pytest.mark.variant)
            for name in RECORDED
            for form in clients.PLAYED
            if (name, form) != ("HealthGathering", "one") and name != "Deathmatch"
        ),
    ],
)
def test_an_episode_that_runs_out_of_time(scenario: str, form: str) -> None:
    """Rewards, both ends, and all that is shown is zero then."""
    env = made(scenario, form, render_mode="rgb_array", **SMALL, **LIMIT)
    told = RECORDED[scenario][form]
    assert clients.short_episode(env) == {
        name: told[name] for name in ("keys", "variables", "steps")
    }


def test_gymnasiums_check() -> None:
    """Observations are in their space and repeat with their seed; warnings are errors."""
    env = made("HealthGathering", "each", **SMALL)
    env_checker.check_env(env.unwrapped, skip_render_check=True)
    assert env.observation_space["screen"].shape == (12, 16, 3)


def test_a_batch_has_no_second_time_limit() -> None:
    id = clients.name_of("HealthGathering", "each", ours=True)
    with pytest.raises(SettingError, match="these ids take episode_timeout, in tics"):
        gymnasium.make_vec(id, 2, max_episode_steps=3, **SMALL)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_a_batch_is_gymnasiums_batch_of_single_ones(mode: str) -> None:
    """Through two ends of episodes: observations, rewards, ends, and the last observations."""
    id, count = clients.name_of("HealthGathering", "each", ours=True), 3
    settings = SMALL | {"episode_timeout": 8}
    ours = gymnasium.make_vec(id, count, autoreset_mode=mode, **settings)
    theirs = gymnasium.vector.SyncVectorEnv(
        [lambda: gymnasium.make(id, **settings)] * count, autoreset_mode=mode
    )
    assert ours.action_space == theirs.action_space
    assert ours.observation_space == theirs.observation_space
    seen = [envs.reset(seed=3)[0] for envs in (ours, theirs)]
    rng, ends = np.random.default_rng(0), 0
    for _ in range(6):
        same(*seen)
        action = rng.integers(0, 2, (count, 3), np.int8)
        (mine, *told, info), (other, *expected, last) = (e.step(action) for e in (ours, theirs))
        for value, wanted in zip(told, expected, strict=True):
            assert value.dtype == wanted.dtype
            np.testing.assert_array_equal(value, wanted)
        ends += int(told[1].all())
        assert (
            ("final_obs" in info) == ("final_obs" in last) == (told[1].all() and mode == "SameStep")
        )
        for one, two in zip(info.get("final_obs", ()), last.get("final_obs", ()), strict=True):
            same(one, two)
            assert not any(part.any() for part in one.values())
        seen = [mine, other]
    assert ends == (2 if mode == "NextStep" else 3)


def same(ours: Any, theirs: Any) -> None:
    assert set(ours) == set(theirs)
    for name, part in ours.items():
        assert (part.shape, part.dtype) == (theirs[name].shape, theirs[name].dtype)
        np.testing.assert_array_equal(part, theirs[name])


def test_settings_of_the_game() -> None:
    env = made("TakeCover", **PLAIN).unwrapped
    assert int(env.params.max_steps_in_episode) == 2**31 - 1
    limited = env.params.replace(max_steps_in_episode=100)
    kept = vizdoom_ids.made(limited, "TakeCover", max_buttons_pressed=1, **PLAIN)[1]
    assert int(kept.max_steps_in_episode) == 100
    with pytest.raises(SettingError, match="screen_resolution and another setting both set height"):
        made("TakeCover", height=8, screen_resolution="RES_160X120", **PLAIN)
    settings = {"episode_timeout": 50, "living_reward": 2, "mode": "PLAYER", "render_hud": False}
    env = made("TakeCover", screen_resolution="RES_160X120", **settings, **PLAIN).unwrapped
    assert (env.env.height, env.env.width) == (120, 160)
    assert (int(env.params.max_steps_in_episode), float(env.params.living_reward)) == (50, 2.0)
    shown = [made("Basic", render_weapon=shown, **PLAIN).unwrapped.env for shown in (False, True)]
    assert [env.show_weapon for env in shown] == [False, True]
    assert shown[1] == made("Basic", **PLAIN).unwrapped.env


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            {"depth_buffer_enabled": True},
            "only be False here, not True; jaxenstein/doom-basic-v0 w",
        ),
        ({"labels_buffer_enabled": True}, "jaxenstein/doom-basic-v0 with observation='labels'"),
        ({"audio_buffer_enabled": True}, "audio_buffer_enabled can only be False here, not True$"),
        ({"automap_buffer_enabled": True}, "automap_buffer_enabled can only be False"),
        ({"screen_format": "GRAY8"}, "only be 'RGB24' here, not 'GRAY8'; .*GrayscaleObservation"),
        ({"mode": "ASYNC_PLAYER"}, "mode can only be 'PLAYER' here, not 'ASYNC_PLAYER'"),
        ({"kill_reward": 5}, "kill_reward can only be 0 here"),
        ({"screen_resolution": "RES_640X360"}, "4 to 3, such as RES_160X120, not 'RES_640X360'"),
        ({"screen_resolution": 7}, "4 to 3, such as RES_160X120, not 7"),
        ({"doom_skill": 3}, "doom-basic has no setting or param 'doom_skill'"),
        ({"doom_scenario_path": "my.wad"}, "has no setting or param 'doom_scenario_path'"),
        ({"observation": "labels"}, "observation is that of .*; make jaxenstein/doom-basic-v0"),
        ({"max_buttons_pressed": -1}, "max_buttons_pressed must be"),
        ({"frame_skip": 0}, "frame_skip must be"),
    ],
)
def test_what_the_game_has_and_these_have_not(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(SettingError, match=message):
        made("Basic", **(PLAIN | settings))


def test_more_buttons_than_there_are() -> None:
    with pytest.warns(UserWarning, match="max_buttons_pressed=9 is more than the 3 buttons"):
        env = made("Basic", max_buttons_pressed=9, **PLAIN)
    assert env.action_space.n == 8


@pytest.mark.parametrize(
    ("scenario", "action", "message"),
    [
        ("Basic", np.array([[0, 1]]), "3 numbers, each 0 or 1"),
        ("Basic", np.array([[0, 1, 2]]), "3 numbers, each 0 or 1"),
        ("Basic", np.array([[0.0, 1.0, 1.0]]), "3 numbers, each 0 or 1"),
        ("Deathmatch", np.zeros((1, 17), int), "a dict of 'binary' and 'continuous'"),
        (
            "Deathmatch",
            {"binary": np.zeros((1, 17), int), "continuous": np.ones((1, 3))},
            "the 3 numbers of 'continuous' must be 0",
        ),
    ],
)
def test_wrong_actions(scenario: str, action: Any, message: str) -> None:
    with pytest.raises(gymnasium.error.InvalidAction, match=message):
        made(scenario, "each", **PLAIN).unwrapped._interface.actions(action, 1)


@pytest.mark.parametrize("scenario", RECORDED)
def test_without_the_games_pictures(scenario: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The error says how to get them."""

    def missing() -> Any:
        raise vizdoom_buffers.MissingViZDoomError("No: pip install 'jaxenstein[vizdoom]'")

    monkeypatch.setattr(vizdoom_buffers, "load_vizdoom", missing)
    with pytest.raises(ImportError, match=r"jaxenstein\[vizdoom\].*look='plain'"):
        made(scenario)


def test_the_page_lists_the_ids() -> None:
    page = (Path(__file__).parents[2] / "docs" / "from-vizdoom.md").read_text("utf-8")
    sentence = page[page.index("The ids are `jaxenstein/Vizdoom`") : page.index("then `-v1`.")]
    assert re.findall(r"`(\w+)`", sentence) == sorted(RECORDED)
    assert sorted(VIZDOOM_SCENARIOS) == sorted(RECORDED)


needs_vizdoom = pytest.mark.skipif(not INSTALLED, reason="ViZDoom is not installed")


@needs_vizdoom
@pytest.mark.parametrize("scenario", RECORDED)
def test_the_record_is_of_this_version(scenario: str) -> None:
    importlib.import_module("vizdoom.gymnasium_wrapper")
    assert clients.facts(scenario) == RECORDED[scenario]


@needs_vizdoom
@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenario", "steps", "alike"),
    [
        ("MyWayHome", None, 0.99),
        ("Basic", None, 0),
        # New medkits come from random numbers of the game.
        ("HealthGathering", 30, 0.95),
    ],
)
def test_the_same_client_in_the_game(scenario: str, steps: int | None, alike: float) -> None:
    """Only the game itself shows that rewards, ends and variables are its own, step by step."""
    importlib.import_module("vizdoom.gymnasium_wrapper")
    jax.clear_caches()
    with mock.patch("jaxenstein.tasks.first_person.render", render):
        agreement = clients.compare(scenario, episodes=20)
    jax.clear_caches()
    assert np.mean(agreement.first) >= alike
    if steps is None:
        assert agreement.whole == 20
        assert agreement.early >= 8
        assert np.mean(agreement.later) >= alike
    else:
        assert agreement.steps >= steps * 20
