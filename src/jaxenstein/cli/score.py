"""`jaxenstein score`: aggregates of results over tasks and runs, for publishing."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import suite
from ..files import check_writable
from .arguments import Parser, UsageError, add_seed, add_suite, flag
from .listing import format_table
from .opening import baselines, write_json, written_anyway

if TYPE_CHECKING:
    import numpy as np

    from ..comparison import Compared
    from ..scores import Estimate, Profile

HELP = "aggregate results over tasks and runs, with intervals"
DESCRIPTION = """\
Read files of 'jaxenstein evaluate --json' and show, for every task and policy, the mean return with
its 95 % bootstrap interval, over runs and episodes, or with one run over episodes. Results of one
policy bear the same name in all files, or --label gives them one. Greedy and sampled actions are
two policies. Results of a task with different versions, settings or params of its environment are
refused, and so are policies with different tasks.

--reference FILE has the returns of a random player and of an expert for every task, as JSON:
{"simple": {"random": 0.1, "expert": 0.9}}. A run's score is (return - random) / (expert - random).
With it the command shows the interquartile mean (IQM), mean, median and optimality gap over all
tasks, as in Agarwal et al. 2021, with 95 % intervals from resampling the runs of every task. With
two policies it shows the probability that a run of the first scores higher than one of the second.

--suite scores results of 'jaxenstein evaluate --suite'. It needs all tasks of the benchmark, and
uses the references that come with the package.
"""
EPILOG = """\
examples:
  jaxenstein score simple-rnd.json simple-ppo.json
  jaxenstein score --label rnd rnd/*.json --label ppo ppo/*.json --actions sampled
  jaxenstein score rnd.json mine.json --suite --plot scores.png
  jaxenstein score rnd.json ppo.json --reference reference.json --plot scores.png --json scores.json
"""
# What the table calls the aggregates.
HEADINGS = {
    "interquartile_mean": "IQM",
    "mean": "MEAN",
    "median": "MEDIAN",
    "optimality_gap": "GAP",
}
# Thresholds of a profile.
POINTS = 201


@dataclasses.dataclass(frozen=True)
class Summary:
    """What is computed of normalised scores, by policy.

    Attributes:
        scores: of the runs of each task.
        aggregates: over all tasks.
        profiles: at the same thresholds.
    """

    scores: dict[str, list[np.ndarray]]
    aggregates: dict[str, dict[str, Estimate]]
    profiles: dict[str, Profile]


def fill(parser: Parser) -> None:
    """Add the arguments."""
    help = "files of 'jaxenstein evaluate --json'"
    parser.add_argument("results", nargs="*", metavar="RESULTS", type=Path, help=help)
    parser.add_argument(
        "--label",
        dest="labels",
        action="append",
        nargs="+",
        default=[],
        metavar=("NAME", "FILE"),
        help="files of one policy, and the name that it is shown by; may be given again",
    )
    add_suite(parser, "the results are of the benchmark, whose references come with the package")
    flag(parser, "--reference FILE", "returns between which scores are normalised", Path)
    parser.add_argument(
        "--actions",
        choices=("greedy", "sampled"),
        help="leave out the results of the other way of acting (default: each is a policy)",
    )
    flag(parser, "--plot FILE", "draw aggregates and profiles: .png or .svg", Path)
    flag(parser, "--json FILE", "also write the numbers as JSON", Path)
    add_seed(parser)


def run(options: argparse.Namespace) -> None:
    """Read, print the tables, write the files."""
    from ..comparison import gather, read_reference

    files = _files(options)
    if options.json is not None:
        check_writable(options.json)
    if options.suite is not None and options.reference is not None:
        raise UsageError("jaxenstein score: give either --suite or --reference FILE")
    if options.plot is not None:
        if options.suite is None and options.reference is None:
            raise UsageError(
                "jaxenstein score: --plot draws normalised scores: give --suite or --reference"
            )
        baselines("curves").check_picture(options.plot)
    compared = gather(files, options.actions)
    reference = None
    if options.suite is not None:
        compared, reference = suite.check_compared(compared, options.suite), suite.references()
    elif options.reference is not None:
        reference = read_reference(options.reference)
    summary = None if reference is None else summarised(compared, reference, options.seed)
    chance = _chance(compared, options.seed)
    report = _report(compared, summary, chance, options.seed)
    with written_anyway(options.json, lambda path: write_json(path, report)):
        _print(compared, summary, chance, options.seed)
    if options.plot is not None and summary is not None:
        figure = baselines("score_plot").plot_scores(summary.aggregates, summary.profiles)
        baselines("curves").save_figure(figure, [options.plot])
        print(f"wrote {options.plot}")


def _print(compared: Compared, summary: Summary | None, chance: Estimate | None, seed: int) -> None:
    """Print the tables."""
    print(table_of_tasks(compared, summary, seed))
    print(end=_notes(compared))
    if summary is not None:
        print(f"\n{table_of_aggregates(summary)}")
    if chance is not None:
        one, other = compared
        print(
            f"\nprobability that {one} scores higher than {other}: {chance.value:.3f}, "
            f"95 % {chance.low:.3f} - {chance.high:.3f}"
        )


def _files(options: argparse.Namespace) -> list[tuple[str | None, Path]]:
    """Every file with the label that it was given."""
    files: list[tuple[str | None, Path]] = [(None, path) for path in options.results]
    for label, *paths in options.labels:
        if not paths:
            raise UsageError(f"jaxenstein score: --label {label} needs files after the name")
        files += [(label, Path(path)) for path in paths]
    if not files:
        raise UsageError("jaxenstein score: give files of 'jaxenstein evaluate --json'")
    return files


def summarised(compared: Compared, reference: Mapping[str, Any], seed: int) -> Summary:
    """The aggregates and profiles of normalised scores."""
    import numpy as np

    from ..comparison import run_scores
    from ..scores import aggregates, profile

    scores = {policy: run_scores(mine, reference) for policy, mine in compared.items()}
    pooled = np.concatenate([runs for mine in scores.values() for runs in mine])
    taus = np.linspace(min(0, pooled.min()), max(1, pooled.max()), POINTS)
    return Summary(
        scores,
        {policy: aggregates(mine, seed=seed) for policy, mine in scores.items()},
        {policy: profile(mine, taus, seed=seed) for policy, mine in scores.items()},
    )


def _chance(compared: Compared, seed: int) -> Estimate | None:
    """The probability of improvement, where there are two policies."""
    from ..comparison import run_returns
    from ..scores import probability_of_improvement

    if len(compared) != 2:
        return None
    one, other = (run_returns(mine) for mine in compared.values())
    return probability_of_improvement(one, other, seed=seed)


def table_of_tasks(compared: Compared, summary: Summary | None, seed: int) -> str:
    """A row for each task and policy, as text."""
    from ..intervals import mean_interval

    heading = ("TASK", "POLICY", "RUNS", "EPISODES", "RETURN", "95 %", "SUCCESS")
    rows: list[tuple[str, ...]] = [heading if summary is None else (*heading, "SCORE")]
    for number, task in enumerate(next(iter(compared.values()))):
        for policy, mine in compared.items():
            results = mine[task]
            earned = mean_interval(results.returns, seed=seed)
            row = (
                task if policy == next(iter(compared)) else "",
                policy,
                *map(str, results.returns.shape),
                f"{earned.mean:.4g}",
                f"{earned.low:.4g} - {earned.high:.4g}",
                f"{results.successes.mean():.1%}",
            )
            if summary is not None:
                row = (*row, f"{summary.scores[policy][number].mean():.3f}")
            rows.append(row)
    return format_table(rows, right=(2, 3, 4, 5, 6, 7))


def _notes(compared: Compared) -> str:
    """A line for each policy whose intervals leave out the chance of training."""
    lines = []
    for policy, mine in compared.items():
        single = [task for task, results in mine.items() if len(results.names) == 1]
        if single:
            which = "every task" if len(single) == len(mine) > 1 else ", ".join(single)
            lines.append(
                f"{policy} has a single run of {which}: its intervals do not tell how much another "
                "training would differ\n"
            )
    return "".join(lines)


def table_of_aggregates(summary: Summary) -> str:
    """A row for each policy, as text."""
    heading = (word for name in HEADINGS.values() for word in (name, "95 %"))
    rows: list[tuple[str, ...]] = [("POLICY", *heading)]
    for policy, found in summary.aggregates.items():
        cells = (
            cell
            for name in HEADINGS
            for cell in (
                f"{found[name].value:.3f}",
                f"{found[name].low:.3f} - {found[name].high:.3f}",
            )
        )
        rows.append((policy, *cells))
    return format_table(rows, right=tuple(range(1, 9)))


def _report(
    compared: Compared, summary: Summary | None, chance: Estimate | None, seed: int
) -> dict[str, Any]:
    """The numbers as plain JSON values."""
    from ..intervals import mean_interval
    from ..scores import RESAMPLES

    report: dict[str, Any] = {"seed": seed, "resamples": RESAMPLES, "policies": {}}
    for policy, mine in compared.items():
        tasks: dict[str, Any] = {}
        for number, (task, results) in enumerate(mine.items()):
            tasks[task] = {
                "version": results.environment.version,
                "runs": list(results.names),
                "episodes": int(results.returns.shape[1]),
                "return": dataclasses.asdict(mean_interval(results.returns, seed=seed)),
                "success": dataclasses.asdict(mean_interval(results.successes, seed=seed)),
            }
            if summary is not None:
                tasks[task]["scores"] = summary.scores[policy][number].tolist()
        report["policies"][policy] = {"tasks": tasks}
        if summary is not None:
            found = summary.aggregates[policy]
            report["policies"][policy] |= {
                "aggregates": {name: dataclasses.asdict(one) for name, one in found.items()},
                "profile": {
                    name: values.tolist() for name, values in vars(summary.profiles[policy]).items()
                },
            }
    if chance is not None:
        report["probability_of_improvement"] = dataclasses.asdict(chance)
    return report
