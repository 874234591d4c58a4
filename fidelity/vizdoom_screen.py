"""What ViZDoom's My Way Home shows from known poses: walls to the row, and the depth buffer."""

from __future__ import annotations

import itertools
import random
from dataclasses import dataclass
from typing import Any

import numpy as np

from jaxenstein.adapters.vizdoom_buffers import load_vizdoom
from jaxenstein.errors import JAXensteinError
from jaxenstein.tasks.doom.lattice import Tiles
from jaxenstein.tasks.doom.walls import ARMOUR, DoomMap

VARIABLES = ("POSITION_X", "POSITION_Y", "ANGLE", "CAMERA_POSITION_Z")
BUTTONS = ("TURN_LEFT_RIGHT_DELTA", "MOVE_FORWARD", "MOVE_LEFT", "MOVE_RIGHT", "TURN_LEFT")
IDLE = [0.0] * len(BUTTONS)
# Half the side of the player's box in map units.
PLAYER_RADIUS = 16.0
# The armour is reached 36 units away, where the episode ends; a walk covers less than 180.
STANDING_ROOM = 60
WALKING_ROOM = 220


@dataclass(frozen=True)
class View:
    """What the game shows from one pose.

    Attributes:
        x: place in map units.
        y: place in map units.
        angle: degrees, counterclockwise from east.
        eye: height of the eye above the floor in map units.
        top: int[W], first row of the wall in each column.
        bottom: int[W], first row below the wall; 0 in columns without a wall.
        value: int[W], of the depth buffer at the horizon.
        sprite: bool[W], whether something stands before the wall.
    """

    x: float
    y: float
    angle: float
    eye: float
    top: np.ndarray
    bottom: np.ndarray
    value: np.ndarray
    sprite: np.ndarray


@dataclass(frozen=True)
class DepthScale:
    """Depth in map units of the depth buffer's values.

    Attributes:
        step: map units from one value to the next.
        offset: where the first value, 0, begins.
        quantum: the difference of successive values: 1, or 2 on screens of 960 rows.
        worst: how far a border between two values lies off this line, in map units.
        samples: how many distances it was fitted to.
    """

    step: float
    offset: float
    quantum: int
    worst: float
    samples: int

    def value_of(self, depth: np.ndarray) -> np.ndarray:
        """The value that a depth in map units should have."""
        return np.floor((depth - self.offset) / (self.step * self.quantum)) * self.quantum

    def middle(self, value: np.ndarray) -> np.ndarray:
        """The depth in the middle of a value's range."""
        return self.offset + self.step * (value + 0.5 * self.quantum)


def prepare(game: Any) -> None:
    """Settings beyond those of the scenario: the screen alone, without weapon or time limit."""
    vizdoom = load_vizdoom()
    game.set_available_buttons([getattr(vizdoom.Button, name) for name in BUTTONS])
    game.set_button_max_value(vizdoom.Button.TURN_LEFT_RIGHT_DELTA, 0)
    game.set_screen_format(vizdoom.ScreenFormat.RGB24)
    game.set_doom_skill(3)
    game.set_episode_timeout(0)
    game.set_depth_buffer_enabled(True)
    game.set_labels_buffer_enabled(True)
    game.set_render_weapon(False)
    game.set_render_crosshair(False)


def place(game: Any, x: int, y: int, turn: float) -> None:
    """Put the player down and turn it to the right by some degrees.

    Warping lowers the eye to the floor for one tic, and leaves the player's momentum.
    """
    game.send_game_command(f"warp {x} {y}")
    game.make_action([turn, *IDLE[1:]])
    game.make_action(IDLE)


def look(game: Any) -> View:
    """Read the state that the game shows; `r_drawflat` must be on."""
    state = game.get_state()
    x, y, angle, eye = (float(value) for value in state.game_variables)
    wall = state.depth_buffer > 0
    player = {label.value for label in state.labels if label.object_name == "DoomPlayer"}
    things = (state.labels_buffer > 0) & ~np.isin(state.labels_buffer, sorted(player))
    height = wall.shape[0]
    some = wall.any(axis=0)
    return View(
        x=x,
        y=y,
        angle=angle,
        eye=eye,
        top=np.where(some, wall.argmax(axis=0), height),
        bottom=np.where(some, height - wall[::-1].argmax(axis=0), 0),
        value=state.depth_buffer[height // 2].astype(int),
        sprite=things.any(axis=0),
    )


def calibrate(game: Any, tiles: Tiles) -> DepthScale:
    """Fit the scale of the depth buffer, facing east in the northern corridor."""
    y, wall = 48, 1120
    xs = range(420, wall - int(PLAYER_RADIUS) - 1)
    place(game, xs[0], y, look(game).angle)
    seen = []
    for x in xs:
        if not tiles.is_free(x, y, PLAYER_RADIUS):
            raise JAXensteinError(f"({x}, {y}) was expected to be free in My Way Home")
        place(game, x, y, 0.0)
        view = look(game)
        seen.append((wall - view.x, int(view.value[len(view.value) // 2])))
    distance, value = np.array(seen).T
    number = np.unique(value)
    border = np.array(
        [
            (distance[value == below].max() + distance[value == above].min()) / 2
            for below, above in itertools.pairwise(number)
        ]
    )
    quantum, number = int(np.diff(number).min()), number[1:]
    step, offset = np.polyfit(number, border, 1)
    worst = np.abs(offset + step * number - border).max()
    return DepthScale(float(step), float(offset), quantum, float(worst), len(seen))


def collect(game: Any, doom_map: DoomMap, tiles: Tiles, poses: int, seed: int) -> list[View]:
    """Views from random poses, in turn standing and after some random walking."""
    draw = random.Random(seed)
    goal = next(thing for thing in doom_map.things if thing.kind == ARMOUR)
    xs = [x for wall in doom_map.walls for x in (wall.x0, wall.x1)]
    ys = [y for wall in doom_map.walls for y in (wall.y0, wall.y1)]
    views: list[View] = []
    while len(views) < poses:
        x, y = draw.randint(min(xs), max(xs)), draw.randint(min(ys), max(ys))
        to_goal = max(abs(x - goal.x), abs(y - goal.y))
        if to_goal < STANDING_ROOM or not tiles.is_free(x, y, PLAYER_RADIUS + 1):
            continue
        place(game, x, y, draw.uniform(-180.0, 180.0))
        if len(views) % 2 and to_goal > WALKING_ROOM:
            for _ in range(draw.randint(4, 20)):
                buttons = [float(draw.random() < p) for p in (0.8, 0.3, 0.3, 0.3)]
                game.make_action([0.0, *buttons])
        if game.is_episode_finished():
            raise JAXensteinError("the episode ended during a walk: the armour was reached")
        views.append(look(game))
    return views
