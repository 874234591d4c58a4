"""Registered things: pictures in every form, observations and maps, and refused input."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest
from PIL import Image

from jaxenstein import SettingError, show
from jaxenstein.engine.art import load_art
from jaxenstein.maps import label_name, parse_ascii, register_thing
from jaxenstein.maps.own_things import OWN_LABELS
from jaxenstein.maps.things import KEY, THING_OF
from jaxenstein.tasks.appearance import build_theme
from jaxenstein.tasks.navigation import Navigation
from jaxenstein.view.topdown import draw_map

RED, BLUE = (200, 30, 20), (20, 40, 220)


@pytest.fixture(autouse=True)
def _restored_things() -> Iterator[None]:
    before = dict(THING_OF)
    for label in OWN_LABELS:  # of other tests in this process
        THING_OF.pop(label, None)
    yield
    THING_OF.clear()
    THING_OF.update(before)


def random_cells() -> np.ndarray:
    """Random cells: 0 is empty, 1 and 2 are the two colours."""
    return np.random.default_rng(3).integers(0, 3, (32, 32))


def as_text(cells: np.ndarray) -> str:
    return "\n".join("".join(".#o"[mark] for mark in row) for row in cells)


def as_image(cells: np.ndarray) -> np.ndarray:
    """uint8[32, 32, 4]: slightly different colours, and random colours in transparent pixels."""
    palette = np.array([[*BLUE, 60], [RED[0] - 20, 35, 30, 255], [25, 60, 200, 200]], np.uint8)
    return palette[cells]


def planes(cells: np.ndarray) -> np.ndarray:
    """uint32[2, 32], bit by bit: columns from the left, with the top at the highest bit."""
    words = np.zeros((2, 32), np.uint32)
    for row in range(32):
        for column in range(32):
            bit = np.uint32(1 << (31 - row))
            words[0, column] |= bit * np.uint32(cells[row, column] > 0)
            words[1, column] |= bit * np.uint32(cells[row, column] == 2)
    return words


@pytest.mark.parametrize("form", ["text", "indented", "array", "pixels", "file", "file's name"])
def test_every_form_gives_the_same_picture(form: str, tmp_path: Path) -> None:
    cells, file = random_cells(), tmp_path / "thing.png"
    Image.fromarray(as_image(cells)).save(file)
    indented = "\n    " + as_text(cells).replace("\n", "\n    ") + "\n    "
    given: dict[str, Any] = {
        "text": as_text(cells),
        "indented": indented,
        "array": cells,
        "pixels": as_image(cells),
        "file": file,
        "file's name": str(file),
    }
    thing = register_thing("banana", 200, given[form], colour=RED, detail=BLUE)
    theme = build_theme((KEY.label, thing.label), doors=False)
    np.testing.assert_array_equal(np.asarray(theme.sprite_art)[1], planes(cells))
    np.testing.assert_array_equal(np.asarray(theme.sprite_colours)[1], [RED, BLUE])
    assert np.asarray(theme.sprite_labels).tolist() == [KEY.label, 200]
    assert (thing.radius, thing.drop) == (0.25, 0.25)


def test_thing_in_several_colours_has_a_label_per_colour() -> None:
    light = np.where(random_cells()[..., None] == 1, 220, 30).astype(np.uint8).repeat(3, axis=-1)
    thing = register_thing("gem", 250, light, colour=None)
    assert label_name(252) == "blue gem"
    theme = build_theme((thing.labels[2],), doors=False)
    np.testing.assert_array_equal(theme.sprite_art[0], planes(np.where(random_cells() == 1, 1, 2)))
    np.testing.assert_array_equal(np.asarray(theme.sprite_colours)[0, 0], (52, 96, 236))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Hunt(Navigation):
    """A map whose goal is the thing with the label 200."""

    @functools.cached_property
    def sprite_labels(self) -> tuple[int, ...]:
        return (200,)


def test_thing_appears_in_observations_and_on_maps() -> None:
    full = np.ones((32, 32), int)
    register_thing("slab", 200, full, colour=RED, radius=0.5)
    hall = parse_ascii("#####\n#S.G#\n#####")
    env = Hunt(tilemap=hall, heading=0.0, height=8, width=8, observation="labels")
    labels = np.asarray(env.reset(jax.random.key(0))[0])
    # Two tiles ahead, half a tile to each side covers more than the middle half of the image.
    assert (labels[3:5, 3:5] == 200).all()
    np.testing.assert_array_equal(show(labels, "labels").image[3, 3], RED)
    picture = draw_map(hall, scale=32).sprites(np.array([[2.5, 1.5]]), np.array([200]))
    assert np.asarray(picture.image())[48, 80].tolist() == list(RED)


def test_thing_can_be_registered_again_with_another_picture() -> None:
    register_thing("banana", 200, as_text(random_cells()), colour=RED)
    turned = random_cells().T
    register_thing("banana", 200, as_text(turned), colour=RED)
    art = np.asarray(build_theme((200,), doors=False).sprite_art)[0]
    np.testing.assert_array_equal(art, planes(turned))
    np.testing.assert_array_equal(load_art("apple"), load_art(as_text(decoded("apple"))))


def test_new_picture_appears_in_compiled_programs() -> None:
    hall = parse_ascii("#####\n#S.G#\n#####")
    shares = []
    for rows in (32, 16):
        picture = np.where(np.arange(32)[:, None] < rows, 1, 0).repeat(32, axis=1)
        register_thing("slab", 200, picture, colour=RED, radius=0.5)
        env = Hunt(tilemap=hall, heading=0.0, height=8, width=8, observation="labels")
        labels = np.asarray(env.reset(jax.random.key(0))[0])
        shares.append((int((labels[:4] == 200).sum()), int((labels[4:] == 200).sum())))
    (upper, lower), (upper_of_half, lower_of_half) = shares
    assert upper == upper_of_half == lower > 0
    assert lower_of_half == 0


@pytest.mark.parametrize("names", [("red gem", "gem"), ("gem", "red gem")])
def test_label_names_differ(names: tuple[str, str]) -> None:
    colour_of = {"red gem": RED, "gem": None}
    first, second = names
    register_thing(first, 200, random_cells(), colour=colour_of[first])
    with pytest.raises(SettingError, match="'red gem' is already the name of a label"):
        register_thing(second, 220, random_cells(), colour=colour_of[second])
    register_thing(first, 200, random_cells().T, colour=colour_of[first])


def test_sizes_can_be_numpy_numbers() -> None:
    quarter: Any = np.float32(0.25)
    thing = register_thing("banana", 200, TEXT, colour=RED, radius=quarter)
    assert (thing.radius, thing.drop) == (0.25, 0.25)


def decoded(name: str) -> np.ndarray:
    drawn, second = (load_art(name)[:, None, :] >> np.arange(32, dtype=np.uint32)[::-1, None]) & 1
    return (drawn + second).astype(int)


TEXT = as_text(np.ones((32, 32), int))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"picture": TEXT[33:]}, "the picture of 'banana' must have 32 rows, not 31"),
        ({"picture": TEXT.replace("\n#", "\n", 1)}, "row 2 must have 32 pixels, not 31"),
        ({"picture": "x" + TEXT[1:]}, "row 1 has 'x', which is not one of '.', '#', 'o'"),
        ({"picture": TEXT.replace("#", ".")}, "is empty"),
        ({"picture": np.ones((32, 31), int)}, "32 rows and 32 columns, not 32 and 31"),
        ({"picture": np.full((32, 32), 3)}, "must hold only 0, 1 and 2, not 3 to 3"),
        ({"picture": ""}, "must have 32 rows, not 1"),
        ({"picture": [[1] * 32, [1]]}, "the picture of 'banana' is not an array"),
        ({"picture": np.ones((32, 32))}, r"not float64\[32, 32\]"),
        ({"picture": np.ones((16, 16, 4), np.uint8)}, "32 columns, not 16 and 16"),
        ({"picture": np.ones((2, 32), np.uint32)}, "32 columns, not 2 and 32"),
        ({"picture": "nothing.png"}, "'nothing.png' cannot be read as an image"),
        ({"label": 141}, "a whole number from 192 to 255, not 141"),
        ({"label": 251, "colour": None}, "a whole number from 192 to 250, not 251"),
        ({"label": 200.0}, "not 200.0"),
        ({"label": 201}, "'peel' has the labels .201."),
        ({"label": 196, "colour": None}, "'peel' has the labels .201."),
        ({"name": "peel"}, "'peel' has the labels .201."),
        ({"name": "red wall"}, "'red wall' is already the name of a label"),
        ({"name": "key", "colour": None}, "'blue key' is already the name of a label"),
        ({"name": ""}, "must be one line of text"),
        ({"colour": (1, 2)}, "the colour of 'banana' must be"),
        ({"detail": (0, 0, 256)}, "the detail of 'banana' must be"),
        ({"radius": 0.6}, "the radius of 'banana' must be above 0 and at most 0.5 tiles, not 0.6"),
        (
            {"radius": np.nan},
            "the radius of 'banana' must be above 0 and at most 0.5 tiles, not nan",
        ),
        ({"drop": np.nan}, "the drop of 'banana' must be from -0.25 to 0.25 .* not nan"),
        ({"drop": 10**400}, "the drop of 'banana' must be from -0.25 to 0.25"),
        ({"radius": 0.3, "drop": 0.4}, "must be from -0.2 to 0.2 with a radius of 0.3"),
    ],
)
def test_invalid_things_are_refused(changes: dict[str, Any], message: str) -> None:
    register_thing("peel", 201, TEXT, colour=BLUE)
    before = dict(THING_OF)
    row = {"name": "banana", "label": 200, "picture": TEXT, "colour": RED, **changes}
    with pytest.raises(SettingError, match=message):
        register_thing(row.pop("name"), row.pop("label"), row.pop("picture"), **row)
    assert before == THING_OF


def test_image_of_wrong_size_is_not_decoded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unpack(*_: object, **__: object) -> None:
        raise AssertionError("unpacked")

    Image.new("RGB", (33, 32)).save(tmp_path / "large.png")
    monkeypatch.setattr(Image.Image, "convert", unpack)
    with pytest.raises(SettingError, match="must have 32 rows and 32 columns, not 32 and 33"):
        register_thing("large", 200, tmp_path / "large.png", colour=RED)


def test_unused_label_has_no_picture_and_no_name() -> None:
    with pytest.raises(SettingError, match=r"no thing has the label 222: .*register_thing"):
        build_theme((222,), doors=False)
    with pytest.raises(SettingError, match="there is no label 222"):
        label_name(222)
