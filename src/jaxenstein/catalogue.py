"""The environments that come with the package: their ids, and what builds them."""

from __future__ import annotations

import dataclasses
import functools
import inspect
from collections.abc import Callable
from typing import Any

from .environment import AnyEnvironment
from .maps.ascii import load_layout
from .tasks.doom.health_gathering import DoomHealthGathering, DoomHealthGatheringSupreme
from .tasks.doom.my_way_home import EVERY_SPOT, DoomMyWayHome
from .tasks.doom.scenario import ANY_ANGLE
from .tasks.first_person import FirstPerson
from .tasks.goals import NavigationParams
from .tasks.health_gathering import HealthGathering
from .tasks.key_corridor import KeyCorridor
from .tasks.maze import Maze, MazeParams
from .tasks.navigation import Navigation

Build = Callable[..., AnyEnvironment]

_NAMING = ("name", "version")
SETTINGS = tuple(
    field.name for field in dataclasses.fields(FirstPerson) if field.name not in _NAMING
)
"""The settings that every environment takes which is seen in first person."""


@dataclasses.dataclass(frozen=True)
class Entry:
    """One registered environment.

    Attributes:
        summary: one line for people.
        build: makes the environment from its settings: a class, or a function. Settings of its
            own are its parameters by name; `**settings` stands for those of all.
        version: of the environment, which grows when its behaviour changes.
        family: environments of one family share a page of the documentation.
        module: what has to be imported for the id to be known; "" if nothing has.
    """

    summary: str
    build: Build
    version: int = 0
    family: str = ""
    module: str = ""

    @property
    def required(self) -> tuple[str, ...]:
        """The settings that it cannot do without."""
        parameters = inspect.signature(self.build).parameters
        needed = [one.name for one in parameters.values() if one.default is one.empty]
        return tuple(name for name in self.settings if name in needed)

    @functools.cached_property
    def settings(self) -> tuple[str, ...]:
        """The names of the settings that it takes."""
        bound = self.build.keywords if isinstance(self.build, functools.partial) else ()
        fixed = {*_NAMING, *bound}
        kinds = {one.name: one.kind for one in inspect.signature(self.build).parameters.values()}
        every = SETTINGS if inspect.Parameter.VAR_KEYWORD in kinds.values() else ()
        named = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
        own = [name for name, kind in kinds.items() if kind in named and name not in fixed]
        return *every, *(name for name in own if name not in every)


def _corridors(layout: str, horizon: int) -> Build:
    """A small map whose agent starts facing east."""

    def build(**settings: Any) -> Navigation:
        defaults = NavigationParams(max_steps_in_episode=horizon)
        return Navigation(tilemap=load_layout(layout), heading=0.0, defaults=defaults, **settings)

    return build


# ViZDoom's texture for both floor and ceiling, FLAT1_1, has the mean RGB (65, 46, 26).
_HOME_FLOOR = ((104, 84, 62), (84, 66, 46))
_HOME_CEILING = (52, 42, 34)


def _my_way_home(
    *,
    coloured: bool = True,
    spawn: tuple[int, int] | None = None,
    heading: tuple[float, float] | None = None,
) -> Build:
    """A variant of ViZDoom's My Way Home; `spawn` is the one start cell of the sparse ones."""

    def build(**settings: Any) -> Navigation:
        tilemap = load_layout("my-way-home", regions=coloured)
        return Navigation(
            tilemap=tilemap.with_spawns((spawn,)) if spawn else tilemap,
            heading=heading,
            floor=_HOME_FLOOR,
            ceiling=_HOME_CEILING,
            defaults=NavigationParams(
                max_steps_in_episode=2100, discount=0.999, living_reward=-0.0001
            ),
            **settings,
        )

    return build


# A move of one MiniGrid cell, or a turn of 90 degrees, is about 1 / 0.15 of our steps.
_STEPS_A_MOVE = 1 / 0.15


def _key_corridor(size: int, rows: int) -> Build:
    """KeyCorridorS<size>R<rows>, whose budget of 30 moves a tile of room is rescaled."""
    defaults = NavigationParams(max_steps_in_episode=round(30 * size**2 * _STEPS_A_MOVE))
    return functools.partial(KeyCorridor, room_size=size, room_rows=rows, defaults=defaults)


# Floor (two colours of a checker) of the mazes 01, 02 and 03 of DeepMind Lab, after the names of
# their textures, and the sky above them.
_LAB_FLOORS = (
    ((204, 118, 52), (184, 102, 42)),
    ((70, 112, 188), (60, 98, 170)),
    ((78, 150, 84), (66, 126, 150)),
)
_LAB_SKY = (142, 190, 228)
_LAB_HORIZON, _LAB_DISCOUNT = (1800, 4500, 9000), (0.999, 0.9995, 0.9999)
# Five cells of two tiles.
_LAB_START_DISTANCE = 10


def _dmlab(kind: str, number: int, *, respawn: bool) -> Build:
    """A navigation maze; `kind` is "static" or "random-goal"."""

    def build(**settings: Any) -> Maze:
        tilemap = load_layout(f"dmlab-{kind}-{number:02}", goal_required=False)
        cells = tilemap.apples
        if kind == "random-goal":
            tilemap = dataclasses.replace(tilemap, spawns=cells, goals=cells, apples=())
        elif not respawn:
            tilemap = dataclasses.replace(tilemap, apples=())
        drawn = len(cells) // 10 if kind == "random-goal" and respawn else 0
        return Maze(
            tilemap=tilemap,
            start_distance=_LAB_START_DISTANCE,
            respawn=respawn,
            drawn_apples=drawn,
            floor=_LAB_FLOORS[number - 1],
            ceiling=_LAB_SKY,
            defaults=MazeParams(
                max_steps_in_episode=_LAB_HORIZON[number - 1], discount=_LAB_DISCOUNT[number - 1]
            ),
            **settings,
        )

    return build


def _dmlab_entries() -> dict[str, Entry]:
    goals = {"static": "goal and starts fixed", "random-goal": "a new goal cell each episode"}
    ends = {False: "+10 ends", True: "+10, apples +1, respawns until time is up"}
    return {
        f"dmlab-{kind}-{number:02}{'-respawn' if respawn else ''}": Entry(
            f"DeepMind Lab's maze {number:02}: {goal}; {ends[respawn]}",
            _dmlab(kind, number, respawn=respawn),
            family=f"dmlab-{kind}",
        )
        for respawn in (False, True)
        for kind, goal in goals.items()
        for number in (1, 2, 3)
    }


def _key_corridor_entry(size: int, rows: int) -> Entry:
    name = f"MiniGrid's KeyCorridorS{size}R{rows}"
    return Entry(
        f"{name}: key, locked door, goal; a new layout each time",
        _key_corridor(size, rows),
        family="key-corridor",
    )


def _doom_home(summary: str, spots: tuple[int, ...], angles: tuple[int, int]) -> Entry:
    """A variant of Doom's own My Way Home, by the ids of its starts and its first headings."""
    build = functools.partial(DoomMyWayHome, spots=spots, angles=angles)
    return Entry(summary, build, family="doom-my-way-home")


# Doom's angles grow counter-clockwise, ours clockwise: 0 to 3.6 degrees there is -3.6 to 0 here.
ENTRIES: dict[str, Entry] = {
    "simple": Entry(
        "a ring corridor, goal in the opposite corner", _corridors("simple", 300), family="simple"
    ),
    "key-door": Entry(
        "a corridor with a red key, a red locked door and the goal behind it",
        _corridors("key-door", 300),
        family="key-door",
    ),
    "my-way-home": Entry(
        "ViZDoom's eight-room maze: 17 starts, any heading, one goal",
        _my_way_home(),
        family="my-way-home",
    ),
    "my-way-home-colorless": Entry(
        "my-way-home with all walls in one colour",
        _my_way_home(coloured=False),
        family="my-way-home",
    ),
    "my-way-home-sparse": Entry(
        "my-way-home from the western room, facing east",
        _my_way_home(spawn=(3, 10), heading=(-3.6, 0.0)),
        family="my-way-home",
    ),
    "my-way-home-very-sparse": Entry(
        "my-way-home from the end of the dead end, facing west",
        _my_way_home(spawn=(12, 26), heading=(176.4, 183.6)),
        family="my-way-home",
    ),
    "health-gathering": Entry(
        "ViZDoom's acid floor: medkits keep you alive", HealthGathering, family="health-gathering"
    ),
    "key-corridor": _key_corridor_entry(4, 3),
    "key-corridor-s3r1": _key_corridor_entry(3, 1),
    "key-corridor-s3r2": _key_corridor_entry(3, 2),
    "key-corridor-s3r3": _key_corridor_entry(3, 3),
    "key-corridor-s5r3": _key_corridor_entry(5, 3),
    "key-corridor-s6r3": _key_corridor_entry(6, 3),
    **_dmlab_entries(),
    "doom-my-way-home": _doom_home(
        "ViZDoom's My Way Home itself: Doom's motion, tic by tic", EVERY_SPOT, ANY_ANGLE
    ),
    "doom-my-way-home-sparse": _doom_home(
        "doom-my-way-home from the western room, facing east", (10,), (0, 655)
    ),
    "doom-my-way-home-very-sparse": _doom_home(
        "doom-my-way-home from the end of the dead end, facing west", (15,), (32112, 33423)
    ),
    "doom-health-gathering": Entry(
        "ViZDoom's Health Gathering itself: Doom's motion, tic by tic",
        DoomHealthGathering,
        family="doom-health-gathering",
    ),
    "doom-health-gathering-supreme": Entry(
        "ViZDoom's Health Gathering Supreme itself: walls, and poison among the medkits",
        DoomHealthGatheringSupreme,
        family="doom-health-gathering",
    ),
}

ALIASES: dict[str, str] = {
    "key-corridor-s4r3": "key-corridor",
    **{name.replace("random-goal", "random"): name for name in ENTRIES if "random-goal" in name},
}
"""Other names of environments, each with the id it stands for."""
