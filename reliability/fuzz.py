"""Fuzz every parser and loader: maps, settings, trajectories, configs, runs.

    python -m reliability.fuzz --minutes 10                  all targets, with equal times
    python -m reliability.fuzz --minutes 60 --target ascii   one target

Each target starts with valid input, which Hypothesis mutates. Inputs that are accepted, or refused
for a new reason, are mutated further. Everything except a result or one of the project's own errors
is a defect, and so are errors that say too little, warnings, hangs, and files left behind. The
smallest case of a defect is kept in `fuzz/TARGET`, and the exit status is 1.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import math
import os
import re
import shutil
import signal
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

import hypothesis
import jax
from hypothesis import strategies

from jaxenstein.errors import JAXensteinError, MapWarning

from .spoil import Case, Rng, Target
from .targets import TARGETS

OUT = Path("fuzz")
# Seconds after which a case counts as hung; cases per round, after which new cases are mutated and
# compiled functions are dropped; and the number of new cases to keep.
PATIENCE, ROUND, MOST = 120.0, 200, 300
# Health checks of Hypothesis that do not apply here.
_HEALTH = hypothesis.HealthCheck
SLOW = (_HEALTH.too_slow, _HEALTH.data_too_large, _HEALTH.large_base_example)


def attempt(target: Target, case: Case, patience: float = PATIENCE) -> str:
    """Run a case in an empty folder.

    Returns:
        The reason of a refusal, or "" if the case was accepted.

    Raises:
        AssertionError: a defect that does not raise an exception itself.
    """
    with scratch() as folder:
        case.write(folder)
        before, refusal = contents(folder), ""
        try:
            with limited(patience), warnings.catch_warnings():
                warnings.simplefilter("error")
                warnings.simplefilter("ignore", MapWarning)
                target.run(case)
        except JAXensteinError as error:
            refusal = str(error)
            assert len(refusal.strip()) >= 8, f"an error without a message: {refusal!r}"
            named = any(Path(name).parts[0] in refusal for name in case.files)
            assert named or not target.named, f"an error that does not name a file: {refusal}"
        after = contents(folder)
        left = [name for name in {*before, *after} if before.get(name) != after.get(name)]
        assert not left, f"left files behind: {sorted(left)}"
        return refusal


def fuzz(
    target: Target, cases: int, seed: int = 0, keep: Path | None = None, seconds: float = math.inf
) -> Counter[str]:
    """Try some cases.

    Args:
        target: the target to fuzz.
        cases: maximum number of cases; Hypothesis tries no case twice.
        seed: random seed.
        keep: a folder for the files of the last defect, which is the smallest.
        seconds: time limit.

    Returns:
        The number of refusals for each reason; "" counts accepted cases.

    Raises:
        AssertionError: a seed of the target is not accepted.
        Exception: a defect, in a case as small as possible.
    """
    for case in target.seeds:
        assert attempt(target, case) == "", f"a seed is not valid: {attempt(target, case)}"
    later: list[Case] = []
    reasons, end, failed = Counter[str](), time.monotonic() + seconds, False

    def once(case: Case, rng: Rng, changes: int) -> None:
        """Mutate and try a case, unless time is over and no defect is being shrunk."""
        nonlocal failed
        for _ in range(changes):
            case = target.spoil(case, rng)
        # Only now: Hypothesis calls it a defect if the same case draws less than before.
        if time.monotonic() > end and not failed:
            return
        try:
            reason = skeleton(attempt(target, case))
        except BaseException:
            failed = True
            if keep is not None:
                shutil.rmtree(keep, ignore_errors=True)
                case.write(keep)
            raise
        if not reason or reason not in reasons:
            later.append(case)
        reasons[reason] += 1

    for number, done in enumerate(range(0, cases, ROUND)):
        if time.monotonic() > end:
            break
        pool = strategies.sampled_from([*target.seeds, *later[-MOST:]])
        spoilt = hypothesis.given(pool, strategies.randoms(), strategies.integers(1, 4))(once)
        options = hypothesis.settings(
            max_examples=min(ROUND, cases - done), deadline=None, database=None,
            suppress_health_check=SLOW,
            phases=(hypothesis.Phase.generate, hypothesis.Phase.shrink),
        )  # fmt: skip
        hypothesis.seed(seed * 1000 + number)(options(spoilt))()
        jax.clear_caches()
    return reasons


@contextlib.contextmanager
def scratch() -> Iterator[Path]:
    """An empty temporary folder inside another one, as the working directory."""
    with tempfile.TemporaryDirectory(prefix="fuzz-") as name:
        folder = Path(name).resolve() / "here"
        folder.mkdir()
        with contextlib.chdir(folder):
            yield folder


@contextlib.contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Interrupt a block that takes longer, if the system has the signal."""
    if not hasattr(signal, "setitimer"):
        yield
        return

    def ring(*_: object) -> None:
        raise AssertionError(f"took longer than {seconds:g} s")

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def contents(folder: Path) -> dict[str, str]:
    """Digests of everything below a folder, by name, to detect changes."""
    return {
        str(path.relative_to(folder)): os.readlink(path)
        if path.is_symlink()
        else hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
        if path.is_symlink() or path.is_file()
    }


def skeleton(text: str) -> str:
    """A message without quoted words, paths and numbers, to compare reasons."""
    text = re.sub(r"'[^']*'|\"[^\"]*\"", "'..'", " ".join(text.split()))
    text = re.sub(r"\S*/\S*", "PATH", text)
    return re.sub(r"0x[0-9a-f]+|-?\d[\d.e+-]*|\binf\b|\bnan\b", "N", text)[:160]


def main(arguments: Sequence[str] | None = None) -> int:
    """Fuzz the named targets; return 1 if there are defects."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--minutes", type=float, default=5.0, help="total minutes (default 5)")
    parser.add_argument(
        "--target", action="append", choices=list(TARGETS), help="a target; repeat for several"
    )
    parser.add_argument("--seed", type=int, default=int(time.time()), help="random seed")
    parser.add_argument("--out", type=Path, default=OUT, help="folder for defects (default fuzz)")
    options = parser.parse_args(arguments)
    names, failed = options.target or list(TARGETS), False
    print(f"seed {options.seed}\n| target | tried | accepted | reasons |\n|---|---:|---:|---:|")
    for name in names:
        seconds, reasons = 60 * options.minutes / len(names), Counter[str]()
        try:
            kept = options.out.resolve() / name
            reasons = fuzz(TARGETS[name](), sys.maxsize, options.seed, kept, seconds)
        except Exception as error:
            failed = True
            print(f"{name}: defect: {error!r}, kept in {options.out / name}")
        print(f"| {name} | {reasons.total()} | {reasons['']} | {len(reasons)} |", flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
