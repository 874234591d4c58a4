"""Spoilt input for every parser and loader: maps, trajectories, configurations, runs, arguments.

    python -m reliability.fuzz --minutes 10                  all targets, the same time each
    python -m reliability.fuzz --minutes 60 --target ascii   one of them
    python -m reliability.fuzz --again fuzz/ascii-3f2a       a kept defect once more

Each target begins with valid input and spoils it again and again; what gives an outcome that was
not seen before is spoilt further. Anything but a result or one of the project's own errors, with
its place, is a defect: it is kept as a folder of files, and the exit status is 1.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import hashlib
import os
import random
import shutil
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

import jax

from .cases import ACCEPTED, DEFECT, REFUSED, Case, Outcome, Target, attempt
from .targets import TARGETS, open_target

OUT = Path("fuzz")
# Cases that are kept to be spoilt further; seconds after which one hangs; how many changes at once.
MOST_KEPT, PATIENCE = 300, 120.0
CHANGES = (1, 1, 1, 2, 3, 5)
# The share of accepted cases that are spoilt further.
GO_ON = 0.2
# Compiled and traced functions are forgotten after so many cases, lest they fill the memory.
FORGET_EVERY = 200


@dataclasses.dataclass
class Tally:
    """What was tried of a target.

    Attributes:
        kinds: how many cases had each kind of outcome.
        reasons: how many were refused for each reason.
        defects: the smallest case of each kind of defect.
        seconds: how long it took.
    """

    kinds: Counter[str] = dataclasses.field(default_factory=Counter)
    reasons: Counter[str] = dataclasses.field(default_factory=Counter)
    defects: dict[str, tuple[Case, Outcome]] = dataclasses.field(default_factory=dict)
    seconds: float = 0.0

    def add(self, case: Case, outcome: Outcome) -> bool:
        """Count a case; whether its outcome is a new one."""
        self.kinds[outcome.kind] += 1
        if outcome.kind == REFUSED:
            self.reasons[outcome.words] += 1
            return self.reasons[outcome.words] == 1
        if outcome.kind == DEFECT:
            smallest = self.defects.get(outcome.words)
            if smallest is None or case.size < smallest[0].size:
                self.defects[outcome.words] = case, outcome
            return smallest is None
        return False


def fuzz(
    target: Target, rng: random.Random, *, seconds: float = 60.0, cases: int | None = None
) -> Tally:
    """Try a target for some time, or a number of cases.

    Raises:
        ValueError: one of the target's own seeds is not accepted.
    """
    tally, kept = Tally(), target.seeds()
    begin = time.monotonic()
    for seed in kept:
        outcome = try_case(target, seed)
        if outcome.kind != ACCEPTED:
            raise ValueError(f"{target.name}: a seed is not valid: {outcome.details}")
        tally.add(seed, outcome)
    while tally.kinds.total() < cases if cases else time.monotonic() - begin < seconds:
        case = rng.choice(kept)
        for _ in range(rng.choice(CHANGES)):
            case = target.spoil(case, rng)
        outcome = try_case(target, case)
        # Defects are found again all the time if they are spoilt further.
        new = tally.add(case, outcome) and outcome.kind == REFUSED
        if new or (outcome.kind == ACCEPTED and rng.random() < GO_ON):
            kept.append(case)
            if len(kept) > MOST_KEPT:
                del kept[rng.randrange(len(kept))]
        if tally.kinds.total() % FORGET_EVERY == 0:
            jax.clear_caches()
    tally.seconds = time.monotonic() - begin
    return tally


def try_case(target: Target, case: Case) -> Outcome:
    """Run a case in an empty folder of its own."""
    with scratch() as folder:
        return attempt(target, case, folder, PATIENCE)


@contextlib.contextmanager
def scratch() -> Iterator[Path]:
    """An empty folder below another one, as the working directory; then it is removed."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory(prefix="fuzz-") as name:
        folder = Path(name).resolve() / "here"
        folder.mkdir()
        os.chdir(folder)
        try:
            yield folder
        finally:
            os.chdir(before)


def keep(folder: Path, target: str, case: Case, outcome: Outcome) -> Path:
    """Write a defect down: its files, its arguments, and what came of it."""
    short = hashlib.sha256(outcome.words.encode()).hexdigest()[:6]
    place = folder / f"{target}-{short}"
    shutil.rmtree(place, ignore_errors=True)
    (place / "files").mkdir(parents=True)
    case.write(place / "files")
    write_args(place / "args", case.args)
    (place / "outcome.txt").write_text(
        f"{target}\n{outcome.words}\n\n{outcome.details}\n", encoding="utf-8", errors="replace"
    )
    return place


def write_args(path: Path, args: Sequence[str]) -> None:
    """Arguments as a file, separated by zero bytes, which none can hold."""
    path.write_bytes(b"\0".join(arg.encode("utf-8", "surrogateescape") for arg in args))


def again(place: Path) -> Outcome:
    """Run a kept defect once more."""
    root, data = place / "files", (place / "args").read_bytes()
    files = {
        str(path.relative_to(root)): path.read_bytes() for path in root.rglob("*") if path.is_file()
    }
    args = tuple(os.fsdecode(arg) for arg in data.split(b"\0")) if data else ()
    target = open_target((place / "outcome.txt").read_text(encoding="utf-8").split("\n")[0])
    return try_case(target, Case(files, args))


def table(tallies: dict[str, Tally]) -> str:
    """What was tried, as a table of Markdown."""
    lines = ["| target | tried | accepted | refused | reasons | defects | s |"]
    lines += ["|---|---:|---:|---:|---:|---:|---:|"]
    for name, tally in tallies.items():
        kinds = tally.kinds
        cells = (kinds.total(), kinds[ACCEPTED], kinds[REFUSED], len(tally.reasons))
        shown = " | ".join(map(str, (*cells, len(tally.defects), round(tally.seconds))))
        lines.append(f"| {name} | {shown} |")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Fuzz what the command line names; 1 if there were defects."""
    options = _parser().parse_args(arguments)
    if options.again is not None:
        outcome = again(options.again.resolve())
        print(outcome.kind, outcome.details or outcome.words)
        return int(outcome.kind == DEFECT)
    out, names, tallies = options.out.resolve(), options.target or list(TARGETS), {}
    for name in names:
        print(f"== {name}", flush=True)
        rng = random.Random(f"{options.seed} {name}")
        target = open_target(name)
        tallies[name] = fuzz(
            target, rng, seconds=60 * options.minutes / len(names), cases=options.cases
        )
        for case, outcome in tallies[name].defects.values():
            place = keep(out, name, case, outcome)
            print(f"defect: {outcome.words}\n  kept in {place}", flush=True)
        if options.reasons:
            for words, count in tallies[name].reasons.most_common():
                print(f"{count:7}  {words}")
    print(table(tallies))
    return int(any(tally.defects for tally in tallies.values()))


def _parser() -> argparse.ArgumentParser:
    summary = (__doc__ or "").split("\n\n")
    parser = argparse.ArgumentParser(
        prog="python -m reliability.fuzz",
        description=summary[0],
        epilog=summary[2],
    )
    parser.add_argument("--minutes", type=float, default=5.0, help="of all targets together (5)")
    parser.add_argument("--cases", type=int, help="of each target, instead of minutes")
    parser.add_argument("--target", action="append", choices=list(TARGETS), help="may be repeated")
    parser.add_argument("--seed", type=int, default=0, help="of the changes (0)")
    parser.add_argument("--out", type=Path, default=OUT, help="where defects are kept (fuzz)")
    parser.add_argument("--reasons", action="store_true", help="list why input was refused")
    parser.add_argument("--again", type=Path, metavar="DIR", help="run a kept defect once more")
    return parser


if __name__ == "__main__":
    sys.exit(main())
