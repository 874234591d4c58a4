"""Starting ViZDoom, and what its buffers show in the terms of our observations."""

from __future__ import annotations

import contextlib
import importlib
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from ..errors import JAXensteinError, SettingError
from ..maps.symbols import CEILING, FLOOR

# Screens of the ratio 4 to 3; the smallest one that has as many pixels as the image is taken.
SCREENS = ((160, 120), (320, 240), (640, 480), (1280, 960))
# Map units of a step of the 8-bit depth buffer, and per row of the screen those of value 0: fitted
# to walls at known distances.
DEPTH_STEP, DEPTH_START = 7.1376, 0.0227
# The label buffer's value for floor and ceiling; walls have 0, things others.
FLATS = 1
# Weights of red, green and blue in grey images, ITU-R BT.601.
LUMA = (0.299, 0.587, 0.114)
VARIABLES = ("POSITION_X", "POSITION_Y", "ANGLE", "VELOCITY_X", "VELOCITY_Y", "HEALTH")


class MissingViZDoomError(JAXensteinError, ImportError):
    """ViZDoom is needed and not installed."""


def load_vizdoom() -> Any:
    """The vizdoom module.

    Raises:
        MissingViZDoomError: it is not installed; the message names the extra.
    """
    try:
        # By its name: a type checker would take the file beside this one for it.
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
    """A running `vizdoom.DoomGame` with the settings of a scenario's own configuration.

    The files that it would leave in the working directory go to a temporary folder.

    Args:
        scenario: its name, such as `"my_way_home"`.
        seed: of the game's random numbers.
        variables: names of the game variables in each state, in this order.
        size: width and height of the screen, one of `SCREENS`.
        prepare: changes more settings before the game starts.
    """
    vizdoom = load_vizdoom()
    game = vizdoom.DoomGame()
    with tempfile.TemporaryDirectory() as folder:
        game.load_config(str(Path(vizdoom.scenarios_path) / f"{scenario}.cfg"))
        game.set_doom_config_path(str(Path(folder) / "settings.ini"))
        game.set_window_visible(False)
        game.set_sound_enabled(False)
        game.set_screen_resolution(getattr(vizdoom.ScreenResolution, "RES_{}X{}".format(*size)))
        game.set_available_game_variables([getattr(vizdoom.GameVariable, v) for v in variables])
        game.set_seed(seed)
        if prepare is not None:
            prepare(game)
        try:
            # It makes a folder of its own in the working directory.
            with contextlib.chdir(folder):
                game.init()
            yield game
        finally:
            game.close()


def screen_for(height: int, width: int) -> tuple[int, int]:
    """The screen to make an image of.

    Raises:
        SettingError: it is larger than all screens.
    """
    for screen in SCREENS:
        if width <= screen[0] and height <= screen[1]:
            return screen
    raise SettingError(
        f"images of {height}x{width} are larger than the game's largest screen, 960x1280"
    )


def sample(buffer: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """[height, width] of a screen's buffer [rows, columns]: the pixel at each one's middle.

    The game rounds all edges down to whole pixels, so a pixel shows what is at its lower right
    corner: the one whose corner is nearest to the middle is taken.
    """
    rows, columns = (
        ((np.arange(count) + 0.5) * (length / count) + 0.5).astype(int) - 1
        for count, length in zip(size, buffer.shape, strict=True)
    )
    return buffer[rows[:, None], columns[None]]


def depth_image(buffer: np.ndarray, size: tuple[int, int], unit: int) -> np.ndarray:
    """float32[height, width]: distances in tiles of `unit` map units, of a depth buffer."""
    start = DEPTH_START * buffer.shape[0]
    return ((start + DEPTH_STEP * (sample(buffer, size) + 0.5)) / unit).astype(np.float32)


def label_image(
    buffer: np.ndarray, size: tuple[int, int], things: Mapping[int, int], walls: np.ndarray
) -> np.ndarray:
    """uint8[height, width]: label ids, of a label buffer.

    Args:
        buffer: uint8[rows, columns].
        size: height and width.
        things: the label id of each of the buffer's values that stands for a thing.
        walls: uint8[width], the label ids of the walls.
    """
    values = sample(buffer, size)
    flat = np.where(2 * np.arange(size[0]) + 1 < size[0], CEILING, FLOOR)[:, None]
    image = np.where(values == FLATS, flat, walls[None])
    for value, label in things.items():
        image = np.where(values == value, label, image)
    return image.astype(np.uint8)


def colour_image(screen: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """uint8[height, width, 3]: a screen, each pixel the mean of what it covers."""
    height, width = size
    return np.asarray(Image.fromarray(screen).resize((width, height), Image.Resampling.BOX))


def grey(image: np.ndarray) -> np.ndarray:
    """uint8[height, width]: the luma of an image of colours."""
    return np.rint(image @ np.array(LUMA)).astype(np.uint8)
