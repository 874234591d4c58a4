"""MiniGrid layouts to tile maps: a stand-in for its grid, and the package itself if it is there."""

from __future__ import annotations

import sys
import warnings
from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxenstein.errors import (
    JAXensteinError,
    MapError,
    MapWarning,
    SettingError,
    UnknownEnvironmentError,
)
from jaxenstein.maps import parse_ascii
from jaxenstein.maps.importers.minigrid import PREFIXES, convert, convert_id
from jaxenstein.maps.symbols import LOCKED_DOORS, UNLOCKED_DOORS
from jaxenstein.maps.things import KEY

COLOUR_ORDER = ["red", "green", "blue", "purple", "yellow", "grey"]
KEYS, DOORS, LOCKED = KEY.symbols, UNLOCKED_DOORS, LOCKED_DOORS


@dataclass
class Thing:
    """An object of MiniGrid's grid."""

    type: str
    color: str = "grey"
    is_open: bool = False
    is_locked: bool = False


# The things that maps keep, by the symbol of our text maps; `o` and `f` are open door and floor.
THINGS: dict[str, Thing | None] = {
    "#": Thing("wall"),
    ".": None,
    "S": None,
    "G": Thing("goal", "green"),
    "f": Thing("floor", "blue"),
    "o": Thing("door", "red", is_open=True),
    **{mark: Thing("key", color) for mark, color in zip(KEYS, COLOUR_ORDER, strict=True)},
    **{mark: Thing("door", color) for mark, color in zip(DOORS, COLOUR_ORDER, strict=True)},
    **{
        mark: Thing("door", color, is_locked=True)
        for mark, color in zip(LOCKED, COLOUR_ORDER, strict=True)
    },
}
REFUSED = {
    "l": Thing("lava", "red"),
    "x": Thing("box", "purple"),
    "q": Thing("ball", "blue"),
    "?": Thing("key", "pink"),
}


class Grid:
    def __init__(self, lines: list[str]) -> None:
        self.height, self.width = len(lines), len(lines[0])
        self._lines = lines

    def get(self, column: int, row: int) -> Thing | None:
        return (THINGS | REFUSED)[self._lines[row][column]]


class MiniGridEnv:
    """The parts of an environment that `convert` uses."""

    def __init__(self, text: str, direction: int = 0) -> None:
        lines = text.split()
        self.grid = Grid(lines)
        places = [(line.index("S"), row) for row, line in enumerate(lines) if "S" in line]
        self.agent_pos: Any = np.array(places[0]) if places else (-1, -1)
        self.agent_dir = np.int64(direction)
        self.carrying: Thing | None = None

    def step(self, action: int) -> None:
        """The original rules."""


class Wrapper:
    def __init__(self, env: Any) -> None:
        self.unwrapped = getattr(env, "unwrapped", env)


PLAIN = "#####\n#S.G#\n#####"


def test_every_element_is_converted() -> None:
    text = f"{'#' * 12}\n#S{KEYS}..G#\n#o{DOORS}f..#\n##{LOCKED}..f.\n"
    tilemap = convert(MiniGridEnv(text)).tilemap
    ours = text.replace("o", ".").replace("f", ".")
    assert tilemap.tile_text() == ours
    assert tilemap == parse_ascii(ours, "MiniGridEnv")


@settings(deadline=None, max_examples=50)
@given(st.data())
def test_any_grid_converts_tile_by_tile(data: st.DataObject) -> None:
    rows, columns = data.draw(st.integers(2, 6)), data.draw(st.integers(2, 6))
    marks = st.sampled_from([mark for mark in THINGS if mark not in "SG"])
    grid = np.array(data.draw(st.lists(marks, min_size=rows * columns, max_size=rows * columns)))
    start, goal = data.draw(
        st.lists(st.integers(0, grid.size - 1), min_size=2, max_size=2, unique=True)
    )
    grid[start], grid[goal] = "S", "G"
    lines = ["".join(row) for row in grid.reshape(rows, columns)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MapWarning)  # most of these cannot be solved
        tilemap = convert(MiniGridEnv("\n".join(lines))).tilemap
    expected = "".join(line + "\n" for line in lines).replace("o", ".").replace("f", ".")
    assert tilemap.tile_text() == expected
    assert tilemap.spawns == ((start % columns, start // columns),)
    assert tilemap.goals == ((goal % columns, goal // columns),)


def test_headings_are_quarter_turns_clockwise() -> None:
    found = [convert(MiniGridEnv(PLAIN, direction)).heading for direction in range(4)]
    assert found == [0.0, 90.0, 180.0, 270.0]
    assert all(type(heading) is float for heading in found)


def test_wrappers_are_unwrapped() -> None:
    env = MiniGridEnv(PLAIN)
    assert convert(Wrapper(Wrapper(env))) == convert(env)


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ("#####\n#S.l#\n#..G#", MapError, r"MiniGridEnv: lava at column 3, row 1 \(from 0\)"),
        ("#####\n#S.G#\n#.x.#", MapError, r"a purple box at column 2, row 2"),
        ("#####\n#SqG#", MapError, r"a blue ball at column 2, row 1"),
        ("#####\n#S?G#", MapError, r"a pink key at column 2, row 1.*red, green, blue"),
        ("#####\n#S..#", MapError, r"the map has no goal"),
        ("#####\n#SGG#", MapError, r"2 goals \(at column 2, row 1.* and column 3, row 1"),
        ("#####\n#..G#", SettingError, r"call its reset first"),
    ],
)
def test_unsupported_grids_are_refused(text: str, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        convert(MiniGridEnv(text))


def test_mid_episode_states_are_refused_if_a_map_cannot_hold_them() -> None:
    env = MiniGridEnv(PLAIN)
    env.carrying = Thing("key", "yellow")
    with pytest.raises(MapError, match="the agent carries a yellow key"):
        convert(env)
    env = MiniGridEnv(PLAIN)
    env.agent_pos = (3, 1)
    with pytest.raises(MapError, match="stands on the goal at column 3, row 1"):
        convert(env)


class RoomGridLevel(MiniGridEnv):
    mission = "go to the red ball"


class GoToLocal(RoomGridLevel):
    pass


class UnlockEnv(MiniGridEnv):
    pass


def test_rules_that_maps_lack_are_refused() -> None:
    with pytest.raises(SettingError, match=r"GoToLocal .* instruction .*'go to the red ball'"):
        convert(GoToLocal(PLAIN))
    with pytest.raises(SettingError, match="ends when a door is opened"):
        convert(UnlockEnv(PLAIN))


class Slippery(MiniGridEnv):
    def step(self, action: int) -> None:
        """Another rule."""


def test_unknown_rules_give_a_warning() -> None:
    with pytest.warns(MapWarning, match="Slippery changes what a step does") as caught:
        convert(Slippery(PLAIN))
    assert caught[0].filename == __file__


def test_unreachable_goal_gives_a_warning() -> None:
    with pytest.warns(MapWarning, match=r"column 3, row 1 .*need a key") as caught:
        convert(MiniGridEnv("#####\n#SRG#\n#####"))
    assert caught[0].filename == __file__


@pytest.mark.parametrize("thing", [None, 3, "MiniGrid-Empty-5x5-v0", Wrapper(object())])
def test_other_objects_are_refused(thing: Any) -> None:
    with pytest.raises(SettingError, match="is not a MiniGrid environment"):
        convert(thing)


@pytest.mark.parametrize("package", ["minigrid", "gymnasium"])
def test_error_names_missing_package(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(SettingError, match=r"pip install 'jaxenstein\[minigrid\]'"):
        convert_id("MiniGrid-Empty-5x5-v0", 0)


@pytest.mark.parametrize("seed", [-1, 1.0, None, True])
def test_bad_seeds(seed: Any) -> None:
    with pytest.raises(SettingError, match="seed must be a whole number"):
        convert_id("MiniGrid-Empty-5x5-v0", seed)


# From here on with the package.

CONVERTIBLE = ["Empty", "FourRooms", "DoorKey", "MultiRoom", "SimpleCrossing", "LockedRoom"]


@pytest.fixture(scope="module")
def gymnasium() -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pytest.importorskip("minigrid")
        return pytest.importorskip("gymnasium")


def reset(gymnasium: Any, id: str, seed: int) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of old versions
        env = gymnasium.make(id)
        env.reset(seed=seed)
    return env


def family(id: str) -> str:
    return id.split("-")[1].split("S9")[0].split("S11")[0]


def test_every_registered_id_converts_or_is_refused(gymnasium: Any) -> None:
    ids = [id for id in gymnasium.registry if id.startswith(PREFIXES) and "-WFC-" not in id]
    assert len(ids) > 100
    for id in ids:
        if id.startswith("MiniGrid-") and family(id) in CONVERTIBLE:
            assert convert_id(id, 0).tilemap.name == id
        else:
            with pytest.raises(JAXensteinError, match=id):
                convert_id(id, 0)


def text_of(env: Any) -> str:
    """The grid in our symbols, read from the numbers of `Grid.encode` (columns, rows, 3)."""
    codes = env.unwrapped.grid.encode()
    simple = {1: ".", 2: "#", 8: "G"}
    doors = ["." * 6, DOORS, LOCKED]
    lines = []
    for row in range(codes.shape[1]):
        things = [tuple(map(int, codes[column, row])) for column in range(codes.shape[0])]
        marks = [
            KEYS[colour] if kind == 5 else doors[state][colour] if kind == 4 else simple[kind]
            for kind, colour, state in things
        ]
        lines.append(marks)
    column, row = env.unwrapped.agent_pos
    lines[row][column] = "S"
    return "".join("".join(line) + "\n" for line in lines)


def distance(walkable: np.ndarray, start: tuple[int, int], goal: tuple[int, int]) -> int:
    """Length of the shortest path over bool[columns, rows]; -1 if there is none."""
    lengths, pending = {start: 0}, deque([start])
    while pending:
        column, row = cell = pending.popleft()
        for step in ((column + 1, row), (column - 1, row), (column, row + 1), (column, row - 1)):
            inside = all(
                0 <= place < size for place, size in zip(step, walkable.shape, strict=True)
            )
            if inside and walkable[step] and step not in lengths:
                lengths[step] = lengths[cell] + 1
                pending.append(step)
    return lengths.get(goal, -1)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "id",
    [
        "MiniGrid-Empty-Random-6x6-v0",
        "MiniGrid-FourRooms-v0",
        "MiniGrid-DoorKey-8x8-v0",
        "MiniGrid-MultiRoom-N6-v0",
        "MiniGrid-SimpleCrossingS11N5-v0",
        "MiniGrid-LockedRoom-v0",
    ],
)
def test_converted_map_equals_the_grid(gymnasium: Any, id: str, seed: int) -> None:
    env = reset(gymnasium, id, seed)
    found = convert(env)
    assert found == convert_id(id, seed)
    tilemap = found.tilemap
    assert tilemap.tile_text() == text_of(env)
    ahead = np.deg2rad(found.heading)
    assert np.round([np.cos(ahead), np.sin(ahead)]).tolist() == list(env.unwrapped.dir_vec)

    codes = env.unwrapped.grid.encode()[..., 0]
    ((goal_column, goal_row),) = np.argwhere(codes == 8).tolist()
    column, row = map(int, env.unwrapped.agent_pos)
    theirs = distance(codes != 2, (column, row), (goal_column, goal_row))
    walkable = tilemap.walls.T == 0
    for column, row in tilemap.door_tiles:
        walkable[column, row] = True
    assert theirs == distance(walkable, tilemap.spawns[0], tilemap.goals[0]) > 0


def test_error_for_unknown_id_names_similar_ids(gymnasium: Any) -> None:
    with pytest.raises(UnknownEnvironmentError, match="did you mean 'MiniGrid-FourRooms-v0'"):
        convert_id("MiniGrid-FourRoom-v0", 0)
    with pytest.raises(UnknownEnvironmentError, match="None"):
        convert_id(None, 0)  # pyright: ignore[reportArgumentType]


def test_environments_of_other_packages_are_refused(gymnasium: Any) -> None:
    with pytest.raises(SettingError, match="FrozenLake-v1 is not a MiniGrid environment"):
        convert_id("FrozenLake-v1", 0)


def test_nothing_is_printed(gymnasium: Any, capfd: pytest.CaptureFixture[str]) -> None:
    """Gymnasium warns of old versions, and MiniGrid of levels that it draws again."""
    convert_id("MiniGrid-MultiRoom-N4-S5-v0", 0)
    with pytest.raises(SettingError):
        convert_id("BabyAI-GoToSeqS5R2-v0", 0)
    assert capfd.readouterr() == ("", "")
