"""Ids, and how to build what they name."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, Literal, get_args

from .environment import Environment, cast_params
from .errors import SettingError, UnknownEnvironmentError, nearest
from .maps.ascii import load_layout, parse_ascii
from .tasks.first_person import FirstPerson
from .tasks.navigation import Navigation, NavigationParams

EnvironmentId = Literal[
    "simple",
    "key-door",
    "my-way-home",
    "my-way-home-colorless",
    "my-way-home-sparse",
    "my-way-home-very-sparse",
]

# The settings that every environment takes.
SETTINGS = tuple(
    field.name for field in dataclasses.fields(FirstPerson) if field.name not in ("name", "version")
)


@dataclasses.dataclass(frozen=True)
class Entry:
    """One registered environment.

    Attributes:
        summary: one line for people.
        build: makes the environment from its settings.
    """

    summary: str
    build: Callable[..., Environment[Any, Any]]


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
}


def environment_ids() -> tuple[EnvironmentId, ...]:
    """All ids that `make` knows."""
    return get_args(EnvironmentId)


def make(id: EnvironmentId, **settings: Any) -> tuple[Environment[Any, Any], Any]:
    """Build an environment.

    Args:
        id: one of `environment_ids()`.
        **settings: static settings: `height`, `width` and `field_of_view` of the image,
            `observation`, `autoreset`, `final_observation`, `sprite_layers`; see
            `jaxenstein.tasks.first_person.FirstPerson` and `jaxenstein.Environment`.

    Returns:
        The environment and its default params, whose numbers `params.replace(...)` changes.

    Raises:
        UnknownEnvironmentError: there is no such id.
        SettingError: there is no such setting, or its value is out of range.
    """
    entry = ENTRIES.get(id) if isinstance(id, str) else None
    if entry is None:
        raise UnknownEnvironmentError(
            f"unknown environment {id!r}{nearest(str(id), ENTRIES)}; known: {', '.join(ENTRIES)}"
        )
    _check_names(settings, SETTINGS, NavigationParams)
    env = entry.build(name=id, **settings)
    return env, _on_device(env.default_params)


def from_ascii(text: str, **settings: Any) -> tuple[Navigation, NavigationParams]:
    """Build a navigation environment from a map in ASCII characters.

    Args:
        text: the map, one line a row of tiles; `jaxenstein list --symbols` prints the symbols.
            It needs at least one spawn `S` and one goal `G`.
        **settings: those of `make`, and `name`; `heading`, degrees of the first heading: None
            for any, a number, or (lowest, highest); `regions`, a second text of the same shape
            that gives floor cells the symbol of the walls around them; `floor` and `ceiling`,
            RGB colours.

    Returns:
        The environment and its default params (1000 steps in an episode, discount 0.99).

    Raises:
        MapError: with the line and column of what is wrong with the map.
        SettingError: there is no such setting, or its value is out of range.
    """
    known = (*SETTINGS, "name", "heading", "regions", "floor", "ceiling")
    _check_names(settings, known, NavigationParams)
    name = settings.get("name", "custom")
    tilemap = parse_ascii(text, name, regions=settings.pop("regions", None), stacklevel=3)
    env = Navigation(tilemap=tilemap, **settings)
    return env, _on_device(env.default_params)


def _on_device(params: Any) -> Any:
    """The params as arrays: a call that is given Python numbers transfers each of them anew."""
    return cast_params(params, params)


def _check_names(settings: dict[str, Any], known: tuple[str, ...], params: type) -> None:
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
