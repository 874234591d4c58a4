"""Generated pages and tables besides the environments: scoreboard, benchmark, command line."""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Mapping
from typing import Any
from unittest import mock

from docs.page_parts import link_to, stored_agents, stored_rows, table
from jaxenstein import suite
from jaxenstein.catalogue import MAIN_IDS
from jaxenstein.cli import build_parser
from jaxenstein.cli.listing import between
from jaxenstein.comparison import run_scores, score_interval
from jaxenstein.intervals import Interval, mean_interval
from jaxenstein.results import Results
from jaxenstein.scores import Estimate, aggregates

# The tasks of the benchmark on which the settings of the recipe `long` were chosen.
CHOSEN_ON = "simple", "key-door", "dmlab-static-01", "doom-health-gathering-supreme"
INTRODUCTION = """\
# Command line

`jaxenstein COMMAND --help` prints the text of this page. `python -m jaxenstein` is the same
command. The exit status is 2 for wrong arguments, 1 if something cannot be written or run or if a
replay differs, 3 if all runs of a training diverge, 130 if Ctrl-C or `--minutes` ends a training,
and 141 if the reader of the output closes it.

Commands cache compiled programs in `~/.cache/jaxenstein` (or below `XDG_CACHE_HOME`), at most about
1 GiB, so that later calls start at once. `--no-cache` turns the cache off.
`JAX_COMPILATION_CACHE_DIR` sets another folder."""

BESIDE = ("id", "random player", "expert player", "best agents")
TRAINED = ("id", "frame skip", "sees", "algorithm", "seeds", "decisions per seed",
           "minutes, all seeds", "sampled", "greedy", "config")  # fmt: skip
SCOREBOARD = """# Scoreboard

This table compares trained agents with a random player and with a scripted expert, which sees the
whole state. Players: mean return and, in brackets, success rate over {played} episodes; the pages
of the environments have standard errors. Agents: success rate of the best agents below, or their
return if that rate is 0.

{beside}

## Agents

Success rate, or return if that rate is 0, over all seeds and {episodes} episodes each,
with 95 % bootstrap intervals. "Greedy" takes the most likely action, "sampled" samples one. Minutes
are for all seeds in parallel on one core, including compilation. The players above use frame skip
1; a frame skip also changes the return of a random player.

{trained}

```
jaxenstein train --config CONFIG --out RUN
jaxenstein evaluate RUN
python -m docs.measured agent CONFIG RUN
```

These commands train the agents of a row, evaluate them, and write the row.
[Results](../results.md) has the curves.
"""

RECIPES_OF = """
## Recipes

The defaults of the recipe `tuned` that differ from those of `paper`, by algorithm. Any flag
overrides its default.

{tuned}

The defaults of the recipe `long` that differ from those of `tuned`:

{long}

## Networks

Layers of convolutions are kernel x stride x features. With `paper`, images below 36 pixels have the
layers of `small`.

{networks}
"""


def scoreboard() -> str:
    """The text of the scoreboard."""
    agents = stored_agents()
    beside = []
    for name in MAIN_IDS:
        stored = stored_rows(name)
        told = [f"{row['mean']:.4g} ({100 * row['success']:.0f} %)" for row in stored]
        best = max((_best(row) for row in agents if row["id"] == name), default=(0.0, ""))
        beside.append((link_to(name), *(told or ["not measured yet", ""]), best[1]))
    return SCOREBOARD.format(
        played=stored_rows("simple")[0]["episodes"],
        episodes=agents[0]["episodes"],
        beside=table(BESIDE, beside, right=(1, 2, 3)),
        trained=table(TRAINED, [_row(row) for row in agents], right=(1, 4, 5, 6, 7, 8)),
    )


def _best(row: Mapping[str, Any]) -> tuple[float, str]:
    return max((row[_measure(row)][way]["mean"], _reached(row, way)) for way in row["success"])


def _measure(row: Mapping[str, Any]) -> str:
    """The measure of an agent: success, or return if no episode succeeds."""
    return "success" if any(of["mean"] for of in row["success"].values()) else "return"


def _reached(row: Mapping[str, Any], way: str) -> str:
    """The measure of an agent with its interval; success in percent."""
    ends = [row[_measure(row)][way][end] for end in ("mean", "low", "high")]
    if _measure(row) == "return":
        return "{:.4g} ({:.4g} to {:.4g})".format(*ends)
    return "{:.1f} % ({:.0f} to {:.0f})".format(*(100 * end for end in ends))


def _row(row: Mapping[str, Any]) -> tuple[str, ...]:
    return (
        link_to(row["id"]),
        str(row["frame_skip"]),
        row["sees"],
        row["algo"].upper(),
        str(row["seeds"]),
        f"{row['decisions']:,}",
        f"{row['seconds'] / 60:.0f}",
        _reached(row, "sampled"),
        _reached(row, "greedy"),
        f"`{row['config']}`",
    )


def suite_tasks() -> str:
    """The tasks of the benchmark, for docs/suite.md."""
    head = ("task", "version", "tests", "frame skip", "split", "random", "expert", "why")
    rows = []
    for task in suite.TASKS:
        ends = suite.references()[task.id]
        split = "yes" if task.split else ""
        returns = (f"{value:.4g}" for value in (ends.random, ends.expert))
        name = f"`{task.id}`"
        numbers = str(task.frame_skip), split, *returns
        rows.append((name, str(task.version), task.ability, *numbers, task.reason))
    return table(head, rows, right=(1, 3, 5, 6))


def suite_baselines() -> str:
    """The scores of our agents on each task, and their interquartile means, for docs/suite.md."""
    # "PPO (baseline)" is "PPO" here.
    ours = {name.partition(" ")[0]: mine for name, mine in suite.baselines().items()}
    ends = suite.references()
    rows = []
    for task in suite.TASKS:
        earned = (mean_interval(mine[task.id].returns) for mine in ours.values())
        scores = (score_interval(one, ends[task.id]) for one in earned)
        rows.append([f"`{task.id}`", *(_interval(score.mean, score) for score in scores)])
    found = [interquartile_means(mine) for mine in ours.values()]
    means = [[part, *(_interval(of[part].value, of[part]) for of in found)] for part in found[0]]
    right = range(1, 1 + len(ours))
    return f"{table(['task', *ours], rows, right)}\n\n{table(['tasks', *ours], means, right)}"


def interquartile_means(mine: Mapping[str, Results]) -> dict[str, Estimate]:
    """Those of all tasks, of the tasks on which we did not choose settings, and of each ability."""
    other = {id: results for id, results in mine.items() if id not in CHOSEN_ON}
    parts = {"all": mine, "not tuned on": other}
    ends = suite.references()
    found = {
        name: aggregates(run_scores(part, ends))["interquartile_mean"]
        for name, part in parts.items()
    }
    return found | suite.abilities(mine)


def _interval(value: float, ends: Interval | Estimate) -> str:
    """A score with its interval."""
    return f"{value:z.2f} ({between(ends, '.2f')})"


def with_suite_tables(page: str) -> str:
    """The text of docs/suite.md with its generated tables between their marks."""
    for name, make in (("tasks", suite_tasks), ("baselines", suite_baselines)):
        block = re.compile(rf"(<!-- suite {name} -->\n).*?(<!-- end -->)", re.DOTALL)
        page = block.sub(lambda found, make=make: f"{found[1]}{make()}\n{found[2]}", page)
    return page


def commands_page() -> str:
    """The help texts of all commands."""
    # Format as in a terminal of this width, without colours.
    with mock.patch.dict(os.environ, {"COLUMNS": "100", "NO_COLOR": "1"}):
        (commands,) = (
            action for action in build_parser()._actions
            if isinstance(action, argparse._SubParsersAction)
        )  # fmt: skip
        parts = [_command(name, parser) for name, parser in commands.choices.items()]
    return "\n\n".join([INTRODUCTION, *parts]) + "\n"


def recipes() -> str:
    """What the recipes and networks set, for the page of the commands."""
    from jaxenstein.baselines.config import algorithms  # needs the extra baselines
    from jaxenstein.baselines.networks import NATURE
    from jaxenstein.baselines.runs.options import NETWORKS, RECIPES, all_options

    options = all_options()

    def given(recipe: str) -> list[dict[str, Any]]:
        """The values that a recipe sets for each algorithm."""
        values = RECIPES[recipe]
        return [{**values.get("*", {}), **values.get(algo, {})} for algo in algorithms()]

    def changes(recipe: str, other: str) -> str:
        """The options that differ from the other recipe for any algorithm."""
        pairs = list(zip(given(recipe), given(other), strict=True))
        paper, rows = other == "paper", []
        for name in dict.fromkeys(name for mine, _ in pairs for name in mine):
            usual = options[name].default
            values = [(mine.get(name, usual), its.get(name, usual)) for mine, its in pairs]
            if any(value != old for value, old in values):
                shown = map(_shown, [*[usual] * paper, *(value for value, _ in values)])
                rows.append([f"`--{name.replace('_', '-')}`", *shown])
        names = [f"`{recipe}`, `{algo}`" for algo in algorithms()]
        return table(("flag", *["`paper`"] * paper, *names), rows)

    parts = ("features", "hidden", "head", "convolutions")
    first = {part: options[part].default for part in parts} | {"convolutions": NATURE}
    networks = [
        [f"`{name}`", *(_shown({**first, **sizes}[part]) for part in parts)]
        for name, sizes in NETWORKS.items()
    ]
    flags = ("`--network`", *(f"`--{part}`" for part in parts))
    return RECIPES_OF.format(
        tuned=changes("tuned", "paper"),
        long=changes("long", "tuned"),
        networks=table(flags, networks),
    )


def _shown(value: Any) -> str:
    """A value of an option in a cell; None is the task's own."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        return ", ".join("x".join(map(str, layer)) for layer in value)
    return (
        "of the task" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
    )


def _command(name: str, parser: argparse.ArgumentParser) -> str:
    text = re.sub(r"\x1b\[[0-9;]*m", "", parser.format_help()).rstrip()
    return f"## `jaxenstein {name}`\n\n```text\n{text}\n```"
