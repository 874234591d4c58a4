"""How far what a game shows lies from what the engine's rays say: errors of edges and depths.

Everything here is numpy on one column or one pose at a time; it needs no game.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# A depth jumps between two columns where it changes by this factor and by this many map units.
JUMP_RATIO = 1.2
JUMP_LEAST = 20.0
# A jump just below those bounds on one side is no disagreement: on the other they are lower.
LENIENT = 0.6
# How far off, in columns, the jump that belongs to another one is looked for.
REACH = 4


@dataclass(frozen=True)
class Projection:
    """How a game puts walls onto its screen.

    Attributes:
        height: rows of the screen.
        focal: distance of the image plane in rows.
        ceiling: height of the walls in map units.
    """

    height: int
    focal: float
    ceiling: float

    def edges(self, depth: np.ndarray, eye: float) -> tuple[np.ndarray, np.ndarray]:
        """Rows (real numbers, 0 the screen's upper border) of a wall's upper and lower edge.

        Args:
            depth: perpendicular depth in map units, of any shape.
            eye: height of the eye above the floor in map units.
        """
        middle = self.height / 2
        return middle - self.focal * (self.ceiling - eye) / depth, middle + self.focal * eye / depth

    def depth_of(self, top: np.ndarray, bottom: np.ndarray, eye: float) -> np.ndarray:
        """Depth in map units of walls, from their edges.

        By the height of the wall where both edges are on the screen, else by the lower edge; nan
        where that is below the screen.

        Args:
            top: int[W], first row of the wall.
            bottom: int[W], first row below it.
            eye: height of the eye above the floor in map units.
        """
        seen_bottom = (bottom > 0) & (bottom < self.height)
        seen_both = seen_bottom & (top > 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            by_height = self.focal * self.ceiling / (bottom - top)
            by_bottom = self.focal * eye / (bottom - self.height / 2)
        return np.where(seen_both, by_height, np.where(seen_bottom, by_bottom, np.nan))


def jumps(depth: np.ndarray, leniency: float = 1.0) -> np.ndarray:
    """int[K], columns c at which the depth jumps between c - 1 and c.

    Of adjacent columns that all qualify, such as of a wall seen at a grazing angle, the one with
    the greatest change counts.

    Args:
        depth: float[W], in map units.
        leniency: factor on the bounds of what counts as a jump.
    """
    ratio = np.abs(np.diff(np.log(np.maximum(depth, 1e-6))))
    strong = ratio > leniency * np.log(JUMP_RATIO)
    strong &= np.abs(np.diff(depth)) > leniency * JUMP_LEAST
    change = np.where(strong, ratio, 0.0)
    here = [c for c in np.flatnonzero(strong) if change[c] == change[max(c - 1, 0) : c + 2].max()]
    return np.array(here, int) + 1


def match_jumps(real: np.ndarray, ours: np.ndarray, reach: int = REACH) -> list[int | None]:
    """For each real jump, how many columns to the right ours stands; None if there is none near.

    Args:
        real: float[W], depths that the game shows.
        ours: float[W], depths of the engine.
        reach: how far off it may stand.
    """
    candidates = jumps(ours, LENIENT)
    matches: list[int | None] = []
    for column in jumps(real):
        nearer = real[column] < real[column - 1]
        same = [c for c in candidates if (ours[c] < ours[c - 1]) == nearer]
        offsets = sorted((int(c - column) for c in same), key=abs)
        near = [offset for offset in offsets if abs(offset) <= reach]
        matches.append(near[0] if near else None)
    return matches


def near_jumps(depth: np.ndarray, within: int = 1) -> np.ndarray:
    """bool[W], the columns at most `within` away from the border between the sides of a jump."""
    near = np.zeros(depth.shape, bool)
    for column in jumps(depth, LENIENT):
        near[max(column - within, 0) : column + within] = True
    return near


def around(rows: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """float[W], how far each row lies outside the range of an edge; 0 inside.

    The range is that over the row's column and the next columns on both sides.

    Args:
        rows: float[W], what is judged.
        edge: float[W], the rows of the edge by column.
    """
    ends = np.pad(edge, 1, mode="edge")
    lowest = np.minimum(np.minimum(ends[:-2], ends[2:]), edge)
    highest = np.maximum(np.maximum(ends[:-2], ends[2:]), edge)
    return np.maximum(np.maximum(lowest - rows, rows - highest), 0.0)
