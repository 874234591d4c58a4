"""The figures of a comparison of views: a game's screens against the engine's depths and walls."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fidelity.view_errors import (
    Projection,
    around,
    column_colours,
    match_jumps,
    near_jumps,
    recognised,
    spread,
)
from fidelity.vizdoom_screen import DepthScale, View
from jaxenstein.tasks.doom.lattice import WALL, Tiles

# Rays cast in each pixel: the middle one through its centre, the first next to its left edge.
FINE = 9
# An edge this many rows off is an outlier; one that moves this many rows a column is steep.
OUTLIER = 2.0
STEEP = 1.0


def compare(
    views: Sequence[View],
    depth: np.ndarray,
    control: np.ndarray,
    scale: DepthScale,
    screen: Projection,
) -> dict[str, Any]:
    """The figures of geometry; see `errors_of` for those of each set of rays.

    Args:
        views: the poses, N of them, W columns wide.
        depth: float64[N, W * FINE], the engine's depths in map units.
        control: the same from wrong poses.
        scale: of the game's depth buffer.
        screen: how the game draws walls.
    """
    eyes = [view.eye for view in views]
    return {
        "poses": len(views),
        "columns": depth.size // FINE,
        "columns_with_sprites": int(sum(view.sprite.sum() for view in views)),
        "columns_too_near": int(sum((view.value == 0).sum() for view in views)),
        "eye_lowest": min(eyes),
        "eye_highest": max(eyes),
        "depth_scale": vars(scale),
        "centre": errors_of(views, depth[:, FINE // 2 :: FINE], scale, screen),
        "left": errors_of(views, depth[:, ::FINE], scale, screen),
        "control": errors_of(views, control[:, FINE // 2 :: FINE], scale, screen),
    }


def texture_report(
    views: Sequence[View], depth: np.ndarray, wall: np.ndarray, tiles: Tiles
) -> dict[str, Any]:
    """What colours the real screen has where the engine says a texture is.

    Args:
        views: the poses, N of them.
        depth: float64[N, W], the engine's depths.
        wall: uint8[N, W], labels of the faces that the engine sees.
        tiles: the map.
    """
    colours = np.stack([column_colours(view.screen, view.top, view.bottom) for view in views])
    clear = np.stack([~view.sprite & (view.value > 0) for view in views])
    use = clear & ~np.isnan(colours[..., 0]) & (wall > WALL)
    # Light falls with depth, so columns are compared with those of about their own.
    traits = np.concatenate([colours, 20 * np.log(depth)[..., None]], axis=-1)
    sample = use & (np.arange(depth.shape[1]) % 8 == 0)
    even = sample & (np.arange(len(views)) % 2 == 0)[:, None]
    odd = sample & ~even
    by_name = {}
    for number, name in enumerate(tiles.textures):
        own = colours[use & (wall == WALL + 1 + number)]
        by_name[name] = {
            "columns": len(own),
            "mean_rgb": own[:, :3].mean(axis=0).tolist() if len(own) else None,
        }
    return {
        "by_name": by_name,
        "judged": int(odd.sum()),
        "recognised": recognised(traits[even], wall[even], traits[odd], wall[odd]),
    }


def errors_of(
    views: Sequence[View], depths: np.ndarray, scale: DepthScale, screen: Projection
) -> dict[str, Any]:
    """The errors of one set of depths, float64[N, W] in map units.

    Columns that show a sprite, and those nearer than the depth buffer's value 1, are left out.
    """
    clear = [~view.sprite & (view.value > 0) for view in views]
    relative: list[np.ndarray] = []
    away: list[np.ndarray] = []
    steps: list[np.ndarray] = []
    shifts: list[int | None] = []
    for view, depth, seen in zip(views, depths, clear, strict=True):
        real = screen.depth_of(view.top, view.bottom, view.eye)
        known = seen & ~np.isnan(real)
        relative.append((depth / real - 1)[known])
        away.append((depth / real - 1)[known & ~near_jumps(depth, within=2)])
        steps.append((scale.value_of(depth) - view.value)[seen])
        shifts += match_jumps(np.where(seen, scale.middle(view.value), np.nan), depth)
    matched = [shift for shift in shifts if shift is not None]
    step = np.concatenate(steps)
    return {
        **edge_errors(views, depths, clear, screen),
        "relative_depth": spread(np.concatenate(relative)),
        "relative_depth_away": spread(np.concatenate(away)),
        "depth_value_equal": float((step == 0).mean()),
        "depth_value_within_one": float((np.abs(step) <= scale.quantum).mean()),
        "depth_columns": len(step),
        "jumps": len(shifts),
        "jumps_matched": len(matched),
        "jump_columns": spread(np.array(matched)),
        "jump_shifts": {str(s): matched.count(s) for s in sorted(set(matched))},
    }


def edge_errors(
    views: Sequence[View], depths: np.ndarray, clear: Sequence[np.ndarray], screen: Projection
) -> dict[str, Any]:
    """Errors of the rows of the walls' edges, and where the large ones stand."""
    off: dict[str, list[np.ndarray]] = {"upper": [], "lower": []}
    outliers = {"next to a jump": 0, "steep edge": 0, "other": 0}
    for view, depth, seen in zip(views, depths, clear, strict=True):
        top, bottom = screen.edges(depth, view.eye)
        beside = near_jumps(depth, within=2)
        edges = (
            ("upper", view.top, top, seen & (view.top > 0)),
            ("lower", view.bottom, bottom, seen & (view.bottom < screen.height)),
        )
        for name, real, ours, visible in edges:
            apart = np.stack([real - ours, around(real, ours)])
            off[name].append(apart[:, visible])
            bad = visible & (np.abs(apart[0]) > OUTLIER)
            steep = np.abs(np.gradient(ours)) > STEEP
            outliers["next to a jump"] += int((bad & beside).sum())
            outliers["steep edge"] += int((bad & steep & ~beside).sum())
            outliers["other"] += int((bad & ~steep & ~beside).sum())
    joined = {name: np.concatenate(parts, axis=1) for name, parts in off.items()}
    every = np.concatenate(list(joined.values()), axis=1)
    return {
        "edges": every.shape[1],
        "rows": {name: spread(values[0]) for name, values in joined.items()},
        "within_one_row": float((np.abs(every[0]) <= 1).mean()),
        "within_one_pixel": float((every[1] <= 1).mean()),
        "outliers": outliers,
    }
