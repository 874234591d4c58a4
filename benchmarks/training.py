"""Training steps per second of the baselines, and where the time goes.

    python -m benchmarks.training --algo ppo rnd icm --envs 16 64 256 --parts

Steps per second are of one whole update: rollout, bonus, advantages, epochs. Beside them stand
the floating-point operations of its matrix products and the rate at which this machine does one
large product, which bounds the training from above. JSON has processor times of the process too,
which other programs disturb less; on a GPU they mean nothing.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp

from benchmarks.flops import matrix_flops, matrix_rate
from jaxenstein.baselines import Config, Experience, HParams, Learner, make_learner
from jaxenstein.baselines.learning import ppo
from jaxenstein.baselines.learning.rollout import final_values, rollout
from jaxenstein.files import atomic, check_writable
from jaxenstein.speed.measuring import describe_machine


def measure(function: Any, *args: Any, repeats: int) -> tuple[Any, dict[str, float]]:
    """The result, and the least wall and processor time of a call, in seconds."""
    compiled = jax.jit(function)
    begin = time.perf_counter()
    result = jax.block_until_ready(compiled(*args))
    first = time.perf_counter() - begin
    wall, processor = [], []
    for _ in range(repeats):
        begin, begin_processor = time.perf_counter(), time.process_time()
        result = jax.block_until_ready(compiled(*args))
        wall.append(time.perf_counter() - begin)
        processor.append(time.process_time() - begin_processor)
    return result, {"wall": min(wall), "processor": min(processor), "first_call": first}


def parts(learner: Learner, repeats: int) -> dict[str, dict[str, float]]:
    """Times of the parts of an update, each compiled by itself."""
    config, bonus, network = learner.config, learner.bonus, learner.network
    numbers = HParams(gamma=0.99, bonus_gamma=0.99).check()
    state = learner.init(jax.random.key(0))
    key, times = jax.random.key(1), {}

    def play(state: Any) -> Any:
        return rollout(
            learner.simulator, network, state.params, key, state.actors, config.rollout,
            learner.loop.slots,
        )  # fmt: skip

    (actors, steps, finals, _), times["rollout"] = measure(play, state, repeats=repeats)

    def frames(state: Any) -> Any:
        def step(carry: Any, step_key: jax.Array) -> Any:
            env_state, _ = carry
            action = jax.random.randint(step_key, (config.num_envs,), 0, 3, jnp.int32)
            keys = jax.random.split(step_key, config.num_envs)
            out = learner.simulator.step(keys, env_state, action)
            return (out.state, out.obs), None

        carry = (state.actors.env_state, state.actors.obs)
        return jax.lax.scan(step, carry, jax.random.split(key, config.rollout))[0]

    _, times["  of it frames"] = measure(frames, state, repeats=repeats)
    _, times["values at time limits"] = measure(
        lambda p, f: final_values(learner.simulator, network, p, f, config.rollout),
        state.params, finals, repeats=repeats,
    )  # fmt: skip
    experience = Experience(
        jax.tree.map(lambda a, b: jnp.concatenate([a, b[None]]), steps.obs, actors.obs),
        steps.action,
        steps.ended,
    )
    if config.algo != "ppo":
        _, times["bonus"] = measure(
            lambda s, e: bonus.reward(s, numbers, e), state.bonus, experience, repeats=repeats
        )
        _, times["bonus update"] = measure(
            lambda s, e: bonus.update(key, s, numbers, e, jnp.float32(1e-4)),
            state.bonus, experience, repeats=repeats,
        )  # fmt: skip
    batch = ppo.Batch(steps, state.actors.memory, steps.reward, steps.value)

    def learn(state: Any, batch: Any) -> Any:
        return ppo.train(
            network, config, key, state.params, state.optimiser, batch, numbers, jnp.float32(1e-4)
        )

    _, times["update"] = measure(learn, state, batch, repeats=repeats)
    return times


def measure_training(config: Config, repeats: int, with_parts: bool) -> dict[str, Any]:
    """One update of a configuration: its speed, its matrix products, and where the time goes."""
    learner = make_learner(*config.make_env(), config)
    state = learner.init(jax.random.key(0))
    numbers = HParams().check()

    def update(state: Any) -> Any:
        return learner.train_chunk(state, numbers, 1)

    _, whole = measure(update, state, repeats=repeats)
    flops = matrix_flops(update, state)
    return {
        "algo": config.algo,
        "num_envs": config.num_envs,
        "dtype": config.dtype,
        "steps_per_second": config.steps_per_update / whole["wall"],
        "steps_per_processor_second": config.steps_per_update / whole["processor"],
        "first_call_seconds": whole["first_call"],
        "matrix_flops_per_step": flops / config.steps_per_update,
        "flops_per_second": flops / whole["wall"],
        "parts": parts(learner, repeats) if with_parts else {},
    }


def print_row(row: dict[str, Any], rate: float) -> None:
    """Print what was measured of one configuration, as a row of a Markdown table."""
    cells = [
        row["algo"],
        f"{row['num_envs']}",
        row["dtype"],
        f"{row['steps_per_second']:,.0f}",
        f"{row['matrix_flops_per_step'] / 1e6:,.0f}",
        f"{row['flops_per_second'] / 1e9:,.1f}",
        f"{row['flops_per_second'] / rate:.0%}",
        f"{row['first_call_seconds']:.0f}",
    ]
    print(f"| {' | '.join(cells)} |", flush=True)
    for name, each in row["parts"].items():
        print(f"    {name:<24}{each['wall']:.3f} s", flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Measure training steps per second.")
    parser.add_argument("--algo", nargs="+", default=["ppo", "rnd", "icm"])
    parser.add_argument("--envs", nargs="+", type=int, default=[64], metavar="N")
    parser.add_argument("--env", default="simple", help="id (default simple)")
    parser.add_argument("--size", type=int, default=64, help="pixels a side (default 64)")
    parser.add_argument("--dtype", nargs="+", default=["float32"])
    parser.add_argument("--convolution", default="matmul", choices=["matmul", "lax"])
    parser.add_argument("--repeats", type=int, default=1, help="the fastest counts (default 1)")
    parser.add_argument("--parts", action="store_true", help="also where the time goes")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write everything here")
    return parser


def main() -> None:
    """Measure and print."""
    args = _parser().parse_args()
    if args.json is not None:
        check_writable(args.json)
    rate = matrix_rate()
    machine, device = describe_machine(), jax.devices()[0]
    cores = f"{machine['hardware']['cores_allowed']} cores of {machine['hardware']['cpu']}"
    place = cores if device.platform == "cpu" else device.device_kind
    print(f"{place}, JAX {jax.__version__}: {rate / 1e9:,.1f} GFLOP/s in one large product\n")
    print("| algorithm | envs | dtype | steps/s | MFLOP/step | GFLOP/s | of matmul | first call |")
    print("|---|---:|---|---:|---:|---:|---:|---:|", flush=True)
    rows = []
    for dtype in args.dtype:
        for algo in args.algo:
            for number in args.envs:
                config = Config(
                    env=args.env,
                    env_settings=(("height", args.size), ("width", args.size)),
                    algo=algo,
                    num_envs=number,
                    total_steps=max(10_000_000, number * 128),
                    dtype=dtype,
                    convolution=args.convolution,
                )
                rows.append(measure_training(config, args.repeats, args.parts))
                print_row(rows[-1], rate)
    if args.json is not None:
        result = {"machine": machine, "matrix_rate": rate, "rows": rows}
        with atomic(args.json) as path:
            path.write_text(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
