"""Training steps per second of the baselines, and where the time goes.

    python -m benchmarks.training --algo ppo rnd icm --envs 16 64 256 --parts

Steps per second are of one whole update: rollout, bonus, advantages, epochs. JSON has processor
times of the process too, which other programs disturb less; on a GPU they mean nothing.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp

from benchmarks.report.results import Result
from benchmarks.report.tables import table_of
from benchmarks.suites.processes import memory
from benchmarks.suites.worker import tell
from jaxenstein import make
from jaxenstein.baselines import Config, Experience, Learner, ppo
from jaxenstein.baselines.rollout import final_values, rollout
from jaxenstein.files import atomic, check_writable
from jaxenstein.machine import describe_machine


def measure(
    function: Any, *args: Any, repeats: int, seconds: float = 0.0
) -> tuple[Any, dict[str, Any]]:
    """The result of a call, and seconds: `compile`, `first_call`, and lists `wall`, `processor`.

    It is called `repeats` times after a call that does not count, and for `seconds` at least.
    """
    begin = time.perf_counter()
    compiled = jax.jit(function).lower(*args).compile()
    times: dict[str, Any] = {"compile": time.perf_counter() - begin, "wall": [], "processor": []}
    result = jax.block_until_ready(compiled(*args))
    times["first_call"] = time.perf_counter() - begin
    while len(times["wall"]) < repeats or sum(times["wall"]) < seconds:
        begin, begin_processor = time.perf_counter(), time.process_time()
        result = jax.block_until_ready(compiled(*args))
        times["wall"].append(time.perf_counter() - begin)
        times["processor"].append(time.process_time() - begin_processor)
    return result, times


def parts(learner: Learner, repeats: int) -> dict[str, float]:
    """Seconds of the parts of an update, each compiled by itself; the fastest counts."""
    config, bonus, network = learner.config, learner.bonus, learner.network
    numbers = learner.loop.numbers(None)
    state, key, found = learner.init(jax.random.key(0)), jax.random.key(1), {}

    def timed(name: str, function: Any, *args: Any) -> Any:
        tell(f"{config.algo}, {config.num_envs} environments: {name}")
        result, times = measure(function, *args, repeats=repeats)
        found[name] = min(times["wall"])
        return result

    def play(state: Any) -> Any:
        return rollout(
            learner.simulator, network, state.params, key, state.actors, config.rollout,
            learner.loop.slots,
        )  # fmt: skip

    def frames(state: Any) -> Any:
        def step(carry: Any, step_key: jax.Array) -> Any:
            action = jax.random.randint(step_key, (config.num_envs,), 0, 3, jnp.int32)
            keys = jax.random.split(step_key, config.num_envs)
            out = learner.simulator.step(keys, carry[0], action)
            return (out.state, out.obs), None

        carry = (state.actors.env_state, state.actors.obs)
        return jax.lax.scan(step, carry, jax.random.split(key, config.rollout))[0]

    def values(params: Any, finals: Any) -> Any:
        return final_values(learner.simulator, network, params, finals, config.rollout)

    rate = jnp.float32(1e-4)
    actors, steps, finals, _ = timed("rollout", play, state)
    timed("of it frames", frames, state)
    timed("values at time limits", values, state.params, finals)
    if config.algo != "ppo":
        seen = jax.tree.map(lambda a, b: jnp.concatenate([a, b[None]]), steps.obs, actors.obs)
        experience = Experience(seen, steps.action, steps.ended)
        timed("bonus", lambda s, e: bonus.reward(s, numbers, e), state.bonus, experience)
        timed(
            "bonus update", lambda s, e: bonus.update(key, s, numbers, e, rate),
            state.bonus, experience,
        )  # fmt: skip
    batch = ppo.Batch(steps, state.actors.memory[None], steps.reward, steps.value)
    timed(
        "update",
        lambda s, b: ppo.train(network, config, key, (s.params, s.optimiser), b, numbers, rate),
        state, batch,
    )  # fmt: skip
    return found


def measure_training(config: Config, options: argparse.Namespace) -> dict[str, Any]:
    """One update of a configuration: its speed, and where the time goes."""
    tell(f"{config.algo}, {config.num_envs} environments")
    learner = Learner(*make(options.env, height=options.size, width=options.size), config)
    state = learner.init(jax.random.key(0))
    numbers = learner.loop.numbers(None)

    def update(state: Any) -> Any:
        return learner.train_chunk(state, numbers, 1)

    _, times = measure(update, state, repeats=options.repeats, seconds=options.seconds)
    steps = config.steps_per_update
    return {
        "algo": config.algo,
        "num_envs": config.num_envs,
        "dtype": config.dtype,
        "steps_per_second": steps / min(times["wall"]),
        "steps_per_processor_second": steps / min(times["processor"]),
        "rates": [steps / each for each in times["wall"]],
        "compile_seconds": times["compile"],
        "first_call_seconds": times["first_call"],
        "memory_bytes": memory([os.getpid()]),
        "parameters": sum(leaf.size for leaf in jax.tree.leaves(state.params)),
        "parts": parts(learner, options.repeats) if options.parts else {},
    }


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Measure training steps per second.")
    add = parser.add_argument
    add("--algo", nargs="+", default=["ppo", "rnd", "icm"])
    add("--envs", nargs="+", type=int, default=[64], metavar="N")
    add("--env", default="simple", help="id (default simple)")
    add("--size", type=int, default=64, help="pixels a side (default 64)")
    add("--dtype", nargs="+", default=["float32"])
    add("--convolution", default="matmul", choices=["matmul", "lax"])
    add("--rollout", type=int, default=128, help="steps of an update (default 128)")
    add("--repeats", type=int, default=1, help="at least; the fastest counts (default 1)")
    add("--seconds", type=float, default=0.0, help="repeat for so long at least (default 0)")
    add("--parts", action="store_true", help="also where the time goes")
    add("--json", type=Path, metavar="FILE", help="write everything here")
    return parser


def main() -> None:
    """Measure and print."""
    args = _parser().parse_args()
    if args.json is not None:
        check_writable(args.json)
    rows = [
        measure_training(
            Config(
                algo=algo,
                num_envs=number,
                rollout=args.rollout,
                minibatches=min(4, number),
                total_steps=max(10_000_000, number * args.rollout),
                dtype=dtype,
                convolution=args.convolution,
            ),
            args,
        )
        for dtype in args.dtype for algo in args.algo for number in args.envs
    ]  # fmt: skip
    tell("")
    machine, device = describe_machine(), jax.devices()[0]
    cores = f"{machine['hardware']['cores_allowed']} cores of {machine['hardware']['cpu']}"
    place = cores if device.platform == "cpu" else device.device_kind
    report = {"machine": machine, "device": place, "rows": rows}
    print(f"{place}, JAX {jax.__version__}\n\n{table_of('training', Result(report, rows))}")
    for row in rows:
        told = [f"{name} {seconds:.3f} s" for name, seconds in row["parts"].items()]
        print(*([f"{row['algo']}, {row['num_envs']}: {', '.join(told)}"] if told else []))
    if args.json is not None:
        with atomic(args.json) as path:
            path.write_text(json.dumps(report, indent=2))


if __name__ == "__main__":
    main()
