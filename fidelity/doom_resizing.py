"""Frames of `look="game"` beside the game's, resized in the usual ways.

    python -m fidelity.doom_resizing [--frames N] [--seed N] [--only NAME]

Needs the extras `vizdoom` and `bench` (OpenCV). The game plays random buttons at two sizes of its
screen. Of each of its frames, resized to some sizes, and of ours, drawn at these sizes with one
sample and with two, the share of pixels with three equal bytes and the mean absolute error of a
byte are printed.
"""

# pyright: reportMissingImports=false

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence

import cv2
import numpy as np
from PIL import Image

from fidelity.commands import run_command
from fidelity.doom_looks import SCENARIOS, ours
from fidelity.doom_picture import SIZES, renderers
from fidelity.doom_views import fitted, views
from jaxenstein.cli.arguments import add_seed, whole
from jaxenstein.tasks.doom.wad import Wad, find_iwad

SMALL = (64, 48), (64, 64), (84, 84)
Resize = Callable[[np.ndarray, tuple[int, int]], np.ndarray]


def with_pillow(how: Image.Resampling) -> Resize:
    """Resize by Pillow."""
    return lambda frame, size: np.asarray(Image.fromarray(frame).resize(size, how))


def with_opencv(how: int) -> Resize:
    """Resize by OpenCV."""
    return lambda frame, size: np.asarray(cv2.resize(frame, size, interpolation=how))


WAYS: Mapping[str, Resize] = {
    "nearest, Pillow": with_pillow(Image.Resampling.NEAREST),
    "nearest, OpenCV": with_opencv(cv2.INTER_NEAREST),
    "linear, OpenCV": with_opencv(cv2.INTER_LINEAR),
    "area, OpenCV": with_opencv(cv2.INTER_AREA),
    "box, Pillow": with_pillow(Image.Resampling.BOX),
    "bilinear, Pillow": with_pillow(Image.Resampling.BILINEAR),
}


def cells(images: Sequence[np.ndarray], frames: Sequence[np.ndarray]) -> str:
    """The share of equal pixels and the mean absolute error, as two cells of a table."""
    pairs = list(zip(images, frames, strict=True))
    equal = np.mean([(a == b).all(axis=-1).mean() for a, b in pairs])
    error = np.mean([np.abs(a.astype(int) - b).mean() for a, b in pairs])
    return f"{equal:.1%} | {error:.2f}"


def main(argv: Sequence[str] | None = None) -> int:
    """Play, draw, print a table."""
    parser = argparse.ArgumentParser(description="Compare with ways of resizing the game's frames.")
    parser.add_argument("--frames", type=whole(), default=60, help="of each (default %(default)s)")
    add_seed(parser)
    parser.add_argument("--only", choices=SCENARIOS, help="one scenario")
    options = parser.parse_args(argv)
    pictures = Wad(find_iwad())
    print("| scenario | to | resized | from | one sample: equal | error | two: equal | error |")
    print("|---|---|---|---|---:|---:|---:|---:|")
    for scenario in [options.only] if options.only else SCENARIOS:
        screens = renderers(scenario, pictures)
        order = [screens[size] for size in SIZES]
        played = [views(scenario, size, options.frames, options.seed) for size in SIZES]
        both = [fitted(order, pictures, one) for one in zip(*map(list, played), strict=True)]
        for size in SMALL:
            drawn = [ours(scenario, [one[0] for one in both], size, n) for n in (1, 2)]
            for name, resize in WAYS.items():
                for number, (width, height) in enumerate(SIZES):
                    frames = [resize(one[number].frame, size) for one in both]
                    found = " | ".join(cells(images, frames) for images in drawn)
                    to = "{}x{}".format(*size)
                    print(
                        f"| {scenario} | {to} | {name} | {width}x{height} | {found} |", flush=True
                    )
    return 0


if __name__ == "__main__":
    run_command(main)
