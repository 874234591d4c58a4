"""How the things of the symbol table look to the renderer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..engine.art import load_art
from ..engine.scene import Theme
from ..errors import SettingError
from ..maps.symbols import (
    APPLE_LABEL,
    COLOUR_NAMES,
    GOAL_LABEL,
    KEY_LABELS,
    LABEL_COLOURS,
    MEDKIT_LABEL,
    door_label,
)

RGB = tuple[int, int, int]
# The two tiles of the checker, and the ceiling.
FLOOR: tuple[RGB, RGB] = ((88, 92, 84), (68, 72, 66))
CEILING: RGB = (52, 56, 66)
PANEL_ACCENT: RGB = (225, 225, 215)
# A sprite's detail is its colour times this, if it has none of its own.
DETAIL_SHADE = 0.55


@dataclass(frozen=True)
class Look:
    """A kind of billboard.

    Attributes:
        art: its picture.
        radius: half its side in tiles.
        drop: tiles from eye height down to its centre.
        detail: RGB of its second colour, or None for a darker shade of the first.
    """

    art: str
    radius: float
    drop: float
    detail: RGB | None = None


KEY_LOOK = Look("key", 0.25, 0.15)
LOOKS: dict[int, Look] = {
    GOAL_LABEL: Look("goal", 0.32, 0.1),
    # These two lie on the floor, below the horizon.
    APPLE_LABEL: Look("apple", 0.16, 0.34, (60, 140, 40)),
    MEDKIT_LABEL: Look("medkit", 0.24, 0.26, (200, 24, 28)),
    **dict.fromkeys(KEY_LABELS, KEY_LOOK),
}


def build_theme(
    sprites: tuple[int, ...],
    *,
    doors: bool,
    floor: tuple[RGB, RGB] = FLOOR,
    ceiling: RGB = CEILING,
) -> Theme:
    """The look of a map.

    Args:
        sprites: labels of the sprite looks, in the order of `Sprites.look`.
        doors: whether there are doors; without, nothing is spent on drawing panels.
        floor: the checker's colours, RGB.
        ceiling: its colour, RGB.
    """
    colours = np.array(LABEL_COLOURS, np.float32)
    panels = np.zeros(len(colours), np.int32)
    if doors:
        for colour in range(len(COLOUR_NAMES)):
            panels[door_label(colour, locked=False)] = 1
            panels[door_label(colour, locked=True)] = 2
    plain = np.zeros_like(load_art("door"))
    looks = [LOOKS[label] for label in sprites]
    return Theme(
        wall_colours=colours,
        wall_panels=panels,
        panels=np.stack([plain, load_art("door"), load_art("door-locked")]),
        panel_accent=np.array(PANEL_ACCENT, np.float32),
        floor=np.array(floor, np.float32),
        ceiling=np.array(ceiling, np.float32),
        sprite_art=np.stack([load_art(look.art) for look in looks] or [plain]),
        sprite_colours=np.array(
            [_sprite_colours(*pair) for pair in zip(sprites, looks, strict=True)], np.float32
        ).reshape(-1, 2, 3),
        sprite_radius=np.array([look.radius for look in looks], np.float32),
        sprite_drop=np.array([look.drop for look in looks], np.float32),
        sprite_labels=np.array(sprites, np.uint8),
    )


def check_rgb(field: str, value: Any, shape: tuple[int, ...]) -> None:
    """Raise unless a setting is one RGB colour, or several, as tuples.

    Args:
        field: the name of the setting.
        value: what it was given.
        shape: (3,), or (colours, 3).

    Raises:
        SettingError: it is something else, or not from 0 to 255.
    """
    try:
        colours = np.asarray(value, np.float64)
        hash(value)
    except (TypeError, ValueError, OverflowError):
        colours = np.zeros(0)
    if colours.shape != shape or not ((colours >= 0) & (colours <= 255)).all():
        what = "(red, green, blue)" if shape == (3,) else "two tuples (red, green, blue)"
        raise SettingError(f"{field} must be {what}, numbers from 0 to 255, not {value!r}")


def _sprite_colours(label: int, look: Look) -> np.ndarray:
    """float[2, 3]: the colours of a sprite's shape and of its detail."""
    shape = np.array(LABEL_COLOURS[label], float)
    return np.stack([shape, shape * DETAIL_SHADE if look.detail is None else look.detail])
