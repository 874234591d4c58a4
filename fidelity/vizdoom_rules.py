"""What the ports of ViZDoom's tasks claim of the rules, measured on the real games.

    python -m fidelity.vizdoom_rules [--only health|home] [--seed N]

Needs the extra `bench`. Each line of the table says of how many episodes, steps or things it is.
The games run with the settings of their own configuration files except for the size of the
screen. `make_action` is called once a decision; a frame skip of 4 is Doom's own repetition.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from fidelity import vizdoom_health, vizdoom_home
from fidelity.findings import Findings
from fidelity.vizdoom_game import complaint, load_vizdoom
from jaxenstein.errors import JAXensteinError


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, print the tables, return the exit code."""
    parser = argparse.ArgumentParser(description="Measure rules of ViZDoom's tasks.")
    parser.add_argument("--only", choices=("health", "home"), help="one of the two tasks")
    parser.add_argument("--seed", type=int, default=0, help="of games and players (default 0)")
    parser.add_argument("--episodes", type=int, default=300, help="of each player (default 300)")
    parser.add_argument("--greedy", type=int, default=20, help="of the greedy player (default 20)")
    parser.add_argument("--resets", type=int, default=2000, help="to see starts (default 2000)")
    options = parser.parse_args(argv)
    if min(options.episodes, options.greedy, options.resets) < 1:
        parser.error("--episodes, --greedy and --resets must be at least 1")
    try:
        print(f"ViZDoom {load_vizdoom().__version__}")
        episodes, seed = options.episodes, options.seed
        if options.only in (None, "health"):
            found = Findings("Health Gathering")
            vizdoom_health.measure(found, episodes=episodes, greedy=options.greedy, seed=seed)
        if options.only in (None, "home"):
            found = Findings("My Way Home")
            vizdoom_home.measure(found, episodes=episodes, resets=options.resets, seed=seed)
    except JAXensteinError as error:
        return complaint(error)
    return 0


if __name__ == "__main__":
    sys.exit(main())
