"""What all subjects share; the standard library and NumPy alone, since peers import it too."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

Chunk = Callable[[], int]
"""Makes some steps of the world and returns how many."""
Options = Mapping[str, str]
"""The words of a subject's name behind its kind, such as `{"id": "key-door", "size": "84x84"}`."""
Builder = Callable[[int, Options], Chunk]
"""Builds a subject of so many environments."""
Subjects = Mapping[str, Builder]

ENVIRONMENT_ID = "my-way-home"
SIZE = 64
STEPS_A_CALL = 2**15
# How many frames `keep` keeps: 100 MB of 64x64 ones, more than fit into caches.
FRAMES_KEPT = 2**13
# Of a whole training, over which learning rates fall; only its beginning is run.
TRAINED_STEPS = 10_000_000
SCENARIOS = ("my-way-home", "health-gathering", "health-gathering-supreme")
SHOOTING = (
    "basic", "defend-the-center", "defend-the-line", "deadly-corridor", "predict-position",
    "take-cover", "deathmatch",
)  # fmt: skip

# What a reader should know and only the running subject can tell, such as the renderer.
notes: dict[str, str] = {}


def random_actions(count: int, *shape: int) -> Iterator[Any]:
    """Uniform actions below `count`, round and round: int32[shape], or whole numbers without one.

    They are sampled beforehand, so that sampling is part of no step.
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
    convert: Callable[[Any], Any] = lambda action: action,
) -> Chunk:
    """A random policy of which a pixel of every frame shifts the next action, so that all are read.

    Args:
        step: takes actions and gives the pixels of the frames that follow.
        count: of actions.
        calls: of `step` in a chunk.
        steps: of the world in a call.
        shape: of the actions; none for one whole number.
        convert: makes of NumPy's actions what `step` takes and its pixels are.
    """
    actions, pixel = map(convert, random_actions(count, *shape)), 0

    def chunk() -> int:
        nonlocal pixel
        for _ in range(calls):
            pixel = step((next(actions) + pixel) % count)
        return calls * steps

    return chunk


def middle(frame: np.ndarray) -> int:
    """The red of the pixel in the middle."""
    return int(frame[frame.shape[0] // 2, frame.shape[1] // 2, 0])


def image_size(options: Options, usual: str = f"{SIZE}x{SIZE}") -> tuple[int, int]:
    """(width, height) of the option `size`, such as 84x84."""
    width, _, height = options.get("size", usual).partition("x")
    return int(width), int(height)


def frame_skip(options: Options) -> int:
    """How many steps of the world an action lasts. All of them count, also past an early end."""
    return int(options.get("frame_skip", "1"))
