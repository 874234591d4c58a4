"""Measure a random policy on several devices or machines: steps per second for each number.

    python -m benchmarks.spread                                  # 1, 2, 4, ... local devices
    python -m benchmarks.spread --cpu-devices 4                  # the same, simulated on a CPU
    python -m benchmarks.spread --coordinator HOST:PORT --processes 2 --process 0   # on each host

`jax.shard_map` spreads the environments over the devices. Each device steps, resets and draws its
own environments, and none waits for another. Each environment has its own random keys, so results
do not depend on the number of devices.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jax.sharding import AxisType, Mesh, NamedSharding, PartitionSpec

import jaxenstein
from benchmarks.tables import WHOLE, column, markdown, number
from fidelity.commands import run_command
from jaxenstein.cli.arguments import size, whole
from jaxenstein.errors import SettingError
from jaxenstein.files import atomic, check_writable
from jaxenstein.machine import describe_machine
from jaxenstein.speed.measuring import summarise, timed_calls
from jaxenstein.speed.random_rollout import RolloutCarry, make_random_rollout

AXIS = "env"
COLUMNS = (
    column("devices"), column("environments", "batch", form=WHOLE),
    column("steps/s", "steps_per_second", "median", form=WHOLE),
    column("x the first row", "times", form=number),
)  # fmt: skip


def make_mesh(devices: Sequence[Any]) -> Mesh:
    """A mesh of devices with the single axis `"env"`."""
    return jax.make_mesh((len(devices),), (AXIS,), axis_types=(AxisType.Auto,), devices=devices)


def make_spread_rollout(
    env: Any, params: Any, batch: int, steps: int, mesh: Mesh
) -> tuple[jax.stages.Wrapped, jax.stages.Wrapped]:
    """A rollout of a uniform random policy, with environments spread over a mesh.

    Args:
        env: an environment whose `autoreset` is not `None`.
        params: its params, the same for all environments.
        batch: number of environments on all devices together, a multiple of the number of devices.
        steps: steps in each environment per call.
        mesh: a mesh with the axis `"env"`; its devices may belong to several processes.

    Returns:
        `(rollout, start)`. `start(seed)` takes an integer and returns a `RolloutCarry`. All its
        leaves, including the key, have a leading axis of environments, spread over the devices.
        `rollout(carry)` plays `steps` steps, and reuses the memory of the carry.

    Raises:
        SettingError: the environments do not divide evenly, or `env` does not reset itself.
    """
    if batch < 1 or steps < 1 or batch % mesh.size:
        raise SettingError(
            f"batch must be a multiple of the {mesh.size} devices and steps at least 1, not "
            f"{batch} and {steps}"
        )
    # A rollout of one environment, which does not depend on the number of others.
    play, first = make_random_rollout(env, params, 1, steps)
    apart = PartitionSpec(AXIS)

    def spread(function: Any) -> Any:
        # Devices exchange nothing, so `check_vma` has nothing to check.
        return jax.shard_map(function, mesh=mesh, in_specs=apart, out_specs=apart, check_vma=False)

    def start(seed: Any) -> RolloutCarry:
        keys = jax.random.split(jax.random.key(seed), batch)
        keys = jax.lax.with_sharding_constraint(keys, NamedSharding(mesh, apart))
        return spread(jax.vmap(first))(keys)

    return jax.jit(spread(jax.vmap(play)), donate_argnums=0), jax.jit(start)


def measure_spread(devices: Sequence[Any], options: argparse.Namespace) -> dict[str, Any]:
    """Steps per second with `options.batch` environments on each device."""
    height, width = options.size
    env, params = jaxenstein.make(options.id, height=height, width=width)
    batch = options.batch * len(devices)
    rollout, start = make_spread_rollout(env, params, batch, options.steps, make_mesh(devices))
    carry = jax.block_until_ready(rollout(start(np.uint32(0))))
    # One call per repeat, since all processes must make the same calls.
    taken = [each for _, each in timed_calls(rollout, carry, options.repeats)]
    rates = summarise(options.steps * batch / np.array(taken))
    return {"devices": len(devices), "batch": batch, "steps_per_second": rates}


def main(argv: Sequence[str] | None = None) -> None:
    """Measure and print a table."""
    parser = _parser()
    options = parser.parse_args(argv)
    together = (options.coordinator, options.processes, options.process)
    if any(given is not None for given in together) and None in together:
        parser.error("give --coordinator, --processes and --process together")
    if options.json is not None:
        check_writable(options.json)
    if options.cpu_devices is not None:
        jax.config.update("jax_platforms", "cpu")
        jax.config.update("jax_num_cpu_devices", options.cpu_devices)
    if options.coordinator is not None:
        jax.distributed.initialize(options.coordinator, options.processes, options.process)
    devices = jax.devices()
    counts = sorted({1 << power for power in range(len(devices).bit_length())} | {len(devices)})
    if jax.process_count() > 1:
        counts = [len(devices)]
    rows = [measure_spread(devices[:count], options) for count in counts]
    if jax.process_index():
        return
    for row in rows:
        row["times"] = row["steps_per_second"]["median"] / rows[0]["steps_per_second"]["median"]
    device = devices[0].device_kind
    print(f"{device}\n\n{markdown(COLUMNS, rows)}")
    if options.json is not None:
        report = {**describe_machine(), "device": device, "processes": jax.process_count()}
        with atomic(options.json) as path:
            path.write_text(json.dumps(report | {"rows": rows}, indent=1))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description="Steps per second on 1, 2, 4, ... devices, each with the same work."
    )
    add = parser.add_argument
    add("--id", default="my-way-home", help="environment (default my-way-home)")
    add("--batch", type=whole(), default=256, help="environments on each device (default 256)")
    add("--size", type=size, default=(64, 64), metavar="WxH")
    add("--steps", type=whole(), default=1024, help="steps per call (default 1024)")
    add("--repeats", type=whole(), default=7, help="calls (default 7)")
    add("--cpu-devices", type=whole(), metavar="N", help="simulate N devices on the CPU")
    add("--coordinator", metavar="HOST:PORT", help="address of process 0")
    add("--processes", type=whole(), metavar="N", help="number of processes")
    add("--process", type=whole(0), metavar="I", help="number of this process, from 0")
    add("--json", type=Path, metavar="FILE", help="also write all repeats as JSON")
    return parser


if __name__ == "__main__":
    run_command(main)
