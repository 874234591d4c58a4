"""`jaxenstein list`: the environments there are."""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Mapping
from typing import Any

from .arguments import Parser, add_suite, flag
from .opening import import_module_of

HELP = "list the environments"
DESCRIPTION = """\
List the environments, with --all further sizes and variants in rows of their own, with
--symbols the characters of text maps, with --samples small maps to play with, with
--pretrained the trained agents that come with this package, with --configs the
configurations of trainings that come with it, with --suite the tasks of the benchmark.
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
# Of the list of configurations, which has long names.
WIDER = 140
# Stands behind the size of a map that is not always the same.
GENERATED = "*"
WRAPPING: dict[str, Any] = {"break_on_hyphens": False, "break_long_words": False}


def fill(parser: Parser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "ids", nargs="*", metavar="ID", help="which ones, also MODULE:NAME (default: all)"
    )
    flag(parser, "--all", "further sizes and variants in rows of their own, too")
    flag(parser, "--symbols", "explain the characters of text maps instead")
    flag(parser, "--samples", "the small maps to play with instead")
    flag(parser, "--pretrained", "the trained agents of this package instead")
    add_suite(parser, "the tasks of the benchmark instead")
    flag(parser, "--configs", "the configurations of this package instead")


def run(options: argparse.Namespace) -> None:
    """Print the list."""
    if options.symbols:
        from ..maps.symbols import legend

        print(legend())
        return
    if options.samples:
        from ..maps.map_files import SAMPLES, sample_map

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
    from .. import registry
    from ..level_counts import level_counts

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
    notes = ["map: columns x rows, in tiles; horizon: steps in an episode"]
    if any(row[1].endswith(GENERATED) for row in table):
        notes.append(f"{GENERATED} a new map is generated at every reset")
    if any(row[2] for row in table[1:]):
        notes.append("levels: the number of different levels; + means at least so many")
    for name, others in variants.items():
        notes.append(f"as {name} (--all): {', '.join(others)}")
    if aliases:
        pairs = ", ".join(f"{alias} = {name}" for alias, name in aliases.items())
        notes.append(f"other names: {pairs}")
    notes += actions_of({name: env.action_names for name, (env, _) in environments.items()})
    for note in notes:
        print(textwrap.fill(note, LIST_WIDTH, subsequent_indent="  ", **WRAPPING))


def pretrained_agents() -> str:
    """The trained agents of this package, with what their files say of them."""
    from ..params import Range
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
            own.append(f"the return of {name} counts with {', '.join(told)}, as in its training")
    notes = (
        "skip: steps of the world in one decision",
        "return and success rate of sampled actions, success of greedy ones",
        *own,
        "'jaxenstein play --policy pretrained/NAME' shows one, and with --greedy as it is then",
    )
    return "\n".join([format_table(table, right=(2, 4, 5, 6, 7)), "", *notes])


def tasks_of(name: str) -> str:
    """The tasks of a suite, as text."""
    from .. import suite

    chosen, reference = suite.suite_of(name), suite.references()
    rows = [("TASK", "ABILITY", "SKIP", "IMAGE", "SPLIT", "RANDOM", "EXPERT", "REASON")]
    for task in suite.TASKS:
        height, width = chosen.image or task.small
        ends = reference[task.id]
        rows.append(
            (
                task.id,
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
        f"seeds, {suite.EPISODES} test episodes of each agent with sampled actions",
        "skip: steps of the world in one decision; image: columns x rows",
        "split: agents train on one part of the levels and are tested on the other",
        "random, expert: returns of the players that scores are normalised by",
    )
    return "\n".join([format_table(rows, right=(2, 3, 5, 6), width=WIDER), "", *notes])


def configurations() -> str:
    """The configurations of this package, with what they train."""
    from .opening import baselines

    table: list[tuple[str, ...]] = [
        ("NAME", "ENVIRONMENT", "ALGO", "SKIP", "DECISIONS", "DESCRIPTION")
    ]
    for of in baselines("configs").listed():
        row = (of.name, of.environment, of.algo, str(of.frame_skip), f"{of.decisions:,}", of.about)
        table.append(row)
    notes = (
        "skip: steps of the world in a decision; decisions: of each seed",
        "'jaxenstein train --config NAME --out RUN' trains one, and flags change its options",
    )
    return "\n".join([format_table(table, right=(3, 4), width=WIDER), "", *notes])


def extent(env: Any) -> str:
    """The size of an environment's map as columns x rows, marked if it is generated."""
    from ..tasks.first_person import FirstPerson

    if not isinstance(env, FirstPerson):
        return "-"
    columns, rows = env.map_size
    return f"{columns}x{rows}{GENERATED if env.about().generated else ''}"


def actions_of(names: Mapping[str, tuple[str, ...]]) -> list[str]:
    """What the actions are, a line for each set of them, that of the most environments first.

    Args:
        names: the actions of each environment.
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


def format_table(
    rows: list[tuple[str, ...]], right: tuple[int, ...] = (), width: int | None = None
) -> str:
    """Rows of cells as lines with aligned columns.

    Args:
        rows: the cells of each.
        right: columns that are aligned to the right.
        width: characters in a line; the last column is wrapped to it.
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
