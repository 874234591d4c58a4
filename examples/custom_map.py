"""Your own map: draw it in characters, walk through it, and look at pictures.

    python examples/custom_map.py [--out FOLDER]

writes `map.png`, the map from above, and `walk.gif`, the view of the agent beside its path.
`jaxenstein list --symbols` explains the characters.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import jaxenstein
from jaxenstein import record
from jaxenstein.files import make_folder
from jaxenstein.view.recording import save_png
from jaxenstein.view.topdown import draw_map

# The key `b` opens the blue door `B`; walls `2` have another colour.
MAP = """
##########
#S..#2222#
#...B...G2
#b..#2222#
##########
"""
LEFT, RIGHT, FORWARD, INTERACT = 0, 1, 2, 4
# South to the key, back to the middle row, east to the door, open it, and on to the goal. A turn is
# 15 degrees, and a step forward is 0.15 tiles.
WALK = (
    [RIGHT] * 6
    + [FORWARD] * 13
    + [LEFT] * 12
    + [FORWARD] * 7
    + [RIGHT] * 6
    + [FORWARD] * 14
    + [INTERACT]
    + [FORWARD] * 40
)


def main(argv: Sequence[str] | None = None) -> float:
    """Walk and write the pictures; return the return of the episode."""
    parser = argparse.ArgumentParser(description="Walk through a map of your own.")
    parser.add_argument("--out", type=Path, default=Path("demo"), help="folder for the pictures")
    options = parser.parse_args(argv)
    folder = make_folder(options.out)
    env, params = jaxenstein.from_ascii(MAP, heading=0.0, width=96, height=72)
    picture = draw_map(env.tilemap, scale=36).things()
    save_png(np.asarray(picture.image()), folder / "map.png")
    episode = record(env, params, WALK)
    episode.save(folder / "walk.gif", every=2)
    print(episode.summary())
    print(f"wrote {folder / 'map.png'} and {folder / 'walk.gif'}")
    return float(episode.returns[-1])


if __name__ == "__main__":
    main()
