"""One subject in a process of its own: `python -m benchmarks.subjects NAME [--core N]`.

It prepares the subject, prints one JSON line that describes it, and then answers each line
`{"seconds": S}` on standard input with `{"steps": N, "seconds": T}`, after stepping for about `S`
seconds. End of input ends it. Any interpreter can run it that has what the subject needs.

A name is a kind, a number of environments where the kind has one, and options, such as
`scan-64 id=key-door size=84x84`. The modules beside this one tell the kinds and their options.
Options that a subject does not know only make its name another one.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.metadata
import json
import os
import platform
import re
import sys
import time

from benchmarks.subjects.common import Chunk, notes

# Of those kinds that are not in `own.py`: the module, by their first word.
MODULES = {"vizdoom": "peers", "envpool": "peers", "miniworld": "peers"}
MODULES |= {"adapter": "adapters", "sb3": "sb3", "training": "training"}
MODULES |= {"convolution": "convolutions"}
# Packages whose versions are told where they are loaded: by module.
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
    """Versions of the interpreter and of the packages that were loaded."""
    loaded = {package for module, package in PACKAGES.items() if module in sys.modules}
    found = {package: importlib.metadata.version(package) for package in sorted(loaded)}
    if "jaxenstein" in sys.modules:
        found["jaxenstein"] = sys.modules["jaxenstein"].__version__
    return {"python": platform.python_version()} | found


def answer(chunk: Chunk, seconds: float) -> dict[str, float]:
    """Step for about `seconds` and say how many steps it was and how long it took."""
    steps, began = 0, time.perf_counter()
    while (elapsed := time.perf_counter() - began) < seconds:
        steps += chunk()
    return {"steps": steps, "seconds": elapsed}


def main() -> None:
    """Prepare one subject and serve requests until standard input ends."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name")
    parser.add_argument("--core", type=int)
    arguments = parser.parse_args()
    if arguments.core is not None:
        os.sched_setaffinity(0, {arguments.core})
    # Libraries may print; the answers need standard output for themselves.
    replies = os.fdopen(os.dup(sys.stdout.fileno()), "w", buffering=1)
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    began = time.perf_counter()
    chunk = prepare(arguments.name)
    chunk()
    ready = time.perf_counter() - began
    described = {"versions": versions(), "notes": notes, "ready_seconds": ready}
    print(json.dumps(described), file=replies)
    for line in sys.stdin:
        print(json.dumps(answer(chunk, json.loads(line)["seconds"])), file=replies)


if __name__ == "__main__":
    main()
