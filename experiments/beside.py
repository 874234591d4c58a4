"""Success over minutes of a run directory and of trainings in the game, in one picture.

    python -m experiments.beside RUN FILE [FILE ...] --label TEXT --out PICTURE.png

RUN is of `jaxenstein train`; every FILE is a seed's rows of `experiments.sb3_in_vizdoom` or
`experiments.in_vizdoom`, and `--label` says what they are.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from jaxenstein.baselines.runs.curves import Curve, curves_of, save_plot


def main(argv: Sequence[str] | None = None) -> None:
    """Read the command line and draw."""
    parser = argparse.ArgumentParser(prog="python -m experiments.beside", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("run", type=Path, metavar="RUN")
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE")
    parser.add_argument("--label", required=True, metavar="TEXT")
    parser.add_argument("--title", default="", metavar="TEXT")
    parser.add_argument("--points", type=int, default=20, metavar="N")
    parser.add_argument("--out", type=Path, required=True, metavar="PICTURE.png")
    options = parser.parse_args(argv)
    curves = curves_of(options.run, "success", over="minutes")
    curves.append(in_the_game(options.files, options.label, options.points))
    save_plot(curves, [options.out], "success", options.title)
    print(f"wrote {options.out}")


def in_the_game(files: Sequence[Path], label: str, points: int) -> Curve:
    """The curve of some seeds, pooled into equal spans of time as long as the shortest of them."""
    seeds = [
        np.array([[row["seconds"], row["successes"], row["episodes"]] for row in rows])
        for rows in (
            [json.loads(line) for line in file.read_text("utf-8").splitlines()] for file in files
        )
    ]
    ends = np.linspace(0, min(rows[-1, 0] for rows in seeds), points + 1)[1:]
    values = np.full((len(seeds), points), np.nan)
    for number, rows in enumerate(seeds):
        span = np.searchsorted(ends, rows[:, 0])
        for point in range(points):
            _, successes, episodes = rows[span == point].sum(axis=0)
            if episodes:
                values[number, point] = successes / episodes
    return Curve(label, ends / 60, values, "minutes")


if __name__ == "__main__":
    main()
