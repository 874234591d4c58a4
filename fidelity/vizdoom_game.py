"""Starting ViZDoom's scenarios the way these scripts need them, and what its users see of them.

The game draws its lots from `seed`, so a run can be repeated. The files that it would leave in
the working directory go to a temporary folder.
"""

from __future__ import annotations

import contextlib
import importlib
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from jaxenstein.errors import JAXensteinError

MISSING = "vizdoom is not installed; it comes with the extra 'bench': pip install '.[bench]'"


class MissingViZDoomError(JAXensteinError, ImportError):
    """The script needs ViZDoom, which is not installed."""


def load_vizdoom() -> Any:
    """The vizdoom module.

    Raises:
        MissingViZDoomError: if it is not installed.
    """
    try:
        return importlib.import_module("vizdoom")
    except ImportError as error:
        raise MissingViZDoomError(f"{MISSING} ({error})") from error


@contextlib.contextmanager
def running(
    scenario: str,
    *,
    seed: int,
    variables: Sequence[str],
    size: str = "160X120",
    prepare: Callable[[Any], None] | None = None,
) -> Iterator[Any]:
    """A running `vizdoom.DoomGame` with the settings of a scenario's own configuration.

    Args:
        scenario: its name, such as `"my_way_home"`.
        seed: of the game's random numbers.
        variables: names of the game variables in each state, in this order.
        size: of the screen, as in the names of ViZDoom's resolutions.
        prepare: changes more settings before the game starts.
    """
    vizdoom = load_vizdoom()
    game = vizdoom.DoomGame()
    with tempfile.TemporaryDirectory() as folder:
        game.load_config(str(Path(vizdoom.scenarios_path) / f"{scenario}.cfg"))
        game.set_doom_config_path(str(Path(folder) / "settings.ini"))
        game.set_window_visible(False)
        game.set_sound_enabled(False)
        game.set_screen_resolution(getattr(vizdoom.ScreenResolution, f"RES_{size}"))
        game.set_available_game_variables(
            [getattr(vizdoom.GameVariable, name) for name in variables]
        )
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


def single_buttons(count: int, *, idle: bool) -> list[list[int]]:
    """The actions that press at most one of `count` buttons; the first presses none if `idle`."""
    pressed = [[int(i == j) for j in range(count)] for i in range(count)]
    return [[0] * count, *pressed] if idle else pressed


def complaint(error: JAXensteinError) -> int:
    """Tell what went wrong on the error stream; the exit code."""
    print(f"fidelity: {error}", file=sys.stderr)
    return 2
