"""The targets of fuzzing: readers of maps, pictures, settings, trajectories, configs and runs."""

from __future__ import annotations

import functools
import importlib
import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax

import jaxenstein
from jaxenstein import registry
from jaxenstein.episodes.recorder import record
from jaxenstein.episodes.trajectory_file import load_trajectory
from jaxenstein.errors import SettingError
from jaxenstein.maps.ascii import layout_names, load_layout
from jaxenstein.maps.importers.dmlab import build_tilemap, read_maze
from jaxenstein.maps.map_files import read_map, read_text
from jaxenstein.maps.reach import problems
from jaxenstein.maps.symbols import SYMBOLS
from jaxenstein.spec import spec_of
from jaxenstein.tasks.doom.wad import Wad
from tests.reference.labmaps import write_map
from tests.reference.wads import small_lumps, write_wad

from .spoil import (
    LINES,
    SIGNS,
    TOKENS,
    Case,
    Target,
    flip_bytes,
    text_spoiler,
    tree_spoiler,
)

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


def case(**texts: str | None) -> Case:
    """A case of text files; `a__b` stands for `a.b`."""
    files = {name.replace("__", "."): text.encode() for name, text in texts.items() if text}
    return Case(files)


def maps() -> Target:
    """Text maps with regions or faces: small maps with everything, and the package's maps."""
    seeds = [
        case(map__txt=DOORS),
        case(map__txt=DOORS, map__regions__txt=REGIONS),
        case(map__txt=DOORS, map__faces__txt=FACES),
    ]
    for name in layout_names():
        tilemap = load_layout(name, goal_required=False)
        if tilemap.goals:
            seeds.append(case(map__txt=tilemap.tile_text(), map__faces__txt=tilemap.faces_text()))
    faces = text_spoiler(TOKENS, ("west", "east", "north", "south", "wset", "up"))
    signs = text_spoiler(SIGNS, tuple(SYMBOLS))
    return Target(seeds, _read_map, {".txt": (signs, signs, signs, text_spoiler(LINES), faces)})


def _read_map(_: Case) -> None:
    """Read a map into an environment, and check that its text gives the same map."""
    env, _params = jaxenstein.from_ascii(**read_map(Path("map.txt")))
    tilemap = env.tilemap
    again, _params = jaxenstein.from_ascii(tilemap.tile_text(), faces=tilemap.faces_text())
    # A spawn or apple below a key, goal or other spawn has no symbol of its own.
    assert again.tilemap.tiles == tilemap.tiles
    assert again.tilemap.faces == tilemap.faces
    assert env.level.column_bits.shape[0] >= tilemap.columns


def lab() -> Target:
    """DeepMind Lab's `.map` files, converted to text maps as by `jaxenstein convert`."""
    decals = {(0, 0, "west"): "lab_games/dec_img_style01_001_nonsquare"}
    texts = write_map("###\n#S#\n###"), write_map(PICTURE), write_map(PICTURE, None, decals)

    def read(_: Case) -> None:
        text = read_text(Path("maze.map"), "map")
        tilemap = build_tilemap(read_maze(text, "maze", source="maze.map"))
        problems(tilemap)
        tilemap.tile_text()
        tilemap.faces_text()

    words = text_spoiler(TOKENS, LAB_WORDS)
    ways = {".map": (words, words, text_spoiler(LINES))}
    return Target([case(maze__map=text) for text in texts], read, ways, named=True)


def wads() -> Target:
    """WAD files; every picture is decoded."""

    def read(_: Case) -> None:
        wad = Wad("small.wad")
        if wad.names("F"):
            assert (wad.palette().shape, wad.colormap().shape) == ((256, 3), (34, 256))
        for name in wad.names("F"):
            assert wad.flat(name).shape == (64, 64)
        for name in wad.textures():
            assert wad.texture(name).ndim == 2
        for name in wad.names("S"):
            assert len(wad.sprite(name[:4], name[4:5])) == 8

    whole = [part for part in small_lumps() if part[0] != "TROOB1"]
    pictures = [part for part in whole if len(part[1]) < 500]
    seeds = [Case({"small.wad": write_wad(parts)}) for parts in (pictures, pictures, whole)]
    return Target(seeds, read, {".wad": (flip_bytes,) * 9}, named=True)


def trajectories() -> Target:
    """Trajectory files with an id and with a map."""
    worlds = (
        jaxenstein.make("simple", height=12, width=16),
        jaxenstein.from_ascii("#####\n#S.G#\n#####", height=12, width=16, heading=0),
    )
    to_text = importlib.import_module("jaxenstein.trajectory").to_text
    made = [record(env, params, [2, 0, -1, 2], seed=3).trajectory for env, params in worlds]
    known = ("simple", "health-gathering", "custom", "dict", "depth", [[2, 3]], [0, 255, 0])
    return Target(
        [case(walk__json=to_text(trajectory)) for trajectory in made],
        lambda _: load_trajectory(Path("walk.json")),
        {".json": (tree_spoiler(known),) * 9},
        named=True,
    )


def results() -> Target:
    """Files of results with an id and with a map."""
    worlds = (
        jaxenstein.make("simple", height=12, width=16),
        jaxenstein.from_ascii("#####\n#S.G#\n#####", height=12, width=16, heading=0),
    )
    module = importlib.import_module("jaxenstein.results")
    arrays = {"returns": [[0.5, 1]], "lengths": [[3, 4]], "successes": [[True, False]]}
    made = [
        module.Results(environment=spec_of(*world), policy="mine", names=("mine",), **arrays)
        for world in worlds
    ]
    plain = {"format": module.FORMAT, "version": module.VERSION}
    files = [case(r__json=json.dumps(plain | {"results": [one.to_json()]})) for one in made]
    known = ("greedy", None, [1.0, 2], [True, False], 2**40, "simple")

    def read(_: Case) -> None:
        for one in jaxenstein.read_results("r.json"):
            jaxenstein.write_results("again.json", [one])
            (again,) = jaxenstein.read_results("again.json")
            Path("again.json").unlink()
            assert again.to_json() == one.to_json()

    return Target(files, read, {".json": (tree_spoiler(known),) * 9}, named=True)


def settings() -> Target:
    """Arguments of `make` and `from_ascii`, for each kind of environment."""
    common: dict[str, Any] = {
        **{"height": 12, "width": 16, "field_of_view": 60.0, "observation": "rgb"},
        **{"autoreset": "same-step", "final_observation": False, "sprite_layers": 2},
        "frame_skip": 2,
    }
    painted = {"floor": [[1, 2, 3], [4, 5, 6]], "ceiling": [7, 8, 9], "heading": [-20, 20]}
    given = [
        {"id": "simple", "settings": common},
        {"id": "health-gathering", "settings": {**common, "hud": True}},
        {"id": "key-corridor-s3r1", "settings": {**common, "layout_seed": 3}},
        {"text": DOORS, "settings": {**common, **painted, "name": "x"}},
    ]
    known = ("next-step", None, "gray", "depth", "labels", "dict", [30, 120], 2)
    seeds = [case(settings__json=json.dumps(one)) for one in given]
    return Target(seeds, _make, {".json": (tree_spoiler(known),) * 9})


def _make(spoilt: Case) -> None:
    """Make the environment and trace a reset."""
    try:
        given = json.loads(spoilt.files["settings.json"])
        settings = given.get("settings", {}).items()
    except (KeyError, ValueError, RecursionError, AttributeError) as error:
        raise SettingError(f"not a case of this target: {error!r}") from error
    # Other arguments of the functions would give Python's errors, not theirs.
    settings = {name: _tuples(v) for name, v in settings if name not in ("text", "id", "self")}
    if "text" in given:
        env, params = jaxenstein.from_ascii(given["text"], **settings)
    else:
        env, params = registry.make_with(given.get("id", "simple"), settings)
    jax.eval_shape(env.reset, jax.random.key(0), params)


def _tuples(value: Any) -> Any:
    """Convert lists to tuples, as in settings in Python."""
    if isinstance(value, dict):
        return {name: _tuples(entry) for name, entry in value.items()}
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


OPTIONS: dict[str, Any] = {
    **{"map": "####\n#SG#\n####", "height": 12, "width": 16, "horizon": 10, "num_envs": 4},
    **{"total_steps": 2 * 4 * 8, "rollout": 8, "minibatches": 2, "epochs": 1, "seeds": 2},
    **{"features": 8, "hidden": 8, "head": 8, "convolutions": [[4, 4, 4]]},
}
TOML = """\
env = "simple"
algo = "rnd"
height = 12
width = 16
observation = "rgb"
total_steps = 1e4
num_envs = 4
rollout = 8
convolutions = [[4, 4, 4], [2, 1, 8]]
learning_rate = 3e-4
anneal = true
dtype = "float32"
seeds = 2
horizon = 20
[settings]
field_of_view = 75
[params]
move_distance = 0.2
[grid]
bonus_reward = [0.1, 1]
"""
MAP = "map = '''\n####\n#SG#\n####\n'''\nheading = [-10, 10]\nheight = 12\nwidth = 16\n"
YAML = """\
env: simple
algo: icm
convolutions: [[4, 4, 4]]
params: {move_distance: 0.2}
grid:
  icm_inverse: [0.1, 1]
"""


def configurations() -> Target:
    """Config files of `jaxenstein train --config`. Needs the extra `baselines`."""
    from jaxenstein.baselines.runs.experiment import Experiment
    from jaxenstein.baselines.runs.options import all_options, read_file, resolve

    def read(spoilt: Case) -> None:
        (name,) = spoilt.files
        experiment = resolve(bounded(read_file(Path(name))))
        assert Experiment.from_json(experiment.to_json()) == experiment

    more = "[", "]", "{", "}", "[[grid]]", "'''", "true", "rnd", "icm", "simple", "!!python/x"
    known = (*all_options(), *more)
    words, lines = text_spoiler(TOKENS, known), text_spoiler(LINES)
    seeds = [case(c__toml=TOML), case(c__toml=MAP), case(c__yaml=YAML)]
    ways = {".toml": (words, words, lines), ".yaml": (words, words, lines)}
    return Target(seeds, read, ways)


def bounded(given: dict[str, Any]) -> dict[str, Any]:
    """The options, with sizes limited so that a test is fast."""
    sizes = ("features", "hidden", "head", "rnd_hidden", "rnd_output", "icm_latent", "icm_hidden")
    most = dict.fromkeys(sizes, 64) | {"rnd_layers": 4, "icm_layers": 4, "seeds": 1000}
    return {
        name: min(value, most[name]) if name in most and value > most[name] else value
        for name, value in given.items()
    }


@functools.cache
def trained_run() -> Case:
    """A small run directory, trained in seconds."""
    from jaxenstein.baselines.runs.folder import RunFolder
    from jaxenstein.baselines.runs.options import resolve
    from jaxenstein.baselines.runs.training import train

    with tempfile.TemporaryDirectory() as name:
        train(RunFolder.create(Path(name) / "run", resolve(OPTIONS)))
        paths = [path for path in sorted(Path(name).rglob("*")) if path.is_file()]
        return Case({str(path.relative_to(name)): path.read_bytes() for path in paths})


def runs() -> Target:
    """Run directories: config, checkpoints, metrics; reading must not change them."""
    from jaxenstein.baselines.runs.curves import curves_of
    from jaxenstein.baselines.runs.folder import RunFolder

    @functools.cache
    def template(configuration: bytes) -> Any:
        del configuration
        return RunFolder.open("run").template

    def read(spoilt: Case) -> None:
        opened = RunFolder.open("run")
        # Shapes and dtypes are cached, since tracing takes a second.
        restored = opened.checkpoints.restore(template(spoilt.files["run/config.json"]))
        assert restored is None or restored.update >= 0
        curves_of(Path("run"), "return", 10)

    whole = trained_run()
    last = {name: data for name, data in whole.files.items() if not name.endswith("/0.npz")}
    lines = text_spoiler(LINES), text_spoiler(TOKENS)
    ways = {".json": (tree_spoiler(),) * 9, ".jsonl": lines, ".csv": lines}
    return Target([whole, Case(last)], read, ways, named=True)


TARGETS: dict[str, Callable[[], Target]] = {
    "ascii": maps,
    "dmlab": lab,
    "wad": wads,
    "trajectory": trajectories,
    "results": results,
    "settings": settings,
    "config": configurations,
    "run": runs,
}
"""Functions that make the targets, by name."""
