"""`jaxenstein play`, in a window under SDL's dummy driver and in a pseudo terminal."""

from __future__ import annotations

import functools
import itertools
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import jaxenstein
from jaxenstein.cli import main
from jaxenstein.episodes.session import Session
from jaxenstein.interactive import terminal as terminal_module
from jaxenstein.interactive import window as window_module
from jaxenstein.interactive.display import Rectangle
from jaxenstein.tasks.steering import FORWARD, INTERACT, TURN_RIGHT
from tests.reference.emulator import Emulator

pytestmark = pytest.mark.usefixtures("plain_frames")

SMALL = {"height": 12, "width": 16}
SIZE = ("--height", "12", "--width", "16")
# Over the key to the door, through it and to the goal.
TO_THE_GOAL = ["w"] * 22 + ["space"] + ["w"] * 29
FINISHED = [FORWARD] * 22 + [INTERACT] + [FORWARD] * 29


PlayInWindow = Callable[..., list[dict[str, Any]]]


class Player(window_module.Window):
    """A window in which a list of keys is pressed, each after the previous one has been shown.

    Instead of the name of a key there may be a function to call.
    """

    keys: Sequence[str | Callable[[], object]] = ()
    looks: list[dict[str, Any]]

    def __init__(self, title: str, size: tuple[int, int]) -> None:
        super().__init__(title, size)
        self.todo = list(self.keys)
        type(self).looks = []

    def show(self, frame: np.ndarray | None, lines: Sequence[str] = (), **more: Any) -> None:
        super().show(frame, lines, **more)
        look = {"frame": frame, "lines": list(lines), "overlay": [], "beside": None, **more}
        look |= {"view_box": self.view, "beside_box": self.beside, "pixels": self.pixels()}
        self.looks.append(look)

    def events(self, timeout: float = 0.0) -> list[Any]:
        if timeout >= 0.5:
            key = self.todo.pop(0)
            if callable(key):
                key()
            else:
                for kind in (self._pygame.KEYDOWN, self._pygame.KEYUP):
                    code = self._pygame.key.key_code(key)
                    self._pygame.event.post(self._pygame.event.Event(kind, key=code))
        return super().events(min(timeout, 0.01))


@pytest.fixture
def play_in_window(monkeypatch: pytest.MonkeyPatch) -> PlayInWindow:
    """Plays key-door with some keys; returns all that the window showed."""
    pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setattr(window_module, "Window", Player)

    def run(keys: Sequence[Any], *arguments: str, code: int = 0) -> list[dict[str, Any]]:
        monkeypatch.setattr(Player, "keys", keys)
        assert main(["play", "key-door", "--fps", "60", *SIZE, *arguments]) == code
        return Player.looks

    return run


def cut(look: dict[str, Any], box: Rectangle) -> np.ndarray:
    return look["pixels"][box.top : box.top + box.height, box.left : box.left + box.width]


def reference(actions: Sequence[int], seed: int = 0) -> list[np.ndarray]:
    """The observations of an agent that takes these actions."""
    env, params = jaxenstein.make("key-door", **SMALL)
    session = Session(env, params, seed)
    return [np.asarray(session.observation), *(np.asarray(session.step(a)) for a in actions)]


def test_game_runs_from_notice_to_goal(
    play_in_window: PlayInWindow, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    gif, file = tmp_path / "game.gif", tmp_path / "game.json"
    looks = play_in_window(
        ["m", *TO_THE_GOAL, "m", "w", "q"], "--record", str(gif), "--save", str(file)
    )
    notices = [look for look in looks if look["frame"] is None]
    assert notices
    assert notices[0]["overlay"] == ["compiling ... 0 s"]
    assert len(np.unique(notices[0]["pixels"].reshape(-1, 3), axis=0)) > 2
    first, mapped, *moves = (look for look in looks if look["frame"] is not None)
    frames = reference(FINISHED)
    for look, frame in zip((first, mapped, *moves), (frames[0], *frames), strict=False):
        scale = look["view_box"].width // 16
        assert scale >= 20
        wanted = np.kron(frame, np.ones((scale, scale, 1), np.uint8))
        if not look["overlay"]:
            np.testing.assert_array_equal(cut(look, look["view_box"]), wanted)
    # The map is beside the view from one M to the next, and changes with each move.
    assert first["beside_box"] is None
    maps = [cut(look, look["beside_box"]) for look in (mapped, *moves[: len(FINISHED)])]
    for before, after in itertools.pairwise(maps):
        assert (before != after).any()
    assert moves[-1]["beside_box"] is None
    over = moves[len(FINISHED) - 1]
    assert over["overlay"][:2] == ["reached the goal", f"return +1 after {len(FINISHED)} steps"]
    assert "keys: red" in over["lines"][0]
    # Nothing was played after the end.
    with Image.open(gif) as image:
        assert image.n_frames == len(FINISHED) + 1  # type: ignore[attr-defined]
    saved = json.loads(file.read_text())
    assert [a for a, count in saved["actions"] for _ in range(count)] == FINISHED
    said = capsys.readouterr().out
    assert f"key-door: seed 0, {len(FINISHED)} steps, return 1" in said
    assert str(gif) in said
    assert str(file) in said
    assert main(["replay", str(file)]) == 0


def test_files_are_written_however_the_game_ends(
    play_in_window: PlayInWindow, tmp_path: Path
) -> None:
    def close() -> None:
        pygame = pytest.importorskip("pygame")
        pygame.event.post(pygame.event.Event(pygame.QUIT))

    def interrupt() -> None:
        raise KeyboardInterrupt

    def fail() -> None:
        raise RuntimeError("the graphics card is on fire")

    for i, (end, code) in enumerate(((close, 0), (interrupt, 130), (fail, 1))):
        gif = tmp_path / f"{i}.gif"
        # Three episodes: of two steps, of none, and of one.
        play_in_window(["w", "d", "r", "r", "d", end], "--record", str(gif), code=code)
        with Image.open(gif) as image:
            assert image.n_frames == 5  # type: ignore[attr-defined]


@pytest.mark.skipif(sys.platform == "win32", reason="has no such signals")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_signals_end_the_game_cleanly(
    play_in_window: PlayInWindow, tmp_path: Path, number: int
) -> None:
    file = tmp_path / "game.json"
    # `nohup` ignores SIGHUP, and `play` leaves ignored signals alone.
    before = signal.signal(number, signal.SIG_DFL)
    try:
        with pytest.raises(SystemExit) as ending:
            play_in_window(["w", lambda: os.kill(os.getpid(), number)], "--save", str(file))
        assert signal.getsignal(number) == signal.SIG_DFL
    finally:
        signal.signal(number, before)
    assert ending.value.code == 128 + number
    assert json.loads(file.read_text())["actions"] == [[FORWARD, 1]]


def test_no_file_is_written_without_a_step(
    play_in_window: PlayInWindow, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    play_in_window(["m", "q"], "--record", str(tmp_path / "a.gif"))
    assert "nothing was played" in capsys.readouterr().out
    assert list(tmp_path.iterdir()) == []


def test_help_says_what_agents_see(play_in_window: PlayInWindow) -> None:
    looks = play_in_window(["h", "q"])
    assert "16x12 pixels; the default for agents is 64x64 (--native)" in looks[-1]["overlay"]


def test_non_terminal_input_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(terminal_module.os, "isatty", lambda descriptor: False)
    assert main(["play", "simple", "--terminal"]) == 2
    assert "standard input is not a terminal" in capsys.readouterr().err


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is always a display")
def test_error_without_display_suggests_the_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("pygame")
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    assert main(["play", "simple"]) == 2
    assert "--terminal plays in the terminal" in capsys.readouterr().err


def test_error_without_pygame_names_the_extra(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    assert main(["play", "simple"]) == 2
    said = capsys.readouterr().err
    assert "pip install 'jaxenstein[play]'" in said
    assert "--terminal" in said


def test_one_failing_file_does_not_lose_the_other(
    play_in_window: PlayInWindow, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, gif = tmp_path / "folder", tmp_path / "a.gif"
    folder.mkdir()
    save = "--save", str(folder / "a.json")
    play_in_window(["w", folder.rmdir, "q"], "--record", str(gif), *save, code=1)
    assert "there is no folder" in capsys.readouterr().err
    assert gif.exists()


@pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX terminals")
@pytest.mark.slow
def test_closed_terminal_does_not_lose_the_files(tmp_path: Path) -> None:
    emulator = Emulator(16, 8)
    file, gif = tmp_path / "game.json", tmp_path / "game.gif"
    arguments = ["play", "key-door", "--terminal", "--save", str(file), "--record", str(gif)]
    command = [sys.executable, "-m", "jaxenstein", *arguments]
    tty = emulator.slave
    process = subprocess.Popen(command, start_new_session=True, stdin=tty, stdout=tty, stderr=tty)
    end = time.monotonic() + 120
    while "step 1/" not in emulator.line(6) and time.monotonic() < end:
        emulator.send(b"w")
        time.sleep(0.5)
    emulator.close()
    process.wait(120)
    assert json.loads(file.read_text())["seed"] == 0
    assert gif.exists()


@pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX terminals")
def test_game_in_the_terminal(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    # Just as wide as 16 pixels of the shape 4:3, and as high as 12 with two lines of text.
    emulator = Emulator(16, 8)
    here = functools.partial(terminal_module.Terminal, emulator.slave, emulator.slave)
    monkeypatch.setattr("jaxenstein.cli.play.Terminal", here)
    frames = reference([FORWARD, FORWARD, TURN_RIGHT])
    seen = []

    def see(index: int) -> None:
        """Wait for a frame, and remember whether it came."""
        end = time.monotonic() + 60
        while time.monotonic() < end:
            emulator.settle()
            if np.array_equal(emulator.picture()[:12], frames[index]):
                seen.append(index)
                return

    def person() -> None:
        see(0)
        for index, key in enumerate((b"w", b"\x1b[A", b"\x1bOC"), 1):
            emulator.send(key)
            see(index)
        emulator.send(b"q")

    thread = threading.Thread(target=person)
    thread.start()
    file = tmp_path / "game.json"
    assert main(["play", "key-door", "--terminal", "--save", str(file)]) == 0
    thread.join()
    assert seen == [0, 1, 2, 3]
    assert json.loads(file.read_text())["actions"] == [[FORWARD, 2], [TURN_RIGHT, 1]]
    emulator.settle()
    assert emulator.modes == {"?1049": False, "?25": True, "?7": True, "?2026": False}
    emulator.close()
