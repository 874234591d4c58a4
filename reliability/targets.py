"""The parsers and loaders of maps, settings and trajectories, as targets of fuzzing."""

from __future__ import annotations

import dataclasses
import functools
import importlib
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import jax

import jaxenstein
from jaxenstein import registry
from jaxenstein.cli.arguments import read_map, read_text
from jaxenstein.episodes.recorder import record
from jaxenstein.episodes.trajectory_file import load_trajectory
from jaxenstein.errors import SettingError
from jaxenstein.maps.ascii import layout_names, load_layout
from jaxenstein.maps.importers.dmlab import build_tilemap, read_maze
from jaxenstein.maps.reach import problems
from jaxenstein.maps.symbols import SYMBOLS
from tests.reference.labmaps import write_map

from .cases import Case, Target
from .mutate import Rng, as_text, spoil_bytes, spoil_grid, spoil_json, spoil_lines, spoil_words

FACE_WORDS = ("west", "east", "north", "south", "wset", "up")
LAB_WORDS = (
    *("classname", "worldspawn", "info_player_start", "goal", "apple_reward", "origin", "light"),
    *("{", "}", "(", ")", '"', "//", "patchDef2", "0", "100", "99.8", "-1", "1e9", "50 50 30"),
)
PICTURE = """
#########
#S..3..a#
#.#.#.#.#
#...#..@#
#.#.###.#
#......G#
#########
"""
DOORS = "#########\n#S.r..R.#\n#.#1#.#n#\n#@a..BG.#\n#########\n"
REGIONS = "         \n 11  22  \n 1   2 2 \n 3333    \n         \n"
FACES = "west\n1##2#####\n#       #\n# #1# # #\n#       #\n#########\n"


def spoil_map(data: bytes, rng: Rng) -> bytes:
    """A change of a text map."""
    known = tuple(SYMBOLS)
    ways: tuple[Callable[[bytes, Rng], bytes], ...] = (
        as_text(functools.partial(spoil_grid, known=known)),
        as_text(spoil_lines),
        as_text(functools.partial(spoil_words, known=FACE_WORDS)),
        spoil_bytes,
    )
    return rng.choices(ways, (5, 2, 1, 1))[0](data, rng)


def spoil_one(
    case: Case, rng: Rng, ways: Mapping[str, Callable[[bytes, Rng], bytes]], most: int = 1 << 20
) -> Case:
    """One file of a case changed, in the way of its suffix."""
    name = rng.choice(list(case.files))
    data = ways.get(Path(name).suffix, spoil_bytes)(case.files[name], rng)
    return dataclasses.replace(case, files={**case.files, name: data[:most]})


class Ascii:
    """Text maps with their regions or faces, up to an environment."""

    name, named, quiet = "ascii", False, True

    def seeds(self) -> list[Case]:
        """Small maps with everything, and some of the package's own."""
        seeds = [
            Case({"map.txt": DOORS.encode()}),
            Case({"map.txt": DOORS.encode(), "map.regions.txt": REGIONS.encode()}),
            Case({"map.txt": DOORS.encode(), "map.faces.txt": FACES.encode()}),
        ]
        for name in layout_names():
            tilemap = load_layout(name, goal_required=False)
            if tilemap.goals:
                files = {"map.txt": tilemap.tile_text().encode()}
                faces = tilemap.faces_text()
                files |= {} if faces is None else {"map.faces.txt": faces.encode()}
                seeds.append(Case(files))
        return seeds

    def spoil(self, case: Case, rng: Rng) -> Case:
        """A change of one of the texts, or one of them gone or added."""
        if rng.random() < 0.03:
            extra = rng.choice(("map.faces.txt", "map.regions.txt"))
            files = {name: data for name, data in case.files.items() if name != extra}
            if len(files) == len(case.files):
                files[extra] = rng.choice((REGIONS, FACES)).encode()
            return dataclasses.replace(case, files=files)
        return spoil_one(case, rng, {".txt": spoil_map})

    def run(self, case: Case, folder: Path) -> None:
        """Read the map, build the environment, and read its own text again."""
        texts = read_map(Path("map.txt"))
        env, _ = jaxenstein.from_ascii(**texts)
        tilemap = env.tilemap
        again, _ = jaxenstein.from_ascii(tilemap.tile_text(), faces=tilemap.faces_text())
        # A spawn or apple below a key, goal or other spawn has no sign of its own.
        assert again.tilemap.tiles == tilemap.tiles
        assert again.tilemap.faces == tilemap.faces
        assert env.level.columns.shape[0] >= tilemap.columns


class Lab:
    """DeepMind Lab's `.map` files, up to a text map."""

    name, named, quiet = "dmlab", True, True

    def seeds(self) -> list[Case]:
        """Small mazes as the files have them."""
        decals = {(0, 0, "west"): "lab_games/dec_img_style01_001_nonsquare"}
        texts = (write_map("###\n#S#\n###"), write_map(PICTURE), write_map(PICTURE, None, decals))
        return [Case({"maze.map": text.encode()}) for text in texts]

    def spoil(self, case: Case, rng: Rng) -> Case:
        """A change of words, lines or bytes."""
        words = as_text(functools.partial(spoil_words, known=LAB_WORDS))
        way = rng.choices((words, as_text(spoil_lines), spoil_bytes), (4, 2, 1))[0]
        return spoil_one(case, rng, {".map": way})

    def run(self, case: Case, folder: Path) -> None:
        """As `jaxenstein convert` does."""
        text = read_text(Path("maze.map"), "map")
        tilemap = build_tilemap(read_maze(text, "maze", source="maze.map"))
        problems(tilemap)
        tilemap.tile_text()
        tilemap.faces_text()


class Trajectories:
    """Trajectory files."""

    name, named, quiet = "trajectory", True, True

    @functools.cached_property
    def _texts(self) -> list[str]:
        made = []
        worlds = (
            jaxenstein.make("simple", height=12, width=16),
            jaxenstein.from_ascii("#####\n#S.G#\n#####", height=12, width=16, heading=0),
        )
        for env, params in worlds:
            trajectory = record(env, params, [2, 0, -1, 2], seed=3).trajectory
            assert trajectory is not None
            module = importlib.import_module("jaxenstein.episodes.trajectory")
            made.append(module.to_text(trajectory))
        return made

    def seeds(self) -> list[Case]:
        """Of an id and of a map."""
        return [Case({"walk.json": text.encode()}) for text in self._texts]

    def spoil(self, case: Case, rng: Rng) -> Case:
        """A change of an entry."""
        known = ("simple", "health-gathering", "custom", "dict", "depth", [[2, 3]], [0, 255, 0])
        return spoil_one(case, rng, {".json": functools.partial(spoil_json, known=known)})

    def run(self, case: Case, folder: Path) -> None:
        """Load it."""
        load_trajectory(Path("walk.json"))


class Settings:
    """What `make` and `from_ascii` are given, up to a reset that is traced."""

    name, named, quiet = "settings", False, True

    def seeds(self) -> list[Case]:
        """Every setting of an environment of each kind."""
        common: dict[str, Any] = {
            **{"height": 12, "width": 16, "field_of_view": 60.0, "observation": "rgb"},
            **{"autoreset": "same-step", "final_observation": False, "sprite_layers": 2},
        }
        painted = {"floor": [[1, 2, 3], [4, 5, 6]], "ceiling": [7, 8, 9], "heading": [-20, 20]}
        cases = [
            {"id": "simple", "settings": common},
            {"id": "health-gathering", "settings": {**common, "hud": True}},
            {"id": "key-corridor-s3r1", "settings": {**common, "layout_seed": 3}},
            {"text": DOORS, "settings": {**common, **painted, "name": "x"}},
        ]
        return [Case({"settings.json": json.dumps(case).encode()}) for case in cases]

    def spoil(self, case: Case, rng: Rng) -> Case:
        """A change of a setting."""
        known = ("next-step", None, "gray", "depth", "labels", "dict", [30, 120], 2)
        return spoil_one(case, rng, {".json": functools.partial(spoil_json, known=known)})

    def run(self, case: Case, folder: Path) -> None:
        """Make the environment and look at its first observation's shape."""
        given = _object(case.files["settings.json"])
        settings = _tuples(_table(given.get("settings", {})))
        if "text" in given:
            env, params = jaxenstein.from_ascii(**{**settings, "text": given["text"]})
        else:
            env, params = registry.make_with(given.get("id", "simple"), settings)
        jax.eval_shape(env.reset, jax.random.key(0), params)


def _object(data: bytes) -> dict[str, Any]:
    """The JSON object of a case; what is none is no case of this target."""
    try:
        return _table(json.loads(data))
    except (ValueError, RecursionError) as error:
        raise SettingError(f"not JSON: {error}") from error


def _table(value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise SettingError("not a table of names with values")
    # Names of their own arguments would be errors of Python's, not of the functions.
    return {name: entry for name, entry in value.items() if name not in ("text", "id", "self")} | {
        name: entry for name, entry in value.items() if name in ("text", "id")
    }


def _tuples(value: Any) -> Any:
    """Lists as tuples, as settings in Python are."""
    if isinstance(value, dict):
        return {name: _tuples(entry) for name, entry in value.items()}
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


TARGETS: dict[str, str] = {
    "ascii": "reliability.targets:Ascii",
    "dmlab": "reliability.targets:Lab",
    "trajectory": "reliability.targets:Trajectories",
    "settings": "reliability.targets:Settings",
    "config": "reliability.run_targets:Configurations",
    "run": "reliability.run_targets:Runs",
    "arguments": "reliability.argument_target:Arguments",
}
"""Where each target is, so that those of an extra are imported when they are used."""


@functools.cache
def open_target(name: str) -> Target:
    """The target of a name, made once."""
    module, _, kind = TARGETS[name].partition(":")
    return getattr(importlib.import_module(module), kind)()
