"""Spoilt input for every parser and loader: maps, settings, trajectories, configurations, runs.

    python -m reliability.fuzz --minutes 10                  all targets, the same time each
    python -m reliability.fuzz --minutes 60 --target ascii   one of them

Each target begins with valid input, which Hypothesis spoils again and again; what was accepted, or
refused for a new reason, is spoilt further. Anything but a result or one of the project's own
errors is a defect, and so is an error that says too little, a warning, a hang, or a file left
behind. The smallest case of a defect is kept in `fuzz/TARGET`; the exit status is 1.
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
# Seconds after which a case hangs; cases of a round, after which the new ones are spoilt further
# and compiled functions forgotten; how many are kept for that.
PATIENCE, ROUND, MOST = 120.0, 200, 300
# Of Hypothesis: what takes long or much is no mistake here.
_HEALTH = hypothesis.HealthCheck
SLOW = (_HEALTH.too_slow, _HEALTH.data_too_large, _HEALTH.large_base_example)


def attempt(target: Target, case: Case, patience: float = PATIENCE) -> str:
    """Run a case in an empty folder.

    Returns:
        Why it was refused, "" if it was not.

    Raises:
        AssertionError: a defect that is no exception by itself.
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
            assert len(refusal.strip()) >= 8, f"an error that says nothing: {refusal!r}"
            named = any(Path(name).parts[0] in refusal for name in case.files)
            assert named or not target.named, f"an error that names no file: {refusal}"
        after = contents(folder)
        left = [name for name in {*before, *after} if before.get(name) != after.get(name)]
        assert not left, f"left files behind: {sorted(left)}"
        return refusal


def fuzz(
    target: Target, cases: int, seed: int = 0, keep: Path | None = None, seconds: float = math.inf
) -> Counter[str]:
    """Try some cases.

    Args:
        target: what reads them.
        cases: how many at most; Hypothesis tries none twice.
        seed: of the changes.
        keep: a folder for the files of the last defect, which is the smallest.
        seconds: after which no more are tried.

    Returns:
        How many were refused for each reason; "" counts those that were accepted.

    Raises:
        AssertionError: one of the target's own seeds is not accepted.
        Exception: a defect, found in as small a case as could be.
    """
    for case in target.seeds:
        assert attempt(target, case) == "", f"a seed is not valid: {attempt(target, case)}"
    later: list[Case] = []
    reasons, end, failed = Counter[str](), time.monotonic() + seconds, False

    def once(case: Case, rng: Rng, changes: int) -> None:
        """Try a case with some changes, but for when time is over and no defect is being shrunk."""
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
    """An empty folder below another one, as the working directory; then it is removed."""
    with tempfile.TemporaryDirectory(prefix="fuzz-") as name:
        folder = Path(name).resolve() / "here"
        folder.mkdir()
        with contextlib.chdir(folder):
            yield folder


@contextlib.contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Interrupt what takes longer, where signals can do that."""
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
    """What tells whether something below a folder has changed, by name."""
    return {
        str(path.relative_to(folder)): os.readlink(path)
        if path.is_symlink()
        else hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
        if path.is_symlink() or path.is_file()
    }


def skeleton(text: str) -> str:
    """A message without quoted words, paths and numbers, so that equal reasons look alike."""
    text = re.sub(r"'[^']*'|\"[^\"]*\"", "'..'", " ".join(text.split()))
    text = re.sub(r"\S*/\S*", "PATH", text)
    return re.sub(r"0x[0-9a-f]+|-?\d[\d.e+-]*|\binf\b|\bnan\b", "N", text)[:160]


def main(arguments: Sequence[str] | None = None) -> int:
    """Fuzz what the command line names; 1 if there were defects."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--minutes", type=float, default=5.0, help="of all targets together (5)")
    parser.add_argument("--target", action="append", choices=list(TARGETS), help="may be repeated")
    parser.add_argument("--seed", type=int, default=int(time.time()), help="of the changes")
    parser.add_argument("--out", type=Path, default=OUT, help="where defects are kept (fuzz)")
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
