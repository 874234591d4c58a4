"""Training steps per second of the baselines, and where the time goes.

    python benchmarks/training.py --algo ppo rnd icm --envs 64

Clocks: wall time, and processor time of this process, which other programs disturb less. On a
GPU only the first means anything.
"""

from __future__ import annotations

import argparse
import json
import time
from typing import Any

import jax
import jax.numpy as jnp

from jaxenstein.baselines import Config, Experience, HParams, Learner, make_learner, ppo
from jaxenstein.baselines.rollout import final_values, rollout


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


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--algo", nargs="+", default=["ppo", "rnd", "icm"])
    parser.add_argument("--envs", nargs="+", type=int, default=[64])
    parser.add_argument("--env", default="simple")
    parser.add_argument("--size", type=int, default=64)
    parser.add_argument("--dtype", default="float32")
    parser.add_argument("--convolution", default="matmul")
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--parts", action="store_true", help="also where the time goes")
    args = parser.parse_args()
    device = jax.devices()[0]
    print(json.dumps({"device": device.device_kind, "jax": jax.__version__}))
    for algo in args.algo:
        for number in args.envs:
            config = Config(
                env=args.env,
                env_settings=(("height", args.size), ("width", args.size)),
                algo=algo,
                num_envs=number,
                dtype=args.dtype,
                convolution=args.convolution,
            )
            learner = make_learner(*config.make_env(), config)
            state = learner.init(jax.random.key(0))
            numbers = HParams().check()
            _, whole = measure(
                lambda s, learner=learner, numbers=numbers: learner.train_chunk(s, numbers, 1),
                state,
                repeats=args.repeats,
            )
            speed = {
                f"steps_per_second_{kind}": round(config.steps_per_update / whole[kind], 1)
                for kind in ("wall", "processor")
            }
            names = {"algo": algo, "num_envs": number, "dtype": args.dtype, "size": args.size}
            print(json.dumps(names | speed | {"first_call": whole["first_call"]}), flush=True)
            if args.parts:
                for name, each in parts(learner, args.repeats).items():
                    rounded = {k: round(v, 3) for k, v in each.items()}
                    print(f"    {name:<24}{rounded}", flush=True)


if __name__ == "__main__":
    main()
