"""Ids, and how to build what they name."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal, get_args

from .environment import Environment
from .errors import MapError, SettingError, UnknownEnvironmentError, nearest
from .maps.ascii import load_layout, parse_ascii
from .maps.map_files import read_map
from .tasks.first_person import FirstPerson
from .tasks.health_gathering import HealthGathering
from .tasks.key_corridor import KeyCorridor
from .tasks.maze import Maze, MazeParams
from .tasks.navigation import Navigation, NavigationParams

EnvironmentId = Literal[
    "simple",
    "key-door",
    "my-way-home",
    "my-way-home-colorless",
    "my-way-home-sparse",
    "my-way-home-very-sparse",
    "health-gathering",
    "key-corridor",
    "key-corridor-s3r1",
    "key-corridor-s3r2",
    "key-corridor-s3r3",
    "key-corridor-s5r3",
    "key-corridor-s6r3",
    "dmlab-static-01",
    "dmlab-static-02",
    "dmlab-static-03",
    "dmlab-random-goal-01",
    "dmlab-random-goal-02",
    "dmlab-random-goal-03",
    "dmlab-static-01-respawn",
    "dmlab-static-02-respawn",
    "dmlab-static-03-respawn",
    "dmlab-random-goal-01-respawn",
    "dmlab-random-goal-02-respawn",
    "dmlab-random-goal-03-respawn",
]

# The settings that every environment takes.
SETTINGS = tuple(
    field.name for field in dataclasses.fields(FirstPerson) if field.name not in ("name", "version")
)

# Settings of some environments alone, by how their ids begin.
OWN_SETTINGS = {"health-gathering": ("hud",), "key-corridor": ("layout_seed",)}


@dataclasses.dataclass(frozen=True)
class Entry:
    """One registered environment.

    Attributes:
        summary: one line for people.
        build: makes the environment from its settings.
        version: of the environment, which grows when its behaviour changes.
    """

    summary: str
    build: Callable[..., Environment[Any, Any]]
    version: int = 0


def _corridors(layout: str, horizon: int) -> Callable[..., Navigation]:
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
) -> Callable[..., Navigation]:
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


def _key_corridor(size: int, rows: int) -> Callable[..., KeyCorridor]:
    """KeyCorridorS<size>R<rows>, whose budget of 30 moves a tile of room is rescaled."""
    horizon = round(30 * size**2 * _STEPS_A_MOVE)

    def build(**settings: Any) -> KeyCorridor:
        defaults = NavigationParams(max_steps_in_episode=horizon)
        return KeyCorridor(room_size=size, room_rows=rows, defaults=defaults, **settings)

    return build


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


def _dmlab(kind: str, number: int, *, respawn: bool) -> Callable[..., Maze]:
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
        )
        for respawn in (False, True)
        for kind, goal in goals.items()
        for number in (1, 2, 3)
    }


def _key_corridor_entry(size: int, rows: int) -> Entry:
    name = f"MiniGrid's KeyCorridorS{size}R{rows}"
    return Entry(
        f"{name}: key, locked door, goal; a new layout each time", _key_corridor(size, rows)
    )


# Doom's angles grow counter-clockwise, ours clockwise: 0 to 3.6 degrees there is -3.6 to 0 here.
ENTRIES: dict[str, Entry] = {
    "simple": Entry("a ring corridor, goal in the opposite corner", _corridors("simple", 300)),
    "key-door": Entry(
        "a corridor with a red key, a red locked door and the goal behind it",
        _corridors("key-door", 300),
    ),
    "my-way-home": Entry(
        "ViZDoom's eight-room maze: 17 starts, any heading, one goal", _my_way_home()
    ),
    "my-way-home-colorless": Entry(
        "my-way-home with all walls in one colour", _my_way_home(coloured=False)
    ),
    "my-way-home-sparse": Entry(
        "my-way-home from the western room, facing east",
        _my_way_home(spawn=(3, 10), heading=(-3.6, 0.0)),
    ),
    "my-way-home-very-sparse": Entry(
        "my-way-home from the end of the dead end, facing west",
        _my_way_home(spawn=(12, 26), heading=(176.4, 183.6)),
    ),
    "health-gathering": Entry("ViZDoom's acid floor: medkits keep you alive", HealthGathering),
    "key-corridor": _key_corridor_entry(4, 3),
    "key-corridor-s3r1": _key_corridor_entry(3, 1),
    "key-corridor-s3r2": _key_corridor_entry(3, 2),
    "key-corridor-s3r3": _key_corridor_entry(3, 3),
    "key-corridor-s5r3": _key_corridor_entry(5, 3),
    "key-corridor-s6r3": _key_corridor_entry(6, 3),
    **_dmlab_entries(),
}

ALIASES: dict[str, str] = {
    "key-corridor-s4r3": "key-corridor",
    **{name.replace("random-goal", "random"): name for name in ENTRIES if "random-goal" in name},
}
"""Other names of environments, each with the id it stands for."""


def environment_ids() -> tuple[EnvironmentId, ...]:
    """All ids that `make` knows.

    Examples:
        >>> environment_ids()[:3]
        ('simple', 'key-door', 'my-way-home')
    """
    return get_args(EnvironmentId)


def make(id: EnvironmentId | str, **settings: Any) -> tuple[Environment[Any, Any], Any]:
    """Build an environment.

    Args:
        id: one of `environment_ids()`.
        **settings: static settings: `height`, `width` and `field_of_view` of the image,
            `observation`, `autoreset`, `final_observation`, `frame_skip`, `sprite_layers`; see
            `jaxenstein.tasks.first_person.FirstPerson` and `jaxenstein.Environment`. Besides,
            `hud` of health-gathering and `layout_seed` of key-corridor.

    Returns:
        The environment and its default params, whose numbers `params.replace(...)` changes.

    Raises:
        UnknownEnvironmentError: there is no such id.
        SettingError: there is no such setting, or its value is out of range.

    Examples:
        >>> env, params = make("my-way-home", width=84, height=84)
        >>> env.observation_space().shape, env.action_names
        ((84, 84, 3), ('turn left', 'turn right', 'forward', 'backward', 'interact'))
        >>> int(params.replace(max_steps_in_episode=500).max_steps_in_episode)
        500
        >>> make("my-way-hom")
        Traceback (most recent call last):
        jaxenstein.errors.UnknownEnvironmentError: unknown environment 'my-way-hom', did you...
    """
    return make_with(id, settings)


def make_with(id: Any, settings: Mapping[str, Any]) -> tuple[Environment[Any, Any], Any]:
    """As `make`, with settings of a file, which may have any names, `"id"` among them."""
    name = ALIASES.get(id, id) if isinstance(id, str) else id
    entry = ENTRIES.get(name) if isinstance(name, str) else None
    if entry is None:
        close = nearest(str(id), [*ENTRIES, *ALIASES])
        raise UnknownEnvironmentError(
            f"unknown environment {id!r}{close}; known: {', '.join(ENTRIES)}"
        )
    _check_names(settings, (*SETTINGS, *_own_settings(name)), MazeParams)
    env = entry.build(name=name, version=entry.version, **settings)
    return env, env.check_params()


def _own_settings(name: str) -> tuple[str, ...]:
    lists = (own for start, own in OWN_SETTINGS.items() if name.startswith(start))
    return next(lists, ())


def from_ascii(text: str, **settings: Any) -> tuple[Navigation, NavigationParams]:
    r"""Build a navigation environment from a map in ASCII characters.

    Args:
        text: the map, one line a row of tiles; `jaxenstein list --symbols` prints the symbols.
            It needs at least one spawn `S` and one goal `G`.
        **settings: those of `make`, and `name`; `heading`, degrees of the first heading: None
            for any, a number, or (lowest, highest); `regions`, a second text of the same shape
            that gives floor cells the symbol of the walls around them, or `faces`, one that says
            what each face of a wall shows; `floor` and `ceiling`, RGB colours.

    Returns:
        The environment and its default params (1000 steps in an episode, discount 0.99).

    Raises:
        MapError: with the line and column of what is wrong with the map.
        SettingError: there is no such setting, or its value is out of range.

    Examples:
        >>> import jax
        >>> env, params = from_ascii("#####\n#S G#\n#####", heading=0)
        >>> obs, state = env.reset(jax.random.key(0), params)
        >>> state.position.tolist(), obs.shape
        ([1.5, 1.5], (64, 64, 3))
        >>> from_ascii("#####\n#S ?#\n#####")
        Traceback (most recent call last):
        jaxenstein.errors.MapError: line 2, column 4: unknown symbol '?'; the symbols are ...
    """
    try:
        return _from_texts(text, settings)
    except MapError as error:
        if isinstance(text, Path) or (isinstance(text, str) and re.fullmatch(r"[^#]+\.\w+", text)):
            hint = f"; if {str(text)!r} is the name of a file: from_file reads one"
            raise MapError(f"{error}{hint}") from error
        raise


def from_file(path: str | Path, **settings: Any) -> tuple[Navigation, NavigationParams]:
    """Build a navigation environment from the file of a map in ASCII characters.

    Args:
        path: the map. Of `maze.txt`, `maze.regions.txt` or `maze.faces.txt` beside it says how
            the walls look.
        **settings: those of `from_ascii`; the `name` is by default that of the file.

    Returns:
        As `from_ascii`.

    Raises:
        MapError: a file cannot be read, or is no map.
        SettingError: there is no such setting, or its value is out of range.
    """
    path = Path(path)
    texts = read_map(path)
    return _from_texts(texts.pop("text"), {"name": path.stem, **texts, **settings})


def _from_texts(text: str, settings: dict[str, Any]) -> tuple[Navigation, NavigationParams]:
    """As `from_ascii`; warnings name the line of the caller's caller."""
    known = (*SETTINGS, "name", "heading", "regions", "faces", "floor", "ceiling")
    _check_names(settings, known, NavigationParams)
    name = settings.get("name", "custom")
    painted = {kind: settings.pop(kind, None) for kind in ("regions", "faces")}
    tilemap = parse_ascii(text, name, **painted, stacklevel=4)
    env = Navigation(tilemap=tilemap, **settings)
    return env, env.check_params()


def _check_names(settings: Mapping[str, Any], known: tuple[str, ...], params: type) -> None:
    numbers = {field.name for field in dataclasses.fields(params)}
    for name in settings:
        if name in numbers and name not in known:
            raise SettingError(
                f"{name!r} is a param, not a setting: use params.replace({name}=...) on the "
                "params that make returns"
            )
        if name not in known:
            raise SettingError(
                f"unknown setting {name!r}{nearest(name, known)}; known: {', '.join(known)}"
            )
