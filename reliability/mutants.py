"""Mutation testing: does a test fail where the engine or a task's rule is changed by a little?

    python -m reliability.mutants                          60 mutants of each group
    python -m reliability.mutants rays sprites --sample 200
    python -m reliability.mutants --list                   the groups

Cosmic Ray makes the mutants and runs each group's tests on every one of a random sample, in a copy
of the sources. What was tried is kept below `build/mutants`; the same command goes on with it.
Mutants of annotations, of decorators and of messages change no behaviour and are left out.
"""

from __future__ import annotations

import argparse
import ast
import dataclasses
import functools
import hashlib
import importlib.util
import os
import random
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "build" / "mutants"
COPIED = ("src", "tests", "reliability", "fidelity", "benchmarks", "examples", "pyproject.toml")
# Operators whose mutants are equivalent, or no mutants of behaviour.
IDLE = ("core/RemoveDecorator", "core/ExceptionReplacer")


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
    "rays": Group(("engine/raycast.py", "engine/camera.py"), ("engine/test_raycast.py",)),
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
    "corridor": Group(
        ("tasks/key_corridor.py",), ("tasks/test_key_corridor.py", "tasks/test_generated_level.py")
    ),
    "contract": Group(
        ("environment.py",), ("contract/test_contract.py", "contract/test_autoreset.py")
    ),
}


def work(name: str, options: argparse.Namespace) -> Path:
    """Try a sample of a group's mutants; the session that holds what came of them."""
    group, folder = GROUPS[name], options.folder.resolve()
    session = folder / f"{name}-{_digest(group)}.sqlite"
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="mutants-") as scratch:
        copy = Path(scratch)
        for item in COPIED:
            _copy(ROOT / item, copy / item)
        tests = [f"tests/{test}" for test in group.tests]
        config = copy / "mutants.toml"
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-m", "not slow"]
        command += ["-p", "no:cacheprovider", *tests]
        first = copy / "first.toml"
        # The first run compiles everything.
        for path, limit in ((config, options.limit), (first, 10 * options.limit)):
            path.write_text(_config(group, shlex.join(command), limit), encoding="utf-8")
        # Programs that a mutant leaves as they are need not be compiled again for it.
        environment = dict(os.environ) | {
            "PYTHONPATH": str(copy / "src"),
            "JAX_COMPILATION_CACHE_DIR": str(folder / "compiled"),
            "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
        }

        def cosmic(*arguments: str) -> None:
            program = [sys.executable, "-m", "cosmic_ray.cli", *arguments]
            subprocess.run(program, cwd=copy, env=environment, check=True)

        print(f"== {name}: the tests as they are", flush=True)
        cosmic("baseline", str(first))
        fresh = session.with_suffix(".new")
        cosmic("init", str(config), str(fresh))
        left = sample(fresh, options.sample, options.seed, tried(session))
        fresh.replace(session)
        print(f"== {name}: {left} mutants to try", flush=True)
        cosmic("exec", str(config), str(session))
    return session


def tried(session: Path) -> dict[tuple[Any, ...], Any]:
    """What came of the mutants that a session has tried, by place; nothing if it is not there."""
    if not session.exists():
        return {}
    with _opened(session) as db:
        found = [(item.mutations[0], result) for item, result in db.completed_work_items]
        return {_place(one): result for one, result in found if result.test_outcome is not None}


def sample(session: Path, wanted: int, seed: int, known: Mapping[tuple[Any, ...], Any]) -> int:
    """Mark the mutants of a new session as left out but for a random sample.

    Args:
        session: of Cosmic Ray, new.
        wanted: mutants in the sample.
        seed: for the choice; a larger sample holds the smaller one.
        known: what came of mutants that were tried before, by place.

    Returns:
        How many of the sample are still to be tried.
    """
    work_item = importlib.import_module("cosmic_ray.work_item")
    skipped = work_item.WorkResult(worker_outcome=work_item.WorkerOutcome.SKIPPED)
    with _opened(session) as db:
        items = sorted(db.work_items, key=lambda item: _place(item.mutations[0]))
        able = [item for item in items if _behaves(item.mutations[0])]
        random.Random(seed).shuffle(able)
        chosen = {item.job_id: _place(item.mutations[0]) for item in able[:wanted]}
        rest = [item.job_id for item in items if item.job_id not in chosen]
        db.set_multiple_results(rest, skipped)
        done = [job for job, place in chosen.items() if place in known]
        for job in done:
            db.set_result(job, known[chosen[job]])
        return len(chosen) - len(done)


def report(sessions: dict[str, Path]) -> str:
    """Markdown: how many mutants of each group were killed; then the differences of the others."""
    lines = ["| group | mutants | tried | killed | survived |", "|---|---:|---:|---:|---:|"]
    survivors: list[str] = []
    total = [0, 0, 0]
    for name, session in sessions.items():
        with _opened(session) as db:
            results = [(item, result) for item, result in db.completed_work_items
                       if result.test_outcome is not None]  # fmt: skip
            killed = sum(result.is_killed for _, result in results)
            able = sum(_behaves(item.mutations[0]) for item in db.work_items)
            survivors += [f"\n{name}: {item.mutations[0].operator_name}\n{result.diff}"
                          for item, result in results if not result.is_killed]  # fmt: skip
        total = [a + b for a, b in zip(total, (able, len(results), killed), strict=True)]
        lines.append(f"| {name} | {able} | {len(results)} | {killed} | {len(results) - killed} |")
    able, count, killed = total
    lines.append(f"| all | {able} | {count} | {killed} | {count - killed} |")
    return "\n".join([*lines, *survivors])


def _opened(session: Path) -> Any:
    work_db = importlib.import_module("cosmic_ray.work_db")
    return work_db.use_db(str(session), work_db.WorkDB.Mode.open)


def _copy(source: Path, target: Path) -> None:
    ignored = shutil.ignore_patterns("__pycache__", ".hypothesis")
    if source.is_dir():
        shutil.copytree(source, target, ignore=ignored)
    else:
        shutil.copy(source, target)


def _config(group: Group, command: str, limit: float) -> str:
    modules = ", ".join(f'"src/jaxenstein/{module}"' for module in group.modules)
    return f"""[cosmic-ray]
module-path = [{modules}]
timeout = {limit}
excluded-modules = []
test-command = '''{command}'''

[cosmic-ray.distributor]
name = "local"
"""


def _digest(group: Group) -> str:
    """Of the texts of modules and tests: where one has changed, what was tried says nothing."""
    folders = [ROOT / "src" / "jaxenstein" / module for module in group.modules]
    folders += [ROOT / "tests" / test for test in group.tests]
    return hashlib.sha256(b"\0".join(path.read_bytes() for path in folders)).hexdigest()[:12]


def _place(mutation: Any) -> tuple[Any, ...]:
    return str(mutation.module_path), mutation.operator_name, mutation.occurrence


def _behaves(mutation: Any) -> bool:
    """Whether a mutant may behave otherwise."""
    if mutation.operator_name in IDLE:
        return False
    start, end = tuple(mutation.start_pos), tuple(mutation.end_pos)
    spans = _spans_of(ROOT / mutation.module_path)
    return not any(low <= start and end <= high for low, high in spans)


@functools.cache
def _spans_of(module: Path) -> tuple[tuple[tuple[int, int], tuple[int, int]], ...]:
    return tuple(_idle_spans(module.read_text(encoding="utf-8")))


def _idle_spans(source: str) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
    """From and to (line, column) of annotations, decorators and what is raised.

    Of a signature all but its defaults: its `*` is no operator, though it is mutated like one.
    """
    for node in ast.walk(ast.parse(source)):
        parts: list[ast.AST | None] = []
        if isinstance(node, ast.FunctionDef):
            parts = [*node.decorator_list]
            start, first = (node.lineno, node.col_offset), node.body[0]
            for default in filter(None, (*node.args.defaults, *node.args.kw_defaults)):
                yield start, (default.lineno, default.col_offset)
                start = default.end_lineno or 0, default.end_col_offset or 0
            yield start, (first.lineno, first.col_offset)
        elif isinstance(node, ast.ClassDef):
            parts = [*node.decorator_list]
        elif isinstance(node, ast.AnnAssign):
            parts = [node.annotation]
        elif isinstance(node, ast.Raise):
            parts = [node.exc]
        for part in parts:
            if isinstance(part, ast.expr) and part.end_lineno is not None:
                yield (part.lineno, part.col_offset), (part.end_lineno, part.end_col_offset or 0)


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
    unknown = [name for name in options.groups if name not in GROUPS]
    if unknown:
        parser.error(f"no group {unknown[0]!r}; there are {', '.join(GROUPS)}")
    if options.sample < 1:
        parser.error(f"--sample: at least 1 is needed, not {options.sample}")
    if options.list:
        for name, group in GROUPS.items():
            print(f"{name:12} {' '.join(group.modules)}: {' '.join(group.tests)}")
        return
    if importlib.util.find_spec("cosmic_ray") is None:
        parser.error("Cosmic Ray is not installed: `make mutants`, or pip install '.[mutation]'")
    try:
        sessions = {name: work(name, options) for name in options.groups or GROUPS}
    except subprocess.CalledProcessError as error:
        raise SystemExit(f"reliability.mutants: {shlex.join(map(str, error.cmd[2:4]))} failed: "
                         "do the tests pass as they are?") from error  # fmt: skip
    print(report(sessions))


if __name__ == "__main__":
    main()
