"""The adapter to ViZDoom: on a game that is our own environment behind ViZDoom's interface.

Where ViZDoom is installed (`make partners`), the last tests run in the game itself.
"""

from __future__ import annotations

import dataclasses
import importlib.util
import itertools
import math
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import jax
import numpy as np
import pytest

import jaxenstein
from fidelity import doom_palette
from jaxenstein.adapters import vizdoom_buffers
from jaxenstein.cli import main
from jaxenstein.engine.render import render
from jaxenstein.episodes.policies import Script
from jaxenstein.errors import SettingError
from jaxenstein.maps.symbols import CEILING, FLOOR
from jaxenstein.params import Range
from jaxenstein.tasks.doom.fixed import ONE

pytest.importorskip("gymnasium")

from jaxenstein.adapters import vizdoom

pytestmark = pytest.mark.usefixtures("plain_frames")
SETTINGS: dict[str, Any] = {"observation": "depth", "height": 1, "width": 32, "frame_skip": 4}
INSTALLED = importlib.util.find_spec("vizdoom") is not None


class Game:
    """`vizdoom.DoomGame` as far as the adapter uses it, played by our own rules."""

    def __init__(self, env: Any, params: Any) -> None:
        plain = {name: False for name in ("hud", "show_weapon") if hasattr(env, name)}
        self.env = dataclasses.replace(env, frame_skip=1, height=120, width=160, **plain)
        self.params = self.env.check_params(params)
        self.settings: dict[str, Any] = {}
        self.draw = jax.jit(self.env.observe)
        self.begin = jax.jit(self.env.first_state)

    def __getattr__(self, name: str) -> Any:
        assert name.startswith("set_") or name in ("load_config", "init", "close"), name
        return lambda *value: self.settings.setdefault(name, value)

    def new_episode(self) -> None:
        (seed,) = self.settings.pop("set_seed")
        self.state = self.begin(jax.random.key(seed), self.params)
        self.finished = self.timeout = False
        self.kills = 0

    def make_action(self, buttons: list[int], tics: int) -> float:
        held = sum(down << i for i, down in enumerate(buttons))
        action = self.env.action_buttons.tolist().index(held)
        total = 0.0
        for _ in range(tics):
            self.state, reward, ended, info = self.env.advance(
                jax.random.key(0), self.state, np.int32(action), self.params
            )
            late = self.env.time_is_up(self.state, self.params)
            total += float(reward)
            self.kills += int(info.get("kills", 0))
            if ended or late:
                self.finished, self.timeout = True, bool(late)
                break
        return total

    def is_episode_finished(self) -> bool:
        return self.finished

    def is_episode_timeout_reached(self) -> bool:
        return self.timeout

    def is_player_dead(self) -> bool:
        return int(getattr(self.state, "health", 1)) <= 0

    def get_game_variable(self, name: str) -> float:
        assert name == "KILLCOUNT"
        return float(self.kills)

    def ammo(self) -> list[float]:
        count = len(self.env.game_variables)
        return [float(self.state.trigger.ammo)] * count if count else []

    def get_state(self) -> Any:
        drawn = np.asarray(self.draw(self.state, self.params))
        depth = drawn * self.env.unit
        step = vizdoom_buffers.DEPTH_STEP
        values = np.clip(np.floor((depth - 120 * vizdoom_buffers.DEPTH_START) / step), 0, 255)
        place = np.asarray(self.state.fixed_position) / ONE
        speed = np.asarray(self.state.fixed_velocity) / ONE
        angle = int(self.state.angle) / (2**32 - 1) * 360
        return SimpleNamespace(
            depth_buffer=values.astype(np.uint8),
            screen_buffer=drawn if drawn.ndim == 3 else np.zeros((120, 160, 3), np.uint8),
            game_variables=[*place, angle, *speed, 100.0, *self.ammo()],
            labels=[],
            objects=[],
        )


@pytest.fixture(scope="module")
def world() -> Any:
    env, params = jaxenstein.make("doom-my-way-home", **SETTINGS)
    return env, params.replace(max_steps_in_episode=90)


@pytest.fixture
def game(world: Any, monkeypatch: pytest.MonkeyPatch) -> Game:
    return installed(world, monkeypatch)


def installed(world: Any, monkeypatch: pytest.MonkeyPatch) -> Game:
    """Our environment in the place of the game."""
    game = Game(*world)
    names = ("ScreenResolution", "GameVariable", "ScreenFormat")
    anything = type("Names", (), {"__getattr__": lambda self, name: name})()
    module = SimpleNamespace(
        DoomGame=lambda: game, scenarios_path="", **dict.fromkeys(names, anything)
    )
    monkeypatch.setattr(vizdoom_buffers, "load_vizdoom", lambda: module)
    monkeypatch.setattr(vizdoom, "load_vizdoom", lambda: module)
    return game


def test_missed_shot_is_no_success(monkeypatch: pytest.MonkeyPatch) -> None:
    """The game ends then as early as after a hit."""
    env, params = jaxenstein.make("doom-predict-position", **SETTINGS)
    installed((env, params), monkeypatch)
    attack = env.action_names.index("attack")
    with vizdoom.GameSession(env, params, 1) as session:
        while not session.over:
            session.step(attack if len(session.actions) == 2 else 0)
        assert session.terminated
        assert session.episode_return < 0
        assert session.info == {"success": False}


@pytest.mark.parametrize("kind", [pytest.param("gray", marks=pytest.mark.slow), "dict"])
def test_hud_shows_health_and_ammunition(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    env, params = jaxenstein.make(
        "doom-basic", observation=kind, height=40, width=60, hud=True, show_weapon=True
    )
    game = installed((env, params), monkeypatch)
    game.env = dataclasses.replace(game.env, observation="rgb")
    game.draw = jax.jit(game.env.observe)
    attack = env.action_names.index("attack")
    with vizdoom.GameSession(env, params, 1) as session:
        assert game.settings["set_render_weapon"] == (True,)
        for _ in range(5):
            session.step(attack)
        seen, ours = session.observation, env.observe(session.state, session.params)
        if kind == "dict":
            assert (float(seen["health"][0]), float(seen["ammo"][0])) == (100, 49)
            seen, ours = seen["image"], ours["image"]
        # A strip of four rows; at its right, within a rim, 28 columns are 50 bullets.
        row = seen[38, 31:59].reshape(28, -1)
        assert np.all(row == row[:1], axis=1).tolist() == [True] * 27 + [False]
        np.testing.assert_array_equal(seen[36:], np.asarray(ours)[36:])
        view = vizdoom_buffers.colour_image(session.screen, (36, 60))
        view = vizdoom_buffers.grey(view) if kind == "gray" else view
        np.testing.assert_array_equal(seen[:36], view)
        # The shot has hit: this seed's monster stands ahead.
        session.step(0)
        assert session.over
        assert session.info == {"success": True}


def test_actions_rewards_and_ends_mean_the_same(world: Any, game: Game) -> None:
    env, params = world
    actions = [3, 4, 3, 1, 5, 0, 2, 3, 3, 5] * 3
    with vizdoom.GameSession(env, params, seed=2) as session:
        assert game.settings["set_episode_timeout"] == (90,)
        assert game.settings["set_depth_buffer_enabled"] == (True,)
        first = session.state
        ours = jaxenstein.episodes.session.Session(env, params)
        ours.state = first
        while not session.over:
            action = actions[len(session.actions)]
            session.step(action)
            ours.step(action)
            assert session.rewards[-1] == pytest.approx(ours.rewards[-1])
            if not session.over:
                for name in ("fixed_position", "fixed_velocity", "angle"):
                    there, here = (np.asarray(getattr(s.state, name)) for s in (session, ours))
                    np.testing.assert_array_equal(there, here)
        assert (session.truncated, session.terminated) == (True, False)
        assert len(session.actions) == 23
        assert session.info == {"success": False}
        with pytest.raises(SettingError, match="call reset before step"):
            session.step(0)


def test_ranges_and_settings_of_the_game(world: Any, game: Game) -> None:
    """The game has its own rules, so ranges that agents trained with must not stop it."""
    env, params = world
    params = params.replace(living_reward=Range(-2.0, -1.0))
    games = vizdoom.play_game(
        env, params, Script([3] * 30), prepare=lambda played: played.set_doom_skill(1), episodes=1
    )
    np.testing.assert_allclose(games.returns, -0.009, rtol=1e-5)
    assert game.settings["set_doom_skill"] == (1,)


def test_several_episodes_and_gymnasium_env(world: Any, game: Game) -> None:
    env, params = world
    games = vizdoom.play_game(env, params, Script([3] * 30), episodes=2)
    np.testing.assert_array_equal(games.lengths, [23, 23])
    np.testing.assert_allclose(games.returns, -0.009, rtol=1e-5)
    assert not games.successes.any()
    gym = vizdoom.GameEnv(env, params)
    observation, _ = gym.reset(seed=1)
    again, _ = gym.reset(seed=1)
    np.testing.assert_array_equal(observation, again)
    assert gym.observation_space.contains(observation)
    observation, _, terminated, truncated, info = gym.step(gym.action_space.sample())
    assert gym.observation_space.contains(observation)
    assert (terminated, truncated, info) == (False, False, {"success": False})
    gym.close()


def test_labels_of_a_buffer() -> None:
    buffer = np.zeros((120, 160), np.uint8)
    buffer[:30] = buffer[90:] = 1
    buffer[60:70, 80:] = 200
    image = vizdoom_buffers.label_image(buffer, (4, 2), {200: 113}, np.array([7, 8], np.uint8))
    assert image.tolist() == [[CEILING, CEILING], [7, 8], [7, 8], [FLOOR, FLOOR]]
    image = vizdoom_buffers.label_image(buffer, (12, 2), {200: 113}, np.array([7, 8], np.uint8))
    assert image[6].tolist() == [7, 113]


def test_pixels_are_sampled_at_their_lower_right_corners() -> None:
    """The far wall of Take Cover: 63 units above the eye, 544 away, and a focal length of 96."""
    row, column = np.mgrid[:120, :160]
    rows = vizdoom_buffers.sample(row, (16, 64))[:, 0]
    # Nearest to the middles at 3.75, 11.25, 18.75, 26.25 and so on is a corner at 4, 11, 19, 26.
    assert rows[:8].tolist() == [3, 10, 18, 25, 33, 40, 48, 55]
    assert vizdoom_buffers.sample(column, (1, 64))[0, :4].tolist() == [0, 3, 5, 8]
    np.testing.assert_array_equal(vizdoom_buffers.sample(row, (120, 160)), row)
    np.testing.assert_array_equal(vizdoom_buffers.sample(column, (120, 160)), column)
    # The game draws it from row 48 on, whose corner at 49 is the first below its edge at 48.88.
    top = 60 - 63 / 544 * 96
    assert np.flatnonzero(np.arange(120) + 1 > top)[0] == 48


@pytest.mark.parametrize("samples", [1, 2])
def test_picked_pixels_are_at_the_centres(samples: int) -> None:
    rng = np.random.default_rng(samples)
    screen = rng.integers(0, 256, (240, 320, 3), np.uint8)
    seen = vizdoom_buffers.picked_image(screen, (48, 64), samples).astype(int)
    for row, column in itertools.product(range(48), range(64)):
        centres = [(column + (k + 0.5) / samples) * 320 / 64 for k in range(samples)]
        own = [screen[5 * row + 2, math.floor(x)].astype(int) for x in centres]
        np.testing.assert_array_equal(seen[row, column], sum(own) // samples)


def test_unsupported_scenarios_seeds_and_sizes_are_refused(
    capsys: pytest.CaptureFixture[str],
) -> None:
    sparse, params = jaxenstein.make("doom-my-way-home-sparse", **SETTINGS)
    with pytest.raises(SettingError, match="ViZDoom has no scenario for"):
        vizdoom.GameSession(sparse, params)
    with pytest.raises(SettingError, match="a seed must be a whole number from 0"):
        vizdoom.GameSession(*jaxenstein.make("doom-my-way-home", **SETTINGS), seed=2**32)
    with pytest.raises(SettingError, match="larger than the game's largest"):
        vizdoom_buffers.screen_for(961, 100)
    assert vizdoom_buffers.screen_for(121, 100) == (320, 240)
    if not INSTALLED:
        with pytest.raises(ImportError, match=r"pip install 'jaxenstein\[vizdoom\]'"):
            vizdoom_buffers.load_vizdoom()
        # Told at once, before the run is even looked for.
        assert main(["evaluate", "nothing", "--in", "vizdoom"]) == 2
        assert "ViZDoom is not installed" in capsys.readouterr().err


@pytest.fixture
def real_frames() -> Iterator[None]:
    """Frames of the engine, for tests of their content; these tests come last and recompile."""
    jax.clear_caches()
    with mock.patch("jaxenstein.tasks.first_person.render", render):
        yield
    jax.clear_caches()


@pytest.mark.usefixtures("real_frames")
def test_depths_match_to_eight_bits(world: Any, game: Game) -> None:
    env, params = world
    with vizdoom.GameSession(env, params, seed=2) as session:
        for action in (3, 4, 3, 1, 5, 0, 2, 3):
            session.step(action)
            ours = np.asarray(env.observe(session.state, params))
            # In steps of 7.1 units; tiles have 16.
            wrong = np.abs(session.observation - ours)
            assert wrong.max() < 0.7 * vizdoom_buffers.DEPTH_STEP / 16 + 0.05


@pytest.mark.usefixtures("real_frames")
@pytest.mark.skipif(not INSTALLED, reason="ViZDoom is not installed")
@pytest.mark.parametrize(
    ("id", "kind", "alike"),
    [("doom-my-way-home", "labels", 0.97), ("doom-health-gathering-supreme", "labels", 0.95)],
)
def test_game_frames_match_our_frames(id: str, kind: str, alike: float) -> None:
    env, params = jaxenstein.make(id, observation=kind, height=30, width=40, frame_skip=4)
    with vizdoom.GameSession(env, params, 5) as session:
        for action in (3, 3, 1, 2, 3) * 6:
            session.step(action)
        ours = np.asarray(env.observe(session.state, session.params))
        assert np.mean(np.asarray(session.observation) == ours) > alike


@pytest.mark.usefixtures("real_frames")
@pytest.mark.skipif(not INSTALLED, reason="ViZDoom is not installed")
def test_game_frames_include_weapon_and_hud() -> None:
    """The weapon is in the lower middle, and the strip shows the variables."""
    pictures = {}
    for shown in (False, True):
        env, params = jaxenstein.make(
            "doom-basic", observation="rgb", height=60, width=80, hud=True, show_weapon=shown
        )
        with vizdoom.GameSession(env, params, 5) as session:
            for action in [1] * 5 + [0] * 20:
                session.step(action)
            pictures[shown] = session.observation
            assert int(session.state.trigger.ammo) == 49
            ours = np.asarray(env.observe(session.state, session.params))
            np.testing.assert_array_equal(session.observation[54:], ours[54:])
    differs = np.any(pictures[True] != pictures[False], axis=-1)
    assert differs[30:54, 30:50].sum() > 60
    assert not differs[:24].any()
    assert not differs[:, :20].any()
    assert not differs[:, 60:].any()


@pytest.mark.skipif(not INSTALLED, reason="ViZDoom is not installed")
def test_game_state_includes_all_monsters() -> None:
    env: Any
    env, params = jaxenstein.make("doom-deadly-corridor", **SETTINGS)
    with vizdoom.GameSession(env, params, 5) as session:
        ours, kinds = env.init_state(jax.random.key(0), params).monsters, env.horde.kind_of
        theirs = session.state.monsters
        for kind in range(len(env.horde.kinds)):
            places = [np.asarray(c.position)[kinds == kind].tolist() for c in (ours, theirs)]
            assert sorted(places[0]) == sorted(places[1])
        assert np.asarray(theirs.living).all()
        assert int(session.state.trigger.ammo) == 52


@pytest.mark.skipif(not INSTALLED, reason="ViZDoom is not installed")
@pytest.mark.usefixtures("real_frames")
def test_game_look_sees_the_pixels_of_the_game(tmp_path: Path) -> None:
    """Of the WAD file of the environment; agents of random looks see the same pixels."""
    other, first = tmp_path / "other.wad", []
    doom_palette.main([str(other), "--channels", "gbr"])
    for settings in ({"look": "game"}, {"look": "game", "wad": str(other)}, {"look": "random"}):
        env, params = jaxenstein.make("doom-my-way-home", height=48, width=64, **settings)
        with vizdoom.GameSession(env, params, seed=1) as session:
            first.append(session.observation)
            for _ in range(3):
                ours = np.asarray(env.observe(session.state, params))
                equal = (ours == session.observation).all(axis=-1).mean()
                assert equal > 0.99 or settings["look"] == "random"
                session.step(env.index_of("turn left"))
    np.testing.assert_array_equal(first[1], first[0][..., [1, 2, 0]])
    np.testing.assert_array_equal(first[2], first[0])
