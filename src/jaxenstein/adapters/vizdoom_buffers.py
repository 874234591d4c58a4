"""Start ViZDoom, and convert its buffers to our observations."""

from __future__ import annotations

import contextlib
import importlib
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from ..engine.shade import luma_of
from ..errors import JAXensteinError, SettingError
from ..maps.symbols import CEILING, FLOOR

# Screens with ratio 4 to 3; the smallest one with enough pixels for the image is used.
SCREENS = ((160, 120), (320, 240), (640, 480), (1280, 960))
# Map units per step of the 8-bit depth buffer, and an offset per row of the screen; both were
# fitted to walls at known distances.
DEPTH_STEP, DEPTH_START = 7.1376, 0.0227
# The value of floor and ceiling in the label buffer; walls are 0, things have other values.
FLATS = 1
VARIABLES = ("POSITION_X", "POSITION_Y", "ANGLE", "VELOCITY_X", "VELOCITY_Y", "HEALTH")


class MissingViZDoomError(JAXensteinError, ImportError):
    """ViZDoom is needed but not installed."""


def load_vizdoom() -> Any:
    """The vizdoom module.

    Raises:
        MissingViZDoomError: ViZDoom is not installed; the message names the extra.
    """
    try:
        # Imported by name: a type checker would otherwise find vizdoom.py in this folder.
        return importlib.import_module("vizdoom")
    except ImportError as error:
        raise MissingViZDoomError(
            f"ViZDoom is not installed ({error}): pip install 'jaxenstein[vizdoom]'"
        ) from error


@contextlib.contextmanager
def running(
    scenario: str,
    *,
    seed: int,
    variables: Sequence[str] = VARIABLES,
    size: tuple[int, int] = SCREENS[0],
    prepare: Callable[[Any], None] | None = None,
) -> Iterator[Any]:
    """A running `vizdoom.DoomGame` with the configuration of a scenario.

    Files that the game would write to the working directory go to a temporary folder.

    Args:
        scenario: the name of the scenario, such as `"my_way_home"`.
        seed: the seed of the game.
        variables: the names of the game variables in each state, in this order.
        size: width and height of the screen.
        prepare: a function that changes more settings before the game starts.

    Raises:
        SettingError: the game has no screen of this size.
    """
    vizdoom = load_vizdoom()
    game = vizdoom.DoomGame()
    resolution = getattr(vizdoom.ScreenResolution, "RES_{}X{}".format(*size), None)
    if resolution is None:
        raise SettingError("the game has no screen of {}x{} pixels".format(*size))
    with tempfile.TemporaryDirectory() as folder:
        game.load_config(str(Path(vizdoom.scenarios_path) / f"{scenario}.cfg"))
        game.set_doom_config_path(str(Path(folder) / "settings.ini"))
        game.set_window_visible(False)
        game.set_sound_enabled(False)
        game.set_screen_resolution(resolution)
        game.set_available_game_variables([getattr(vizdoom.GameVariable, v) for v in variables])
        game.set_seed(seed)
        if prepare is not None:
            prepare(game)
        try:
            # The game creates a folder in the working directory.
            with contextlib.chdir(folder):
                game.init()
            yield game
        finally:
            game.close()


def screen_for(height: int, width: int) -> tuple[int, int]:
    """The smallest screen from which an image can be sampled.

    Raises:
        SettingError: the image is larger than all screens.
    """
    for screen in SCREENS:
        if width <= screen[0] and height <= screen[1]:
            return screen
    raise SettingError(
        f"images of {height}x{width} are larger than the game's largest screen, 960x1280"
    )


def sample(buffer: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """[height, width] of a screen buffer [rows, columns]: the pixel at the middle of each cell.

    The game rounds all edges down to whole pixels, so a pixel shows what is at its lower right
    corner; the pixel whose corner is nearest to the middle is used.
    """
    rows, columns = (
        ((np.arange(count) + 0.5) * (length / count) + 0.5).astype(int) - 1
        for count, length in zip(size, buffer.shape, strict=True)
    )
    return buffer[rows[:, None], columns[None]]


def depth_image(buffer: np.ndarray, size: tuple[int, int], unit: int) -> np.ndarray:
    """float32[height, width]: a depth buffer in tiles of `unit` map units."""
    start = DEPTH_START * buffer.shape[0]
    return ((start + DEPTH_STEP * (sample(buffer, size) + 0.5)) / unit).astype(np.float32)


def label_image(
    buffer: np.ndarray, size: tuple[int, int], things: Mapping[int, int], walls: np.ndarray
) -> np.ndarray:
    """uint8[height, width]: the label ids of a label buffer.

    Args:
        buffer: uint8[rows, columns].
        size: height and width.
        things: the label id for each buffer value that stands for a thing.
        walls: uint8[width], the label ids of the walls.
    """
    values = sample(buffer, size)
    flat = np.where(2 * np.arange(size[0]) + 1 < size[0], CEILING, FLOOR)[:, None]
    image = np.where(values == FLATS, flat, walls[None])
    for value, label in things.items():
        image = np.where(values == value, label, image)
    return image.astype(np.uint8)


def colour_image(screen: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """uint8[height, width, 3]: a screen; each pixel is the mean of the area it covers."""
    height, width = size
    return np.asarray(Image.fromarray(screen).resize((width, height), Image.Resampling.BOX))


def picked_image(screen: np.ndarray, size: tuple[int, int], samples: int = 1) -> np.ndarray:
    """uint8[height, width, 3]: the pixels of a screen that `look="game"` draws.

    They are the pixels at the centres of the image's pixels or, with two samples, the means of the
    pixels at the centres of their left and right halves.
    """
    height, width = size
    rows, columns = (
        ((np.arange(few) + 0.5) * many / few).astype(int)
        for few, many in zip((height, samples * width), screen.shape[:2], strict=True)
    )
    pixels = screen[rows[:, None], columns].reshape(height, width, samples, 3)
    return (pixels.sum(axis=2, dtype=np.int32) // samples).astype(np.uint8)


def grey(image: np.ndarray) -> np.ndarray:
    """uint8[height, width]: the luma of a colour image."""
    return luma_of(*np.moveaxis(image.astype(np.uint32), -1, 0)).astype(np.uint8)
