"""Which numbers learn fastest on the clock: variants of one training, and a table of them.

    python -m experiments.study STUDY --out DIR
    python -m experiments.study STUDY --out DIR --only "1 epoch" "4 epochs"

STUDY is a TOML file: `base` is what `jaxenstein train --config` takes, a path relative to the file
or the name of a configuration of this package; `[shared]` has options in which all differ from it,
every line of `[variants]` is a name with those in which that one does besides, and `reach` is the
success rate to be reached. Each is trained into a run directory below DIR, all its seeds side by
side; the same command goes on with what is not finished. With `--only` several cores can share the
variants, and the first command then has the table. The table has the decisions and the seconds
after which the median seed and the last one reached it, over three updates, and the success over
the last tenth of the training, seed by seed. Seconds are of all seeds together and without
compiling, which a cache may have done.
"""

from __future__ import annotations

import argparse
import re
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jaxenstein.baselines.runs.configs import find_config
from jaxenstein.baselines.runs.folder import RunFolder
from jaxenstein.baselines.runs.metrics import read_metrics, read_seconds, rows_by_run
from jaxenstein.baselines.runs.options import read_file, resolve
from jaxenstein.baselines.runs.training import train
from jaxenstein.progress import Progress

# Updates whose episodes are pooled, and the fewest episodes in them: where all begin together,
# those that end early are the successful ones.
POOLED, FEWEST = 3, 20
HEAD = (
    "| variant | solved | at the end, % | decisions: median, last | seconds: median, last | "
    "decisions a second |"
)


def main(argv: Sequence[str] | None = None) -> None:
    """Train what is not trained yet, and print the table."""
    parser = argparse.ArgumentParser(prog="python -m experiments.study", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("study", type=Path, metavar="STUDY")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="train and show these variants")
    options = parser.parse_args(argv)
    study = read(options.study)
    names = options.only or study["variants"]
    if unknown := [name for name in names if name not in study["variants"]]:
        known = ", ".join(map(repr, study["variants"]))
        parser.error(f"--only: {options.study} has no variant {unknown[0]!r}; it has {known}")
    base = read_file(find_config(study["base"], options.study.parent)) | study.get("shared", {})
    lines = [HEAD, "|---|---:|---:|---:|---:|---:|"]
    for name in names:
        given = base | study["variants"][name]
        folder = trained(options.out / folder_name(name), given, name)
        lines.append(row_of(name, folder, study["reach"]))
    print("\n".join(lines))


def read(path: Path) -> dict[str, Any]:
    """A study's file."""
    return tomllib.loads(path.read_text("utf-8"))


def folder_name(name: str) -> str:
    """A variant's name without blanks and brackets."""
    return "-".join(re.findall(r"[\w.-]+", name))


def trained(path: Path, given: dict[str, Any], name: str) -> RunFolder:
    """The run directory, trained to its end.

    Raises:
        SettingError: it is there and was made with other options.
    """
    experiment = resolve(given)
    folder = RunFolder.open_or_create(path, experiment)
    with Progress(experiment.config.updates, name, unit="updates", compiles=True) as progress:
        train(folder, notify=lambda update, rows: progress.update(update))
    return folder


def row_of(name: str, folder: RunFolder, reach: float) -> str:
    """A line of the table."""
    runs, steps = len(folder.experiment.runs), folder.experiment.config.steps_per_update
    by_run = rows_by_run(read_metrics(folder.path), runs)
    first = np.array([solved_at(rows, reach) for rows in by_run])
    clock = read_seconds(folder.path, folder.experiment.config.updates)
    solved = int(np.isfinite(first).sum())
    shares = [np.median(first), first.max()]
    decisions = told([at * steps for at in shares])
    rate = (len(clock) - 1) * steps * runs / (clock[-1] - clock[0])
    seconds = told([at * steps * runs / rate for at in shares])
    ends = ", ".join(f"{100 * at_the_end(rows):.0f}" for rows in by_run)
    return f"| {name} | {solved} of {runs} | {ends} | {decisions} | {seconds} | {rate:,.0f} |"


def told(numbers: Sequence[float]) -> str:
    """Whole numbers, or `never`."""
    return ", ".join(f"{number:,.0f}" if np.isfinite(number) else "never" for number in numbers)


def at_the_end(rows: Sequence[dict[str, Any]]) -> float:
    """The success rate over the last tenth of the updates; not a number without an episode."""
    last = rows[-max(1, len(rows) // 10) :]
    episodes = sum(row["episodes"] for row in last)
    return sum(row["successes"] for row in last) / episodes if episodes else np.nan


def solved_at(rows: Sequence[dict[str, Any]], reach: float) -> float:
    """The first update after which `POOLED` updates together have such a success rate; or inf."""
    counts = np.array([[row["successes"], row["episodes"]] for row in rows], np.float64)
    sums = np.cumsum(counts, axis=0)
    sums[POOLED:] -= sums[:-POOLED].copy()
    successes, episodes = sums[POOLED - 1 :].T
    reached = (episodes >= FEWEST) & (successes >= reach * episodes)
    return float(np.argmax(reached) + POOLED) if reached.any() else np.inf


if __name__ == "__main__":
    main()
