"""What an accelerator does: every environment at many batch sizes, against what memory allows.

    python -m benchmarks.device --json results/device.json [--minutes M]

For each environment, batch and image size: whole random-policy steps a second, frames alone a
second, seconds to compile, memory of the compiled program, and with `--profile` how many kernels
a step starts and for how long they run. The limit is what a copy of memory reaches here: a frame
must at least be written. The file grows with every case; the same command goes on where it was
ended. On a CPU the same program runs, with tiny sizes: `--batches 4 --sizes 16x16`.
"""

from __future__ import annotations

import argparse
import itertools
import statistics
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jaxenstein
from benchmarks.report.results import device_row
from benchmarks.report.tables import TABLES, markdown
from benchmarks.store import earlier, write
from benchmarks.subjects.frames import make_frames
from jaxenstein.catalogue import MAIN_IDS
from jaxenstein.cli.arguments import size as image_size
from jaxenstein.cli.arguments import whole
from jaxenstein.errors import JAXensteinError
from jaxenstein.files import check_writable
from jaxenstein.machine import describe_machine
from jaxenstein.speed.measuring import summarise
from jaxenstein.speed.random_rollout import make_random_rollout

BATCHES = (64, 256, 1024, 4096, 16384, 65536)
SIZES = ((64, 64), (84, 84))
# Steps of one call: about so many frames, within these bounds.
FRAMES_A_CALL = 2**18
STEPS = (4, 256)


def measure_case(name: str, batch: int, size: tuple[int, int], options: Any) -> dict[str, Any]:
    """Measure one environment with one batch and image size; a failure is told in the result."""
    case = {"id": name, "batch": batch, "height": size[0], "width": size[1]}
    env, params = jaxenstein.make(name, height=size[0], width=size[1])
    steps = max(STEPS[0], min(STEPS[1], FRAMES_A_CALL // batch, options.steps or STEPS[1]))
    try:
        rollout, start = make_random_rollout(env, params, batch, steps)
        whole = _measure(rollout, start(jax.random.key(0)), batch * steps, options)
        first = start(jax.random.key(0))
        seen = first.state, first.obs, jnp.copy(first.state.position)
        alone = _measure(make_frames(env, params, steps), seen, batch * steps, options)
    except jax.errors.JaxRuntimeError as error:
        return case | {"failed": str(error).strip().splitlines()[0]}
    frame_bytes = size[0] * size[1] * 3
    kernels = whole.pop("kernels")
    if kernels is not None:
        kernels = {name: value / steps for name, value in kernels.items()}
    return case | {
        "steps_a_call": steps,
        "steps_per_second": whole.pop("rates"),
        "frames_per_second": alone["rates"],
        "frame_bytes": frame_bytes,
        "compile_seconds": whole["compile_seconds"],
        "program_bytes": whole["program_bytes"],
        "kernels_a_step": kernels,
    }


def _measure(program: Any, carry: Any, count: int, options: Any) -> dict[str, Any]:
    """Compile a program that takes and gives a carry, and call it again and again."""
    began = time.perf_counter()
    compiled = program.lower(carry).compile()
    compile_seconds = time.perf_counter() - began
    carry = jax.block_until_ready(compiled(carry))
    rates = []
    for _ in range(options.repeats):
        began, calls = time.perf_counter(), 0
        while (elapsed := time.perf_counter() - began) < options.seconds:
            carry, calls = jax.block_until_ready(compiled(carry)), calls + 1
        rates.append(calls * count / elapsed)
    kernels = None
    if options.profile:
        kernels = count_kernels(lambda: jax.block_until_ready(compiled(carry)))
    return {
        "rates": summarise(np.array(rates)),
        "compile_seconds": compile_seconds,
        "program_bytes": _program_bytes(compiled),
        "kernels": kernels,
    }


def _program_bytes(compiled: Any) -> int | None:
    """Bytes that a compiled program holds while it runs, its carry included."""
    found = compiled.memory_analysis()
    if found is None:
        return None
    kept = found.argument_size_in_bytes + found.output_size_in_bytes - found.alias_size_in_bytes
    return kept + found.temp_size_in_bytes


def copy_bandwidth(size: int, seconds: float = 0.5) -> float:
    """Bytes a second, those read and those written, of adding 1 to a large array in place."""
    words = jnp.zeros(size // 4, jnp.uint32)
    add = jax.jit(lambda array: array + np.uint32(1), donate_argnums=0)
    words = jax.block_until_ready(add(words))
    times, end = [], time.perf_counter() + seconds
    while time.perf_counter() < end or not times:
        began = time.perf_counter()
        for _ in range(8):
            words = add(words)
        jax.block_until_ready(words)
        times.append((time.perf_counter() - began) / 8)
    return 2 * words.nbytes / statistics.median(times)


def count_kernels(run: Callable[[], Any]) -> dict[str, float] | None:
    """Kernels and copies on the device while `run` runs, which must wait for its end.

    Returns:
        `count` and `seconds`, which adds up those that ran at once; None where the profiler saw
        no device, such as on a CPU, or this JAX cannot read its files.
    """
    profile_data = getattr(jax.profiler, "ProfileData", None)
    if profile_data is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        with jax.profiler.trace(folder):
            run()
        # Other lines of a plane sum the same kernels up by operation, module and step.
        durations = [
            event.duration_ns
            for file in sorted(Path(folder).rglob("*.xplane.pb"))
            for plane in profile_data.from_file(str(file)).planes
            if plane.name.startswith("/device:")
            for line in plane.lines
            if line.name.startswith("Stream")
            for event in line.events
        ]
    return {"count": float(len(durations)), "seconds": sum(durations) / 1e9} if durations else None


def main(argv: Sequence[str] | None = None) -> None:
    """Measure all cases and print them as they come."""
    options = _parser().parse_args(argv)
    if options.json is not None:
        check_writable(options.json)
    device = f"{jax.devices()[0].platform}: {jax.devices()[0].device_kind}"
    of = ("seconds", "repeats", "steps", "copy_bytes", "profile")
    same = {"device": device, "settings": {name: getattr(options, name) for name in of}}
    before = earlier(options.json, same) if options.json else None
    rows = before["rows"] if before else []
    done = {(row["id"], row["batch"], (row["height"], row["width"])) for row in rows}
    # That which the rows so far were held against.
    known = before["copy_bytes_per_second"] if before else None
    bandwidth = known or copy_bandwidth(options.copy_bytes)
    print(f"{device}, JAX {jax.__version__}: copies at {bandwidth / 1e9:,.0f} GB/s\n", flush=True)
    columns = TABLES["device"].columns
    print(markdown(columns, []), flush=True)
    end = time.monotonic() + 60 * options.minutes if options.minutes else None
    for case in itertools.product(options.ids, options.sizes, options.batches):
        name, size, batch = case
        if (name, batch, size) in done:
            continue
        if end is not None and time.monotonic() > end:
            print("\nnot finished: the same command goes on")
            break
        rows.append(measure_case(name, batch, size, options))
        print(markdown(columns, [device_row(rows[-1], bandwidth)]).splitlines()[-1], flush=True)
        if "failed" in rows[-1]:
            print(f"  {rows[-1]['failed']}", flush=True)
        if options.json is not None:
            report = {**describe_machine(), **same}
            write(options.json, report | {"copy_bytes_per_second": bandwidth, "rows": rows})


def _list(convert: Callable[[str], Any]) -> Callable[[str], list[Any]]:
    return lambda text: [convert(part) for part in text.split(",")]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Measure the environments on an accelerator.")
    ids = list(jaxenstein.environment_ids())
    parser.add_argument("--ids", nargs="+", default=list(MAIN_IDS), choices=ids, metavar="ID")
    parser.add_argument("--batches", type=_list(whole()), default=list(BATCHES), metavar="N,...")
    parser.add_argument("--sizes", type=_list(image_size), default=list(SIZES), metavar="WxH,...")
    parser.add_argument("--seconds", type=float, default=0.3, help="of a repeat (default 0.3)")
    parser.add_argument("--repeats", type=whole(), default=5, help="(default 5)")
    parser.add_argument("--steps", type=whole(), metavar="T", help="most steps in one call")
    parser.add_argument(
        "--copy-bytes", type=whole(), default=2**30, metavar="N", help="of a copy (default 1 GiB)"
    )
    parser.add_argument("--profile", action="store_true", help="count kernels with JAX's profiler")
    parser.add_argument("--minutes", type=float, metavar="M", help="end after so many, to go on")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every repeat here")
    return parser


if __name__ == "__main__":
    try:
        main()
    except JAXensteinError as error:
        raise SystemExit(f"benchmarks.device: {error}") from error
