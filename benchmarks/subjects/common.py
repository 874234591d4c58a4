"""Common parts of all subjects; uses only the standard library and NumPy, since peers import it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

Chunk = Callable[[], int]
"""Makes some steps of the world, and returns their number."""
Options = Mapping[str, str]
"""The options in a subject's name, such as `{"id": "key-door", "size": "84x84"}`."""
Builder = Callable[[int, Options], Chunk]
"""Builds a subject with a number of environments."""
Subjects = Mapping[str, Builder]

ENVIRONMENT_ID = "my-way-home"
SIZE = 64
STEPS_A_CALL = 2**15
# Steps per update of a training, and its length, for learning rate schedules: only its start runs.
ROLLOUT, TRAINED_STEPS = 128, 10_000_000
SCENARIOS = ("my-way-home", "health-gathering", "health-gathering-supreme")
# Scenarios with `look="game"`.
PICTURED = ("my-way-home", "health-gathering", "health-gathering-supreme", "defend-the-center")
FIGHTS = (
    "defend-the-center", "defend-the-line", "deadly-corridor", "take-cover", "deathmatch",
)  # fmt: skip
SHOOTING = ("basic", "predict-position", *FIGHTS)

# Facts for readers that only the running subject knows, such as the renderer.
notes: dict[str, str] = {}


def random_actions(count: int, *shape: int) -> Iterator[Any]:
    """An endless cycle of uniform actions below `count`: int32[shape], or integers without shape.

    Actions are sampled in advance, so that steps do not include sampling.
    """
    rows = max(256, 2**14 // math.prod(shape))
    sampled = np.random.default_rng(0).integers(count, size=(rows, *shape), dtype=np.int32)
    return itertools.cycle(sampled if shape else sampled.tolist())


def random_loop(
    step: Callable[[Any], Any],
    count: int,
    calls: int,
    steps: int,
    *shape: int,
) -> Chunk:
    """A random policy that adds a pixel of every frame to the next action, so that frames are read.

    Args:
        step: takes actions, and returns a pixel of each next frame.
        count: number of actions.
        calls: calls of `step` per chunk.
        steps: steps of the world per call.
        shape: shape of the actions; none for one integer.
    """
    actions, pixel = random_actions(count, *shape), 0

    def chunk() -> int:
        nonlocal pixel
        for _ in range(calls):
            pixel = step((next(actions) + pixel) % count)
        return calls * steps

    return chunk


def middle(frame: np.ndarray) -> int:
    """The red channel of the middle pixel."""
    return int(frame[frame.shape[0] // 2, frame.shape[1] // 2, 0])


def frame_skip(options: Options) -> int:
    """The option `frame_skip`, 1 by default."""
    return int(options.get("frame_skip", 1))


def image_size(options: Options, usual: str = f"{SIZE}x{SIZE}") -> tuple[int, int]:
    """(width, height) of the option `size`, such as 84x84."""
    width, _, height = options.get("size", usual).partition("x")
    return int(width), int(height)
