"""`jaxenstein score`: aggregate results over tasks and runs, for publication."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .. import intervals, scores, suite
from ..comparison import (
    Compared,
    Reference,
    gather,
    read_reference,
    run_returns,
    run_scores,
    score_interval,
)
from ..files import check_apart, check_writable
from ..intervals import mean_interval
from ..scores import Estimate, Profile, aggregates, probability_of_improvement, profile
from .arguments import Parser, UsageError, add_seed, add_suite, flag
from .listing import between, format_table
from .opening import baselines, write_json, written_anyway

HELP = "compare policies over tasks, with confidence intervals"
DESCRIPTION = """\
Read files from 'jaxenstein evaluate --json', and show the mean return of every policy in every task
with a 95 % bootstrap interval over runs and episodes. Results with the same name belong to the same
policy; --label sets the name. Greedy and sampled actions are two policies. All policies must have
the same tasks, and a task must have the same version, settings and params everywhere. With several
policies, the command also shows the probability that a run of the first has a higher return than a
run of each other.

--reference FILE gives the returns of a random and an expert policy in every task, as JSON:
{"simple": {"random": 0.1, "expert": 0.9}}. The score of a run is then
(return - random) / (expert - random), and the command shows the interquartile mean (IQM), mean,
median and optimality gap over all tasks (Agarwal et al. 2021). Their 95 % intervals come from
resampling the runs of every task.

--suite scores results of 'jaxenstein evaluate --suite', with the references of the benchmark, and
warns if tasks, training seeds or test episodes are missing. It also shows the IQM of the tasks of
each ability. --baselines adds the results of our agents on the same tasks, which come with the
package; without RESULTS it shows them alone.
"""
EPILOG = """\
examples:
  jaxenstein score simple-rnd.json simple-ppo.json
  jaxenstein score --label rnd rnd/*.json --label ppo ppo/*.json --actions sampled
  jaxenstein score mine.json --suite --baselines --plot scores.png
  jaxenstein score rnd.json ppo.json --reference reference.json --plot scores.png --json scores.json
"""
# Headings of the aggregates in the table.
HEADINGS = {
    "interquartile_mean": "IQM",
    "mean": "MEAN",
    "median": "MEDIAN",
    "optimality_gap": "GAP",
}
# Number of thresholds in a profile.
POINTS = 201


@dataclasses.dataclass(frozen=True)
class Summary:
    """Statistics of the normalised scores of each policy.

    Attributes:
        reference: the returns that set the scale of each task.
        scores: an array for each task, with the score of each run.
        aggregates: over all tasks, by name.
        profiles: performance profiles, all at the same thresholds.
        abilities: of the benchmark, the interquartile mean over the tasks of each ability.
    """

    reference: Mapping[str, Reference]
    scores: dict[str, list[np.ndarray]]
    aggregates: dict[str, dict[str, Estimate]]
    profiles: dict[str, Profile]
    abilities: dict[str, dict[str, Estimate]]


def fill(parser: Parser) -> None:
    """Add the arguments."""
    help = "files from 'jaxenstein evaluate --json'"
    parser.add_argument("results", nargs="*", metavar="RESULTS", type=Path, help=help)
    parser.add_argument(
        "--label",
        dest="labels",
        action="append",
        nargs="+",
        default=[],
        metavar=("NAME", "FILE"),
        help="a name for a policy, and its files; repeat for each policy",
    )
    add_suite(parser, "score results of the benchmark")
    help = "with --suite: add the results of our agents"
    parser.add_argument("--baselines", action="store_true", help=help)
    flag(parser, "--reference FILE", "returns that normalise the scores", Path)
    parser.add_argument(
        "--actions",
        choices=("greedy", "sampled"),
        help="use only results with greedy or with sampled actions (default: both)",
    )
    flag(parser, "--plot FILE", "plot aggregates and performance profiles: .png or .svg", Path)
    flag(parser, "--json FILE", "also write the numbers as JSON", Path)
    add_seed(parser)


def run(options: argparse.Namespace) -> None:
    """Read the results, print the tables, and write the files."""
    if options.suite is not None and options.reference is not None:
        raise UsageError("jaxenstein score: give either --suite or --reference FILE")
    if options.baselines and options.suite is None:
        raise UsageError("jaxenstein score: --baselines needs --suite")
    if options.baselines and options.actions == "greedy":
        raise UsageError(
            "jaxenstein score: --baselines has only sampled actions; leave out --actions greedy"
        )
    files = _files(options)
    check_apart([options.json, options.plot], [*(path for _, path in files), options.reference])
    if options.json is not None:
        check_writable(options.json)
    if options.plot is not None:
        if options.suite is None and options.reference is None:
            raise UsageError(
                "jaxenstein score: --plot needs normalised scores: give --suite or --reference"
            )
        baselines("curves").check_picture(options.plot)
    compared = gather(files, options.actions) if files else {}
    reference = None
    if options.suite is not None:
        compared, reference = _of_suite(compared, options), suite.references()
    elif options.reference is not None:
        reference = read_reference(options.reference)
    summary = None if reference is None else summarised(compared, reference, options)
    chances = _chances(compared, options.seed)

    def write(path: Path) -> None:
        report = _report(compared, summary, chances, options.seed)
        if options.suite is not None:
            report |= {"suite": options.suite, "suite_version": suite.VERSION}
        write_json(path, report)

    with written_anyway(options.json, write):
        _print(compared, summary, chances, options.seed, options.suite)
    if options.plot is not None and summary is not None:
        tasks = _count(compared, options.suite is not None)
        figure = baselines("score_plot").plot_scores(summary.aggregates, summary.profiles, tasks)
        baselines("curves").save_figure(figure, [options.plot])
        print(f"wrote {options.plot}")


def _of_suite(compared: Compared, options: argparse.Namespace) -> Compared:
    """Check the user's results, and add those of the baselines on the same tasks."""
    checked = suite.check_compared(compared, options.suite)
    shipped = suite.baselines(options.suite) if options.baselines else {}
    for mine in checked.values():
        shipped = {policy: {id: its[id] for id in mine} for policy, its in shipped.items()}
    if taken := sorted({*checked} & {*shipped}):
        raise UsageError(f"jaxenstein score: {taken[0]} is a baseline; use another --label")
    return checked | shipped


def _print(
    compared: Compared,
    summary: Summary | None,
    chances: Mapping[str, Estimate],
    seed: int,
    of_suite: str | None,
) -> None:
    """Print the tables."""
    if of_suite is not None:
        print(f"{of_suite} suite, version {suite.VERSION}")
    print(table_of_tasks(compared, summary, seed))
    print(end=_notes(compared, of_suite is not None))
    if summary is not None:
        print(f"\n{table_of_aggregates(summary)}")
        if abilities := table_of_abilities(summary):
            print(f"\n{abilities}")
    if chances:
        print()
    first = next(iter(compared))
    for other, chance in chances.items():
        results = (*compared[first].values(), *compared[other].values())
        single = all(len(one.names) == 1 for one in results)
        interval = "" if single else f", 95 % {between(chance, '.3f')}"
        print(
            f"probability that {first} scores higher than {other}, ties counted half: "
            f"{chance.value:.3f}{interval}"
        )


def _files(options: argparse.Namespace) -> list[tuple[str | None, Path]]:
    """Every file with its label, or None."""
    files: list[tuple[str | None, Path]] = [(None, path) for path in options.results]
    for label, *paths in options.labels:
        if not paths:
            raise UsageError(f"jaxenstein score: --label {label}: give files after the name")
        files += [(label, Path(path)) for path in paths]
    if not files and not options.baselines:
        raise UsageError("jaxenstein score: give files from 'jaxenstein evaluate --json'")
    return files


def summarised(
    compared: Compared, reference: Mapping[str, Reference], options: argparse.Namespace
) -> Summary:
    """The aggregates and profiles of normalised scores."""
    scores = {policy: run_scores(mine, reference) for policy, mine in compared.items()}
    pooled = np.concatenate([runs for mine in scores.values() for runs in mine])
    taus = np.linspace(min(0, pooled.min()), max(1, pooled.max()), POINTS)
    seed = options.seed
    of_suite = {} if options.suite is None else compared
    return Summary(
        reference,
        scores,
        {policy: aggregates(mine, seed=seed) for policy, mine in scores.items()},
        {policy: profile(mine, taus, seed=seed) for policy, mine in scores.items()},
        {policy: suite.abilities(mine, seed=seed) for policy, mine in of_suite.items()},
    )


def _chances(compared: Compared, seed: int) -> dict[str, Estimate]:
    """The probability of improvement of the first policy over each other."""
    returns = {policy: run_returns(mine) for policy, mine in compared.items()}
    first, *others = returns
    return {
        other: probability_of_improvement(returns[first], returns[other], seed=seed)
        for other in others
    }


def table_of_tasks(compared: Compared, summary: Summary | None, seed: int) -> str:
    """A table with a row for each task and policy."""
    heading = ("TASK", "POLICY", "RUNS", "EPISODES", "RETURN", "95 %", "SUCCESS")
    rows: list[tuple[str, ...]] = [heading if summary is None else (*heading, "SCORE", "95 %")]
    for task in next(iter(compared.values())):
        for policy, mine in compared.items():
            results = mine[task]
            earned = mean_interval(results.returns, seed=seed)
            row = (
                task if policy == next(iter(compared)) else "",
                policy,
                *map(str, results.returns.shape),
                f"{earned.mean:.4g}",
                between(earned, ".4g"),
                f"{results.successes.mean():.1%}",
            )
            if summary is not None:
                score = score_interval(earned, summary.reference[task])
                row = (*row, f"{score.mean:z.3f}", between(score, ".3f"))
            rows.append(row)
    return format_table(rows, right=range(2, len(rows[0])))


def _count(compared: Compared, of_suite: bool) -> str:
    """The number of tasks, and that of the benchmark if some are missing."""
    number, all_tasks = len(next(iter(compared.values()))), len(suite.TASKS)
    if of_suite and number < all_tasks:
        return f"{number} of {all_tasks} tasks"
    return f"{number} task{'s' * (number != 1)}"


def _notes(compared: Compared, of_suite: bool) -> str:
    """Lines on missing tasks, single runs, and departures from the benchmark's protocol."""
    lines = []
    if of_suite and len(next(iter(compared.values()))) < len(suite.TASKS):
        lines.append(f"{_count(compared, of_suite)}: a score of the benchmark needs all of them\n")
    for policy, mine in compared.items():
        single = [task for task, results in mine.items() if len(results.names) == 1]
        if single:
            which = "every task" if len(single) == len(mine) > 1 else ", ".join(single)
            lines.append(
                f"{policy} has a single run of {which}: its intervals do not include the variation "
                "between training runs\n"
            )
        if of_suite and (departures := suite.departures(mine.values())):
            lines.append(f"{policy} departs from the protocol: {', '.join(departures)}\n")
    return "".join(lines)


def table_of_aggregates(summary: Summary) -> str:
    """A table with a row for each policy; single runs have no intervals."""
    heading = (word for name in HEADINGS.values() for word in (name, "95 %"))
    rows: list[tuple[str, ...]] = [("POLICY", *heading)]
    for policy, found in summary.aggregates.items():
        single = _single(summary, policy)
        row = [policy]
        for name in HEADINGS:
            one = found[name]
            row += [f"{one.value:z.3f}", "-" if single else between(one, ".3f")]
        rows.append(tuple(row))
    return format_table(rows, right=range(1, len(rows[0])))


def table_of_abilities(summary: Summary) -> str:
    """A table with a row for each ability of the benchmark; "" if no ability has all its tasks."""
    rows: list[tuple[str, ...]] = [("IQM OF", *summary.abilities)]
    for ability in next(iter(summary.abilities.values()), {}):
        cells = (
            _told(found[ability], _single(summary, policy))
            for policy, found in summary.abilities.items()
        )
        rows.append((ability, *cells))
    return format_table(rows, right=range(1, len(rows[0]))) if rows[1:] else ""


def _single(summary: Summary, policy: str) -> bool:
    """Whether a policy has a single run of every task."""
    return all(len(runs) == 1 for runs in summary.scores[policy])


def _told(one: Estimate, single: bool) -> str:
    """A score with its interval; single runs have no interval."""
    return f"{one.value:z.3f}" + ("" if single else f" ({between(one, '.3f')})")


def _report(
    compared: Compared, summary: Summary | None, chances: Mapping[str, Estimate], seed: int
) -> dict[str, Any]:
    """The numbers as plain JSON values."""
    resamples = {"returns": intervals.RESAMPLES, "scores": scores.RESAMPLES}
    report: dict[str, Any] = {"seed": seed, "resamples": resamples, "policies": {}}
    for policy, mine in compared.items():
        tasks: dict[str, Any] = {}
        for number, (task, results) in enumerate(mine.items()):
            tasks[task] = {
                "version": results.environment.version,
                "runs": list(results.names),
                "episodes": results.episodes,
                "actions": results.actions,
                **{
                    name: dataclasses.asdict(intervals.mean_interval(values, seed=seed))
                    for name, values in (
                        ("return", results.returns),
                        ("success", results.successes),
                    )
                },
            }
            if summary is not None:
                earned = intervals.Interval(**tasks[task]["return"])
                score = score_interval(earned, summary.reference[task])
                tasks[task]["scores"] = summary.scores[policy][number].tolist()
                tasks[task]["score"] = dataclasses.asdict(score)
        report["policies"][policy] = {"tasks": tasks}
        if summary is not None:
            report["policies"][policy] |= {
                "aggregates": _plain(summary.aggregates[policy]),
                "profile": {
                    name: values.tolist() for name, values in vars(summary.profiles[policy]).items()
                },
            }
            if policy in summary.abilities:
                report["policies"][policy]["abilities"] = _plain(summary.abilities[policy])
    report["probability_of_improvement"] = _plain(chances)
    return report


def _plain(found: Mapping[str, Estimate]) -> dict[str, Any]:
    return {name: dataclasses.asdict(one) for name, one in found.items()}
