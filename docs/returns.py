"""What the scripted players get in each environment, for the pages of the site.

    python -m docs.returns [--episodes N] [ID ...]

writes docs/returns.json: returns of each player, and the versions of environments and JAX. With
ids, only their rows are measured anew.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax

import jaxenstein
from docs.command import each, parser_of
from fidelity.players import measure
from jaxenstein.catalogue import ENTRIES, MAIN_IDS
from jaxenstein.files import atomic, check_writable

OUT = Path(__file__).parent / "returns.json"
EPISODES = 256


def players_of(name: str) -> tuple[str, ...]:
    """The players that play an environment: chance, and the one that knows the way."""
    return "uniform", jaxenstein.make(name)[0].about().expert


def rows_of(name: str, episodes: int) -> list[dict[str, Any]]:
    """A row for each player, with the versions that it is true of."""
    facts = {"version": ENTRIES[name].version, "jax": jax.__version__}
    rows = [measure(name, player, episodes, None) for player in players_of(name)]
    return [facts | {key: row[key] for key in row if key != "original"} for row in rows]


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, and write the file."""
    parser = parser_of("docs.returns", __doc__)
    parser.add_argument("--episodes", type=int, default=EPISODES, metavar="N")
    parser.add_argument("--out", type=Path, default=OUT, metavar="FILE.json")
    options = parser.parse_args(argv)
    check_writable(options.out)
    wanted = options.ids or list(MAIN_IDS)
    kept = []
    if options.ids and options.out.exists():
        kept = json.loads(options.out.read_text("utf-8"))["players"]
    measured = [row for n in each(options.ids, "playing") for row in rows_of(n, options.episodes)]
    rows = [*(row for row in kept if row["id"] not in wanted), *measured]
    rows.sort(key=lambda row: list(ENTRIES).index(row["id"]))
    result = {"command": "python -m docs.returns", "players": rows}
    with atomic(options.out) as temporary:
        temporary.write_text(json.dumps(result, indent=1) + "\n", "utf-8")
    print(f"wrote {options.out}")


if __name__ == "__main__":
    main()
