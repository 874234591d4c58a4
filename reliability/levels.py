"""How many levels each environment has that draws one at each reset.

    python -m reliability.levels            count those that are new or have another version
    python -m reliability.levels ID ...     count these anew
    python -m reliability.levels --check    only tell what differs, of all or of some

Levels are drawn with the environment's own resets and told apart by a hash of 64 bits. If each of
them came often, that is their number; a level that never came has a chance of less than one in ten
thousand draws then. With very many of them drawing stops early: there are at least so many.
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
"""Of more levels their number makes no difference."""
# Draws at a time, the fewest and the most in all; how often each level comes until all are known.
BATCH, FEWEST, MOST, OFTEN = 2**14, 2**16, 2**21, 8


def count_levels(env: Any) -> tuple[int, bool]:
    """How many levels there are, and whether that is their number; else there are at least so many.

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
    """What there is to keep of an id."""
    levels, exact = count_levels(jaxenstein.make(name)[0])
    return LevelCount(levels, exact, ENTRIES[name].version)


def generated_ids() -> list[str]:
    """The ids of environments that draw a level at each reset, in the order of the catalogue."""
    return [name for name in ENTRIES if isinstance(jaxenstein.make(name)[0], GeneratedTask)]


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; 1 if `--check` finds a difference."""
    parser = argparse.ArgumentParser(prog="python -m reliability.levels", description=__doc__)
    parser.add_argument("ids", nargs="*", metavar="ID")
    parser.add_argument("--check", action="store_true")
    options = parser.parse_args(argv)
    known, ids = dict(level_counts()), generated_ids()
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
    """Keep the counts, a line for each."""
    rows = [f"{json.dumps(n)}: {json.dumps(dataclasses.asdict(c))}" for n, c in counts.items()]
    with atomic(FILE) as temporary:
        temporary.write_text("{\n" + ",\n".join(rows) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
