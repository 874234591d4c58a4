"""Playing by hand with a simulated clock, without a window."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

import jaxenstein
from jaxenstein.episodes.session import Session
from jaxenstein.interactive.controls import ACTION_KEYS, keys_of
from jaxenstein.interactive.display import Display, Event, Rectangle
from jaxenstein.interactive.game import Game, draw, play, wait_for
from jaxenstein.registry import ENTRIES
from jaxenstein.tasks.steering import BACKWARD, FORWARD, INTERACT, TURN_LEFT, TURN_RIGHT
from jaxenstein.view.topdown import AGENT, PATH

pytestmark = pytest.mark.usefixtures("plain_frames")

SMALL = {"height": 12, "width": 16}
# From the start of key-door over the key to the door, through it and to the goal.
TO_THE_DOOR, TO_THE_GOAL = "w" * 22, "w" * 30


@pytest.fixture(scope="module")
def world() -> tuple[Any, Any]:
    return jaxenstein.make("key-door", **SMALL)


@pytest.fixture
def game(world: tuple[Any, Any]) -> Game:
    return Game(*world, seed=5, keep=True)


def test_the_instruction_is_shown_from_the_first_frame() -> None:
    env: Any
    env, params = jaxenstein.make("minigrid-go-to-door-5x5", **SMALL)
    game = Game(env, params, seed=0)
    asked = game.env.instruction(game.session.state)
    assert asked
    assert game.status()[1] == asked


TIMES = itertools.count()


def tap(game: Game, *keys: str) -> None:
    """Press keys so slowly that each of them acts."""
    for key in keys:
        now = float(next(TIMES))
        game.handle(Event("press", key), now)
        game.handle(Event("release", key), now)
        game.advance(now)


def test_keys_act_and_the_game_shows_the_observation(game: Game, world: tuple[Any, Any]) -> None:
    keys = ("w", "up", "a", "left", "d", "right", "s", "down", "space", "x")
    actions = (FORWARD, FORWARD, TURN_LEFT, TURN_LEFT, TURN_RIGHT, TURN_RIGHT, BACKWARD, BACKWARD)
    reference = Session(*world, 5)
    np.testing.assert_array_equal(game.frame, reference.observation)
    for key, action in zip(keys, (*actions, INTERACT), strict=False):
        tap(game, key)
        np.testing.assert_array_equal(game.frame, reference.step(action))
    tap(game, keys[-1])
    assert game.session.actions == [*actions, INTERACT]


def test_keys_are_shown_only_if_the_task_has_keys() -> None:
    env, params = jaxenstein.from_ascii("#####\n#S.G#\n#####", heading=0, **SMALL)
    assert "keys" not in Game(env, params).status()[0]


def test_game_runs_from_key_to_goal(game: Game) -> None:
    assert "keys: none" in game.status()[0]
    tap(game, *TO_THE_DOOR)
    assert "keys: red" in game.status()[0]
    assert game.overlay() == []
    tap(game, "space")
    assert game.status()[1] == "opened a door"
    tap(game, *TO_THE_GOAL)
    steps = len(game.session.actions)
    assert game.session.over
    assert game.overlay()[:2] == ["reached the goal", f"return +1 after {steps} steps"]
    assert "seed 6" in game.overlay()[2]
    assert "reward +1   return +1" in game.status()[0]
    # Nothing is played after the end, and held keys do not carry over to the next episode.
    game.handle(Event("press", "w"), float(next(TIMES)))
    assert game.due(float(next(TIMES))) is None
    finished = game.session
    tap(game, "r")
    assert game.session.seed == 6
    assert game.session.actions == []
    assert game.due(float(next(TIMES))) is None
    assert game.status()[0].startswith("seed 6   step 0/300   reward 0   return 0")
    assert game.last_played is finished
    tap(game, "w")
    assert game.last_played is game.session


def test_all_episodes_are_kept(game: Game, world: tuple[Any, Any]) -> None:
    tap(game, "w", "d", "r", "r", "w", "w", "w")
    episodes = game.episodes()
    # Seed 6 was passed over.
    assert [episode.steps for episode in episodes] == [2, 3]
    for episode, seed, actions in zip(
        episodes, (5, 7), ((FORWARD, TURN_RIGHT), (FORWARD,) * 3), strict=True
    ):
        reference = Session(*world, seed)
        np.testing.assert_array_equal(episode.frames[0], reference.observation)
        for action, frame in zip(actions, episode.frames[1:], strict=True):
            np.testing.assert_array_equal(frame, reference.step(action))
        assert episode.tilemap == world[0].tilemap
        assert episode.name == "key-door"


def test_pausing_and_help_stop_the_game(game: Game) -> None:
    tap(game, "p", "w")
    assert game.overlay()[0] == "paused"
    assert game.session.actions == []
    tap(game, "p", "w", "h", "w", "space")
    assert len(game.session.actions) == 1
    text = "\n".join(game.overlay())
    for line in ("W, up: forward", "space: interact", "R: next episode", "Q, Esc: quit"):
        assert line in text
    tap(game, "h", "w")
    assert len(game.session.actions) == 2
    assert game.overlay() == []


def test_held_keys_are_released_by_a_pause(game: Game) -> None:
    for pausing in "ph":
        now = float(next(TIMES))
        game.handle(Event("press", "w"), now)
        assert game.due(now) == 0.0
        game.handle(Event("press", pausing), now)
        assert game.due(now) is None
        game.handle(Event("press", pausing), now)
        assert game.due(now) is None


@pytest.mark.parametrize("event", [Event("press", "q"), Event("press", "escape"), Event("close")])
def test_quitting(game: Game, event: Event) -> None:
    game.handle(event, 0.0)
    assert game.over


def test_time_limit_ends_the_game(world: tuple[Any, Any]) -> None:
    env, params = world
    game = Game(env, params.replace(max_steps_in_episode=2), note="a note")
    assert game.status()[1] == "H: help   a note"
    tap(game, "w", "w", "w")
    assert len(game.session.actions) == 2
    assert game.overlay()[0] == "time is up"
    assert "step 2/2" in game.status()[0]
    assert game.episodes() == []


def test_seeds_wrap_around(world: tuple[Any, Any]) -> None:
    game = Game(*world, seed=2**32 - 1)
    tap(game, "r")
    assert game.session.seed == 0


def test_health_is_shown_and_no_keys_are() -> None:
    made: tuple[Any, Any] = jaxenstein.make("health-gathering", sprite_layers=1, **SMALL)
    game = Game(*made)
    reference = Session(game.env, game.params, 0)
    assert f"health {float(reference.info['health']):g}" in game.status()[0]
    assert "keys" not in game.status()[0]
    tap(game, "s", "down", "space")
    assert game.session.actions == []
    assert "backward" not in "\n".join(game.help())
    for _ in range(8):
        tap(game, "w")
        reference.step(FORWARD)
    assert f"health {float(reference.info['health']):g}" in game.status()[0]


@pytest.mark.parametrize("room", [Rectangle(0, 0, 230, 90), Rectangle(0, 0, 115, 400)])
def test_the_map_shows_agent_and_path(game: Game, room: Rectangle) -> None:
    tap(game, *"wwwwwwwwww")
    image = game.map_image(room)
    scale = min(room.width // 11, room.height // 3)
    assert image.shape == (3 * scale, 11 * scale, 3)

    def at(x: float, y: float) -> tuple[int, ...]:
        return tuple(image[int(y * scale), int(x * scale)].tolist())

    x, y = np.asarray(game.session.state.position)
    assert at(x, y) == AGENT
    # The path begins in its first colour; the start's ring lies around its first point.
    assert np.abs(np.subtract(at(1.9, y), PATH[0])).max() < 12
    tap(game, "r")
    image = game.map_image(room)
    assert at(1.5, 1.5) == AGENT
    assert at(x + 0.4, y) != AGENT
    assert np.abs(np.subtract(at(x, y), PATH[0])).max() > 12
    # In a display of characters it is drawn larger than it is shown.
    assert game.map_image(room, 3).shape == (9 * scale, 33 * scale, 3)
    assert game.map_image(Rectangle(0, 0, 1, 1)).shape == (3, 11, 3)


@pytest.mark.parametrize("kind", ["depth", "dict"])
def test_other_observation_kinds_are_shown_as_images(kind: str) -> None:
    env, params = jaxenstein.from_ascii("#####\n#S.G#\n#####", observation=kind, **SMALL)
    game = Game(env, params, keep=True)
    tap(game, "w")
    assert game.frame.dtype == np.uint8
    assert game.frame.shape == (12, 16, 3)
    np.testing.assert_array_equal(game.episodes()[0].frames[1], game.frame)


@pytest.mark.parametrize("id", ENTRIES)
def test_every_action_of_every_environment_has_a_key(id: str) -> None:
    env, _ = jaxenstein.make(id)
    keys = keys_of(env.action_names)
    assert tuple(keys) == env.action_names
    assert all(keys.values())
    # No action falls back to the keys for unknown actions.
    unforeseen = keys.keys() - ACTION_KEYS.keys()
    assert not any(key.isdigit() for name in unforeseen for key in keys[name])


class Script(Display):
    """A display that plays a list of keys, one whenever the game is idle."""

    finer, gap = 1, 0

    def __init__(self, keys: Sequence[str] = ()) -> None:
        self.keys = list(keys)
        self.shown: list[tuple[Any, ...]] = []
        self.room: list[bool] = []
        self.meanwhile: Callable[[], object] = lambda: None

    def show(
        self,
        frame: np.ndarray | None,
        lines: Sequence[str] = (),
        *,
        beside: np.ndarray | None = None,
        overlay: Sequence[str] = (),
    ) -> None:
        self.shown.append((frame, list(lines), beside, list(overlay)))

    def close(self) -> None:
        self.keys.clear()

    def area(self, lines: int) -> Rectangle:
        raise NotImplementedError

    def beside_area(self, lines: int) -> Rectangle:
        assert lines == 2
        return Rectangle(0, 0, 110, 60)

    def make_room(self, beside: bool) -> None:
        self.room.append(beside)

    def events(self, timeout: float = 0.0) -> list[Event]:
        assert timeout >= 0
        if timeout < 0.5:
            self.meanwhile()
            return []
        key = self.keys.pop(0)
        return [Event("press", key), Event("release", key)]


def test_game_is_played_and_shown(world: tuple[Any, Any]) -> None:
    game = Game(*world, fps=60)
    display = Script(["w", "m", "d", "m", "x", "q"])
    play(display, game)
    assert game.session.actions == [FORWARD, TURN_RIGHT]
    assert display.room == [True, False]
    reference = Session(*world)
    first, second = reference.observation, reference.step(FORWARD)
    third = reference.step(TURN_RIGHT)
    frames = [frame for frame, *_ in display.shown]
    # A key without a meaning draws nothing.
    for frame, wanted in zip(frames, (first, second, second, third, third, third), strict=True):
        np.testing.assert_array_equal(frame, wanted)
    assert [beside is not None for _, _, beside, _ in display.shown] == [
        *(False, False, True, True, False, False)
    ]
    display.keys = []
    draw(display, game)
    assert display.shown[-1][1] == game.status()


def test_a_notice_is_shown_while_compiling() -> None:
    done = threading.Event()
    display = Script()
    display.meanwhile = lambda: done.set() if len(display.shown) >= 3 else None
    found = object()

    def load() -> Any:
        assert done.wait(20)
        return found

    assert wait_for(display, load) is found
    assert len(display.shown) >= 3
    for frame, _, _, overlay in display.shown:
        assert frame is None
        assert overlay[0].startswith("compiling")


def test_quitting_while_compiling() -> None:
    done = threading.Event()
    for event in (Event("close"), Event("press", "q"), Event("press", "escape")):
        display = Script()
        display.events = lambda timeout=0.0, event=event: [event]  # type: ignore[method-assign]
        assert wait_for(display, lambda: done.wait(20) and None) is None  # type: ignore[arg-type]
    done.set()


def test_errors_while_compiling_are_shown() -> None:
    def load() -> Game:
        raise RuntimeError("out of memory")

    with pytest.raises(RuntimeError, match="out of memory"):
        wait_for(Script(), load)
