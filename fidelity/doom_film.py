"""A film of an agent here, on the left, and in ViZDoom, on the right, from the same start.

    python -m fidelity.doom_film RUN FILE.webp [--greedy] [--run N] [--seed N] [--most-bytes N]

Needs the extras `baselines` and `vizdoom`. RUN is as in `jaxenstein evaluate`. The agent sees
observations of its own size; both pictures have 160x120 pixels and its environment's look. The film
shows every step in real time or, if the file would be too large, only every second, third, ...
"""

from __future__ import annotations

import argparse
import io
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from jaxenstein.baselines import load_policy
from jaxenstein.cli.beside_vizdoom import play_both
from jaxenstein.errors import SettingError
from jaxenstein.files import atomic, check_writable

# Tics of the game per second, and what `--most-bytes` is by default.
TICS, MOST_BYTES = 35, 1_000_000
SUFFIXES = ".webp", ".gif"
GAP, BRIGHT = 4, 255


def side_by_side(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """uint8[n, h, w, 3]: two films; the shorter one repeats its last frame."""
    count = max(len(left), len(right))
    both = [film[np.minimum(np.arange(count), len(film) - 1)] for film in (left, right)]
    gap = np.full((*both[0].shape[:2], GAP, 3), BRIGHT, np.uint8)
    return np.concatenate([both[0], gap, both[1]], axis=2)


def encoded(frames: np.ndarray, suffix: str, seconds: float, most: int) -> bytes:
    """The film with as many frames as fit.

    Args:
        frames: uint8[n, h, w, 3].
        suffix: one of `SUFFIXES`.
        seconds: from one frame to the next.
        most: bytes.

    Raises:
        SettingError: not even two frames fit.
    """
    for every in range(1, max(2, len(frames))):
        shown = [Image.fromarray(frame) for frame in (*frames[:-1:every], frames[-1])]
        data = io.BytesIO()
        duration = round(1000 * seconds * every)
        how = {"save_all": True, "append_images": shown[1:], "duration": duration, "loop": 0}
        if suffix == ".webp":
            shown[0].save(data, "WEBP", quality=60, method=4, **how)
        else:
            shown[0].save(data, "GIF", **how)
        if data.tell() <= most:
            return data.getvalue()
    raise SettingError(f"the film does not fit into {most} bytes: allow more with --most-bytes")


def main(argv: Sequence[str] | None = None) -> int:
    """Play, draw, write."""
    parser = argparse.ArgumentParser(description="Film an agent here and in ViZDoom.")
    parser.add_argument("agent", metavar="RUN", help="a run directory, FILE.npz or pretrained/NAME")
    parser.add_argument("file", type=Path, help="the film to write, .webp or .gif")
    parser.add_argument("--greedy", action="store_true", help="take the most likely actions")
    parser.add_argument("--run", type=int, metavar="N", help="number of the run (default: best)")
    parser.add_argument("--seed", type=int, default=0, help="of the episode (default %(default)s)")
    parser.add_argument("--most-bytes", type=int, default=MOST_BYTES, help="(default %(default)s)")
    options = parser.parse_args(argv)
    if options.file.suffix not in SUFFIXES:
        parser.error(f"{options.file} must end in {' or '.join(SUFFIXES)}")
    check_writable(options.file)
    policy = load_policy(options.agent, options.run, greedy=options.greedy)
    here, there = play_both(policy, options.seed)
    frames = side_by_side(here.frames, there.frames)
    seconds = policy.env.frame_skip / TICS
    data = encoded(frames, options.file.suffix, seconds, options.most_bytes)
    with atomic(options.file) as temporary:
        temporary.write_bytes(data)
    print(f"{here.summary()}; {there.summary()}, wrote {options.file}, {len(data):,} bytes")
    return 0


if __name__ == "__main__":
    sys.exit(main())
