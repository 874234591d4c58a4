"""What importing the package costs beside importing JAX: `python -m benchmarks.import_cost`."""

from __future__ import annotations

import argparse
import subprocess
import sys

import numpy as np

from benchmarks.interleave import median_ratio
from jaxenstein.speed.measuring import summarise

SUBJECTS = ("import jax", "import jaxenstein")
TIMED = "import time; began = time.perf_counter(); {}; print(time.perf_counter() - began)"


def seconds_of(statement: str) -> float:
    """Seconds that `statement` takes in a fresh interpreter."""
    command = [sys.executable, "-c", TIMED.format(statement)]
    return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def main() -> None:
    """Time both imports in turn and print medians, quartiles and the median ratio."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=11)
    rounds = parser.parse_args().rounds
    times: dict[str, list[float]] = {statement: [] for statement in SUBJECTS}
    for number in range(rounds + 1):
        for statement, seconds in times.items():
            taken = seconds_of(statement)
            if number:  # The first round fills the file cache.
                seconds.append(taken)
    for statement, seconds in times.items():
        found = summarise(np.array(seconds))
        quartiles = f"{found['lower_quartile']:.3f} - {found['upper_quartile']:.3f}"
        print(f"{statement:18} {found['median']:.3f} s  ({quartiles})")
    print(f"ratio              {median_ratio(times[SUBJECTS[1]], times[SUBJECTS[0]]):.3f}")


if __name__ == "__main__":
    main()
