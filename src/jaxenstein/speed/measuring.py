"""Measure speed, compile time and memory, in a fresh process for each configuration.

Only a fresh process can show the peak memory of one configuration. It is also unaffected by caches,
threads and the heap of earlier ones. `python -m jaxenstein.speed.measuring SETTINGS` is such a
process: settings and results are JSON.
"""

from __future__ import annotations

import dataclasses
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

# With these, XLA's CPU backend uses one thread; several would compete for one core.
ONE_THREAD = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"


@dataclasses.dataclass(frozen=True)
class Settings:
    """One configuration.

    Attributes:
        name: the name of the environment.
        spec: the fields of the environment's `Spec`, which JSON can hold.
        batch: the number of parallel environments.
        steps: steps of each environment per repeat.
        repeats: measured repeats, after one to warm up.
        seed: the seed of the resets and the policy.
        core: the CPU core to run on with a single thread, or None for all.
    """

    name: str
    spec: Mapping[str, Any]
    batch: int
    steps: int
    repeats: int
    seed: int = 0
    core: int | None = None


class BenchmarkError(RuntimeError):
    """A measuring process failed; the message is the last line of its output."""


def measure_in_process(settings: Settings) -> dict[str, Any]:
    """Measure one configuration in its own process; see `measure` for the result.

    Raises:
        BenchmarkError: the process failed.
    """
    environment = dict(os.environ)
    source = str(Path(__file__).parents[2])
    paths = [source, *filter(None, [environment.get("PYTHONPATH")])]
    environment["PYTHONPATH"] = os.pathsep.join(paths)
    if settings.core is not None:
        flags = [ONE_THREAD, *filter(None, [environment.get("XLA_FLAGS")])]
        environment["XLA_FLAGS"] = " ".join(reversed(flags))
    command = [sys.executable, "-m", "jaxenstein.speed.measuring"]
    # A large map would be too long for an argument.
    told = json.dumps(dataclasses.asdict(settings))
    done = subprocess.run(command, input=told, env=environment, capture_output=True, text=True)
    if done.returncode:
        lines = done.stderr.strip().splitlines() or [f"ended with code {done.returncode}"]
        where = f"{settings.name} with batch {settings.batch}"
        raise BenchmarkError(f"measuring {where} failed: {lines[-1]}")
    return json.loads(done.stdout.strip().splitlines()[-1])


def measure(settings: Settings) -> dict[str, Any]:
    """Measure one configuration in this process.

    Returns:
        `id`, the settings, those of the environment, and: `seconds` of every repeat;
        `steps_per_second` with `median`, `lower_quartile`, `upper_quartile` and `repeats`;
        `world_steps_per_second`, likewise, with `frame_skip` world steps per step;
        `compile_seconds` of `reset`, `step` and the whole `rollout`; `peak_memory_bytes` of
        the process; `device_peak_bytes` if the device reports it; `device`.
    """
    if settings.core is not None:
        os.sched_setaffinity(0, {settings.core})
    import jax

    from .. import registry
    from ..fields import as_tuples
    from ..spec import Spec
    from ..tasks.first_person import SETTINGS
    from .random_rollout import make_random_rollout

    # The user named this module on the command line, so importing it is safe.
    registry.import_module_of(settings.spec["id"])
    texts = {name: as_tuples(value) for name, value in settings.spec["settings"].items()}
    env, params = Spec(**{**settings.spec, "settings": texts}).build()
    env = dataclasses.replace(env, autoreset="same-step")
    compiling = _compile_times(env, params, settings.batch)
    rollout, start = make_random_rollout(env, params, settings.batch, settings.steps)
    carry = jax.block_until_ready(start(jax.random.key(settings.seed)))
    program, compiling["rollout"] = compile_timed(rollout, carry)
    first = program(carry)
    seconds, counts = [], [_count(first)]
    for carry, taken in timed_calls(program, first, settings.repeats):
        seconds.append(taken)
        counts.append(_count(carry))
    device = jax.devices()[0]
    return {
        "id": settings.name,
        **{name: as_tuples(getattr(env, name)) for name in SETTINGS},
        **dataclasses.asdict(settings),
        "steps_per_second": summarise(settings.batch * settings.steps / np.array(seconds)),
        "world_steps_per_second": summarise(np.diff(counts) / np.array(seconds)),
        "seconds": seconds,
        "compile_seconds": compiling,
        "peak_memory_bytes": _peak_memory(),
        "device_peak_bytes": (device.memory_stats() or {}).get("peak_bytes_in_use"),
        "device": f"{device.platform}: {device.device_kind}",
    }


def _count(carry: Any) -> int:
    """World steps so far, over all environments."""
    return int(np.sum(np.asarray(carry.world_steps), dtype=np.int64))


def _compile_times(env: Any, params: Any, batch: int) -> dict[str, float]:
    """Seconds to lower and compile the batched reset and step."""
    import jax
    import jax.numpy as jnp

    keys = jax.random.split(jax.random.key(0), batch)
    reset = jax.jit(jax.vmap(lambda key: env.reset(key, params)))
    step = jax.jit(jax.vmap(lambda key, state, action: env.step(key, state, action, params)))
    _, reset_seconds = compile_timed(reset, keys)
    _, states = jax.eval_shape(reset, keys)
    _, step_seconds = compile_timed(step, keys, states, jnp.zeros(batch, jnp.int32))
    return {"reset": reset_seconds, "step": step_seconds}


def compile_timed(program: Any, *args: Any) -> tuple[Any, float]:
    """Compile a jitted function for these arguments; returns it and the seconds it took."""
    begin = time.perf_counter()
    compiled = program.lower(*args).compile()
    return compiled, time.perf_counter() - begin


def timed_calls(
    program: Callable[[Any], Any], carry: Any, repeats: int, seconds: float = 0.0
) -> Iterator[tuple[Any, float]]:
    """Call a program repeatedly on its last result.

    Args:
        program: a function from a carry to the next carry.
        carry: the first carry, which may be donated.
        repeats: the number of measurements.
        seconds: the shortest duration of a repeat; it makes at least one call.

    Yields:
        After each repeat, the carry and the seconds per call.
    """
    import jax

    for _ in range(repeats):
        begin, calls = time.perf_counter(), 0
        while not calls or time.perf_counter() - begin < seconds:
            carry, calls = jax.block_until_ready(program(carry)), calls + 1
        yield carry, (time.perf_counter() - begin) / calls


def summarise(rates: np.ndarray) -> dict[str, Any]:
    """The median and quartiles of the rates of all repeats, and the rates."""
    lower, median, upper = (float(q) for q in np.quantile(rates, [0.25, 0.5, 0.75]))
    return {
        "median": median,
        "lower_quartile": lower,
        "upper_quartile": upper,
        "repeats": [float(rate) for rate in rates],
    }


def _peak_memory() -> int | None:
    """The peak memory of this process in bytes; None if the system does not report it."""
    try:
        # Unlike `getrusage`, this does not include the memory of the parent process.
        with open("/proc/self/status", encoding="ascii") as status:
            for line in status:
                if line.startswith("VmHWM:"):
                    return int(line.split()[1]) * 1024
    except OSError:
        pass
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # The unit is bytes on macOS and kibibytes elsewhere.
    return peak if sys.platform == "darwin" else peak * 1024


if __name__ == "__main__":
    print(json.dumps(measure(Settings(**json.load(sys.stdin)))))
