"""Train one configuration with several algorithms, and draw their learning curves together.

    python -m experiments.compare experiments/figure3/simple.toml --out runs/figure3/simple

Each algorithm gets a run directory of `jaxenstein train` below DIR. The same command goes on
with what is not finished, so a run may be spread over several sessions: `--minutes` ends one.
Where it ends, DIR has return.png, success.png and summary.md; a later session replaces them.
"""

from __future__ import annotations

import argparse
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from jaxenstein.baselines.runs.curves import curves_of, save_plot
from jaxenstein.baselines.runs.sweeps import summary
from jaxenstein.cli.sweep import table
from jaxenstein.errors import JAXensteinError

# The numbers of the exploration bonuses: one point of the paper's grids each. ICM's bonus is added
# to the reward, so the smallest factor is the one that leaves a reward of 1 visible.
NUMBERS = {
    "ppo": [],
    "rnd": ["--bonus-reward", "1", "--rnd-loss", "0.1"],
    "icm": ["--bonus-reward", "0.1", "--bonus-learning-rate", "3e-4"],
}
METRICS = ("return", "success")


def train(options: argparse.Namespace, algo: str, deadline: float | None) -> bool:
    """Train one algorithm, or go on with it; whether it is finished."""
    folder = options.out / algo
    command = [sys.executable, "-m", "jaxenstein.cli", "train", "--out", str(folder)]
    command += ["--config", str(options.config), "--algo", algo, *NUMBERS[algo]]
    command += [] if options.seeds is None else ["--seeds", str(options.seeds)]
    # With the options of before again, which it compares.
    command += ["--resume"] if (folder / "config.json").exists() else []
    with subprocess.Popen(command) as process:
        try:
            process.wait(None if deadline is None else max(1.0, deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            # It ends after the update that runs, with a checkpoint.
            process.send_signal(signal.SIGINT)
            process.wait()
        except KeyboardInterrupt:
            # The terminal has told it too.
            process.wait()
            raise
    if process.returncode not in (0, 130):
        raise SystemExit(process.returncode)
    return process.returncode == 0


def report(options: argparse.Namespace, folders: Sequence[Path]) -> str:
    """Draw the curves and write the table; returns the table."""
    for metric in METRICS:
        curves = [curve for folder in folders for curve in curves_of(folder, metric, 50)]
        save_plot(curves, [options.out / f"{metric}.png"], metric, options.config.stem)
    text = table(summary(folders))
    (options.out / "summary.md").write_text(f"```\n{text}\n```\n")
    return text


def main() -> None:
    """Train, draw and print."""
    parser = argparse.ArgumentParser(
        description="Train a configuration with several algorithms and draw their curves."
    )
    parser.add_argument("config", type=Path, help="options of 'jaxenstein train' as TOML")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("--algo", nargs="+", default=list(NUMBERS), choices=list(NUMBERS))
    parser.add_argument("--seeds", type=int, metavar="N", help="instead of the file's number")
    parser.add_argument("--minutes", type=float, metavar="M", help="stop after so many, to go on")
    options = parser.parse_args()
    deadline = None if options.minutes is None else time.monotonic() + 60 * options.minutes
    options.out.mkdir(parents=True, exist_ok=True)
    done = []
    for algo in options.algo:
        if deadline is None or time.monotonic() < deadline:
            done.append(train(options, algo, deadline))
    folders = [options.out / algo for algo in options.algo]
    folders = [folder for folder in folders if (folder / "metrics.jsonl").exists()]
    if not folders:
        raise SystemExit("nothing is trained yet: the same command goes on")
    try:
        print(report(options, folders))
    except JAXensteinError as error:
        raise SystemExit(f"no curves yet: {error}") from error
    if len(done) < len(options.algo) or not all(done):
        raise SystemExit("not finished: the same command goes on")


if __name__ == "__main__":
    main()
