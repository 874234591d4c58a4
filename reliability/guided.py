"""Fuzzing guided by coverage, with Atheris, of what reads a single file.

    python -m pip install '.[fuzzing]'
    python -m reliability.guided ascii --minutes 10

Atheris (libFuzzer for Python) changes the bytes, and goes on with what reaches new lines of this
package; outcomes are judged as `python -m reliability.fuzz` does, which needs no Atheris, knows the
formats, and tries folders and arguments too. Atheris installs on Linux.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

# Bytes of the longest input.
LONGEST = 4096
# What a file alone does not make.
FOLDERS = ("run", "arguments")


def watched(
    target: Any, name: str, options: argparse.Namespace, ended: Callable[[], object]
) -> Callable[[bytes], None]:
    """A function of bytes that tries them, and ends the process when the time is over.

    Args:
        target: what reads them.
        name: the name of their file.
        options: those of the command line.
        ended: called at the end.
    """
    from . import fuzz
    from .cases import DEFECT, Case

    tally, out, seconds = fuzz.Tally(), options.out.resolve(), 60 * options.minutes
    end = time.monotonic() + seconds

    def run(data: bytes) -> None:
        case = Case({name: bytes(data)})
        outcome = fuzz.try_case(target, case)
        new = tally.add(case, outcome)
        if new and outcome.kind == DEFECT:
            place = fuzz.keep(out, target.name, case, outcome)
            print(f"defect: {outcome.words}\n  kept in {place}", flush=True)
        if time.monotonic() > end:
            tally.seconds = seconds
            print(fuzz.table({target.name: tally}), flush=True)
            ended()
            # libFuzzer has no way to return to Python.
            os._exit(int(bool(tally.defects)))

    return run


def main(arguments: Sequence[str] | None = None) -> None:
    """Fuzz the target that the command line names; the exit status is 1 if there were defects."""
    parser = argparse.ArgumentParser(
        prog="python -m reliability.guided", description=(__doc__ or "").split("\n\n")[0]
    )
    parser.add_argument("target", help="such as ascii or config")
    parser.add_argument("--minutes", type=float, default=5.0, help="(default 5)")
    parser.add_argument("--seed", type=int, default=1, help="of the changes (default 1)")
    parser.add_argument("--out", type=Path, default=Path("fuzz"), help="where defects are kept")
    options = parser.parse_args(arguments)
    if importlib.util.find_spec("atheris") is None:
        parser.error("Atheris is not installed: python -m pip install '.[fuzzing]' (Linux)")
    if options.minutes <= 0 or options.seed < 1:
        parser.error("--minutes must be above 0 and --seed at least 1 (0 is libFuzzer's chance)")
    atheris = importlib.import_module("atheris")
    # What is imported in here counts the lines it reaches.
    with atheris.instrument_imports(include=["jaxenstein"]):
        from .targets import TARGETS, open_target

    known = [name for name in TARGETS if name not in FOLDERS]
    if options.target not in known:
        parser.error(f"no target {options.target!r} of one file; there are {', '.join(known)}")
    target = open_target(options.target)
    seeds = [seed for seed in target.seeds() if len(seed.files) == 1 and not seed.args]
    # Their names decide how they are read: the first one's kind is fuzzed.
    name = next(iter(seeds[0].files))
    corpus = Path(tempfile.mkdtemp(prefix="corpus-"))
    for number, seed in enumerate(seeds):
        if name in seed.files:
            (corpus / str(number)).write_bytes(seed.files[name])
    flags = [f"-seed={options.seed}", f"-max_len={LONGEST}", "-timeout=0", "-verbosity=0"]
    run = watched(target, name, options, lambda: shutil.rmtree(corpus, ignore_errors=True))
    atheris.Setup([sys.argv[0], *flags, str(corpus)], run)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
