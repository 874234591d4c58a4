"""Count the levels of environments that draw a level at each reset.

    python -m reliability.levels            count new ids and ids with another version
    python -m reliability.levels ID ...     count these ids again
    python -m reliability.levels --check    only print differences, for all or some ids

Levels are drawn with the environment's resets, and compared by a 64-bit hash. Once every level has
been drawn several times, the count is exact: a level that is still missing has a probability below
1 in 10,000 per draw. With very many levels, drawing stops early, and the count is a lower bound.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

import jaxenstein
from jaxenstein.catalogue import ENTRIES
from jaxenstein.files import atomic
from jaxenstein.level_counts import FILE, LevelCount, level_counts
from jaxenstein.tasks.first_person import GeneratedTask
from jaxenstein.tasks.splits import sample_levels

ENOUGH = 10_000
"""The largest count; a larger number makes no difference."""
# Draws per batch, minimum and maximum number of draws, and draws per level for an exact count.
BATCH, FEWEST, MOST, OFTEN = 2**14, 2**16, 2**21, 8


def count_levels(env: Any) -> tuple[int, bool]:
    """The number of levels, and whether it is exact; otherwise it is a lower bound.

    Args:
        env: a `GeneratedTask`.
    """
    found, times = np.zeros(0, np.uint64), np.zeros(0, np.int64)
    for draws in range(BATCH, MOST + 1, BATCH):
        halves = np.asarray(sample_levels(env, BATCH, draws)).astype(np.uint64)
        codes, more = np.unique(halves[:, 0] << np.uint64(32) | halves[:, 1], return_counts=True)
        found, places = np.unique(np.concatenate([found, codes]), return_inverse=True)
        times = np.bincount(places.reshape(-1), np.concatenate([times, more])).astype(np.int64)
        if len(found) >= ENOUGH:
            return ENOUGH, False
        if draws >= FEWEST and times.min() >= OFTEN:
            return len(found), True
    return len(found), False


def counted(name: str) -> LevelCount:
    """The count of an id."""
    levels, exact = count_levels(jaxenstein.make(name)[0])
    return LevelCount(levels, exact, ENTRIES[name].version)


def generated_ids() -> list[str]:
    """The ids of environments that draw a level at each reset, in the order of the catalogue."""
    return [name for name in ENTRIES if isinstance(jaxenstein.make(name)[0], GeneratedTask)]


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; return 1 if `--check` finds a difference."""
    parser = argparse.ArgumentParser(prog="python -m reliability.levels", description=__doc__)
    parser.add_argument("ids", nargs="*", metavar="ID")
    parser.add_argument("--check", action="store_true")
    options = parser.parse_args(argv)
    known, ids = dict(level_counts()), generated_ids()
    if unknown := [name for name in options.ids if name not in ids]:
        parser.error(f"no environments that draw levels: {', '.join(unknown)}")
    stale = [n for n in ids if n not in known or known[n].version != ENTRIES[n].version]
    differ = False
    for name in options.ids or (ids if options.check else stale):
        count = counted(name)
        changed = known.get(name) != count
        differ |= changed
        print(f"{name}: {count.words}{' (changed)' * changed}", flush=True)
        if not options.check:
            known[name] = count
            write({each: known[each] for each in ids if each in known})
    return int(differ and options.check)


def write(counts: dict[str, LevelCount]) -> None:
    """Write the counts, one per line."""
    rows = [f"{json.dumps(n)}: {json.dumps(dataclasses.asdict(c))}" for n, c in counts.items()]
    with atomic(FILE) as temporary:
        temporary.write_text("{\n" + ",\n".join(rows) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
