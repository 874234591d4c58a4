"""Training speed of this project's recurrent PPO on My Way Home, for `train_compare.py`.

    python -m benchmarks.train_own --envs 8 --seconds 20

The last line of the output is JSON, with the names of `train_sb3.py` and `compile_seconds`.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Sequence
from typing import Any

from benchmarks.train_processes import memory

TOTAL_STEPS = 10_000_000
MINIBATCHES = 4


def measure(options: argparse.Namespace, found: dict[str, Any]) -> None:
    """Compile, train whole updates, and note what is known into `found` as soon as it is."""
    import jax

    from jaxenstein.baselines import Config, HParams, make_learner
    from jaxenstein.speed.measuring import describe_machine

    device = jax.devices()[0]
    found["versions"] = describe_machine()["versions"]
    found["device"] = "cpu" if device.platform == "cpu" else device.device_kind
    found["stage"] = "making the environments"
    began = time.perf_counter()
    config = Config(
        env="my-way-home",
        env_settings=(("height", 64), ("width", 64)),
        algo="ppo",
        num_envs=options.envs,
        rollout=options.rollout,
        minibatches=min(MINIBATCHES, options.envs),
        total_steps=max(TOTAL_STEPS, options.envs * options.rollout),
    )
    learner = make_learner(*config.make_env(), config)
    numbers = HParams().check()
    state = jax.block_until_ready(learner.init(jax.random.key(0)))
    found["creation_seconds"] = time.perf_counter() - began
    found["parameters"] = sum(leaf.size for leaf in jax.tree.leaves(state.params))
    found["stage"], began = "compiling", time.perf_counter()
    update = jax.jit(lambda state: learner.train_chunk(state, numbers, 1)).lower(state).compile()
    found["compile_seconds"] = time.perf_counter() - began
    found["base_bytes"] = memory([os.getpid()])["memory_bytes"]
    found["stage"], times = "training", []
    while len(times) < 2 or sum(times[1:]) < options.seconds:
        began = time.perf_counter()
        state = jax.block_until_ready(update(state))[0]
        times.append(time.perf_counter() - began)
    found["warm_up_seconds"] = times[0]
    found["rates"] = [config.steps_per_update / each for each in times[1:]]
    found |= memory([os.getpid()])
    del found["stage"]


def main(argv: Sequence[str] | None = None) -> int:
    """Measure and print one line of JSON; 1 if it failed."""
    parser = argparse.ArgumentParser(description="Training speed of this project's baseline.")
    parser.add_argument("--envs", type=int, required=True, metavar="N")
    parser.add_argument("--rollout", type=int, default=128, metavar="T", help="(default 128)")
    parser.add_argument("--seconds", type=float, default=20.0, help="to measure (default 20)")
    options = parser.parse_args(argv)
    found: dict[str, Any] = {"envs": options.envs, "rollout": options.rollout}
    found["stage"] = "importing"
    try:
        measure(options, found)
    except (Exception, KeyboardInterrupt) as error:
        said = " ".join(str(error).split()) or "no message"
        found["failed"] = f"{type(error).__name__}: {said}, while {found.pop('stage')}"
    print(json.dumps(found), flush=True)
    return int("failed" in found)


if __name__ == "__main__":
    sys.exit(main())
