"""Mutation testing: does a test fail where the engine or a task's rule is changed by a little?

    python -m reliability.mutants                          60 mutants of each group
    python -m reliability.mutants rays sprites --sample 200
    python -m reliability.mutants --list                   the groups

Cosmic Ray makes the mutants and runs each group's tests on every one of a random sample, in a copy
of the sources. Its session is kept below `build/mutants`: the same command goes on with it, and
`cr-report` reads it. Mutants of annotations, decorators and messages change no behaviour and are
left out.
"""

from __future__ import annotations

import argparse
import ast
import dataclasses
import functools
import hashlib
import importlib
import importlib.util
import os
import random
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "build" / "mutants"
COPIED = ("src", "tests", "reliability", "fidelity", "benchmarks", "examples", "pyproject.toml")
# Parts of a syntax tree whose mutants behave as before, or only say something else.
IDLE = ("annotation", "returns", "exc", "decorator_list")


@dataclasses.dataclass(frozen=True)
class Group:
    """Modules, and the tests that must notice a change of them.

    Attributes:
        modules: files below `src/jaxenstein`.
        tests: files below `tests`.
    """

    modules: tuple[str, ...]
    tests: tuple[str, ...]


GROUPS = {
    "rays": Group(
        ("engine/raycast.py", "engine/lines.py", "engine/camera.py"), ("engine/test_raycast.py",)
    ),
    "level": Group(("engine/level.py",), ("engine/test_level.py", "engine/test_raycast.py")),
    "sprites": Group(("engine/sprites.py",), ("engine/test_sprites.py", "engine/test_render.py")),
    "pixels": Group(
        ("engine/pixels.py", "engine/image_columns.py", "engine/shade.py", "engine/render.py"),
        ("engine/test_shade.py", "engine/test_render.py", "engine/test_sprites.py"),
    ),
    "stages": Group(("engine/fusion.py",), ("engine/test_fusion.py",)),
    "navigation": Group(
        ("tasks/navigation.py", "engine/motion.py", "tasks/draws.py"),
        ("tasks/test_navigation.py",),
    ),
    "maze": Group(("tasks/maze.py", "tasks/steering.py"), ("tasks/test_maze.py",)),
    "health": Group(
        ("tasks/health_gathering.py", "tasks/hud.py"), ("tasks/test_health_gathering.py",)
    ),
    "corridor": Group(("tasks/key_corridor.py",), ("tasks/test_key_corridor.py",)),
    "contract": Group(
        ("environment.py", "turn.py"), ("contract/test_contract.py", "contract/test_autoreset.py")
    ),
}


def work(name: str, options: argparse.Namespace) -> None:
    """Try a sample of a group's mutants and print those that no test noticed."""
    group, folder = GROUPS[name], options.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    files = [ROOT / "src" / "jaxenstein" / module for module in group.modules]
    files += [ROOT / "tests" / test for test in group.tests]
    # Where a file has changed, what was tried says nothing.
    digest = hashlib.sha256(b"\0".join(file.read_bytes() for file in files)).hexdigest()[:12]
    session = folder / f"{name}-{digest}-{options.seed}-{options.sample}.sqlite"
    with tempfile.TemporaryDirectory(prefix="mutants-") as scratch:
        copy = Path(scratch)
        for item in COPIED:
            if (ROOT / item).is_dir():
                ignored = shutil.ignore_patterns("__pycache__", ".hypothesis")
                shutil.copytree(ROOT / item, copy / item, ignore=ignored)
            else:
                shutil.copy(ROOT / item, copy)
        # Programs that a mutant leaves as they are need not be compiled again for it.
        environment = dict(os.environ) | {
            "PYTHONPATH": str(copy / "src"),
            "JAX_COMPILATION_CACHE_DIR": str(folder / "compiled"),
            "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
        }

        def cosmic(*arguments: str) -> None:
            program = [sys.executable, "-m", *arguments]
            subprocess.run(program, cwd=copy, env=environment, check=True)

        # The first run compiles everything.
        for config, limit in (("first", 10 * options.limit), ("mutants", options.limit)):
            (copy / config).write_text(_config(group, limit), encoding="utf-8")
        cosmic("cosmic_ray.cli", "baseline", "first")
        if not session.exists():
            fresh = session.with_suffix(".new")
            cosmic("cosmic_ray.cli", "init", "mutants", str(fresh), "--force")
            sample(fresh, options.sample, options.seed)
            fresh.replace(session)
        cosmic("cosmic_ray.cli", "exec", "mutants", str(session))
        print(f"== {name}", flush=True)
        cosmic("cosmic_ray.tools.report", "--surviving-only", "--show-diff", str(session))


def _config(group: Group, limit: float) -> str:
    modules = ", ".join(f'"src/jaxenstein/{module}"' for module in group.modules)
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-m", "not slow"]
    command += ["-p", "no:cacheprovider", *(f"tests/{test}" for test in group.tests)]
    return f"""[cosmic-ray]
module-path = [{modules}]
timeout = {limit}
excluded-modules = []
test-command = '''{shlex.join(command)}'''

[cosmic-ray.distributor]
name = "local"
"""


def sample(session: Path, wanted: int, seed: int) -> None:
    """Keep a random sample of the mutants of a new session of Cosmic Ray."""
    work_db = importlib.import_module("cosmic_ray.work_db")
    with work_db.use_db(str(session), work_db.WorkDB.Mode.open) as db:
        items = [item for item in db.work_items if behaves(item.mutations[0])]
        items.sort(key=lambda item: str(item.mutations))
        random.Random(seed).shuffle(items)
        db.clear()
        db.add_work_items(items[:wanted])


def behaves(mutation: Any) -> bool:
    """Whether a mutant may behave otherwise."""
    start, end = tuple(mutation.start_pos), tuple(mutation.end_pos)
    return not any(
        low <= start and end <= high for low, high in _idle_spans(ROOT / mutation.module_path)
    )


@functools.cache
def _idle_spans(module: Path) -> tuple[tuple[tuple[int, int], tuple[int, int]], ...]:
    """From and to (line, column) of annotations, decorators and what is raised."""

    def expressions() -> Iterator[ast.expr]:
        for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
            for field in IDLE:
                part = getattr(node, field, None)
                yield from part if isinstance(part, list) else [part] if part else []

    return tuple(
        ((part.lineno, part.col_offset), (part.end_lineno or 0, part.end_col_offset or 0))
        for part in expressions()
    )


def main(argv: Sequence[str] | None = None) -> None:
    """Try the groups that are named."""
    parser = argparse.ArgumentParser(description="Mutation testing of the engine and the rules.")
    parser.add_argument("groups", nargs="*", metavar="GROUP", help="(default: all)")
    parser.add_argument("--list", action="store_true", help="the groups and their files")
    parser.add_argument("--sample", type=int, default=60, metavar="N", help="of each (default 60)")
    parser.add_argument("--seed", type=int, default=0, help="of the sample (default 0)")
    limit = "seconds after which a mutant's tests count as failed (default 240)"
    parser.add_argument("--limit", type=float, default=240.0, metavar="S", help=limit)
    parser.add_argument("--folder", type=Path, default=FOLDER, help="for what was tried")
    options = parser.parse_args(argv)
    if unknown := [name for name in options.groups if name not in GROUPS]:
        parser.error(f"no group {unknown[0]!r}; there are {', '.join(GROUPS)}")
    if options.list:
        for name, group in GROUPS.items():
            print(f"{name:12} {' '.join(group.modules)}: {' '.join(group.tests)}")
        return
    if importlib.util.find_spec("cosmic_ray") is None:
        parser.error("Cosmic Ray is not installed: `make mutants`, or pip install '.[mutation]'")
    for name in options.groups or GROUPS:
        try:
            work(name, options)
        except subprocess.CalledProcessError as error:
            command = shlex.join(map(str, error.cmd[2:5]))
            parser.error(f"{command} failed: do the tests pass as they are?")


if __name__ == "__main__":
    main()
