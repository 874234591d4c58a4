"""What importing the package costs beside importing JAX: `python -m benchmarks.imports`."""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys

SUBJECTS = ("import jax", "import jaxenstein")
TIMED = "import time; began = time.perf_counter(); {}; print(time.perf_counter() - began)"


def seconds_of(statement: str) -> float:
    """Seconds that `statement` takes in a fresh interpreter."""
    command = [sys.executable, "-c", TIMED.format(statement)]
    return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def main() -> None:
    """Time both imports in turn and print quartiles and the median ratio."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=11)
    rounds = parser.parse_args().rounds
    # The first round fills the file cache.
    times = [[seconds_of(statement) for statement in SUBJECTS] for _ in range(rounds + 1)][1:]
    for statement, seconds in zip(SUBJECTS, zip(*times, strict=True), strict=True):
        low, middle, high = statistics.quantiles(seconds, n=4, method="inclusive")
        print(f"{statement:18} {middle:.3f} s  ({low:.3f} - {high:.3f})")
    print(f"ratio              {statistics.median(ours / jax for jax, ours in times):.3f}")


if __name__ == "__main__":
    main()
