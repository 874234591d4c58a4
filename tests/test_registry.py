"""Ids, settings, and the errors for wrong ones."""

import dataclasses
from pathlib import Path
from typing import Any, cast

import jax
import numpy as np
import pytest

import jaxenstein
from jaxenstein import MapError
from jaxenstein.catalogue import ALIASES, ENTRIES
from jaxenstein.tasks.first_person import SETTINGS

MAP = "#####\n#S.G#\n#####"


def make(name: Any, **settings: Any) -> Any:
    return jaxenstein.make(name, **settings)


def test_ids_match_the_catalogue():
    assert jaxenstein.environment_ids() == tuple(ENTRIES)
    assert all(entry.family for entry in ENTRIES.values())
    assert not set(ALIASES) & set(ENTRIES)


@pytest.mark.parametrize(("alias", "name"), ALIASES.items())
def test_aliases_build_the_same_environment(alias, name):
    assert make(alias)[0] == make(name)[0]
    assert make(alias)[0].name == name


def test_settings_of_only_some_environments():
    assert make("health-gathering", hud=True)[0].hud
    assert make("key-corridor-s3r3", layout_seed=3)[0].layout_seed == 3
    for name, own in (("key-door", "layout_seed"), ("simple", "hud")):
        with pytest.raises(jaxenstein.SettingError, match="unknown setting"):
            make(name, **{own: 1})


@pytest.mark.parametrize("name", jaxenstein.environment_ids())
def test_every_id_builds_its_environment(name):
    env, params = make(name, height=5, width=7)
    assert (env.name, env.height, env.width) == (name, 5, 7)
    for leaf, default in zip(
        jax.tree.leaves(params), jax.tree.leaves(env.default_params), strict=True
    ):
        assert isinstance(leaf, jax.Array)
        assert leaf.dtype == (np.int32 if isinstance(default, int) else np.float32)
        assert float(leaf) == pytest.approx(float(default))


# A copy of the table in the documentation.
@pytest.mark.parametrize(
    ("name", "horizon", "discount", "living"),
    [
        ("simple", 300, 0.99, 0.0),
        ("key-door", 300, 0.99, 0.0),
        ("t-maze", 200, 0.99, 0.0),
        ("my-way-home", 2100, 0.999, -0.0001),
        ("my-way-home-colorless", 2100, 0.999, -0.0001),
        ("my-way-home-sparse", 2100, 0.999, -0.0001),
        ("my-way-home-very-sparse", 2100, 0.999, -0.0001),
        ("health-gathering", 2100, 0.99, 1.0),
        ("key-corridor", 3200, 0.99, 0.0),
        ("key-corridor-s3r1", 1800, 0.99, 0.0),
        ("key-corridor-s3r2", 1800, 0.99, 0.0),
        ("key-corridor-s3r3", 1800, 0.99, 0.0),
        ("key-corridor-s5r3", 5000, 0.99, 0.0),
        ("key-corridor-s6r3", 7200, 0.99, 0.0),
        *(
            (f"dmlab-{kind}-{number}{end}", horizon, discount, 0.0)
            for kind in ("static", "random-goal")
            for end in ("", "-respawn")
            for number, horizon, discount in (
                ("01", 1800, 0.999),
                ("02", 4500, 0.9995),
                ("03", 9000, 0.9999),
            )
        ),
    ],
)
def test_default_params_of_the_tasks(name, horizon, discount, living):
    _, params = make(name)
    assert int(params.max_steps_in_episode) == horizon
    assert float(params.discount) == pytest.approx(discount)
    assert float(params.living_reward) == pytest.approx(living)
    # Health gathering has no goal.
    assert float(getattr(params, "goal_reward", 1)) == (10 if name.startswith("dmlab") else 1)
    assert np.degrees(float(params.turn_angle)) == pytest.approx(15)
    assert float(params.move_distance) == pytest.approx(0.15)


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("my-way-hom", "did you mean 'my-way-home'"),
        ("KeyDoor", "did you mean 'key-door'"),
        ("zzz", "there are simple, key-door.* and others; 'jaxenstein list' shows all"),
        (3, "unknown environment 3"),
        ("jaxenstein/my-way-home-v0", "is an id of gymnasium.make; here it is 'my-way-home'"),
        (None, "unknown environment None"),
        ("maze.txt", "from_file, or --map-file on the command line"),
    ],
)
def test_error_for_unknown_id_names_the_nearest(name, hint):
    with pytest.raises(jaxenstein.UnknownEnvironmentError, match=hint):
        make(name)


@pytest.mark.parametrize("name", ["\x1b[2J", "two\nlines", 3])
def test_names_are_one_line_strings(name):
    with pytest.raises(jaxenstein.SettingError, match="name must be one line of text, not"):
        jaxenstein.from_ascii("####\n#SG#\n####", name=name)


def test_error_for_unknown_setting_names_the_nearest():
    with pytest.raises(jaxenstein.SettingError, match="'heigth', did you mean 'height'"):
        make("simple", heigth=3)
    with pytest.raises(jaxenstein.SettingError, match=r"params\.replace\(goal_reward="):
        make("simple", goal_reward=3)
    # A param of other tasks is not a param of this task.
    with pytest.raises(jaxenstein.SettingError, match="unknown setting 'apple_reward'"):
        make("simple", apple_reward=1)
    with pytest.raises(jaxenstein.SettingError, match=r"params\.replace\(apple_reward="):
        make("dmlab-static-01-respawn", apple_reward=1)
    with pytest.raises(jaxenstein.SettingError, match="did you mean the param 'damage'"):
        make("health-gathering", damag=1)
    with pytest.raises(jaxenstein.SettingError, match="unknown setting 'tilemap'"):
        make("simple", tilemap=None)
    with pytest.raises(jaxenstein.SettingError, match="'headings', did you mean 'heading'"):
        jaxenstein.from_ascii(MAP, headings=3)


def test_all_settings_are_accepted():
    given = {
        "height": 3,
        "width": 4,
        "field_of_view": 75.5,
        "observation": "gray",
        "autoreset": None,
        "final_observation": False,
        "frame_skip": 2,
        "sprite_layers": 2,
        "look": "random",
        "look_range": 0.5,
        "look_seeds": (0, 9),
        "textures": None,
    }
    assert set(given) == set(SETTINGS)
    env, _ = make("key-door", **given)
    fields = {f.name: getattr(env, f.name) for f in dataclasses.fields(env)}
    assert given.items() <= fields.items()


def test_from_ascii_accepts_name_regions_and_colours():
    regions = "...\n.1.\n..."
    text = "###\n#S#\n#G#\n###"
    env, _ = jaxenstein.from_ascii(
        text,
        name="cell",
        regions="###\n#1#\n#2#\n###",
        floor=((1, 2, 3), (4, 5, 6)),
        ceiling=(7, 8, 9),
        heading=(10, 20),
    )
    assert env.name == env.tilemap.name == "cell"
    assert env.tilemap.faces is not None
    assert cast(Any, env.theme.ceiling).tolist() == [7, 8, 9]
    with pytest.raises(jaxenstein.MapError, match="regions text"):
        jaxenstein.from_ascii(text, regions=regions)


def test_lists_and_arrays_work_like_tuples_in_settings():
    text, colours = "####\n#SG#\n####", [[1, 2, 3], [4, 5, 6]]
    env, params = jaxenstein.from_ascii(
        text, heading=[0, 90], floor=colours, ceiling=np.array([7, 8, 9]), height=8, width=8
    )
    same, _ = jaxenstein.from_ascii(
        text, heading=(0, 90), floor=((1, 2, 3), (4, 5, 6)), ceiling=(7, 8, 9), height=8, width=8
    )
    assert (env, hash(env)) == (same, hash(same))
    assert 0 <= env.reset(jax.random.key(0), params)[1].heading <= np.pi / 2
    for wrong in ({0: 90}, {0, 90}, [0, {}]):
        with pytest.raises(jaxenstein.SettingError, match=r"heading cannot be a (dict|set)"):
            jaxenstein.from_ascii(text, heading=wrong)


def test_map_errors_keep_their_position():
    with pytest.raises(jaxenstein.MapError, match="line 2, column 3") as caught:
        jaxenstein.from_ascii("####\n#S?G\n####")
    assert (caught.value.line, caught.value.column) == (2, 3)


def test_map_file_is_read_with_its_regions_and_faces(tmp_path):
    path = tmp_path / "maze.txt"
    path.write_text(f"{MAP}\n")
    env, params = jaxenstein.from_file(path, heading=90, height=8, width=8)
    told, _ = jaxenstein.from_ascii(MAP, name="maze", heading=90, height=8, width=8)
    assert (env, params.max_steps_in_episode) == (told, 1000)
    (tmp_path / "maze.regions.txt").write_text("#####\n#222#\n#####")
    painted, _ = jaxenstein.from_file(str(path), name="mine")
    assert painted.name == "mine"
    assert painted.tilemap.faces is not None
    with pytest.raises(MapError, match=r"cannot read the map .*nowhere\.txt: no such file"):
        jaxenstein.from_file(tmp_path / "nowhere.txt")
    with pytest.raises(MapError, match=r"cannot read the map .*null byte"):
        jaxenstein.from_file("maze\0.txt")


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="of Unix")
def test_endless_map_file_is_not_read_to_its_end():
    with pytest.raises(MapError, match=r"the map /dev/zero: it has more than 16777216 characters"):
        jaxenstein.from_file("/dev/zero")


@pytest.mark.parametrize("text", ["maze.txt", Path("maps/maze.txt")])
def test_file_name_in_place_of_a_map_is_recognised(text):
    with pytest.raises(MapError, match=r"maze\.txt' is a file name, use from_file to read it"):
        jaxenstein.from_ascii(text)
    with pytest.raises(MapError, match=r"^line 1, column 3: unknown symbol .\?.; the symbols are"):
        jaxenstein.from_ascii("#S?G")


def test_repr_of_an_environment_is_one_line():
    env, _ = jaxenstein.make("my-way-home")
    assert repr(env) == "Navigation('my-way-home')"
    env, _ = jaxenstein.make("key-corridor-s3r1", height=32, observation="gray", autoreset=None)
    shown = repr(env)
    assert shown.startswith("KeyCorridor('key-corridor-s3r1', autoreset=None, height=32, ")
    assert "observation='gray'" in shown
    assert max(len(repr(jaxenstein.make(id)[0])) for id in jaxenstein.environment_ids()) < 110


def test_warnings_point_at_the_caller():
    with pytest.warns(jaxenstein.MapWarning, match="line 2, column 4") as caught:
        jaxenstein.from_ascii("#####\n#S#G#\n#####")
    assert caught[0].filename == __file__


def test_apples_of_a_map_are_not_lost_in_silence():
    with pytest.warns(jaxenstein.MapWarning, match="custom: apples are left out; ") as caught:
        jaxenstein.from_ascii("######\n#SaaG#\n######")
    assert caught[0].filename == __file__
