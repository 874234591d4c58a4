"""The window under SDL's dummy driver, and the layout of images on any display."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxenstein.interactive.display import DisplayError, Event, Rectangle, arrange, fit
from jaxenstein.interactive.window import Window
from jaxenstein.view.recording import BACKGROUND

RNG = np.random.default_rng(0)
FRAME = RNG.integers(0, 256, (12, 16, 3), np.uint8)
MAP = RNG.integers(0, 256, (50, 70, 3), np.uint8)
SIZES = st.integers(1, 300)


@pytest.fixture
def window(monkeypatch: pytest.MonkeyPatch) -> Iterator[Window]:
    pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    with Window("test", (400, 300)) as window:
        yield window


def cut(window: Window, box: Rectangle | None) -> np.ndarray:
    """The pixels of a window in a box."""
    assert box is not None
    return window.pixels()[box.top : box.top + box.height, box.left : box.left + box.width]


def squares(frame: np.ndarray, scale: int) -> np.ndarray:
    return np.kron(frame, np.ones((scale, scale, 1), np.uint8))


@settings(deadline=None)
@given(SIZES, SIZES, SIZES, SIZES)
def test_images_scale_by_whole_numbers(
    room_wide: int, room_high: int, height: int, width: int
) -> None:
    box = fit(Rectangle(5, 7, room_wide, room_high), height, width)
    assert box.left >= 5
    assert box.left + box.width <= 5 + room_wide
    assert box.top >= 7
    assert box.top + box.height <= 7 + room_high
    scale = box.width // width
    if width <= room_wide and height <= room_high:
        assert (box.width, box.height) == (scale * width, scale * height)
        assert (scale + 1) * width > room_wide or (scale + 1) * height > room_high
    else:
        assert box.width == room_wide or box.height == room_high
    # In the middle, but for a pixel.
    assert abs((box.left - 5) - (5 + room_wide - box.left - box.width)) <= 1


@settings(deadline=None)
@given(SIZES, SIZES, SIZES, SIZES)
def test_two_images_do_not_overlap(wide: int, high: int, height: int, width: int) -> None:
    area, side = Rectangle(0, 0, 2 * wide + 6, high), Rectangle(wide + 6, 0, wide, high)
    frame, beside = np.zeros((12, 16, 3), np.uint8), np.zeros((height, width, 3), np.uint8)
    first, second = arrange(area, side, frame, beside, 6)
    assert first is not None
    assert second is not None
    assert first.left + first.width + 6 <= second.left
    assert second.left + second.width == 2 * wide + 6
    assert arrange(area, side, frame, None, 6) == (fit(area, 12, 16), None)
    assert arrange(area, side, None, None, 6) == (None, None)


def test_frame_pixels_are_square(window: Window) -> None:
    window.show(FRAME)
    np.testing.assert_array_equal(cut(window, window.view), squares(FRAME, 24))
    window.show(FRAME, ["text", "more"])
    np.testing.assert_array_equal(cut(window, window.view), squares(FRAME, 19))
    assert window.view is not None
    below = window.pixels()[window.view.top + window.view.height :]
    assert (below != BACKGROUND).any()
    assert window.beside is None


def test_second_image_is_beside_the_first(window: Window) -> None:
    window.show(FRAME, beside=MAP)
    np.testing.assert_array_equal(cut(window, window.view), squares(FRAME, 15))
    np.testing.assert_array_equal(cut(window, window.beside), squares(MAP, 2))
    assert window.view is not None
    assert window.beside is not None
    assert window.view.left + window.view.width <= window.beside.left
    window.show(None, beside=MAP)
    assert window.view is None


def test_an_overlay_lies_on_top(window: Window) -> None:
    window.show(FRAME)
    plain = window.pixels()
    window.show(FRAME, overlay=["over", "there"])
    changed = (window.pixels() != plain).any(axis=-1)
    rows, columns = np.nonzero(changed)
    # In the middle, and nowhere else.
    assert abs(rows.min() + rows.max() - 300) <= 12
    assert abs(columns.min() + columns.max() - 400) <= 12
    assert changed.mean() < 0.2


def test_any_window_size_works(window: Window) -> None:
    for size in ((1, 1), (20, 10), (30, 400), (900, 40)):
        window.resize(size)
        window.show(FRAME, ["a line that is much too long for it", ""], beside=MAP, overlay=["x"])
        assert window.size == size
        assert window.pixels().shape == (size[1], size[0], 3)


def test_window_grows_for_a_second_image(window: Window, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(window, "_screen_width", lambda: 2000)
    window.make_room(True)
    assert window.size == (800, 300)
    window.make_room(False)
    assert window.size == (400, 300)
    monkeypatch.setattr(window, "_screen_width", lambda: 640)
    window.make_room(True)
    assert window.size == (640, 300)
    # One that was resized by hand stays as it is.
    window.resize((500, 500))
    window.make_room(False)
    assert window.size == (500, 500)


def test_events_become_keys_and_closing(window: Window) -> None:
    pygame = pytest.importorskip("pygame")
    window.events()
    for kind, key in (
        (pygame.KEYDOWN, pygame.K_w),
        (pygame.KEYUP, pygame.K_w),
        (pygame.KEYDOWN, pygame.K_UP),
        (pygame.KEYDOWN, pygame.K_SPACE),
        (pygame.KEYDOWN, pygame.K_ESCAPE),
    ):
        pygame.event.post(pygame.event.Event(kind, key=key))
    pygame.event.post(pygame.event.Event(pygame.MOUSEMOTION, pos=(0, 0)))
    pygame.event.post(pygame.event.Event(pygame.VIDEORESIZE, size=(500, 400), w=500, h=400))
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    assert window.events() == [
        Event("press", "w"),
        Event("release", "w"),
        Event("press", "up"),
        Event("press", "space"),
        Event("press", "escape"),
        Event("redraw"),
        Event("close"),
    ]
    assert window.events(0.01) == []


def test_error_without_pygame_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(DisplayError, match=r"pip install 'jaxenstein\[play\]'"):
        Window("test", (40, 30))


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is always a display")
def test_error_without_display_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pygame")
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(DisplayError, match="DISPLAY and WAYLAND_DISPLAY are not set"):
        Window("test", (40, 30))
    # A display that does not answer.
    monkeypatch.setenv("DISPLAY", ":4711")
    with pytest.raises(DisplayError, match="no window can be opened"):
        Window("test", (40, 30))
