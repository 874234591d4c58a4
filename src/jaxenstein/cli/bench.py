"""`jaxenstein bench`: steps per second, compile time and memory."""

from __future__ import annotations

import argparse
import dataclasses
import os
from pathlib import Path
from typing import Any

from ..files import check_writable
from ..machine import describe_machine
from ..progress import Progress, si
from ..spec import Spec
from ..speed.measuring import Settings, measure_in_process
from .arguments import Parser, UsageError, add_environment, add_seed, flag, size, whole
from .listing import format_table
from .opening import given_options, import_module_of, open_spec, write_json, written_anyway

HELP = "measure steps per second, compile time and memory"
DESCRIPTION = """\
Measure rollouts of a uniform random policy in one compiled scan. Every step samples actions, moves
the world, resets finished episodes and draws a frame. Each pair of environment and batch size runs
in its own process, which compiles, warms up, and repeats the rollout. The table shows the median
and the quartiles over the repeats, world steps per second (--frame-skip times as many), the time to
compile reset and step, and the peak memory.
"""
EPILOG = """\
examples:
  jaxenstein bench
  jaxenstein bench my-way-home key-door --batch 64,256,1024 --json bench.json
  jaxenstein bench my-way-home --size 160x120 --core 0
  jaxenstein bench my-way-home --frame-skip 4

Close other programs first. If the quartiles are far apart, something else was running.
"""


def fill(parser: Parser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "ids", nargs="*", metavar="ID", help="environments to measure (default: my-way-home)"
    )
    add_environment(parser, without=("env",))
    parser.add_argument(
        "--batch",
        type=batches,
        default=[64, 256, 1024],
        metavar="N,N,...",
        help="batch sizes: numbers of parallel environments (default 64,256,1024)",
    )
    flag(parser, "--steps T", "steps of each environment in a repeat", whole(), 256)
    flag(parser, "--repeats R", "measured repeats, after one warm-up", whole(), 9)
    flag(parser, "--size WxH", "width and height of a frame (default 64x64)", size)
    core = "use only CPU core N, with one thread (default: all cores)"
    flag(parser, "--core N", core, whole(0))
    report = "also write all repeats as JSON, with versions, hardware and settings"
    flag(parser, "--json FILE", report, Path)
    add_seed(parser)


def batches(text: str) -> list[int]:
    """An argument type: batch sizes separated by commas."""
    return [whole()(part.strip()) for part in text.split(",")]


def run(options: argparse.Namespace) -> None:
    """Measure, print the table, write the JSON file."""
    _check_core(options.core)
    if options.json is not None:
        check_writable(options.json)
    plan = [
        Settings(
            name=name,
            spec=dataclasses.asdict(spec),
            batch=batch,
            steps=options.steps,
            repeats=options.repeats,
            seed=options.seed,
            core=options.core,
        )
        # Report a wrong id or setting before measuring anything.
        for spec, name in _environments(options)
        for batch in options.batch
    ]
    results = []
    with Progress(len(plan), "measuring", unit="runs") as progress:
        for done, settings in enumerate(plan, 1):
            progress.label = f"{settings.name}, batch {settings.batch}"
            progress.show()
            results.append(measure_in_process(settings))
            progress.update(done)
    report = {**describe_machine(), "results": results}
    with written_anyway(options.json, lambda path: write_json(path, report)):
        print(table(results))


def _environments(options: argparse.Namespace) -> list[tuple[Spec, str]]:
    """The specs and names of the environments to measure."""
    given = given_options(options)
    for id in options.ids:
        import_module_of(id)
    if options.size is not None and {"height", "width"} & {*given}:
        raise UsageError("jaxenstein bench: give either --size or --height and --width")
    if options.size is not None:
        given = dict(zip(("height", "width"), options.size, strict=True)) | given
    if "map_file" in given and not options.ids:
        return [open_spec(given)]
    return [open_spec({**given, "env": id}) for id in options.ids or ["my-way-home"]]


def table(results: list[dict[str, Any]]) -> str:
    """The results as text."""
    rows = [("ENVIRONMENT", "SIZE", "BATCH", "STEPS/S", "QUARTILES", "WORLD", "COMPILE", "MEMORY")]
    for result in results:
        rates, compiling = result["steps_per_second"], result["compile_seconds"]
        peak = result["peak_memory_bytes"]
        rows.append(
            (
                result["id"],
                f"{result['width']}x{result['height']}",
                str(result["batch"]),
                si(rates["median"]),
                f"{si(rates['lower_quartile'])} to {si(rates['upper_quartile'])}",
                si(result["world_steps_per_second"]["median"]),
                f"{compiling['reset'] + compiling['step']:.1f} s",
                "-" if peak is None else f"{peak / 2**20:.0f} MiB",
            )
        )
    return format_table(rows, right=(1, 2, 3, 5, 6, 7))


def _check_core(core: int | None) -> None:
    if core is None:
        return
    if not hasattr(os, "sched_getaffinity"):
        raise UsageError("jaxenstein bench: --core: this system cannot pin a process to a core")
    allowed = sorted(os.sched_getaffinity(0))
    if core not in allowed:
        raise UsageError(f"jaxenstein bench: --core must be one of {allowed}, not {core}")
