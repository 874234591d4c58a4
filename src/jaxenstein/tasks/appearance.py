"""The look of walls, doors and the things of `maps.things` in the renderer."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..engine.art import load_art
from ..engine.scene import Theme
from ..errors import SettingError, quoted
from ..maps.symbols import LABEL_COLOURS, door_label
from ..maps.things import COLOURS, RGB, THING_OF, Thing

# The two colours of the floor's checker, and the ceiling.
FLOOR: tuple[RGB, RGB] = ((88, 92, 84), (68, 72, 66))
CEILING: RGB = (52, 56, 66)
PANEL_ACCENT: RGB = (225, 225, 215)


def build_theme(
    sprites: tuple[int, ...],
    *,
    doors: bool,
    floor: tuple[RGB, RGB] = FLOOR,
    ceiling: RGB = CEILING,
) -> Theme:
    """Build the look of a map.

    Args:
        sprites: labels of the sprite pictures, in the order of `Sprites.picture`; things from
            `maps.things` or registered ones.
        doors: whether there are doors; without doors, drawing panels costs nothing.
        floor: the colours of the checker, RGB.
        ceiling: the colour of the ceiling, RGB.

    Raises:
        SettingError: a label belongs to no thing.
    """
    colours = np.array(LABEL_COLOURS, np.float32)
    panels = np.zeros(len(colours), np.int32)
    if doors:
        for colour in range(len(COLOURS)):
            panels[door_label(colour, locked=False)] = 1
            panels[door_label(colour, locked=True)] = 2
    plain = np.zeros_like(load_art("door"))
    things = [_thing_of(label) for label in sprites]
    return Theme(
        wall_colours=colours,
        wall_panels=panels,
        panels=np.stack([plain, load_art("door"), load_art("door-locked")]),
        panel_accent=np.array(PANEL_ACCENT, np.float32),
        floor=np.array(floor, np.float32),
        ceiling=np.array(ceiling, np.float32),
        sprite_art=np.stack([load_art(thing.art) for thing in things] or [plain]),
        sprite_colours=np.array(
            [t.paints(label) for t, label in zip(things, sprites, strict=True)], np.float32
        ).reshape(-1, 2, 3),
        sprite_radius=np.array([thing.radius for thing in things], np.float32),
        sprite_drop=np.array([thing.drop for thing in things], np.float32),
        sprite_labels=np.array(sprites, np.uint8),
    )


def _thing_of(label: int) -> Thing:
    if label not in THING_OF:
        raise SettingError(
            f"no thing has the label {label}: register one with jaxenstein.maps.register_thing"
        )
    return THING_OF[label]


def check_rgb(field: str, value: Any, shape: tuple[int, ...]) -> None:
    """Raise unless a setting is one RGB colour, or several, as tuples.

    Args:
        field: the name of the setting.
        value: its value.
        shape: (3,), or (colours, 3).

    Raises:
        SettingError: the value has another form, or a number is not from 0 to 255.
    """
    try:
        colours = np.asarray(value, np.float64)
        hash(value)
    except (TypeError, ValueError, OverflowError):
        colours = np.zeros(0)
    if colours.shape != shape or not ((colours >= 0) & (colours <= 255)).all():
        what = "(red, green, blue)" if shape == (3,) else "two tuples (red, green, blue)"
        raise SettingError(f"{field} must be {what}, numbers from 0 to 255, not {quoted(value)}")
