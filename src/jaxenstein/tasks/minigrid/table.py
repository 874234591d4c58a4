"""The worlds that MiniGrid registers: ids, settings, and horizons in its own moves.

Importing this module imports no task; building a world does.
"""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from ...environment import AnyEnvironment

# A move of one cell, or a turn of 90 degrees, is about 1 / 0.15 of our steps.
STEPS_A_MOVE = 1 / 0.15
PREFIX = "minigrid-"
# Of each kind of rule a small world, which is shown for those like it.
_KEY, _LAVA, _WANDERERS = "door-key-6x6", "lava-crossing-s9n1", "dynamic-obstacles-6x6"
_BOXES, _INSTRUCTION = "obstructed-maze-1dlhb", "put-near-6x6-n2"


class Worlds(NamedTuple):
    """Sizes and kinds of one world.

    Attributes:
        source: module of this package and class, with a colon between.
        summary: one line for people, with {} for settings by name.
        shown: the id that stands for all of them in pictures and tests, without the prefix.
        sizes: moves up to the horizon, and settings of the class, by id without the prefix.
        version: of all of them.
    """

    source: str
    summary: str
    shown: str
    sizes: Mapping[str, tuple[int, dict[str, Any]]]
    version: int = 0


def build(source: str, moves: int, settings: Mapping[str, Any]) -> Callable[..., AnyEnvironment]:
    """What makes a world from the settings that all environments share."""
    module, name = source.split(":")
    kind = getattr(importlib.import_module(f".{module}", __package__), name)
    usual = kind.__dataclass_fields__["defaults"].default
    defaults = usual.replace(max_steps_in_episode=round(moves * STEPS_A_MOVE))
    return functools.partial(kind, defaults=defaults, **settings)


def _square(sizes: tuple[int, ...], share: int, name: str, **settings: Any) -> dict[str, Any]:
    """Sizes whose horizon is a multiple of their area."""
    return {name.format(size=size): (share * size**2, {"size": size, **settings}) for size in sizes}


def _crossings(name: str, obstacle: str) -> dict[str, Any]:
    return {
        f"{name}-s{size}n{count}": (
            4 * size**2,
            {"size": size, "crossings": count, "obstacle": obstacle},
        )
        for size, count in ((9, 1), (9, 2), (9, 3), (11, 5))
    }


def _obstructed(visited: int, quarters: int, aside: bool, traits: str) -> tuple[int, dict]:
    hidden, blocked = "h" in traits, "b" in traits
    return 144 * visited, {
        "quarters": quarters,
        "start_aside": aside,
        "hidden": hidden,
        "blocked": blocked,
    }


WORLDS: tuple[Worlds, ...] = (
    Worlds(
        "doors:DoorKey",
        "a key, a locked door, and the goal behind it",
        _KEY,
        _square((5, 6, 8, 16), 10, "door-key-{size}x{size}"),
    ),
    Worlds(
        "open_rooms:FourRooms",
        "four rooms, start and goal anywhere",
        _KEY,
        {"four-rooms": (100, {})},
    ),
    Worlds(
        "open_rooms:Empty",
        "an empty room, the goal in its corner",
        _KEY,
        {
            **_square((5, 6, 8, 16), 4, "empty-{size}x{size}"),
            **_square((5, 6), 4, "empty-random-{size}x{size}", random_start=True),
        },
    ),
    Worlds(
        "multi_room:MultiRoom",
        "a chain of {rooms} rooms joined by doors, the goal in the last",
        _KEY,
        {
            "multi-room-n2-s4": (40, {"rooms": 2, "room_size": 4}),
            "multi-room-n4-s5": (80, {"rooms": 4, "room_size": 5}),
            "multi-room-n6": (120, {"rooms": 6, "room_size": 10}),
        },
    ),
    Worlds(
        "open_rooms:Crossing",
        "streams of lava ({crossings}) to cross by gaps",
        _LAVA,
        _crossings("lava-crossing", "lava"),
    ),
    Worlds(
        "open_rooms:Crossing",
        "walls ({crossings}) to cross by gaps",
        _KEY,
        _crossings("simple-crossing", "wall"),
    ),
    Worlds(
        "open_rooms:LavaGap",
        "a stream of lava with one gap",
        _LAVA,
        _square((5, 6, 7), 4, "lava-gap-s{size}"),
    ),
    Worlds(
        "open_rooms:DistShift",
        "two strips of lava, the second in row {strip_row}",
        _LAVA,
        {f"dist-shift{i}": (252, {"strip_row": row}) for i, row in ((1, 2), (2, 5))},
    ),
    Worlds(
        "open_rooms:DynamicObstacles",
        "a room in which balls wander ({obstacles}), which must not be walked into",
        _WANDERERS,
        {
            f"dynamic-obstacles-{'random-' * start}{size}x{size}": (
                4 * size**2,
                {"size": size, "obstacles": count, "random_start": start},
            )
            for start, size, count in (
                (False, 5, 2),
                (True, 5, 2),
                (False, 6, 3),
                (True, 6, 3),
                (False, 8, 4),
                (False, 16, 8),
            )
        },
    ),
    Worlds(
        "doors:LockedRoom",
        "six rooms at a hall, one locked, its key in another",
        _KEY,
        {"locked-room": (190, {})},
    ),
    Worlds(
        "doors:RedBlueDoors",
        "open the red door, then the blue one",
        _KEY,
        _square((6, 8), 20, "red-blue-doors-{size}x{size}"),
    ),
    Worlds("doors:Unlock", "a key, and a locked door to open", _KEY, {"unlock": (288, {})}),
    Worlds(
        "doors:UnlockPickup",
        "pick up the box behind a locked door",
        _BOXES,
        {
            "unlock-pickup": (288, {"blocked": False}),
            "blocked-unlock-pickup": (576, {"blocked": True}),
        },
    ),
    Worlds(
        "doors:KeyCorridorBall",
        "key-corridor by the source's rule: pick the ball up with empty hands",
        _KEY,
        {
            f"key-corridor-s{size}r{rows}": (30 * size**2, {"room_size": size, "room_rows": rows})
            for size, rows in ((3, 1), (3, 2), (3, 3), (4, 3), (5, 3), (6, 3))
        },
        version=1,
    ),
    Worlds(
        "doors:ObstructedMaze",
        "a ball behind locked doors, keys in boxes: {hidden}, balls before doors: {blocked}",
        _BOXES,
        {
            **{f"obstructed-maze-1dl{t}": _obstructed(2, 0, False, t) for t in ("", "h", "hb")},
            **{f"obstructed-maze-2dl{t}": _obstructed(4, 1, True, t) for t in ("", "h", "hb")},
            "obstructed-maze-1q": _obstructed(5, 1, False, "hb"),
            "obstructed-maze-2q": _obstructed(11, 2, True, "hb"),
            "obstructed-maze-full": _obstructed(25, 4, False, "hb"),
        },
    ),
    Worlds(
        "instructions:Memory",
        "a thing in a room, and its like at one end of a crossing: memory",
        _KEY,
        {
            **_square((7, 9, 11, 13), 5, "memory-s{size}"),
            **_square((13, 17), 5, "memory-s{size}-random", random_length=True),
        },
    ),
    Worlds(
        "instructions:Fetch",
        "pick up the one of {objects} things that is asked for",
        _INSTRUCTION,
        {
            f"fetch-{size}x{size}-n{count}": (5 * size**2, {"size": size, "objects": count})
            for size, count in ((5, 2), (6, 2), (8, 3))
        },
    ),
    Worlds(
        "instructions:GoToDoor",
        "say done beside the door that is asked for",
        _INSTRUCTION,
        _square((5, 6, 8), 4, "go-to-door-{size}x{size}"),
    ),
    Worlds(
        "instructions:GoToObject",
        "say done beside the thing that is asked for",
        _INSTRUCTION,
        _square((6, 8), 5, "go-to-object-{size}x{size}-n2"),
    ),
    Worlds(
        "instructions:PutNear",
        "put one of {objects} things down near another, as asked",
        _INSTRUCTION,
        {
            f"put-near-{size}x{size}-n{count}": (5 * size, {"size": size, "objects": count})
            for size, count in ((6, 2), (8, 3))
        },
    ),
)
"""All of them, in the order in which they are listed."""


def world_of(name: str) -> Worlds:
    """The world of an id, given without the prefix."""
    return next(world for world in WORLDS if name in world.sizes)
