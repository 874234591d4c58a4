"""`jaxenstein list`: list environments, maps, agents, tasks and configs."""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Collection, Mapping
from typing import Any

from .. import registry, suite
from ..intervals import Interval
from ..level_counts import level_counts
from ..maps.map_files import SAMPLES, sample_map
from ..maps.symbols import legend
from ..params import Range
from ..scores import Estimate
from ..tasks.first_person import FirstPerson
from .arguments import Parser, UsageError, add_suite, flag
from .opening import import_module_of

HELP = "list environments, sample maps, pretrained agents and configs"
DESCRIPTION = """\
List the environments; --all gives every size and variant its own row. The other flags list
something else instead: the symbols of text maps, sample maps, pretrained agents, training configs,
or the tasks of the benchmark.
"""
EPILOG = """\
examples:
  jaxenstein list
  jaxenstein list --all
  jaxenstein list --symbols
  jaxenstein list --samples
  jaxenstein list --pretrained
  jaxenstein list --suite
  jaxenstein list --configs
  jaxenstein list my_module:my-task
"""


LIST_WIDTH = 100
# For tables with long names.
WIDER = 140
# Marks the size of a generated map.
GENERATED = "*"
WRAPPING: dict[str, Any] = {"break_on_hyphens": False, "break_long_words": False}


def fill(parser: Parser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "ids", nargs="*", metavar="ID", help="ids to list, or MODULE:NAME (default: all)"
    )
    flag(parser, "--all", "list every size and variant in its own row")
    flag(parser, "--symbols", "explain the symbols of text maps")
    flag(parser, "--samples", "show the sample maps")
    flag(parser, "--pretrained", "list the pretrained agents")
    add_suite(parser, "list the tasks of the benchmark")
    flag(parser, "--configs", "list the training configs of this package")


def run(options: argparse.Namespace) -> None:
    """Print the list."""
    flags = ("symbols", "samples", "pretrained", "suite", "configs")
    chosen = [f"--{name}" for name in flags if getattr(options, name)] + options.ids[:1]
    if len(chosen) > 1:
        raise UsageError(f"jaxenstein list: give either {chosen[0]} or {chosen[1]}")
    if options.symbols:
        print(legend())
        return
    if options.samples:
        maps = [f"samples/{name}: {about}\n{sample_map(name)}" for name, about in SAMPLES.items()]
        print("\n\n".join(maps))
        return
    if options.pretrained:
        print(pretrained_agents())
        return
    if options.suite is not None:
        print(tasks_of(options.suite))
        return
    if options.configs:
        print(configurations())
        return
    for id in options.ids:
        import_module_of(id)
    found = dict(map(registry.find, options.ids or registry.environment_ids()))
    variants: dict[str, list[str]] = {}
    if not (options.ids or options.all):
        for name in [name for name, entry in found.items() if entry.variant_of]:
            variants.setdefault(found.pop(name).variant_of, []).append(name)
    environments = {name: registry.make(name) for name in found}
    table = [("ID", "MAP", "LEVELS", "HORIZON", "DISCOUNT", "DESCRIPTION")]
    for name, (env, params) in environments.items():
        horizon, discount = str(params.max_steps_in_episode), f"{params.discount:g}"
        counted = level_counts().get(name)
        levels = counted.short if counted else ""
        table.append((name, extent(env), levels, horizon, discount, found[name].summary))
    print(format_table(table, right=(1, 2, 3, 4), width=LIST_WIDTH))
    print()
    aliases = {alias: name for alias, name in registry.ALIASES.items() if name in found}
    notes = ["map: columns x rows, in tiles; horizon: most world steps in an episode"]
    if any(row[1].endswith(GENERATED) for row in table):
        notes.append(f"{GENERATED} every reset generates a new map")
    if any(row[2] for row in table[1:]):
        notes.append("levels: number of different levels; + means at least this many")
    for name, others in variants.items():
        notes.append(f"variants of {name} (--all): {', '.join(others)}")
    if aliases:
        pairs = ", ".join(f"{alias} = {name}" for alias, name in aliases.items())
        notes.append(f"other names: {pairs}")
    notes += actions_of({name: env.action_names for name, (env, _) in environments.items()})
    for note in notes:
        print(textwrap.fill(note, LIST_WIDTH, subsequent_indent="  ", **WRAPPING))


def pretrained_agents() -> str:
    """A table of the pretrained agents and their scores."""
    from .opening import baselines

    trained = baselines("trained")
    own: list[str] = []
    table: list[tuple[str, ...]] = [
        ("NAME", "ENVIRONMENT", "SKIP", "ALGO", "DECISIONS", "RETURN", "SUCCESS", "GREEDY")
    ]
    for name, file in trained.pretrained().items():
        plain = trained.read_config(file)
        config, score = plain["config"], plain["agent"]["score"]
        steps = plain["agent"]["update"] * config["num_envs"] * config["rollout"]
        place, algo = plain["environment"]["id"] or "a map", config["algo"]
        earned = f"{score['sampled']['return']['mean']:.3g}"
        rates = [f"{score[way]['success']['mean']:.0%}" for way in ("sampled", "greedy")]
        skip = str(plain["environment"]["settings"].get("frame_skip", 1))
        table.append((name, place, skip, algo, f"{steps:,}", earned, *rates))
        if params := plain["environment"]["params"]:
            told = (f"{p}={Range(*v) if isinstance(v, list) else v}" for p, v in params.items())
            own.append(f"the return of {name} is with {', '.join(told)}, as in training")
    notes = (
        "skip: world steps per decision",
        "return, success: with sampled actions; greedy: success rate with the most likely actions",
        *own,
        "'jaxenstein play --policy pretrained/NAME' plays one (--greedy: its most likely actions)",
    )
    return "\n".join([format_table(table, right=(2, 4, 5, 6, 7)), "", *notes])


def tasks_of(name: str) -> str:
    """A table of the tasks of a suite."""
    chosen, reference = suite.suite_of(name), suite.references()
    rows = [("TASK", "VERSION", "ABILITY", "SKIP", "IMAGE", "SPLIT", "RANDOM", "EXPERT", "REASON")]
    for task in suite.TASKS:
        height, width = chosen.image or task.small
        ends = reference[task.id]
        rows.append(
            (
                task.id,
                str(task.version),
                task.ability,
                str(task.frame_skip),
                f"{width}x{height}",
                "yes" if task.split else "",
                f"{ends.random:.4g}",
                f"{ends.expert:.4g}",
                task.reason,
            )
        )
    notes = (
        f"{name} suite, version {suite.VERSION}: {chosen.total_steps:,} decisions, {suite.SEEDS} "
        f"seeds, {suite.EPISODES} test episodes per agent with sampled actions",
        "skip: world steps per decision; image: columns x rows",
        "split: agents train on one part of the levels and are tested on the other",
        "random, expert: returns of the two players that normalise the scores",
    )
    return "\n".join([format_table(rows, right=(1, 3, 4, 6, 7), width=WIDER), "", *notes])


def configurations() -> str:
    """A table of the training configs of this package."""
    from .opening import baselines

    table: list[tuple[str, ...]] = [
        ("NAME", "ENVIRONMENT", "ALGO", "SKIP", "DECISIONS", "DESCRIPTION")
    ]
    for of in baselines("configs").listed():
        row = (of.name, of.environment, of.algo, str(of.frame_skip), f"{of.decisions:,}", of.about)
        table.append(row)
    notes = (
        "skip: world steps per decision; decisions: for each seed",
        "'jaxenstein train --config NAME --out RUN' trains one; flags override its options",
    )
    return "\n".join([format_table(table, right=(3, 4), width=WIDER), "", *notes])


def extent(env: Any) -> str:
    """The size of an environment's map as columns x rows, marked if the map is generated."""
    if not isinstance(env, FirstPerson):
        return "-"
    columns, rows = env.map_size
    return f"{columns}x{rows}{GENERATED if env.about().generated else ''}"


def actions_of(names: Mapping[str, tuple[str, ...]]) -> list[str]:
    """A line for each set of actions; the most common set comes last, as "all others".

    Args:
        names: the action names of each environment.
    """
    users: dict[tuple[str, ...], list[str]] = {}
    for name, actions in names.items():
        users.setdefault(actions, []).append(name)
    lines = []
    for actions, ids in sorted(users.items(), key=lambda item: -len(item[1])):
        numbered = ", ".join(f"{i} {action}" for i, action in enumerate(actions))
        lines.append(f"actions of {', '.join(ids) if lines else 'all'}: {numbered}")
    if len(lines) > 1:
        lines[0] = lines[0].replace(" of all:", " of all others:")
        lines.append(lines.pop(0))
    return lines


def between(ends: Interval | Estimate, form: str) -> str:
    """The ends of an interval, each in a format such as ".3f"."""
    return f"{ends.low:z{form}} to {ends.high:z{form}}"


def format_table(
    rows: list[tuple[str, ...]], right: Collection[int] = (), width: int | None = None
) -> str:
    """Format rows of cells as lines with aligned columns.

    Args:
        rows: the cells of each row.
        right: columns to align to the right.
        width: the most characters in a line; the last column is wrapped.
    """
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    if width is not None:
        widths[-1] = max(20, width - sum(widths[:-1]) - 2 * (len(widths) - 1))
    lines = []
    for row in rows:
        last = textwrap.wrap(row[-1], widths[-1], **WRAPPING) if width is not None else row[-1:]
        for n, words in enumerate(last or [""]):
            cells = [*(row[:-1] if n == 0 else [""] * (len(row) - 1)), words]
            lines.append(
                "  ".join(
                    cell.rjust(space) if i in right else cell.ljust(space)
                    for i, (cell, space) in enumerate(zip(cells, widths, strict=True))
                ).rstrip()
            )
    return "\n".join(lines)
