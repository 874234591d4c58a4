"""What the ports of ViZDoom's tasks claim of the rules, measured on the real games.

    python -m fidelity.vizdoom_rules [--only health|home] [--seed N] [--json FILE]

Needs the extra `bench`. Each line of the table says of how many episodes, steps or things it is.
The games run with the settings of their own configuration files except for the size of the
screen. `make_action` is called once a decision; a frame skip of 4 is Doom's own repetition.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from fidelity import vizdoom_health, vizdoom_home
from fidelity.findings import Findings
from fidelity.vizdoom_game import complaint, load_vizdoom
from jaxenstein.errors import JAXensteinError
from jaxenstein.files import atomic, check_writable


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, print the table, return the exit code."""
    arguments = _parser().parse_args(argv)
    try:
        load_vizdoom()
        if arguments.json:
            check_writable(arguments.json)
        report = {"vizdoom": importlib.metadata.version("vizdoom"), **measure(arguments)}
        if arguments.json:
            with atomic(arguments.json) as path:
                path.write_text(json.dumps(report, indent=1))
    except JAXensteinError as error:
        return complaint(error)
    return 0


def measure(arguments: argparse.Namespace) -> dict[str, list]:
    """The findings of each task."""
    report = {}
    if arguments.only in (None, "health"):
        print("Health Gathering\n")
        found = Findings()
        vizdoom_health.measure(
            found, episodes=arguments.episodes, greedy=arguments.greedy, seed=arguments.seed
        )
        report["health_gathering"] = found.items
    if arguments.only in (None, "home"):
        print("\nMy Way Home\n")
        found = Findings()
        vizdoom_home.measure(
            found, episodes=arguments.episodes, resets=arguments.resets, seed=arguments.seed
        )
        report["my_way_home"] = found.items
    return report


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Measure rules of ViZDoom's tasks.")
    parser.add_argument("--only", choices=("health", "home"), help="one of the two tasks")
    parser.add_argument("--seed", type=int, default=0, help="of games and players (default 0)")
    parser.add_argument(
        "--episodes", type=_positive, default=300, help="of each player (default 300)"
    )
    parser.add_argument(
        "--greedy", type=_positive, default=20, help="of the greedy player (default 20)"
    )
    parser.add_argument(
        "--resets", type=_positive, default=2000, help="to see where episodes start (default 2000)"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures here")
    return parser


def _positive(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"must be at least 1, not {value}")
    return value


if __name__ == "__main__":
    sys.exit(main())
