"""A sheet of frames in random order, half of them ours with `look="game"`, half the game's.

    python -m fidelity.doom_sheet FILE.webp [--frames N] [--seed N]

Needs the extra `vizdoom`. The game plays random buttons. Ours are drawn from pose and things
of other states of it. Prints which frames are ours, numbered row by row. The file, at most 400 kB,
has pictures of the WAD file, so Freedoom's licence (BSD) applies to it.
"""

from __future__ import annotations

import argparse
import io
import random
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from fidelity.commands import run_command
from fidelity.doom_looks import LEVEL, ours
from fidelity.doom_picture import SIZES, renderers
from fidelity.doom_views import fitted, views
from jaxenstein.cli.arguments import add_seed, whole
from jaxenstein.files import atomic, check_writable
from jaxenstein.tasks.doom.wad import Wad, find_iwad
from jaxenstein.view.recording import mosaic

SIZE, COLUMNS = SIZES[1], 4
# Of so many frames of an episode, one is shown. Others look nearly like it.
ONE_OF = 4
MOST_BYTES = 400_000


def sheet(frames: int, seed: int) -> tuple[np.ndarray, list[int]]:
    """uint8[h, w, 3], the numbered frames, and the numbers of ours."""
    draw, pictures = random.Random(seed), Wad(find_iwad())
    here = sorted(draw.sample(range(frames), frames // 2))
    shown: list[np.ndarray] = [np.zeros(0)] * frames
    order = draw.sample(range(frames), frames)
    for number, scenario in enumerate(LEVEL):
        places = order[number :: len(LEVEL)]
        screen = renderers(scenario, pictures)[SIZE]
        played = list(views(scenario, SIZE, ONE_OF * len(places), seed))[::ONE_OF]
        found = [fitted([screen], pictures, [view])[0] for view in played]
        drawn = ours(scenario, found, SIZE)
        for place, view, image in zip(places, found, drawn, strict=True):
            shown[place] = image if place in here else view.frame
    return mosaic(np.stack(shown), COLUMNS), [place + 1 for place in here]


def numbered(image: np.ndarray, frames: int) -> Image.Image:
    """The sheet with a number at the upper left of each frame."""
    picture = Image.fromarray(image)
    pen = ImageDraw.Draw(picture)
    width, height = (side + 2 for side in SIZE)
    for i in range(frames):
        corner = 6 + i % COLUMNS * width, 4 + i // COLUMNS * height
        pen.text(corner, str(i + 1), fill="white", stroke_fill="black", stroke_width=2)
    return picture


def encoded(picture: Image.Image) -> bytes:
    """The picture as WebP, in the best quality that is small enough.

    Raises:
        ValueError: none is.
    """
    for quality in range(95, 5, -5):
        data = io.BytesIO()
        picture.save(data, "WEBP", quality=quality, method=6)
        if data.tell() <= MOST_BYTES:
            return data.getvalue()
    raise ValueError(f"the sheet does not fit into {MOST_BYTES} bytes; draw fewer frames")


def main(argv: Sequence[str] | None = None) -> int:
    """Play, draw, write, print the answers."""
    parser = argparse.ArgumentParser(description="Draw a sheet of our frames and of the game's.")
    parser.add_argument("file", type=Path, help="a .webp file")
    parser.add_argument("--frames", type=whole(), default=20, help="(default %(default)s)")
    add_seed(parser)
    options = parser.parse_args(argv)
    check_writable(options.file)
    image, here = sheet(options.frames, options.seed)
    with atomic(options.file) as temporary:
        temporary.write_bytes(encoded(numbered(image, options.frames)))
    print(f"ours: {', '.join(map(str, here))}; all others are the game's")
    return 0


if __name__ == "__main__":
    run_command(main)
