"""Rays against walls at any place and angle: each ray with each wall, in float64."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# Float32 may put an end of a wall on the other side of a ray that passes this near to it, and may
# mistake which of two walls is nearer whose depths differ by this share.
BESIDE, TIE = 1e-5, 1e-4


class Sight(NamedTuple):
    """What N rays meet: depth, number of the wall, place on it from its left end (0) to its right
    end (1), and whether rounding can decide otherwise."""

    depth: np.ndarray
    number: np.ndarray
    along: np.ndarray
    sure: np.ndarray


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Of vectors [..., 2]."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def cast(left: np.ndarray, right: np.ndarray, eye: np.ndarray, rays: np.ndarray) -> Sight:
    """Follow N rays float64[N, 2] from an eye to L walls with ends float64[L, 2], y downwards."""
    way, offset = right - left, left - eye
    # Whether the eye is on the side from which the left end is on the left.
    front = cross(offset, way) > 0
    turn = cross(rays[:, None], way)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = cross(offset, way) / turn
        along = cross(offset[None], rays[:, None]) / turn
    ahead = front & (turn != 0) & (depth > 0)
    met = ahead & (along >= 0) & (along <= 1)
    depth = np.where(ahead, depth, np.inf)
    reach = np.where(met, depth, np.inf)
    number, each = reach.argmin(axis=1), np.arange(len(rays))
    first = reach[each, number]
    other = np.where(np.arange(len(left)) == number[:, None], np.inf, reach).min(axis=1)
    # How far from a ray the ends of what is not hidden are, as seen from where they are.
    ends = np.stack([offset, offset + way])
    beside = np.abs(cross(rays[:, None], ends[:, None])) / np.linalg.norm(rays, axis=1)[:, None]
    near = (beside < BESIDE * (1 + np.linalg.norm(ends, axis=2)[:, None])).any(axis=0)
    doubtful = (near & front & (depth <= first[:, None] * (1 + TIE))).any(axis=1)
    return Sight(first, number, along[each, number], ~doubtful & (other > first * (1 + TIE)))
