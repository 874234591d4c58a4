"""The environments that come with the package: their ids, and what builds them.

Importing this module imports no task: an entry does when it is first built or asked about.
"""

from __future__ import annotations

import dataclasses
import functools
import importlib
import inspect
from collections.abc import Callable, Mapping
from typing import Any

from .environment import AnyEnvironment

Build = Callable[..., AnyEnvironment]


@dataclasses.dataclass(frozen=True)
class Entry:
    """One registered environment.

    Attributes:
        summary: one line for people.
        load: imports and returns `build`.
        version: of the environment, which grows when its behaviour changes.
        family: environments of one family share a page of the documentation.
        variant_of: another id, which stands for this one wherever environments are shown or tested
            one by one: this one differs in sizes and numbers alone.
        module: what has to be imported for the id to be known; "" if nothing has.
    """

    summary: str
    load: Callable[[], Build]
    version: int = 0
    family: str = ""
    variant_of: str = ""
    module: str = ""

    @functools.cached_property
    def build(self) -> Build:
        """Makes the environment from its settings: a class, or a function.

        Settings of its own are its parameters by name; `**settings` stands for those of all.
        """
        return self.load()

    @property
    def required(self) -> tuple[str, ...]:
        """The settings that it cannot do without."""
        parameters = inspect.signature(self.build).parameters
        needed = [one.name for one in parameters.values() if one.default is one.empty]
        return tuple(name for name in self.settings if name in needed)

    @functools.cached_property
    def settings(self) -> tuple[str, ...]:
        """The names of the settings that it takes."""
        from .tasks.first_person import SETTINGS

        bound = self.build.keywords if isinstance(self.build, functools.partial) else ()
        fixed = {"name", "version", *bound}
        kinds = {one.name: one.kind for one in inspect.signature(self.build).parameters.values()}
        every = SETTINGS if inspect.Parameter.VAR_KEYWORD in kinds.values() else ()
        named = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
        own = [name for name, kind in kinds.items() if kind in named and name not in fixed]
        return *every, *(name for name in own if name not in every)


def _corridors(layout: str) -> Build:
    """A small map whose agent starts facing east."""
    from .maps.ascii import load_layout
    from .tasks.goals import NavigationParams
    from .tasks.navigation import Navigation

    defaults = NavigationParams(max_steps_in_episode=300)
    return functools.partial(
        Navigation, tilemap=load_layout(layout), heading=0.0, defaults=defaults
    )


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
    from .maps.ascii import load_layout
    from .tasks.goals import NavigationParams
    from .tasks.navigation import Navigation

    tilemap = load_layout("my-way-home", regions=coloured)
    return functools.partial(
        Navigation,
        tilemap=tilemap.with_spawns((spawn,)) if spawn else tilemap,
        heading=heading,
        floor=_HOME_FLOOR,
        ceiling=_HOME_CEILING,
        defaults=NavigationParams(max_steps_in_episode=2100, discount=0.999, living_reward=-0.0001),
    )


def _t_maze() -> Build:
    from .maps.ascii import load_layout
    from .tasks.t_maze import DEFAULTS, TMaze

    return functools.partial(TMaze, tilemap=load_layout("t-maze"), defaults=DEFAULTS)


def _health_gathering() -> Build:
    from .tasks.health_gathering import HealthGathering

    return HealthGathering


def _key_corridor(size: int, rows: int) -> Build:
    """KeyCorridorS<size>R<rows>, whose budget of 30 moves a tile of room is rescaled."""
    from .tasks.goals import NavigationParams
    from .tasks.key_corridor import KeyCorridor
    from .tasks.minigrid.table import STEPS_A_MOVE

    defaults = NavigationParams(max_steps_in_episode=round(30 * size**2 * STEPS_A_MOVE))
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


def _dmlab(kind: str, number: int, respawn: bool) -> Build:
    """A navigation maze; `kind` is "static" or "random-goal"."""
    from .maps.ascii import load_layout
    from .tasks.maze import Maze, MazeParams

    tilemap = load_layout(f"dmlab-{kind}-{number:02}", goal_required=False)
    cells = tilemap.apples
    if kind == "random-goal":
        tilemap = dataclasses.replace(tilemap, spawns=cells, goals=cells, apples=())
    elif not respawn:
        tilemap = dataclasses.replace(tilemap, apples=())
    return functools.partial(
        Maze,
        tilemap=tilemap,
        start_distance=_LAB_START_DISTANCE,
        respawn=respawn,
        drawn_apples=len(cells) // 10 if kind == "random-goal" and respawn else 0,
        floor=_LAB_FLOORS[number - 1],
        ceiling=_LAB_SKY,
        defaults=MazeParams(
            max_steps_in_episode=_LAB_HORIZON[number - 1], discount=_LAB_DISCOUNT[number - 1]
        ),
    )


def _doom_home(spots: tuple[int, ...] = (), angles: tuple[int, int] | None = None) -> Build:
    """A variant of Doom's own My Way Home, by the ids of its starts and its first headings."""
    from .tasks.doom.my_way_home import ANY_ANGLE, EVERY_SPOT, DoomMyWayHome

    return functools.partial(DoomMyWayHome, spots=spots or EVERY_SPOT, angles=angles or ANY_ANGLE)


def _doom_health(*, supreme: bool = False) -> Build:
    from .tasks.doom.health_gathering import DoomHealthGathering, DoomHealthGatheringSupreme

    return DoomHealthGatheringSupreme if supreme else DoomHealthGathering


def _entry(family: str, summary: str, load: Callable[..., Build], **variant: Any) -> Entry:
    return Entry(summary, functools.partial(load, **variant), family=family)


_home = functools.partial(_entry, "my-way-home", load=_my_way_home)
_doom = functools.partial(_entry, "doom-my-way-home", load=_doom_home)


def _corridor_entry(size: int, rows: int) -> Entry:
    summary = (
        f"MiniGrid's KeyCorridorS{size}R{rows}: key, locked door, goal; a new layout each time"
    )
    return _entry("key-corridor", summary, _key_corridor, size=size, rows=rows)


def _dmlab_entries() -> dict[str, Entry]:
    goals = {"static": "goal and starts fixed", "random-goal": "a new goal cell each episode"}
    ends = {False: "+10 ends", True: "+10, apples +1, respawns until time is up"}
    return {
        f"dmlab-{kind}-{number:02}{'-respawn' if respawn else ''}": _entry(
            f"dmlab-{kind}",
            f"DeepMind Lab's maze {number:02}: {goal}; {ends[respawn]}",
            _dmlab,
            kind=kind,
            number=number,
            respawn=respawn,
        )
        for respawn in (False, True)
        for kind, goal in goals.items()
        for number in (1, 2, 3)
    }


def _maze(module: str, name: str) -> Build:
    return importlib.import_module(f"{__package__}.tasks.{module}").build(name)


def _maze_entries() -> dict[str, Entry]:
    from .tasks.maze_table import FAMILIES

    return {
        name: dataclasses.replace(
            _entry(family, summary, _maze, module=module, name=name),
            variant_of="" if name == next(iter(summaries)) else next(iter(summaries)),
        )
        for family, (module, summaries) in FAMILIES.items()
        for name, summary in summaries.items()
    }


def _minigrid_entries() -> dict[str, Entry]:
    from .tasks.minigrid.table import PREFIX, WORLDS, build

    return {
        PREFIX + name: Entry(
            f"MiniGrid: {world.summary.format(**_in_words(settings))}",
            functools.partial(build, world.source, moves, settings),
            world.version,
            family="minigrid",
            variant_of="" if name == world.shown else PREFIX + world.shown,
        )
        for world in WORLDS
        for name, (moves, settings) in world.sizes.items()
    }


def _in_words(settings: Mapping[str, Any]) -> dict[str, Any]:
    words = {True: "yes", False: "no"}
    return {n: words[v] if isinstance(v, bool) else v for n, v in settings.items()}


def _doom_shooter(module: str, kind: str) -> Build:
    return getattr(importlib.import_module(f"{__package__}.tasks.doom.{module}"), kind)


def _doom_entries() -> dict[str, Entry]:
    from .tasks.doom.table import SHOOTERS

    return {
        name: Entry(
            f"ViZDoom's {scenario.summary}",
            functools.partial(_doom_shooter, scenario.module, scenario.kind),
            scenario.version,
            family=scenario.main or name,
            variant_of=scenario.main,
        )
        for name, scenario in SHOOTERS.items()
    }


# Doom's angles grow counter-clockwise, ours clockwise: 0 to 3.6 degrees there is -3.6 to 0 here.
ENTRIES: dict[str, Entry] = {
    "simple": _entry(
        "simple", "a ring corridor, goal in the opposite corner", _corridors, layout="simple"
    ),
    "key-door": _entry(
        "key-door",
        "a corridor with a red key, a red locked door and the goal behind it",
        _corridors,
        layout="key-door",
    ),
    "t-maze": _entry("t-maze", "a key that is soon gone tells which arm pays: memory", _t_maze),
    "my-way-home": _home("ViZDoom's eight-room maze: 17 starts, any heading, one goal"),
    "my-way-home-colorless": _home("my-way-home with all walls in one colour", coloured=False),
    "my-way-home-sparse": _home(
        "my-way-home from the western room, facing east", spawn=(3, 10), heading=(-3.6, 0.0)
    ),
    "my-way-home-very-sparse": _home(
        "my-way-home from the end of the dead end, facing west",
        spawn=(12, 26),
        heading=(176.4, 183.6),
    ),
    "health-gathering": _entry(
        "health-gathering", "ViZDoom's acid floor: medkits keep you alive", _health_gathering
    ),
    "key-corridor": _corridor_entry(4, 3),
    "key-corridor-s3r1": _corridor_entry(3, 1),
    "key-corridor-s3r2": _corridor_entry(3, 2),
    "key-corridor-s3r3": _corridor_entry(3, 3),
    "key-corridor-s5r3": _corridor_entry(5, 3),
    "key-corridor-s6r3": _corridor_entry(6, 3),
    **_dmlab_entries(),
    **_maze_entries(),
    **_minigrid_entries(),
    "doom-my-way-home": _doom("ViZDoom's My Way Home itself: Doom's motion, tic by tic"),
    "doom-my-way-home-sparse": _doom(
        "doom-my-way-home from the western room, facing east", spots=(10,), angles=(0, 655)
    ),
    "doom-my-way-home-very-sparse": _doom(
        "doom-my-way-home from the end of the dead end, facing west",
        spots=(15,),
        angles=(32112, 33423),
    ),
    "doom-health-gathering": _entry(
        "doom-health-gathering",
        "ViZDoom's Health Gathering itself: Doom's motion, tic by tic",
        _doom_health,
    ),
    "doom-health-gathering-supreme": _entry(
        "doom-health-gathering",
        "ViZDoom's Health Gathering Supreme itself: walls, and poison among the medkits",
        _doom_health,
        supreme=True,
    ),
    **_doom_entries(),
}

ALIASES: dict[str, str] = {
    "key-corridor-s4r3": "key-corridor",
    **{name.replace("random-goal", "random"): name for name in ENTRIES if "random-goal" in name},
}
"""Other names of environments, each with the id it stands for."""

MAIN_IDS: tuple[str, ...] = tuple(name for name, entry in ENTRIES.items() if not entry.variant_of)
"""The ids that are variants of no other: the ones with pictures, golden episodes and tests."""
