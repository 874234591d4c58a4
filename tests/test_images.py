"""Images for the setting `textures`: reading, names, sizes, and refused input."""

import dataclasses
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import jaxenstein
from jaxenstein import SettingError
from jaxenstein.images import MOST_SIDE, read_images
from jaxenstein.maps.symbols import LABEL_NAMES, WALL_LABELS, door_label
from jaxenstein.settings import spec_from
from jaxenstein.spec import Spec, spec_of

GREY = np.full((4, 4, 3), 128, np.uint8)


def noise(height: int, width: int, channels: int = 3) -> np.ndarray:
    shape = (height, width, channels)
    return np.random.default_rng(height * width).integers(0, 256, shape, dtype=np.uint8)


def save(folder: Path, **images: np.ndarray) -> Path:
    for name, image in images.items():
        Image.fromarray(image).save(folder / f"{name.replace('_', '-')}.png")
    return folder


def test_folder_and_arrays_of_the_same_images_are_equal(tmp_path: Path) -> None:
    walls, goal = noise(8, 16), noise(4, 4, 4)
    folder = save(tmp_path, wall=walls, goal=goal, red_key=walls)
    (tmp_path / "notes.txt").write_text("no image")
    (tmp_path / "door.png").symlink_to("/dev/zero")
    arrays = {"goal": goal, "red key": walls, "wall": walls}
    of_folder: Any = jaxenstein.make("simple", textures=str(folder))[0]
    of_arrays: Any = jaxenstein.make("simple", textures=arrays)[0]
    assert of_folder == of_arrays
    assert hash(of_folder) == hash(of_arrays)
    for other in ({**arrays, "wall": walls[:, ::-1].copy()}, {**arrays, "door": walls}):
        assert jaxenstein.make("simple", textures=other)[0] != of_arrays
    assert jaxenstein.make("simple")[0] != of_arrays
    assert dataclasses.replace(of_folder, height=8).textures == of_arrays.textures
    found = read_images(arrays).of_labels()
    np.testing.assert_array_equal(found[WALL_LABELS[3]].pixels[..., :3], walls)
    np.testing.assert_array_equal(found[LABEL_NAMES.index("goal")].pixels, goal)
    assert set(found) == {*WALL_LABELS, LABEL_NAMES.index("goal"), LABEL_NAMES.index("red key")}


def test_specific_label_names_take_precedence() -> None:
    images = {"locked_red-door": noise(2, 2), "DOOR": GREY, "locked door": noise(1, 1), "key": GREY}
    found = read_images(images).of_labels()
    sides = [len(found[door_label(c, locked=True)].pixels) for c in (0, 1)]
    assert (*sides, len(found[door_label(0, locked=False)].pixels)) == (2, 1, 4)
    assert [len(found[LABEL_NAMES.index(f"{c} key")].pixels) for c in ("red", "grey")] == [4, 4]


@pytest.mark.parametrize(
    ("shape", "sides"), [((8, 2), (8, 2)), ((5, 3), (8, 4)), ((300, 129), (MOST_SIDE, MOST_SIDE))]
)
def test_sides_become_powers_of_two(shape: tuple[int, int], sides: tuple[int, int]) -> None:
    picture = read_images({"wall": noise(*shape)}).pictures["wall"]
    assert picture.pixels.shape == (*sides, 4)
    assert picture.shape == shape[1] / shape[0]
    assert (picture.pixels[..., 3] == 255).all()


def test_transparent_pixels_do_not_affect_a_resized_image() -> None:
    """A white disc on transparent black stays white up to its edge."""
    y, x = np.indices((300, 300))
    inside = np.hypot(x - 149.5, y - 149.5) < 120
    disc = np.repeat(np.where(inside, 255, 0).astype(np.uint8)[..., None], 4, axis=-1)
    pixels = read_images({"goal": disc}).pictures["goal"].pixels
    shown = pixels[..., 3] >= 128
    assert 0.4 < shown.mean() < 0.6
    assert pixels[shown][:, :3].min() >= 254


WRONG: list[tuple[Any, str]] = [
    (3, "textures must be a folder of images, or a table of names with arrays, not a int"),
    ([GREY], "textures must be a folder of images, or .*, not a list"),
    ({}, "textures must be at least one image"),
    ("no/such/folder", "'no/such/folder', which does not exist"),
    (__file__, "which is a file or is below one"),
    ("x" * 300, "which cannot be read"),
    ("~nobody-here/images", "which does not exist"),
    ("a\0b", "which cannot be read"),
    ({"wal": GREY}, "no image can be called 'wal', did you mean 'wall'?"),
    ({"goat": GREY}, "did you mean 'goal'"),
    ({7: GREY}, "no image can be called 7"),
    ({"wall": "brick.png"}, r"must be an array uint8\[height, width, 3 or 4\], not 'brick.png'"),
    ({"wall": GREY[..., 0]}, r"not uint8\[4, 4\]"),
    ({"wall": GREY / 255}, r"not float64\[4, 4, 3\]"),
    ({"wall": GREY[:0]}, "sides of 1 to 4096 pixels, not 4 by 0"),
    ({"wall": np.zeros((5000, 4, 3), np.uint8)}, "sides of 1 to 4096 pixels, not 4 by 5000"),
    ({"wall": np.zeros((1, 65, 3), np.uint8)}, "not be more than 64 times as long as wide"),
]


@pytest.mark.parametrize(("given", "message"), WRONG)
def test_invalid_images_are_refused(given: Any, message: str) -> None:
    with pytest.raises(SettingError, match=message):
        jaxenstein.make("simple", textures=given)


def test_error_names_wrong_file(tmp_path: Path) -> None:
    save(tmp_path, wall=GREY)
    whole = (tmp_path / "wall.png").read_bytes()
    for name, content, message in (
        ("goal.png", b"", "goal.png' cannot be read as an image"),
        ("goal.png", whole[:40], "goal.png' cannot be read as an image"),
        ("gaol.png", whole, "gaol.png: no image can be called 'gaol', did you mean 'goal'"),
    ):
        file = tmp_path / name
        file.write_bytes(content)
        with pytest.raises(SettingError, match=re.escape(message)):
            jaxenstein.make("simple", textures=tmp_path)
        file.unlink()
    Image.new("1", (4097, 1)).save(tmp_path / "floor.png")
    with pytest.raises(SettingError, match=r"floor.png' must have sides .* not 4097 by 1"):
        jaxenstein.make("simple", textures=tmp_path)


def test_textures_need_the_plain_look() -> None:
    with pytest.raises(SettingError, match="textures need look='plain', not look='patterned'"):
        jaxenstein.make("simple", textures={"wall": GREY}, look="patterned")


def test_folder_is_saved_in_files_and_arrays_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = save(tmp_path, wall=GREY)
    env, params = jaxenstein.make("simple", textures=folder)
    plain = json.loads(json.dumps(spec_of(env, params).to_json()))
    assert plain["settings"]["textures"] == str(folder)
    assert Spec.from_json(plain).build()[0] == dataclasses.replace(env, autoreset=None)
    monkeypatch.chdir(folder.parent)
    spec = spec_from({"env": "simple", "textures": folder.name})
    assert spec.settings["textures"] == str(folder)
    assert spec.build()[0] == dataclasses.replace(env, autoreset=None)
    env, params = jaxenstein.make("simple", textures={"wall": GREY})
    with pytest.raises(SettingError, match="save them as images in a folder, and give its path"):
        spec_of(env, params).to_json()
