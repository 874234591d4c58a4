"""Training steps per second of the baselines.

    python -m benchmarks.training --algo ppo rnd icm --envs 16 64 256

Steps per second are of one whole update: rollout, bonus, advantages, epochs. JSON has processor
times of the process too, which other programs disturb less; on a GPU they mean nothing.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax

from benchmarks.measure import tell
from benchmarks.subjects.common import TRAINED_STEPS
from benchmarks.tables import WHOLE, column, markdown
from jaxenstein import make
from jaxenstein.baselines import Config, Learner
from jaxenstein.files import atomic, check_writable
from jaxenstein.machine import describe_machine
from jaxenstein.speed.measuring import compile_timed, timed_calls

COLUMNS = (
    column("algorithm", "algo", left=True), column("dtype", left=True),
    column("environments", "num_envs"), column("steps/s", "steps_per_second", form=WHOLE),
    column("first call s", "first_call_seconds", form=WHOLE),
)  # fmt: skip


def measure_training(config: Config, options: argparse.Namespace) -> dict[str, Any]:
    """The speed of whole updates of a configuration."""
    tell(f"{config.algo}, {config.num_envs} environments")
    learner = Learner(*make(options.env, height=options.size, width=options.size), config)
    state = learner.init(jax.random.key(0))
    begin = time.perf_counter()
    update, _ = compile_timed(jax.jit(lambda s: learner.train_chunk(s, None, 1)[0]), state)
    state = jax.block_until_ready(update(state))
    first_call, begin = time.perf_counter() - begin, time.process_time()
    taken = [seconds for _, seconds in timed_calls(update, state, options.repeats)]
    processor = (time.process_time() - begin) / options.repeats
    steps = config.steps_per_update
    return {
        "algo": config.algo,
        "num_envs": config.num_envs,
        "dtype": config.dtype,
        "steps_per_second": steps / min(taken),
        "steps_per_processor_second": steps / processor,
        "rates": [steps / each for each in taken],
        "first_call_seconds": first_call,
        "parameters": sum(leaf.size for leaf in jax.tree.leaves(state.params)),
    }


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Measure training steps per second.")
    add = parser.add_argument
    add("--algo", nargs="+", default=["ppo", "rnd", "icm"])
    add("--envs", nargs="+", type=int, default=[64], metavar="N")
    add("--env", default="simple", help="id (default simple)")
    add("--size", type=int, default=64, help="pixels a side (default 64)")
    add("--dtype", nargs="+", default=["float32"])
    add("--rollout", type=int, default=128, help="steps of an update (default 128)")
    add("--repeats", type=int, default=1, help="the fastest counts (default 1)")
    add("--json", type=Path, metavar="FILE", help="write everything here")
    return parser


def main(argv: Sequence[str] | None = None) -> None:
    """Measure and print."""
    options = _parser().parse_args(argv)
    if options.json is not None:
        check_writable(options.json)
    rows = [
        measure_training(
            Config(
                algo=algo,
                num_envs=number,
                rollout=options.rollout,
                minibatches=min(4, number),
                total_steps=max(TRAINED_STEPS, number * options.rollout),
                dtype=dtype,
            ),
            options,
        )
        for dtype in options.dtype for algo in options.algo for number in options.envs
    ]  # fmt: skip
    tell("")
    report, device = describe_machine(), jax.devices()[0].device_kind
    print(f"{device}, JAX {jax.__version__}\n\n{markdown(COLUMNS, rows)}")
    if options.json is not None:
        with atomic(options.json) as path:
            path.write_text(json.dumps(report | {"device": device, "rows": rows}, indent=1))


if __name__ == "__main__":
    main()
