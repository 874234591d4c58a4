"""Compare variants of one training by the time that they need to learn.

    python -m experiments.study STUDY --out DIR
    python -m experiments.study STUDY --out DIR --only "1 epoch" "4 epochs"

STUDY is a TOML file. `base` is a config for `jaxenstein train --config`: a path relative to STUDY,
or the name of a config of this package. `[shared]` changes options for all variants, each line of
`[variants]` changes options for one variant, and `reach` is the success rate to reach.

Every variant is trained in a run directory below DIR, with all seeds in parallel. Run the same
command again to continue. To use several cores, give each core some variants with `--only`; then
run the command without it for the table.

The table shows the decisions and the seconds until the median seed and the last seed reached the
success rate, over three updates, and the success rate of every seed over the last tenth of
training. Seconds are for all seeds together, without compilation.
"""

from __future__ import annotations

import argparse
import re
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fidelity.commands import run_command
from jaxenstein.baselines.runs.configs import find_config
from jaxenstein.baselines.runs.folder import RunFolder
from jaxenstein.baselines.runs.metrics import read_metrics, read_seconds, rows_by_run
from jaxenstein.baselines.runs.options import read_file, resolve
from jaxenstein.baselines.runs.training import train
from jaxenstein.errors import SettingError
from jaxenstein.fields import Domain, check_value
from jaxenstein.files import read_text, reason_of
from jaxenstein.progress import Progress

# Number of updates to pool, and the minimum number of episodes in them. A minimum is needed since
# the first episodes to end are the successful ones.
POOLED, FEWEST = 3, 20
# What the file of a study needs.
NEEDED = {"base": Domain("text"), "reach": Domain("number", 0, 1), "variants": Domain("table")}
HEAD = (
    "| variant | solved | at the end, % | decisions: median, last | seconds: median, last | "
    "decisions per second |"
)


def main(argv: Sequence[str] | None = None) -> None:
    """Train the variants that are not finished, and print the table."""
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
    """Read the file of a study.

    Raises:
        SettingError: it cannot be read, lacks something, or two variants would share a folder.
    """
    try:
        study = tomllib.loads(read_text(path))
    except (OSError, ValueError) as error:
        raise SettingError(f"cannot read {path}: {reason_of(error)}") from error
    for name, domain in NEEDED.items():
        check_value(f"{path}: {name}", domain, study.get(name))
    folders: dict[str, str] = {}
    for name in study["variants"]:
        other = folders.setdefault(folder_name(name), name)
        if other != name:
            raise SettingError(
                f"{path}: the variants {other!r} and {name!r} would have one folder, "
                f"{folder_name(name)!r}: rename one"
            )
    return study


def folder_name(name: str) -> str:
    """A variant's name without blanks and brackets."""
    return "-".join(re.findall(r"[\w.-]+", name))


def trained(path: Path, given: dict[str, Any], name: str) -> RunFolder:
    """Train to the end, and return the run directory.

    Raises:
        SettingError: the directory has a run with other options.
    """
    experiment = resolve(given)
    folder = RunFolder.open_or_create(path, experiment)
    with Progress(experiment.config.updates, name, unit="updates", compiles=True) as progress:
        train(folder, notify=lambda update, rows: progress.update(update))
    return folder


def row_of(name: str, folder: RunFolder, reach: float) -> str:
    """A row of the table."""
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
    """Format numbers; infinite ones are `never`."""
    return ", ".join(f"{number:,.0f}" if np.isfinite(number) else "never" for number in numbers)


def at_the_end(rows: Sequence[dict[str, Any]]) -> float:
    """The success rate over the last tenth of the updates; NaN without episodes."""
    last = rows[-max(1, len(rows) // 10) :]
    episodes = sum(row["episodes"] for row in last)
    return sum(row["successes"] for row in last) / episodes if episodes else np.nan


def solved_at(rows: Sequence[dict[str, Any]], reach: float) -> float:
    """The first update at which the last `POOLED` updates reach a success rate, or inf."""
    counts = np.array([[row["successes"], row["episodes"]] for row in rows], np.float64)
    sums = np.cumsum(counts, axis=0)
    sums[POOLED:] -= sums[:-POOLED].copy()
    successes, episodes = sums[POOLED - 1 :].T
    reached = (episodes >= FEWEST) & (successes >= reach * episodes)
    return float(np.argmax(reached) + POOLED) if reached.any() else np.inf


if __name__ == "__main__":
    run_command(main)
