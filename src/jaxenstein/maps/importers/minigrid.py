"""Convert MiniGrid environments to tile maps.

This file relies on these facts of MiniGrid (Farama Foundation, Apache 2.0, package version 3.2.0).
An environment has a `grid` of columns and rows of objects with `type` and `color`, `agent_pos`
(column, row) and `agent_dir`, quarter turns clockwise from east. A door may be open, closed or
locked. An episode ends on the only goal of the map, unless the environment's class differs.

Neither minigrid nor gymnasium is imported before `convert_id` is called.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from ...errors import MapError, MapWarning, SettingError, UnknownEnvironmentError, nearest, quoted
from ...fields import check_whole
from ..reach import problems, summarised
from ..symbols import DEFAULT_WALL, door_label
from ..things import COLOUR_NAMES
from ..tilemap import Cell, Door, Key, TileMap

PREFIXES = ("MiniGrid-", "BabyAI-")
"""The prefix of the ids that minigrid registers."""

_PICK_UP = "an object has to be picked up to end the episode"
_INSTRUCTION = "the task is an instruction in words ({mission})"

# Rules that maps cannot express, by the name of the class that has them.
_RULES: dict[str, str] = {
    "KeyCorridorEnv": f"{_PICK_UP}; with a goal instead of the ball, this task is available as "
    "key-corridor-s3r1 to -s6r3",
    "UnlockPickupEnv": _PICK_UP,
    "BlockedUnlockPickupEnv": _PICK_UP,
    "ObstructedMazeEnv": _PICK_UP,
    "UnlockEnv": "the episode ends when a door is opened, and the map has no goal",
    "RedBlueDoorEnv": "the episode ends when two doors are opened in order, and the map has no "
    "goal",
    "MemoryEnv": "the episode ends beside one of two objects, the one that matches a third",
    "DynamicObstaclesEnv": "balls move about, and touching one ends the episode",
    "PlaygroundEnv": "it has no task: nothing is rewarded and the map has no goal",
    "FetchEnv": _INSTRUCTION,
    "GoToDoorEnv": _INSTRUCTION,
    "GoToObjectEnv": _INSTRUCTION,
    "PutNearEnv": _INSTRUCTION,
    "RoomGridLevel": _INSTRUCTION,  # all of BabyAI
}


@dataclass(frozen=True)
class MiniGridMap:
    """A layout of a MiniGrid environment.

    Attributes:
        tilemap: the map; its one spawn is the agent's cell.
        heading: the agent's heading in degrees: 0 east, 90 south, 180 west, 270 north.
    """

    tilemap: TileMap
    heading: float


def convert(env: Any) -> MiniGridMap:
    """Convert the current layout of a MiniGrid environment for `jaxenstein.tasks.navigation`.

    Walls of any colour become the default wall; coloured floor and open doors become floor. Closed
    and locked doors, keys and the goal are kept. The rules of `Navigation` differ from MiniGrid's:
    keys do not block the way, the agent picks them up by walking over them and keeps them all, and
    doors stay open.

    Args:
        env: the environment, after `reset`; Gymnasium wrappers are ignored.

    Raises:
        SettingError: the environment is not from MiniGrid, has not been reset, or has a rule that
            no map can express, such as an instruction or an object to pick up.
        MapError: there is a thing that maps do not have (the message names the place), no goal or
            several goals, or the agent carries something.

    Warns:
        MapWarning: the agent's cell has no path to the goal, or an unknown class of environment
            changes what a step does.
    """
    return _convert(env, stacklevel=3)


def convert_id(id: str, seed: int) -> MiniGridMap:
    """Convert the layout that a registered MiniGrid environment has after `reset(seed=seed)`.

    Args:
        id: an id of Gymnasium's registry, such as "MiniGrid-FourRooms-v0".
        seed: the seed, at least 0; equal seeds give equal maps.

    Raises:
        UnknownEnvironmentError: the id does not exist.
        SettingError: as for `convert`, or gymnasium or minigrid is missing, the environment cannot
            be made or reset, or the seed is not a whole number >= 0.
        MapError: as for `convert`.

    Warns:
        MapWarning: as for `convert`.
    """
    check_whole("seed", seed, 0)
    with contextlib.closing(_reset(id, seed)) as env:
        return _convert(env, stacklevel=3)


def _convert(env: Any, stacklevel: int) -> MiniGridMap:
    """As `convert`, with the stack level of warnings relative to this function."""
    env = getattr(env, "unwrapped", env)
    name = _name(env)
    _check_rules(env, name, stacklevel + 1)
    start = _start(env, name)
    if getattr(env, "carrying", None) is not None:
        raise MapError(f"the agent carries {_describe(env.carrying)}; reset first", source=name)
    tilemap = _read_grid(env.grid, start, name)
    for problem, (column, row) in summarised(problems(tilemap)):
        warnings.warn(
            f"{name}, {_place(column, row)}: {problem}", MapWarning, stacklevel=stacklevel
        )
    return MiniGridMap(tilemap, 90.0 * (int(env.agent_dir) % 4))


def _reset(id: str, seed: int) -> Any:
    """Make and reset the environment with this id."""
    with _silence():
        gymnasium = _import_packages()
    _check_known(id, gymnasium.registry)
    with _silence():  # again, because gymnasium adds its own warning filter when it is imported
        try:
            env = gymnasium.make(id)
            env.reset(seed=seed)
        except Exception as error:  # third-party code may fail in any way
            raise SettingError(f"gymnasium cannot make and reset {quoted(id)}: {error}") from error
    return env


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Suppress output (pygame's greeting) and warnings (old versions) of the packages."""
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        yield


def _import_packages() -> Any:
    """Import Gymnasium, with MiniGrid's environments registered."""
    try:
        importlib.import_module("minigrid")
        return importlib.import_module("gymnasium")
    except ImportError as error:
        raise SettingError(
            f"MiniGrid environments need the packages minigrid and gymnasium ({error}): "
            "pip install 'jaxenstein[minigrid]'"
        ) from error


def _check_known(id: str, registry: Any) -> None:
    if not isinstance(id, str) or id not in registry:
        ours = [known for known in registry if known.startswith(PREFIXES)]
        raise UnknownEnvironmentError(
            f"unknown MiniGrid environment {quoted(id)}{nearest(str(id), ours)}; "
            f"gymnasium.registry has the {len(ours)} ids of the installed minigrid"
        )


def _name(env: Any) -> str:
    spec = getattr(env, "spec", None)
    return str(getattr(spec, "id", None) or type(env).__name__)


def _rule(env: Any) -> str:
    """The rule of the environment that no map can express; "" if none is known."""
    names = [base.__name__ for base in type(env).__mro__]
    return next((_RULES[name] for name in names if name in _RULES), "")


def _check_rules(env: Any, name: str, stacklevel: int) -> None:
    """Raise for a rule that no map can express; warn about a class that may have such a rule."""
    if rule := _rule(env):
        mission = repr(str(getattr(env, "mission", "")))
        raise SettingError(f"{name} cannot be converted: {rule.format(mission=mission)}")
    bases = type(env).__mro__
    original = next((base for base in bases if base.__name__ == "MiniGridEnv"), None)
    owner = next((base for base in bases if "step" in vars(base)), None)
    if original is not None and owner is not original and owner is not None:
        warnings.warn(
            f"{name}: {owner.__name__} changes what a step does, but the map lacks its rules",
            MapWarning,
            stacklevel=stacklevel,
        )


def _start(env: Any, name: str) -> Cell:
    """The agent's cell; raises unless this is a MiniGrid environment that has been reset."""
    grid = getattr(env, "grid", None)
    parts = (getattr(grid, part, None) for part in ("get", "width", "height"))
    if any(part is None for part in parts) or not hasattr(env, "agent_pos"):
        raise SettingError(f"{name} is not a MiniGrid environment: it lacks a grid or agent_pos")
    position, direction = env.agent_pos, getattr(env, "agent_dir", None)
    if position is None or direction is None or min(*position, direction) < 0:
        raise SettingError(f"{name} has no layout yet: call its reset first")
    column, row = position
    return int(column), int(row)


def _read_grid(grid: Any, start: Cell, name: str) -> TileMap:
    tiles = [bytearray(grid.width) for _ in range(grid.height)]
    goals: list[Cell] = []
    keys: list[Key] = []
    doors: list[Door] = []
    for row, line in enumerate(tiles):
        for column in range(grid.width):
            thing = grid.get(column, row)
            kind = getattr(thing, "type", "floor")  # None where the grid is empty
            if kind == "wall":
                line[column] = DEFAULT_WALL
            elif kind == "goal":
                goals.append((column, row))
            elif kind == "key":
                keys.append(Key(column, row, _colour(thing, column, row, name)))
            elif kind == "door" and not thing.is_open:
                colour = _colour(thing, column, row, name)
                doors.append(Door(column, row, colour, bool(thing.is_locked)))
                line[column] = door_label(colour, bool(thing.is_locked))
            elif kind not in ("floor", "empty", "door"):
                raise MapError(
                    f"{_describe(thing)} at {_place(column, row)}: maps only have walls, doors, "
                    "keys and a goal",
                    source=name,
                )
    _check_goal(goals, start, name)
    rows = tuple(bytes(line) for line in tiles)
    return TileMap(
        name, rows, spawns=(start,), goals=tuple(goals), keys=tuple(keys), doors=tuple(doors)
    )


def _check_goal(goals: list[Cell], start: Cell, name: str) -> None:
    if not goals:
        raise MapError("the map has no goal", source=name)
    if len(goals) > 1:
        places = " and ".join(_place(*goal) for goal in goals[:2])
        raise MapError(
            f"there are {len(goals)} goals (at {places}), each of which ends an episode, but here "
            "each episode would have one of them",
            source=name,
        )
    if start in goals:
        raise MapError(f"the agent stands on the goal at {_place(*start)}", source=name)


def _colour(thing: Any, column: int, row: int, name: str) -> int:
    """Colour index of a door or key."""
    if thing.color not in COLOUR_NAMES:
        raise MapError(
            f"{_describe(thing)} at {_place(column, row)}: doors and keys must be "
            f"{', '.join(COLOUR_NAMES)}",
            source=name,
        )
    return COLOUR_NAMES.index(thing.color)


def _describe(thing: Any) -> str:
    kind = str(thing.type)
    return kind if kind in ("lava", "goal") else f"a {getattr(thing, 'color', '')} {kind}"


def _place(column: int, row: int) -> str:
    return f"column {column}, row {row} (from 0)"
