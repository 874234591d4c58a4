"""The environments that come with the package, one row per id.

Importing this module imports no task. A row imports its task when it is first used.
"""

from __future__ import annotations

import dataclasses
import functools
import importlib
import inspect
import math
from collections.abc import Callable, Mapping
from typing import Any

from .environment import AnyEnvironment

Build = Callable[..., AnyEnvironment]


@dataclasses.dataclass(frozen=True)
class Row:
    """The definition of an id.

    Attributes:
        id: the id without a version.
        family: environments of one family share a page of the documentation.
        source: "module:Class" in `jaxenstein.tasks`, or "module:function", where the function
            returns a `functools.partial` of a class. For a registered task, the class or function.
        summary: a one-line description.
        fixed: arguments of the class or function that `make` does not take.
        params: params whose defaults differ from those of the class.
        variant_of: the id that represents this one where not all environments are listed or
            tested; the two differ only in numbers such as sizes.
        version: increases when the behaviour of the environment changes.
        module: the module to import before the id is known; "" if none is needed.
    """

    id: str
    family: str
    source: str | Build
    summary: str
    fixed: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    params: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    variant_of: str = ""
    version: int = 0
    module: str = ""

    @functools.cached_property
    def build(self) -> Build:
        """The function that makes the environment from the settings of `make`."""
        if not isinstance(self.source, str):
            return self.source
        module, name = self.source.split(":")
        target = getattr(importlib.import_module(f"{__package__}.tasks.{module}"), name)
        is_class = isinstance(target, type)
        made: Any = functools.partial(target, **self.fixed) if is_class else target(**self.fixed)
        fields = made.func.__dataclass_fields__
        if "defaults" not in fields:
            assert not self.params, f"{target.__name__} has no field 'defaults' for params"
            return made
        return functools.partial(made, defaults=fields["defaults"].default.replace(**self.params))

    @functools.cached_property
    def settings(self) -> tuple[str, ...]:
        """The names of the settings of `make`: the keyword arguments of `build`.

        `**settings` in a function stands for the settings of all first-person environments.
        """
        from .tasks.first_person import SETTINGS

        bound = self.build.keywords if isinstance(self.build, functools.partial) else ()
        fixed = {"name", "version", *bound}
        kinds = {one.name: one.kind for one in inspect.signature(self.build).parameters.values()}
        every = SETTINGS if inspect.Parameter.VAR_KEYWORD in kinds.values() else ()
        named = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
        own = [name for name, kind in kinds.items() if kind in named and name not in fixed]
        return *every, *(name for name in own if name not in every)


def _row(
    family: str,
    shown: str,
    id: str,
    source: str,
    summary: str,
    steps: int = 0,
    params: Mapping[str, float] | None = None,
    version: int = 0,
    **fixed: Any,
) -> Row:
    """Make a row; {} in the id and the summary is filled in from `fixed` by name.

    The id `shown` represents the row, unless it is the row's own id. The time limit `steps`
    becomes a param; 0 keeps the default of the class.
    """
    words = {n: ("no", "yes")[v] if isinstance(v, bool) else v for n, v in fixed.items()}
    id, summary = id.format(**words), summary.format(**words)
    params = dict(params or {}) | ({"max_steps_in_episode": steps} if steps else {})
    return Row(id, family, source, summary, fixed, params, shown if id != shown else "", version)


# Our steps per MiniGrid move of one cell, and per turn of 90 degrees.
STEPS_A_MOVE = 1 / 0.15


def _grid(
    shown: str, id: str, source: str, moves: int, summary: str, version: int = 0, **fixed: Any
) -> Row:
    """A MiniGrid environment, with the time limit in MiniGrid moves."""
    names = f"minigrid-{shown}", f"minigrid-{id}", f"minigrid.{source}", f"MiniGrid: {summary}"
    return _row("minigrid", *names, round(moves * STEPS_A_MOVE), None, version, **fixed)


def _dmlab(kind: str, number: int, respawn: bool) -> Row:
    """A DeepMind Lab maze."""
    goal = "fixed goal and starts" if kind == "static" else "a new goal cell each episode"
    end = "goal +10, apples +1, respawns until the time limit" if respawn else "goal +10, then ends"
    steps, discount = ((1800, 0.999), (4500, 0.9995), (9000, 0.9999))[number - 1]
    id = f"dmlab-{kind}-{number:02}{'-respawn' * respawn}"
    summary, params = f"DeepMind Lab's maze {number:02}: {goal}; {end}", {"discount": discount}
    fixed = {"kind": kind, "number": number, "respawn": respawn}
    return _row(f"dmlab-{kind}", "", id, "maze:dmlab", summary, steps, params, **fixed)


def _doom(
    id: str,
    source: str,
    summary: str,
    version: int = 0,
    *,
    family: str = "",
    shown: str = "",
    **fixed: Any,
) -> Row:
    """A ViZDoom scenario; by default its family is the id that represents it."""
    id = f"doom-{id}"
    names = family or shown or id, shown, id, f"doom.{source}", f"ViZDoom's {summary}"
    return _row(*names, version=version, **fixed)


# For each kind of rule, the small MiniGrid world that represents similar ones.
_KEY, _LAVA, _BALLS = "door-key-6x6", "lava-crossing-s9n1", "dynamic-obstacles-6x6"
_BOXES, _ASKED = "obstructed-maze-1dlhb", "put-near-6x6-n2"
# Long steps in MiniWorld; the agent also reaches the box from farther away.
_FAST = {"move_distance": 0.7, "turn_angle": math.radians(45), "goal_radius": 1.736}
_LAYOUT = "navigation:from_layout"
# Sizes of DeepMind Lab's explore levels: in 2048 mazes, none has more than 16 or 35 doorways.
_SMALL, _LARGE = {"size": 11, "rooms": 4}, {"size": 17, "rooms": 9, "most": 3}
_LAB, _LARGER = "DeepMind Lab:", "the same in a larger maze"
_HALL = {"kind": "objects", "size": 13, "rooms": 1, "least": 11, "most": 11}

# fmt: off
ROWS: tuple[Row, ...] = (
    _row("simple", "", "simple", _LAYOUT, "a ring corridor, goal in the opposite corner", 300,
         layout="simple", heading=0.0),
    _row("key-door", "", "key-door", _LAYOUT,
         "a corridor with a red key, a red locked door and the goal behind it", 300,
         layout="key-door", heading=0.0),
    _row("t-maze", "", "t-maze", "t_maze:t_maze",
         "a key shows which arm pays, and soon disappears: memory"),
    *(_row("my-way-home", "", f"my-way-home{end}", "navigation:my_way_home", summary, 2100,
           {"discount": 0.999, "living_reward": -0.0001}, **fixed)
      for end, summary, fixed in (
          ("", "ViZDoom's eight-room maze: 17 starts, any heading, one goal", {}),
          ("-colorless", "my-way-home with all walls in one colour", {"regions": False}),
          ("-sparse", "my-way-home from the western room, facing east",
           {"spawn": (3, 10), "heading": (-3.6, 0.0)}),
          ("-very-sparse", "my-way-home from the end of the dead end, facing west",
           {"spawn": (12, 26), "heading": (176.4, 183.6)}))),
    _row("health-gathering", "", "health-gathering", "health_gathering:HealthGathering",
         "ViZDoom's acid floor: medkits keep you alive"),
    *(_row("key-corridor", "", "key-corridor" + f"-s{n}r{rows}" * (n != 4),
           "key_corridor:KeyCorridor", "MiniGrid's KeyCorridorS{room_size}R{room_rows}: key, "
           "locked door, goal; a new layout each time", round(30 * n**2 * STEPS_A_MOVE),
           room_size=n, room_rows=rows)
      for n, rows in ((4, 3), (3, 1), (3, 2), (3, 3), (5, 3), (6, 3))),
    *(_dmlab(kind, number, respawn)
      for respawn in (False, True) for kind in ("static", "random-goal") for number in (1, 2, 3)),
    *(_row("dmlab-explore", "dmlab-explore-goal-locations", f"dmlab-explore-{id}",
           "explore:level", summary, steps, {"reward": reward}, **fixed)
      for id, summary, steps, reward, fixed in (
          ("goal-locations", f"{_LAB} a goal to find again in a new maze", 1350, 10.0, _SMALL),
          ("goal-locations-large", _LARGER, 1800, 10.0, _LARGE),
          ("obstructed-goals", f"{_LAB} a goal behind doors, some closed", 1350, 10.0,
           {"doors": 20, **_SMALL}),
          ("obstructed-goals-large", _LARGER, 1800, 10.0, {"doors": 40, **_LARGE}),
          ("object-locations", f"{_LAB} apples to find again in a new maze", 1350, 1.0,
           {"kind": "apples", **_SMALL}),
          ("object-locations-large", _LARGER, 1800, 1.0, {"kind": "apples", **_LARGE}),
          ("object-rewards", f"{_LAB} learn which objects pay in this episode", 1350, 2.0,
           {"places": 8, **_HALL}),
          ("object-rewards-many", "the same with eight objects per round", 1800, 2.0,
           {"places": 16, **_HALL}))),
    *(_row("memory-maze", "memory-maze-9x9", "memory-maze-{size}x{size}", "memory_maze:maze",
           f"Memory Maze: fetch {{things}} things on request, for {steps} steps", steps,
           size=size, things=things)
      for size, things, steps in ((9, 3, 1000), (11, 4, 2000), (13, 5, 3000), (15, 6, 4000))),
    *(_row("miniworld", "miniworld-hallway", "miniworld-{name}", "miniworld.rooms:room", summary,
           steps, params, name=name)
      for name, summary, steps, params in (
          ("hallway", "MiniWorld: a red box at the end of a hall", 250, None),
          ("one-room", "MiniWorld: a red box anywhere in a room", 180, None),
          ("one-room-s6", "the same in a small room", 100, None),
          ("one-room-s6-fast", "the same with long steps", 50, _FAST),
          ("four-rooms", "MiniWorld: a red box in one of four rooms", 250, None),
          ("t-maze", "MiniWorld: a red box at one end of a T", 280, None),
          ("t-maze-left", "the same, always at the left end", 280, None),
          ("t-maze-right", "the same, always at the right end", 280, None),
          ("wall-gap", "MiniWorld: a red box behind a gap in a wall", 300, None),
          ("sidewalk", "MiniWorld: a red box beside a street that ends the episode", 150, None))),
    *(_row("miniworld", "miniworld-hallway", f"miniworld-maze{end}", "miniworld.box_maze:BoxMaze",
           summary, steps, params, cells=cells)
      for end, summary, steps, cells, params in (
          ("", "MiniWorld: a red box in a maze of 8 by 8 cells, new each time", 1536, 8, None),
          ("-s2", "the same in 2 by 2 cells", 96, 2, None),
          ("-s3", "the same in 3 by 3 cells", 216, 3, None),
          ("-s3-fast", "the same with long steps", 300, 3, _FAST))),
    *(_row("miniworld-objects", "miniworld-collect-health", f"miniworld-{id}",
           f"miniworld.{source}", f"MiniWorld: {summary}", steps, params)
      for id, source, summary, steps, params in (
          ("collect-health", "collect_health:CollectHealth", "pick up medkits to stay alive", 0,
           None),
          ("pickup-objects", "objects:PickupObjects", "pick up five things", 400,
           None),
          ("put-next", "objects:PutNext", "put the red box down beside the yellow one", 250,
           {"time_cost": 0.2}),
          ("sign", "sign:Sign", "a hidden sign shows the colour of the thing to touch", 0, None))),
    *(_grid(_KEY, "door-key-{size}x{size}", "doors:DoorKey", 10 * n**2,
            "a key, a locked door, and the goal behind it", size=n) for n in (5, 6, 8, 16)),
    _grid(_KEY, "four-rooms", "open_rooms:FourRooms", 100, "four rooms, start and goal anywhere"),
    *(_grid(_KEY, f"empty-{'random-' * bool(start)}{n}x{n}", "open_rooms:Empty", 4 * n**2,
            "an empty room, the goal in its corner", size=n, **start)
      for start, sizes in (({}, (5, 6, 8, 16)), ({"random_start": True}, (5, 6))) for n in sizes),
    *(_grid(_KEY, f"multi-room-{id}", "multi_room:MultiRoom", 20 * rooms,
            "a chain of {rooms} rooms joined by doors, the goal in the last",
            rooms=rooms, room_size=size)
      for id, rooms, size in (("n2-s4", 2, 4), ("n4-s5", 4, 5), ("n6", 6, 10))),
    *(_grid(shown, f"{id}-crossing-s{n}n{count}", "open_rooms:Crossing", 4 * n**2,
            f"cross {what} ({count}) through gaps", size=n, crossings=count, obstacle=obstacle)
      for shown, id, obstacle, what in (
          (_LAVA, "lava", "lava", "streams of lava"), (_KEY, "simple", "wall", "walls"))
      for n, count in ((9, 1), (9, 2), (9, 3), (11, 5))),
    *(_grid(_LAVA, "lava-gap-s{size}", "open_rooms:LavaGap", 4 * n**2,
            "a stream of lava with one gap", size=n) for n in (5, 6, 7)),
    *(_grid(_LAVA, f"dist-shift{number}", "open_rooms:DistShift", 252,
            "two strips of lava, the second in row {strip_row}", strip_row=row)
      for number, row in ((1, 2), (2, 5))),
    *(_grid(_BALLS, f"dynamic-obstacles-{'random-' * start}{n}x{n}", "open_rooms:DynamicObstacles",
            4 * n**2, "a room with moving balls ({obstacles}) to avoid",
            size=n, obstacles=count, random_start=start)
      for n, count, starts in ((5, 2, 2), (6, 3, 2), (8, 4, 1), (16, 8, 1))
      for start in (False, True)[:starts]),
    _grid(_KEY, "locked-room", "doors:LockedRoom", 190,
          "six rooms along a hall; one is locked, its key in another"),
    *(_grid(_KEY, "red-blue-doors-{size}x{size}", "doors:RedBlueDoors", 20 * n**2,
            "open the red door, then the blue one", size=n) for n in (6, 8)),
    _grid(_KEY, "unlock", "doors:Unlock", 288, "a key, and a locked door to open"),
    *(_grid(_BOXES, "blocked-" * blocked + "unlock-pickup", "doors:UnlockPickup", moves,
            "pick up the box behind a locked door", blocked=blocked)
      for blocked, moves in ((False, 288), (True, 576))),
    *(_grid(_KEY, "key-corridor-s{room_size}r{room_rows}", "doors:KeyCorridorBall", 30 * n**2,
            "key-corridor with its original goal: pick up the ball with empty hands", 1,
            room_size=n, room_rows=rows)
      for n, rows in ((3, 1), (3, 2), (3, 3), (4, 3), (5, 3), (6, 3))),
    *(_grid(_BOXES, f"obstructed-maze-{id}", "doors:ObstructedMaze", 144 * moves,
            "a ball behind locked doors; keys in boxes: {hidden}; doors blocked: {blocked}",
            quarters=quarters, start_aside=id[0] == "2", hidden=hidden, blocked=blocked)
      for id, moves, quarters, hidden, blocked in (
          ("1dl", 2, 0, False, False), ("1dlh", 2, 0, True, False), ("1dlhb", 2, 0, True, True),
          ("2dl", 4, 1, False, False), ("2dlh", 4, 1, True, False), ("2dlhb", 4, 1, True, True),
          ("1q", 5, 1, True, True), ("2q", 11, 2, True, True), ("full", 25, 4, True, True))),
    *(_grid(_KEY, f"memory-s{n}{'-random' * bool(length)}", "instructions:Memory", 5 * n**2,
            "find the thing of the first room at one end of a junction: memory", size=n, **length)
      for length, sizes in (({}, (7, 9, 11, 13)), ({"random_length": True}, (13, 17)))
      for n in sizes),
    *(_grid(_ASKED, "fetch-{size}x{size}-n{objects}", "instructions:Fetch", 5 * n**2,
            "pick up the requested one of {objects} things", size=n, objects=count)
      for n, count in ((5, 2), (6, 2), (8, 3))),
    *(_grid(_ASKED, "go-to-door-{size}x{size}", "instructions:GoToDoor", 4 * n**2,
            "say done beside the requested door", size=n) for n in (5, 6, 8)),
    *(_grid(_ASKED, "go-to-object-{size}x{size}-n2", "instructions:GoToObject", 5 * n**2,
            "say done beside the requested thing", size=n) for n in (6, 8)),
    *(_grid(_ASKED, "put-near-{size}x{size}-n{objects}", "instructions:PutNear", 5 * n,
            "put one of {objects} things near another, as requested", size=n, objects=count)
      for n, count in ((6, 2), (8, 3))),
    # Doom's angles grow counter-clockwise, those of my-way-home clockwise: 0 to 3.6 degrees in
    # Doom is -3.6 to 0 here.
    *(_row("doom-my-way-home", "", f"doom-my-way-home{end}", "doom.my_way_home:DoomMyWayHome",
           summary, spots=spots, angles=angles, hud=False, show_weapon=False)
      for end, spots, angles, summary in (
          ("", tuple(range(10, 27)), (0, 65536),
           "ViZDoom's My Way Home itself: Doom's motion, tic by tic"),
          ("-sparse", (10,), (0, 655), "doom-my-way-home from the western room, facing east"),
          ("-very-sparse", (15,), (32112, 33423),
           "doom-my-way-home from the end of the dead end, facing west"))),
    _doom("health-gathering", "health_gathering:DoomHealthGathering",
          "Health Gathering itself: Doom's motion, tic by tic",
          family="doom-health-gathering", supreme=False, show_weapon=False),
    _doom("health-gathering-supreme", "health_gathering:DoomHealthGathering",
          "Health Gathering Supreme itself: walls, and poison among the medkits",
          family="doom-health-gathering", supreme=True, show_weapon=False),
    _doom("basic", "basic:DoomBasic",
          "Basic itself: step aside until the monster is ahead, and shoot",
          hall="basic", rocket=False),
    _doom("simpler-basic", "basic:DoomBasic", "Simpler Basic itself: the monster is nearer",
          shown="doom-basic", hall="simpler-basic", rocket=False),
    _doom("defend-the-center", "defend_the_center:DoomDefendTheCenter",
          "Defend the Center itself: turn and shoot monsters from all sides", 2),
    _doom("defend-the-line", "defend_the_line:DoomDefendTheLine",
          "Defend the Line itself: turn and shoot monsters across a room", 2,
          shown="doom-defend-the-center"),
    _doom("take-cover", "take_cover:DoomTakeCover",
          "Take Cover itself: dodge the fireballs of more and more imps", 1),
    _doom("rocket-basic", "basic:DoomBasic",
          "Rocket Basic itself: a rocket takes a second to arrive",
          shown="doom-basic", hall="simpler-basic", rocket=True),
    _doom("predict-position", "predict_position:DoomPredictPosition",
          "Predict Position itself: one rocket for a monster that walks back and forth",
          shown="doom-basic"),
    _doom("deadly-corridor", "deadly_corridor:DoomDeadlyCorridor",
          "Deadly Corridor itself: past six marksmen to the armour", 2),
    _doom("deathmatch", "deathmatch:DoomDeathmatch",
          "Deathmatch itself for one player: endless monsters, seven weapons, pickups", 3),
)
# fmt: on
"""All environments, in the order in which they are listed."""

ENTRIES: dict[str, Row] = {row.id: row for row in ROWS}
"""The rows by id."""
ALIASES: dict[str, str] = {
    "key-corridor-s4r3": "key-corridor",
    **{name.replace("random-goal", "random"): name for name in ENTRIES if "random-goal" in name},
}
"""Other names of environments, each with its id."""
MAIN_IDS: tuple[str, ...] = tuple(name for name, row in ENTRIES.items() if not row.variant_of)
"""The ids that are not variants of another id; they have pictures and golden episodes."""
