"""How the things of the symbol table look to the renderer."""

from __future__ import annotations

import numpy as np

from ..engine.art import load_art
from ..engine.scene import Theme
from ..maps.symbols import COLOUR_NAMES, GOAL_LABEL, LABEL_COLOURS, door_label, key_label

RGB = tuple[int, int, int]
# The two tiles of the checker, and the ceiling.
FLOOR: tuple[RGB, RGB] = ((88, 92, 84), (68, 72, 66))
CEILING: RGB = (52, 56, 66)
PANEL_ACCENT: RGB = (225, 225, 215)
# Half the side of the billboard and tiles from eye height down to its centre, by kind.
KEY_SIZE = (0.25, 0.15)
GOAL_SIZE = (0.32, 0.1)
# A sprite's detail is its colour times this.
DETAIL_SHADE = 0.55


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
    sizes = np.array(
        [GOAL_SIZE if label == GOAL_LABEL else KEY_SIZE for label in sprites], np.float32
    ).reshape(-1, 2)
    labels = np.array(sprites, np.uint8)
    return Theme(
        wall_colours=colours,
        wall_panels=panels,
        panels=np.stack([plain, load_art("door"), load_art("door-locked")]),
        panel_accent=np.array(PANEL_ACCENT, np.float32),
        floor=np.array(floor, np.float32),
        ceiling=np.array(ceiling, np.float32),
        sprite_art=np.stack([_sprite_art(label) for label in sprites] or [plain]),
        sprite_colours=np.stack([colours[labels], colours[labels] * DETAIL_SHADE], axis=1).astype(
            np.float32
        ),
        sprite_radius=sizes[:, 0],
        sprite_drop=sizes[:, 1],
        sprite_labels=labels,
    )


def _sprite_art(label: int) -> np.ndarray:
    keys = {key_label(colour) for colour in range(len(COLOUR_NAMES))}
    names = {GOAL_LABEL: "goal", **dict.fromkeys(keys, "key")}
    return load_art(names[label])
