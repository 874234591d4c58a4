"""Play millions of steps of every environment, and check invariants in every step.

    python -m reliability.endurance --steps 10_000_000         for all ids together
    python -m reliability.endurance --steps 100_000 simple key-corridor
    python -m reliability.endurance --steps 200_000 --checked   also check indices and NaN

The players are the expert, a random policy, and adversaries that run into walls, spin and use
everything, or choose invalid actions. `--checked` checks every operation for an index out of range,
a division by zero and NaN (`jax.experimental.checkify`), also while drawing; it is slower. One
compiled program runs on its own states, and memory must not grow.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import importlib
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any
from unittest import mock

import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental import checkify

import jaxenstein
from jaxenstein.catalogue import ENTRIES, MAIN_IDS
from jaxenstein.players import UNIFORM, player_of

from . import invariants

SIZE = {"height": 8, "width": 16}
# Parallel environments, a multiple of the number of players, and steps per call.
BATCH, CALL = 40, 250
# The maximum growth of the memory of the process after the first calls, in bytes.
GROWTH = 64 << 20
# Counted like an event, so that frames are drawn.
PIXELS = "pixels above 0"
# Functions that separate stages; checks cannot look inside them.
STAGES = (
    *((f"engine.{module}", "staged") for module in ("render", "raycast", "sprites", "pixels")),
    ("engine.sprites", "repeat"),
    ("environment", "where_any"),
)
EXTREMES = np.array([-(2**31), -1, 2**31 - 1, 127, 255, 5, 6], np.int32)


@dataclasses.dataclass
class Report:
    """The results of playing one environment.

    Attributes:
        steps: number of steps over the batch.
        episodes: number of episodes that ended.
        events: the number of times that each event of `info` happened.
        broken: the number of times that each invariant was violated.
        grown: growth of the memory of the process after the first calls, in bytes.
        seconds: time without compilation.
    """

    steps: int = 0
    episodes: int = 0
    events: dict[str, int] = dataclasses.field(default_factory=dict)
    broken: dict[str, int] = dataclasses.field(default_factory=dict)
    grown: int = 0
    seconds: float = 0.0

    @property
    def problems(self) -> list[str]:
        """The problems in words."""
        found = [f"NOT SO in {count} steps: {name}" for name, count in self.broken.items() if count]
        grown = f"memory grew by {self.grown / 2**20:.0f} MiB"
        return found + [grown] * (self.grown > GROWTH)

    def count(self, counts: Any, steps: int) -> None:
        """Add the counts of some steps."""
        ended, events, broken = jax.device_get(counts)
        self.steps += steps
        self.episodes += int(ended)
        for table, found in ((self.events, events), (self.broken, broken)):
            for name, number in found.items():
                table[name] = table.get(name, 0) + int(number)


def players(env: Any, params: Any) -> list[Callable[[jax.Array, Any], jax.Array]]:
    """Functions that choose an action from key and state."""
    names = env.action_names
    # Doom's scenarios in which the player stays in place lack some of these actions.
    forward, right = (names.index(a) if a in names else 0 for a in ("forward", "turn right"))

    def extreme(key: jax.Array, state: Any) -> jax.Array:
        del state
        return jax.random.choice(key, jnp.asarray(EXTREMES))

    def ram(key: jax.Array, state: Any) -> jax.Array:
        """Walk forward, even if blocked, with a few turns."""
        del state
        return jnp.where(jax.random.bernoulli(key, 0.05), right, forward).astype(jnp.int32)

    def fidget(key: jax.Array, state: Any) -> jax.Array:
        """Alternate between turning, using and walking."""
        walks = jax.random.bernoulli(key, 0.3)
        used = jnp.where(state.time % 3 == 0, right, env.num_actions - 1)
        return jnp.where(walks, forward, used).astype(jnp.int32)

    return [player_of(env)(env, params), UNIFORM(env, params), extreme, ram, fidget]


def make_program(
    env: Any, params: Any, batch: int, steps: int, *, in_turn: bool = False
) -> tuple[Any, Any]:
    """`start(key)` returns a carry; `play(carry)` returns the next carry and counts.

    With `in_turn`, environments step one after the other, since `checkify` does not support batched
    loops and scatters.
    """
    chosen = players(env, params)
    kinds = jnp.arange(batch, dtype=jnp.int32) % len(chosen)

    def one(key: jax.Array, kind: jax.Array, state: Any) -> Any:
        choose_key, step_key = jax.random.split(key)
        action = jax.lax.switch(kind, chosen, choose_key, state)
        obs, after, *outcome = env.step(step_key, state, action, params)
        checks = invariants.of_state(env, after, params)
        checks |= invariants.of_step(env, state, after, outcome, params)
        checks |= invariants.of_observation(obs)
        _, terminated, truncated, info = outcome
        events = {name: info[name].astype(jnp.int32) for name in env.about().events}
        # Read the frame, so that it is not left out of the program.
        events[PIXELS] = jnp.any(obs != 0).astype(jnp.int32)
        broken = {name: (~held).astype(jnp.int32) for name, held in checks.items()}
        return after, ((terminated | truncated).astype(jnp.int32), events, broken)

    def step(carry: Any, _: None) -> Any:
        key, state = carry
        key, now = jax.random.split(key)
        given = jax.random.split(now, batch), kinds, state
        state, counts = jax.lax.map(lambda g: one(*g), given) if in_turn else jax.vmap(one)(*given)
        return (key, state), jax.tree.map(lambda x: jnp.sum(x, dtype=jnp.int32), counts)

    def start(key: jax.Array) -> Any:
        key, now = jax.random.split(key)
        _, state = jax.vmap(env.reset, (0, None))(jax.random.split(now, batch), params)
        limit = jnp.asarray(params.max_steps_in_episode, jnp.int32)
        # Different clocks, so that episodes do not all end in the same step.
        clocks = jnp.arange(batch, dtype=jnp.int32) * limit // batch
        return key, state.replace(time=clocks)

    def play(carry: Any) -> Any:
        carry, counts = jax.lax.scan(step, carry, length=steps)
        return carry, jax.tree.map(lambda x: jnp.sum(x, axis=0, dtype=jnp.int32), counts)

    return jax.jit(start), play


def endure(
    name: str, steps: int, *, seed: int = 0, checked: bool = False, batch: int = BATCH
) -> Report:
    """Play an environment.

    Args:
        name: id of the environment.
        steps: number of steps over the batch, rounded up.
        seed: random seed.
        checked: whether to check every operation, and to draw colours instead of depth.
        batch: number of parallel environments.
    """
    kind = "rgb" if checked else "depth"
    env, params = jaxenstein.make(name, observation=kind, **SIZE)
    calls = -(-steps // (batch * CALL)) if steps >= batch * CALL else 1
    length = min(CALL, -(-steps // batch))
    report = Report()
    with plain_stages() if checked else contextlib.nullcontext():
        start, play = make_program(env, params, batch, length, in_turn=checked)
        carry = start(jax.random.key(seed))
        errors = checkify.index_checks | checkify.nan_checks | checkify.div_checks
        program = checkify.checkify(play, errors=errors) if checked else play
        # The program runs on its own output, so it is compiled only once.
        run = jax.jit(program).lower(carry).compile()
        begin, memory = time.perf_counter(), resident()
        for call in range(calls):
            told = jax.block_until_ready(run(carry))
            error, (carry, counts) = told if checked else (None, told)
            if error is not None and error.get():
                report.broken[" ".join(error.get().split())] = 1
                break
            report.count(counts, batch * length)
            if call == calls // 4:
                memory = resident()
        report.seconds, report.grown = time.perf_counter() - begin, resident() - memory
    return report


@contextlib.contextmanager
def plain_stages() -> Iterator[None]:
    """Merge stages, since checks cannot look inside the conditionals between them."""
    with contextlib.ExitStack() as stack:
        for module, name in STAGES:
            where = importlib.import_module(f"jaxenstein.{module}")
            stack.enter_context(mock.patch.object(where, name, PLAIN[name]))
        jax.clear_caches()
        yield
    jax.clear_caches()


def _repeat(body: Callable[..., Any]) -> Callable[..., Any]:
    def run(rounds: jax.Array, carry: Any, constants: Any) -> Any:
        return jax.lax.fori_loop(0, rounds, lambda i, c: body(i, c, constants), carry)

    return run


PLAIN: dict[str, Callable[..., Any]] = {
    "staged": lambda stage: stage,
    "repeat": _repeat,
    "where_any": lambda function: lambda needed, *args: function(*args),
}


def resident() -> int:
    """The memory of the process in bytes; 0 if unknown."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:
        return 0
    return pages * os.sysconf("SC_PAGE_SIZE")


def main(arguments: Sequence[str] | None = None) -> int:
    """Play the named environments; return 1 if there is a problem."""
    summary = (__doc__ or "").split("\n\n")
    parser = argparse.ArgumentParser(
        prog="python -m reliability.endurance", description=summary[0], epilog=summary[2]
    )
    parser.add_argument(
        "ids", nargs="*", metavar="ID", help="environments (default: all but variants)"
    )
    parser.add_argument(
        "--steps", type=int, default=1_000_000, help="total steps (default 1_000_000)"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--checked", action="store_true", help="check every operation")
    options = parser.parse_args(arguments)
    if unknown := [name for name in options.ids if name not in ENTRIES]:
        parser.error(f"unknown: {', '.join(unknown)}; known: {', '.join(ENTRIES)}")
    names, failed = options.ids or list(MAIN_IDS), False
    print("| id | steps | episodes | events | grown MiB | s | |\n|---|---:|---:|---|---:|---:|---|")
    for name in names:
        steps = -(-options.steps // len(names))
        report = endure(name, steps, seed=options.seed, checked=options.checked)
        failed |= bool(report.problems)
        happened = ", ".join(f"{e} {count}" for e, count in report.events.items() if e != PIXELS)
        print(
            f"| {name} | {report.steps} | {report.episodes} | {happened} | "
            f"{report.grown / 2**20:.1f} | {report.seconds:.0f} | "
            f"{'; '.join(report.problems) or 'ok'} |",
            flush=True,
        )
        jax.clear_caches()
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
