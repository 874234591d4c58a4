"""A window with sharply enlarged pictures above lines of text, which reports keys.

It does not depend on games. pygame-ce, from the extra `play`, is imported when a window is opened.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..view.recording import BACKGROUND, TEXT
from .display import LONGEST_WAIT, Display, DisplayError, Event, Rectangle

# Pixels around the pictures, beside the text, and per line of text.
GAP, MARGIN, LINE, LETTERS = 6, 12, 22, 22
# How much an overlay darkens what is behind it, 0 to 255.
SHADE = 208
# SDL drivers that draw without a display.
UNSEEN = ("dummy", "offscreen")
# The environment variables in which Linux names the display.
DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")


def import_pygame() -> Any:
    """Import pygame.

    Raises:
        DisplayError: it is not installed.
    """
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        return importlib.import_module("pygame")
    except ImportError as error:
        raise DisplayError(
            f"a window needs the package pygame-ce ({error}): pip install 'jaxenstein[play]'"
        ) from error


class Window(Display):
    """The only window of this process. Use it from the main thread."""

    finer = 1
    gap = GAP

    def __init__(self, title: str, size: tuple[int, int]) -> None:
        """Open a resizable window.

        Args:
            title: the title of the window.
            size: (width, height) in pixels.

        Raises:
            DisplayError: pygame-ce is not installed, or there is no display.
        """
        pygame = import_pygame()
        self._pygame = pygame
        self._first = size
        wanted = os.environ.get("SDL_VIDEODRIVER", "")
        # SDL itself would look for a display and complain on standard error.
        if sys.platform == "linux" and not (wanted or any(map(os.environ.get, DISPLAYS))):
            raise DisplayError(f"no window can be opened: {' and '.join(DISPLAYS)} are not set")
        try:
            pygame.display.init()
            pygame.font.init()
            pygame.display.set_caption(title)
            self.resize(size)
        except pygame.error as error:
            raise DisplayError(f"no window can be opened: {error}") from error
        driver = pygame.display.get_driver()
        if driver in UNSEEN and driver != wanted:
            pygame.display.quit()
            raise DisplayError("no window can be opened: there is no display")
        self._font = pygame.font.Font(None, LETTERS)

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self._pygame.display.get_surface().get_size()

    def resize(self, size: tuple[int, int]) -> None:
        """Resize the window to (width, height) in pixels."""
        self._pygame.display.set_mode(size, self._pygame.RESIZABLE)

    def make_room(self, beside: bool) -> None:
        """Grow for a picture beside the frame, or shrink back.

        A window that was resized by hand keeps its size.
        """
        narrow, height = self._first
        wide = min(2 * narrow, max(narrow, self._screen_width()))
        before, after = (narrow, wide) if beside else (wide, narrow)
        if self.size == (before, height):
            self.resize((after, height))
            self._move_into_screen(after)

    def _screen_width(self) -> int:
        return max(width for width, _ in self._pygame.display.get_desktop_sizes())

    def _move_into_screen(self, width: int) -> None:
        """Move a window of that width to the left if it extends past the right edge."""
        display = self._pygame.display
        # On Wayland a window does not know its position, and older pygame versions cannot ask.
        with contextlib.suppress(AttributeError, self._pygame.error):
            left, top = display.get_window_position()
            fitting = max(0, self._screen_width() - width)
            if left > fitting:
                display.set_window_position((fitting, top))

    def show(
        self,
        frame: np.ndarray | None,
        lines: Sequence[str] = (),
        *,
        beside: np.ndarray | None = None,
        overlay: Sequence[str] = (),
    ) -> None:
        """Redraw everything; see `Display.show`."""
        surface = self._pygame.display.get_surface()
        surface.fill(BACKGROUND)
        for picture, box in self.arranged(frame, beside, len(lines)):
            self._draw(surface, picture, box)
        area = self.area(len(lines))
        for i, line in enumerate(lines):
            top = area.top + area.height + GAP + i * LINE
            surface.blit(self._font.render(line, True, TEXT), (MARGIN, top))
        if overlay:
            self._draw_overlay(surface, overlay)
        self._pygame.display.flip()

    def pixels(self) -> np.ndarray:
        """uint8[height, width, 3]: the content of the window."""
        surface = self._pygame.display.get_surface()
        return self._pygame.surfarray.array3d(surface).swapaxes(0, 1).copy()

    def events(self, timeout: float = 0.0) -> list[Event]:
        """The events since the last call; call it often, or the window seems unresponsive."""
        pygame = self._pygame
        found = []
        if timeout > 0:
            first = pygame.event.wait(max(1, round(1000 * min(timeout, LONGEST_WAIT))))
            found = [first] if first.type != pygame.NOEVENT else []
        translated = [self._translate(event) for event in (*found, *pygame.event.get())]
        return [event for event in translated if event is not None]

    def close(self) -> None:
        """Close the window; closing it again does nothing."""
        self._pygame.display.quit()

    def area(self, lines: int) -> Rectangle:
        """The room for pictures above a number of lines of text."""
        width, height = self.size
        text = lines * LINE + GAP if lines else 0
        return Rectangle(GAP, GAP, max(1, width - 2 * GAP), max(1, height - 2 * GAP - text))

    def _draw(self, surface: Any, picture: np.ndarray, box: Rectangle) -> None:
        pygame = self._pygame
        height, width = picture.shape[:2]
        image = pygame.image.frombuffer(picture.tobytes(), (width, height), "RGB")
        shrunk = box.width < width
        scale = pygame.transform.smoothscale if shrunk else pygame.transform.scale
        surface.blit(scale(image, (box.width, box.height)), (box.left, box.top))

    def _draw_overlay(self, surface: Any, lines: Sequence[str]) -> None:
        pygame = self._pygame
        texts = [self._font.render(line, True, TEXT) for line in lines]
        width = max(text.get_width() for text in texts) + 2 * MARGIN
        height = len(lines) * LINE + 2 * MARGIN
        box = pygame.Surface((width, height))
        box.fill(BACKGROUND)
        for i, text in enumerate(texts):
            box.blit(text, (MARGIN, MARGIN + i * LINE))
        box.set_alpha(SHADE)
        area = self.view or self.area(0)
        left, top = area.left + (area.width - width) // 2, area.top + (area.height - height) // 2
        surface.blit(box, (max(0, left), max(0, top)))

    def _translate(self, event: Any) -> Event | None:
        pygame = self._pygame
        if event.type == pygame.QUIT:
            return Event("close")
        if event.type in (pygame.KEYDOWN, pygame.KEYUP):
            kind = "press" if event.type == pygame.KEYDOWN else "release"
            return Event(kind, pygame.key.name(event.key).lower())
        if event.type in (pygame.VIDEORESIZE, pygame.VIDEOEXPOSE):
            return Event("redraw")
        return None
