"""`jaxenstein list`: the environments there are."""

from __future__ import annotations

import argparse

DESCRIPTION = "List the environments, or with --symbols the characters of text maps."
EPILOG = """\
examples:
  jaxenstein list
  jaxenstein list --symbols
"""


def add_command(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "list", help="list the environments", description=DESCRIPTION, epilog=EPILOG
    )
    parser.add_argument(
        "--symbols", action="store_true", help="explain the characters of text maps instead"
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Print the list."""
    if options.symbols:
        from ..maps.symbols import legend

        print(legend())
        return
    from ..registry import ENTRIES, environment_ids, make

    table = [("ID", "MAP", "HORIZON", "DISCOUNT", "DESCRIPTION")]
    actions: dict[tuple[str, ...], list[str]] = {}
    for name in environment_ids():
        env, params = make(name)
        tilemap = getattr(env, "tilemap", None)
        extent = "-" if tilemap is None else f"{tilemap.columns}x{tilemap.rows}"
        horizon, discount = str(params.max_steps_in_episode), f"{params.discount:g}"
        table.append((name, extent, horizon, discount, ENTRIES[name].summary))
        actions.setdefault(env.action_names, []).append(name)
    print(format_table(table))
    print()
    for names, users in actions.items():
        whose = "all" if len(actions) == 1 else ", ".join(users)
        numbered = ", ".join(f"{i} {name}" for i, name in enumerate(names))
        print(f"actions of {whose}: {numbered}")
    print("map: columns x rows, in tiles; horizon: steps in an episode")


def format_table(rows: list[tuple[str, ...]], right: tuple[int, ...] = ()) -> str:
    """Rows of cells as lines with aligned columns; `right` are the right-aligned ones."""
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        cells = [
            cell.rjust(width) if i in right else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)
