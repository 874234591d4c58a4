"""Scenes for the engine in which everything looks different, and their reference images."""

from __future__ import annotations

import functools
from typing import Any

import jax
import numpy as np

from jaxenstein.engine.camera import Camera
from jaxenstein.engine.level import compile_level
from jaxenstein.engine.render import render
from jaxenstein.engine.scene import Scene, Sprites, Theme

from . import images
from .worlds import World, draw_world

LOOKS = 5
SPRITE_LABELS = 250


def plain_theme(seed: int = 0, **changes: Any) -> Theme:
    """Random wall colours, no panels, and random sprites in several sizes; look 0 is solid."""
    rng = np.random.default_rng(seed)
    art = rng.integers(0, 2**32, (LOOKS, 2, 32), dtype=np.uint32)
    art[0, 0] = 0xFFFFFFFF
    looks: dict[str, Any] = {
        "wall_colours": rng.uniform(40, 255, (256, 3)).astype(np.float32),
        "wall_panels": np.zeros(256, np.int32),
        "panels": np.zeros((1, 2, 32), np.uint32),
        "panel_accent": np.array([255, 255, 255], np.float32),
        "floor": np.array([[250, 0, 0], [0, 0, 250]], np.float32),
        "ceiling": np.array([10, 60, 10], np.float32),
        "sprite_art": art,
        "sprite_colours": np.tile(np.array([[255, 0, 0], [0, 255, 0]], np.float32), (LOOKS, 1, 1)),
        "sprite_radius": np.array([0.5, 0.3, 0.15, 0.4, 0.05], np.float32),
        "sprite_drop": np.array([0.0, 0.2, 0.35, -0.1, 0.45], np.float32),
        "sprite_labels": (SPRITE_LABELS + np.arange(LOOKS)).astype(np.uint8),
    }
    return Theme(**(looks | changes))


def draw_scene(seed: int, shape: tuple[int, int], sprites: int) -> tuple[World, Sprites]:
    """A bordered world with one pose, and billboards anywhere in the map, some invisible."""
    rng = np.random.default_rng(seed)
    world = draw_world(seed, shape, bordered=True, poses=1)
    # No wall may have the label of floor, ceiling or a sprite.
    walls = np.where(world.walls >= SPRITE_LABELS, 7, world.walls).astype(np.uint8)
    world = World(walls, world.doors, world.closed, world.positions, world.headings)
    rows, columns = shape
    if rng.random() < 0.5:
        # In front of the eye, where they hide each other.
        away, aside = rng.uniform(0, 4, sprites), rng.uniform(-0.7, 0.7, sprites)
        heading = float(world.headings[0])
        cos, sin = np.cos(heading), np.sin(heading)
        x, y = cos * away - sin * aside, sin * away + cos * aside
        places = world.positions[0] + np.stack([x, y], axis=1)
    else:
        places = rng.uniform(0, 1, (sprites, 2)) * (columns, rows)
    billboards = Sprites(
        position=places.astype(np.float32),  # type: ignore[arg-type]
        picture=rng.integers(0, LOOKS, sprites).astype(np.int32),  # type: ignore[arg-type]
        visible=rng.random(sprites) < 0.8,  # type: ignore[arg-type]
    )
    return world, billboards


def scene_of(world: World, sprites: Sprites, theme: Theme, pose: int = 0) -> Scene:
    """The scene of one pose of a world, with a constant level."""
    return Scene(
        level=compile_level(world.walls, world.doors),
        closed=world.closed,  # type: ignore[arg-type]
        position=world.positions[pose],  # type: ignore[arg-type]
        heading=world.headings[pose],  # type: ignore[arg-type]
        sprites=sprites,
        theme=theme,
    )


def billboards_of(sprites: Sprites, theme: Theme) -> images.Billboards:
    """The same billboards for the reference."""
    return images.Billboards(
        position=np.asarray(sprites.position),
        picture=np.asarray(sprites.picture),
        visible=np.asarray(sprites.visible),
        shape=np.asarray(theme.sprite_art)[:, 0],
        radius=np.asarray(theme.sprite_radius),
        drop=np.asarray(theme.sprite_drop),
        labels=np.asarray(theme.sprite_labels),
    )


def picture_of(
    world: World, sprites: Sprites, theme: Theme, camera: Camera, layers: int, pose: int = 0
) -> images.Picture:
    """The reference image of one pose of a bordered world."""
    return images.draw(
        world.solid,
        world.walls,
        world.positions[pose].astype(np.float64),
        float(world.headings[pose]),
        billboards_of(sprites, theme),
        height=camera.height,
        width=camera.width,
        field_of_view=camera.field_of_view,
        layers=layers,
        room=(camera.eye, camera.wall - camera.eye),
        row_focal=camera.row_focal,
    )


def no_sprites() -> Sprites:
    """No billboards."""
    return Sprites(
        position=np.zeros((0, 2), np.float32),  # type: ignore[arg-type]
        picture=np.zeros(0, np.int32),  # type: ignore[arg-type]
        visible=np.zeros(0, bool),  # type: ignore[arg-type]
    )


@functools.cache
def renderer(camera: Camera, kind: Any, layers: int = 4) -> Any:
    """A jitted `render` whose theme is a constant, as in an environment."""
    theme = plain_theme()

    @jax.jit
    def run(level: Any, closed: Any, position: Any, heading: Any, sprites: Sprites) -> jax.Array:
        return render(Scene(level, closed, position, heading, sprites, theme), camera, kind, layers)

    return run
