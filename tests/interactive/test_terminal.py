"""The terminal display on a pseudo terminal, with an emulator at its other end."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest

from jaxenstein.interactive.display import DisplayError, Event, Rectangle
from jaxenstein.interactive.terminal import HALF_BLOCK, Keys, Terminal
from tests.reference.emulator import Emulator

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX terminals")

RNG = np.random.default_rng(0)
FRAME = RNG.integers(0, 256, (12, 16, 3), np.uint8)
MAP = RNG.integers(0, 256, (30, 20, 3), np.uint8)


@pytest.fixture
def emulator() -> Iterator[Emulator]:
    emulator = Emulator(40, 12)
    yield emulator
    emulator.close()


@pytest.fixture
def terminal(emulator: Emulator) -> Iterator[Terminal]:
    with Terminal(emulator.slave, emulator.slave) as terminal:
        yield terminal


def cut(picture: np.ndarray, box: Rectangle | None) -> np.ndarray:
    assert box is not None
    return picture[box.top : box.top + box.height, box.left : box.left + box.width]


def test_half_blocks_show_the_frame(emulator: Emulator, terminal: Terminal) -> None:
    terminal.show(FRAME, ["step 1", "help"])
    emulator.settle()
    np.testing.assert_array_equal(cut(emulator.picture(), terminal.view), FRAME)
    assert emulator.line(10) == "step 1"
    assert emulator.line(11) == "help"
    # Another frame replaces only the cells that differ.
    received = emulator.received
    terminal.show(FRAME, ["step 1", "help"])
    emulator.settle()
    assert emulator.received - received < 40
    other = FRAME.copy()
    other[3, 4] = 255 - other[3, 4]
    terminal.show(other, ["step 2", "help"])
    emulator.settle()
    np.testing.assert_array_equal(cut(emulator.picture(), terminal.view), other)
    assert emulator.line(10) == "step 2"
    assert emulator.received - received < 250


def test_random_changes_always_end_in_the_current_image(
    emulator: Emulator, terminal: Terminal
) -> None:
    frame = FRAME.copy()
    for i in range(12):
        mask = RNG.random(frame.shape[:2]) < RNG.random()
        frame[mask] = RNG.integers(0, 4, (mask.sum(), 3), np.uint8)
        terminal.show(frame, [f"{i}"], overlay=["over"] if i % 3 == 0 else [])
        terminal.events()
    emulator.settle()
    np.testing.assert_array_equal(cut(emulator.picture(), terminal.view), frame)
    assert emulator.line(11) == "11"
    assert "over" not in "".join(map(emulator.line, range(12)))


def test_small_frames_grow_in_squares_and_large_ones_shrink_by_area(
    emulator: Emulator, terminal: Terminal
) -> None:
    terminal.show(FRAME[:6, :8])
    emulator.settle()
    large = np.kron(FRAME[:6, :8], np.ones((4, 4, 1), np.uint8))
    np.testing.assert_array_equal(cut(emulator.picture(), terminal.view), large)
    # Eight times as large as the terminal: each pixel shown is the mean of a square.
    flat = RNG.integers(0, 256, (24, 40, 3), np.uint8)
    terminal.show(np.kron(flat, np.ones((8, 8, 1), np.uint8)))
    emulator.settle()
    np.testing.assert_array_equal(emulator.picture(), flat)


def test_map_is_beside_the_view(emulator: Emulator, terminal: Terminal) -> None:
    terminal.show(FRAME, ["text"], beside=MAP[:, :15])
    emulator.settle()
    picture = emulator.picture()
    np.testing.assert_array_equal(cut(picture, terminal.view), FRAME)
    assert terminal.beside is not None
    assert terminal.view is not None
    # 30 rows in the 22 that there are.
    assert terminal.beside.height == 22
    assert terminal.view.left + terminal.view.width < terminal.beside.left
    mean = cut(picture, terminal.beside).mean(axis=(0, 1))
    np.testing.assert_allclose(mean, MAP[:, :15].mean(axis=(0, 1)), atol=4)
    terminal.show(FRAME, ["text"])
    emulator.settle()
    assert terminal.view.left == 12


def test_an_overlay_lies_on_top(emulator: Emulator, terminal: Terminal) -> None:
    terminal.show(FRAME, overlay=["game over", "R: again"])
    emulator.settle()
    texts = [emulator.line(row).replace(HALF_BLOCK, "").strip() for row in range(12)]
    assert [text for text in texts if text] == ["game over", "R: again"]


def test_layout_follows_the_terminal_size(emulator: Emulator, terminal: Terminal) -> None:
    terminal.show(FRAME, ["text"])
    emulator.settle()
    for columns, rows in ((16, 7), (100, 40), (5, 3), (1, 1), (40, 12)):
        emulator.resize(columns, rows)
        assert Event("redraw") in terminal.events()
        terminal.show(FRAME, ["text"], beside=MAP, overlay=["a long line of text"])
        assert Event("redraw") not in terminal.events()
        terminal.show(FRAME, ["text"])
        emulator.settle()
        if (columns, rows) == (16, 7):
            np.testing.assert_array_equal(cut(emulator.picture(), terminal.view), FRAME)
            assert emulator.line(6) == "text"


def names(events: list[Event]) -> list[str]:
    """The keys of events, each of which is pressed and then released."""
    assert [event.kind for event in events] == ["press", "release"] * (len(events) // 2)
    assert [event.key for event in events[::2]] == [event.key for event in events[1::2]]
    return [event.key for event in events[::2]]


def test_keys_reach_the_game(emulator: Emulator, terminal: Terminal) -> None:
    emulator.send(b"wA \x1b[A\x1b[B\x1b[C\x1b[Dq")
    pressed = names(terminal.events(5.0))
    assert pressed == ["w", "a", "space", "up", "down", "right", "left", "q"]
    emulator.send(b"\x1b")
    assert names(terminal.events(5.0)) == ["escape"]
    assert terminal.events(0.01) == []


def test_escape_sequence_can_arrive_in_pieces(emulator: Emulator, terminal: Terminal) -> None:
    timer = threading.Timer(0.03, emulator.send, [b"[A"])
    emulator.send(b"\x1b")
    timer.start()
    assert names(terminal.events(5.0)) == ["up"]
    timer.join()


@pytest.mark.parametrize(
    ("data", "keys"),
    [
        (b"\x1bOA\x1bOD", ["up", "left"]),
        (b"\x1b\x1b", ["escape"]),
        (b"\x1b[3~\x1b[200~x\x1b[1;5Pw", ["x", "w"]),
        (b"\x1bw", []),
        ("äöü€w".encode(), ["w"]),
        (b"\x00\x01\x7f\r\t", ["return", "tab"]),
        (b"\x1b[12;40Rw", ["w"]),
    ],
)
def test_decoding_keys(data: bytes, keys: list[str]) -> None:
    whole = Keys()
    assert whole.feed(data) + whole.flush() == keys
    assert not whole.unfinished
    # The same in pieces, except for incomplete sequences.
    pieces = Keys()
    found = [key for i in range(len(data)) for key in pieces.feed(data[i : i + 1])]
    assert found + pieces.flush() == keys


def test_random_bytes_are_harmless() -> None:
    keys = Keys()
    for size in RNG.integers(1, 40, 300):
        for key in keys.feed(RNG.bytes(int(size)) + b"\x1b" * int(size % 2)):
            assert key
    keys.flush()
    assert not keys.unfinished


def test_leaving_restores_everything(emulator: Emulator) -> None:
    import termios

    before = termios.tcgetattr(emulator.slave)

    def fail() -> None:
        with Terminal(emulator.slave, emulator.slave) as terminal:
            terminal.show(FRAME)
            emulator.settle()
            assert emulator.modes == {"?1049": True, "?25": False, "?7": False, "?2026": False}
            during = termios.tcgetattr(emulator.slave)
            assert not during[3] & (termios.ECHO | termios.ICANON)
            # Ctrl-C still interrupts.
            assert during[3] & termios.ISIG
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    emulator.settle()
    assert termios.tcgetattr(emulator.slave) == before
    assert emulator.modes == {"?1049": False, "?25": True, "?7": True, "?2026": False}
    Terminal(emulator.slave, emulator.slave).close()


def test_silent_terminals_do_not_block() -> None:
    emulator = Emulator(40, 12, answers=False)
    with Terminal(emulator.slave, emulator.slave) as terminal:
        start = time.monotonic()
        for _ in range(5):
            terminal.show(FRAME)
            terminal.events()
        assert time.monotonic() - start < 3
    emulator.close()


def test_lost_terminal_is_closed() -> None:
    emulator = Emulator(40, 12)
    terminal = Terminal(os.dup(emulator.slave), os.dup(emulator.slave))
    with terminal:
        emulator.close()
        terminal.show(FRAME)
        assert terminal.events(1.0)[-1] == Event("close")


def test_pipes_are_refused() -> None:
    reading, writing = os.pipe()
    try:
        with pytest.raises(DisplayError, match="standard input is not a terminal"):
            Terminal(reading, writing)
    finally:
        os.close(reading)
        os.close(writing)


def test_error_without_termios_names_supported_systems(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "termios", None)
    with pytest.raises(DisplayError, match="Linux or macOS"):
        Terminal()
