"""Run one subject in its own process: `python -m benchmarks.subjects NAME [--core N]`.

It prepares the subject and prints one JSON line that describes it. It answers each line
`{"seconds": S}` on standard input by stepping for about `S` seconds, and then printing
`{"steps": N, "seconds": T}`. It ends at the end of input. The interpreter only needs the packages
of the subject.

A name has a kind, for some kinds a number of environments, and options, such as
`scan-64 id=key-door size=84x84`. The other modules of this package document kinds and options. With
`busy=1`, another process runs while the subject steps. Unknown options only make names different.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import importlib.metadata
import json
import os
import platform
import re
import subprocess
import sys
import time
from collections.abc import Iterator

from benchmarks.subjects.common import Chunk, notes

# The modules of kinds that are not in `own.py`, by the first word of the kind.
MODULES = {"vizdoom": "peers", "envpool": "peers", "miniworld": "peers"}
MODULES |= {"adapter": "adapters", "sb3": "sb3", "training": "training"}
MODULES |= {"gymnasium": "adapters", "start": "adapters", "convolution": "convolutions"}
# Packages whose versions are reported if they are loaded, by module.
PACKAGES = {
    **{name: name for name in ("jax", "jaxlib", "numpy", "gymnasium", "vizdoom", "envpool")},
    **{name: name for name in ("flax", "miniworld", "pyglet", "torch")},
    "cv2": "opencv-python-headless",
    "stable_baselines3": "stable-baselines3",
    "sb3_contrib": "sb3-contrib",
}


def prepare(name: str) -> Chunk:
    """Build the subject called `name`."""
    head, *words = name.split()
    options = dict(word.split("=", 1) for word in words)
    kind, batch = re.fullmatch(r"(.+?)(?:-(\d+))?", head).groups()  # type: ignore[union-attr]
    module = MODULES.get(kind.partition("-")[0], "own")
    subjects = importlib.import_module(f"benchmarks.subjects.{module}").SUBJECTS
    return subjects[kind](int(batch or 1), options)


def versions() -> dict[str, str]:
    """The versions of the interpreter and of loaded packages."""
    loaded = {package for module, package in PACKAGES.items() if module in sys.modules}
    found = {package: importlib.metadata.version(package) for package in sorted(loaded)}
    if "jaxenstein" in sys.modules:
        found["jaxenstein"] = sys.modules["jaxenstein"].__version__
    return {"python": platform.python_version()} | found


def answer(chunk: Chunk, seconds: float) -> dict[str, float]:
    """Step for about `seconds`; return the number of steps and the time."""
    steps, began = 0, time.perf_counter()
    while (elapsed := time.perf_counter() - began) < seconds:
        steps += chunk()
    return {"steps": steps, "seconds": elapsed}


@contextlib.contextmanager
def neighbour() -> Iterator[None]:
    """Keep one core busy with another process."""
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as process:
        try:
            yield
        finally:
            process.kill()


def main() -> None:
    """Prepare one subject and serve requests until standard input ends."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name")
    parser.add_argument("--core", type=int)
    arguments = parser.parse_args()
    if arguments.core is not None:
        os.sched_setaffinity(0, {arguments.core})
    # Libraries may print, so only answers go to the original standard output.
    replies = os.fdopen(os.dup(sys.stdout.fileno()), "w", buffering=1)
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    began = time.perf_counter()
    chunk = prepare(arguments.name)
    chunk()
    ready = time.perf_counter() - began
    described = {"versions": versions(), "notes": notes, "ready_seconds": ready}
    print(json.dumps(described), file=replies)
    beside = neighbour if "busy=1" in arguments.name.split() else contextlib.nullcontext
    for line in sys.stdin:
        with beside():
            measured = answer(chunk, json.loads(line)["seconds"])
        print(json.dumps(measured), file=replies)


if __name__ == "__main__":
    main()
