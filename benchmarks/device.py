"""Measure every environment on an accelerator at many batch sizes, against the memory bandwidth.

    python -m benchmarks.device [--json FILE]

For each environment, batch and image size, it measures steps per second with a random policy,
frames per second without steps, compile time, and memory of the compiled program. The limit is the
measured bandwidth of a memory copy, since a frame must at least be written. To try it on a CPU, use
tiny sizes: `--batches 4 --sizes 16x16 --copy-bytes 65536`.
"""

from __future__ import annotations

import argparse
import datetime
import json
import statistics
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jaxenstein
from benchmarks.subjects.frames import make_frames
from benchmarks.tables import WHOLE, column, markdown
from fidelity.commands import positive, run_command
from jaxenstein.catalogue import MAIN_IDS
from jaxenstein.cli.arguments import size as image_size
from jaxenstein.cli.arguments import whole
from jaxenstein.files import atomic, check_writable
from jaxenstein.machine import describe_machine
from jaxenstein.speed.measuring import compile_timed, summarise, timed_calls
from jaxenstein.speed.random_rollout import make_random_rollout

BATCHES = (64, 256, 1024, 4096, 16384, 65536)
SIZES = ((64, 64), (84, 84))
# A call draws about FRAMES_A_CALL frames, in a number of steps within STEPS.
FRAMES_A_CALL = 2**18
STEPS = (4, 256)
COLUMNS = (
    column("id", left=True), column("image"), column("batch", form=WHOLE),
    column("steps/s", "steps_per_second", "median", form=WHOLE),
    column("frames/s", "frames_per_second", "median", form=WHOLE),
    column("of the limit", "limit", form="{:.1%}".format),
    column("compile s", "compile_seconds", form="{:.1f}".format),
    column("MiB", "program_bytes", form=WHOLE, unit=2**20),
    column("failed", left=True),
)  # fmt: skip


def measure_case(
    name: str, batch: int, size: tuple[int, int], options: argparse.Namespace
) -> dict[str, Any]:
    """Measure one environment with one batch and image size; the result tells a failure."""
    height, width = size
    case = {"id": name, "batch": batch, "image": f"{width}x{height}"}
    env, params = jaxenstein.make(name, height=height, width=width)
    steps = max(STEPS[0], min(STEPS[1], FRAMES_A_CALL // batch))
    steps = min(steps, options.steps or steps)

    def measure(program: Any, carry: Any) -> dict[str, Any]:
        compiled, seconds = compile_timed(program, carry)
        carry = jax.block_until_ready(compiled(carry))
        taken = [each for _, each in timed_calls(compiled, carry, options.repeats, options.seconds)]
        rates = summarise(batch * steps / np.array(taken))
        return {"rates": rates, "compile": seconds, "bytes": _program_bytes(compiled)}

    try:
        rollout, start = make_random_rollout(env, params, batch, steps)
        steps_made = measure(rollout, start(jax.random.key(0)))
        first = start(jax.random.key(0))
        seen = first.state, first.obs, jnp.copy(first.state.position)
        frames_made = measure(make_frames(env, params, steps), seen)
    except jax.errors.JaxRuntimeError as error:
        return case | {"failed": str(error).strip().splitlines()[0]}
    return case | {
        "steps_a_call": steps,
        "steps_per_second": steps_made["rates"],
        "frames_per_second": frames_made["rates"],
        "frame_bytes": height * width * 3,
        "compile_seconds": steps_made["compile"],
        "program_bytes": steps_made["bytes"],
    }


def _program_bytes(compiled: Any) -> int | None:
    """The memory in bytes of a running compiled program, including its carry."""
    found = compiled.memory_analysis()
    if found is None:
        return None
    kept = found.argument_size_in_bytes + found.output_size_in_bytes - found.alias_size_in_bytes
    return kept + found.temp_size_in_bytes


def copy_bandwidth(size: int) -> float:
    """Bytes read and written per second when adding 1 to a large array in place."""
    words = jnp.zeros(size // 4, jnp.uint32)
    add = jax.jit(lambda array: array + np.uint32(1), donate_argnums=0)
    taken = [each for _, each in timed_calls(add, add(words), 9, 0.05)]
    return 2 * 4 * (size // 4) / statistics.median(taken)


def main(argv: Sequence[str] | None = None) -> None:
    """Measure all cases, and print each at once."""
    options = _parser().parse_args(argv)
    if options.json is not None:
        check_writable(options.json)
    device = f"{jax.devices()[0].platform}: {jax.devices()[0].device_kind}"
    bandwidth = copy_bandwidth(options.copy_bytes)
    print(f"{device}, JAX {jax.__version__}: copies at {bandwidth / 1e9:,.0f} GB/s\n", flush=True)
    print(markdown(COLUMNS, []), flush=True)
    kept = ("ids", "batches", "sizes", "seconds", "repeats", "steps", "copy_bytes")
    report = {
        "began": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        **describe_machine(),
        "settings": {name: getattr(options, name) for name in kept},
        "device": device,
        "copy_bytes_per_second": bandwidth,
    }
    rows = []
    cases = [(i, s, b) for i in options.ids for s in options.sizes for b in options.batches]
    for name, size, batch in cases:
        row = measure_case(name, batch, size, options)
        if "failed" not in row:
            written = row["frames_per_second"]["median"] * row["frame_bytes"]
            row["limit"] = written / bandwidth
        rows.append(row)
        print(markdown(COLUMNS, [row]).splitlines()[-1], flush=True)
        if options.json is not None:
            with atomic(options.json) as path:
                path.write_text(json.dumps(report | {"rows": rows}, indent=1))


def _list(convert: Callable[[str], Any]) -> Callable[[str], list[Any]]:
    return lambda text: [convert(part) for part in text.split(",")]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Measure the environments on an accelerator.")
    add, ids = parser.add_argument, list(jaxenstein.environment_ids())
    add("--ids", nargs="+", default=list(MAIN_IDS), choices=ids, metavar="ID")
    add("--batches", type=_list(whole()), default=list(BATCHES), metavar="N,...")
    add("--sizes", type=_list(image_size), default=list(SIZES), metavar="WxH,...")
    add("--seconds", type=positive, default=0.3, help="seconds per repeat (default 0.3)")
    add("--repeats", type=whole(), default=5, help="repeats (default 5)")
    add("--steps", type=whole(), metavar="T", help="maximum number of steps per call")
    add(
        "--copy-bytes",
        type=whole(4),
        default=2**30,
        metavar="N",
        help="bytes of a copy (default 1 GiB)",
    )
    add("--json", type=Path, metavar="FILE", help="also write all repeats as JSON")
    return parser


if __name__ == "__main__":
    run_command(main)
