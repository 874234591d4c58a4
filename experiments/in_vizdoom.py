"""Train in ViZDoom itself, with the same trainer and configuration, for as long as one likes.

    python -m experiments.in_vizdoom CONFIG --out FILE [--minutes M] [--seed N] ...

CONFIG is what `jaxenstein train --config` takes, about a `doom-` environment. Every decision is
asked of games that run beside (`jaxenstein.adapters.vizdoom.GameSession`), as many as `num_envs`
says; all else is what `jaxenstein train` does. FILE gets a row of metrics after each update. The
game's rewards are its own: where CONFIG trains on a hundredth of them, it takes `--scale 0.01`. On
a core that other work shares, `--clock cpu` counts what this program and its games have had of it
(on Linux). Needs the extras `baselines` and `vizdoom`.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental import io_callback

from jaxenstein.adapters.vizdoom import GameSession
from jaxenstein.baselines import resolve
from jaxenstein.baselines.learner import Learner
from jaxenstein.baselines.runs.configs import find_config
from jaxenstein.baselines.runs.experiment import Experiment
from jaxenstein.baselines.runs.options import read_file
from jaxenstein.environment import Environment
from jaxenstein.files import append, check_writable
from jaxenstein.pytree import PyTreeNode


class GameState(PyTreeNode):
    """Which of the games it is, and the steps taken in it, so that no step can be left out.

    Attributes:
        game: int32[].
        steps: int32[].
    """

    game: jax.Array
    steps: jax.Array


class Games:
    """Games by gymnax' contract, reset in the step that ends an episode; only for `jax.vmap`."""

    def __init__(
        self, env: Environment[Any, Any], params: Any, number: int, scale: float = 1.0
    ) -> None:
        """Start so many games, whose rewards are multiplied by `scale`."""
        self._scale, self.frame_skip = scale, env.frame_skip
        self.action_space, self.observation_space = env.action_space, env.observation_space
        self._sessions = [GameSession(env, params, seed) for seed in range(number)]
        self._next = 0
        first: Any = self._sessions[0].observation
        self._seen = jax.ShapeDtypeStruct(first.shape, first.dtype)

    def reset(self, key: jax.Array, params: Any) -> tuple[jax.Array, GameState]:
        """The next game that has not been handed out, at the start of an episode."""
        del params
        shapes = (self._seen, jax.ShapeDtypeStruct((), np.int32))
        obs, game = io_callback(self._begin, shapes, jax.random.bits(key))
        return obs, GameState(game, jnp.int32(0))

    def step(
        self, key: jax.Array, state: GameState, action: jax.Array, params: Any
    ) -> tuple[jax.Array, GameState, jax.Array, jax.Array, jax.Array, dict[str, Any]]:
        """Hold an action in its game; `final_observation` is the last that the game showed."""
        del params
        flag = jax.ShapeDtypeStruct((), np.bool_)
        shapes = (
            self._seen, jax.ShapeDtypeStruct((), np.float32), flag, flag, flag, self._seen,
            jax.ShapeDtypeStruct((), np.int32),
        )  # fmt: skip
        obs, reward, terminated, truncated, success, final, steps = io_callback(
            self._play, shapes, state.game, state.steps, action, jax.random.bits(key)
        )
        info = {"success": success, "final_observation": final}
        return obs, state.replace(steps=steps), reward, terminated, truncated, info

    def close(self) -> None:
        """Close all games."""
        for session in self._sessions:
            session.close()

    def _begin(self, seed: Any) -> tuple[Any, ...]:
        game, self._next = self._next, self._next + 1
        return self._sessions[game].reset(int(seed)), np.int32(game)

    def _play(self, game: Any, steps: Any, action: Any, seed: Any) -> tuple[Any, ...]:
        session = self._sessions[int(game)]
        final = obs = session.step(int(action))
        flags = [np.bool_(f) for f in (session.terminated, session.truncated)]
        flags.append(np.bool_(session.info["success"]))
        reward = np.float32(session.rewards[-1] * self._scale)
        if session.over:
            obs = session.reset(int(seed))
        return obs, reward, *flags, final, np.int32(steps + 1)


def cpu_seconds() -> float:
    """What this program and its games have had of the processor so far."""
    own, tick = str(os.getpid()), os.sysconf("SC_CLK_TCK")
    total = 0.0
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):  # it has ended meanwhile
            # After the name in brackets: state, parent, ..., user and system time.
            fields = path.read_text().rpartition(")")[2].split()
            if own in (path.parent.name, fields[1]):
                total += (int(fields[11]) + int(fields[12])) / tick
    return total


def train(
    config: str,
    minutes: float,
    seed: int,
    clock: Callable[[], float] = time.perf_counter,
    scale: float = 1.0,
) -> Iterator[dict[str, float]]:
    """Train one run in the game, for so many minutes of a clock; a row for each update."""
    experiment = resolve({**read_file(find_config(config)), "seed": seed, "seeds": 1})
    env, params = experiment.environment.build()
    with contextlib.closing(Games(env, params, experiment.config.num_envs, scale)) as games:
        yield from _train(games, params, experiment, minutes, clock)


def _train(
    games: Games, params: Any, experiment: Experiment, minutes: float, clock: Callable[[], float]
) -> Iterator[dict[str, float]]:
    learner = Learner(games, params, experiment.config)
    state = learner.init(experiment.keys()[0], experiment.numbers())
    updates, begin, seconds = 0, 0.0, 0.0
    while seconds < 60 * minutes:
        state, metrics = learner.train_chunk(state, experiment.numbers(), 1)
        row = {name: float(values[0]) for name, values in jax.device_get(metrics).items()}
        updates += 1
        steps = updates * experiment.config.steps_per_update
        # The first update is compiled; time counts from there on.
        begin = begin or clock()
        seconds = clock() - begin
        print(
            f"{seconds:6.0f} s  {steps} decisions  {row['successes']:.0f} of {row['episodes']:.0f} "
            f"episodes with success, return {row['return_sum'] / max(row['episodes'], 1):.3g}",
            file=sys.stderr,
        )
        yield {
            "seed": experiment.seeds[0], "steps": steps, "seconds": round(seconds, 1), **row
        }  # fmt: skip


def main(argv: Sequence[str] | None = None) -> None:
    """Train, and write each row as it comes."""
    parser = argparse.ArgumentParser(description="Train in ViZDoom itself.")
    parser.add_argument("config")
    parser.add_argument("--out", required=True, help="a file of JSON lines")
    parser.add_argument("--minutes", type=float, default=8.0)
    parser.add_argument("--clock", choices=("wall", "cpu"), default="wall")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--scale", type=float, default=1.0, help="of rewards (default 1)")
    arguments = parser.parse_args(argv)
    check_writable(arguments.out)
    clock = cpu_seconds if arguments.clock == "cpu" else time.perf_counter
    rows = train(arguments.config, arguments.minutes, arguments.seed, clock, arguments.scale)
    for number, row in enumerate(rows):
        if number == 0:
            # What was there stays until there is something in its place.
            Path(arguments.out).unlink(missing_ok=True)
        append(Path(arguments.out), json.dumps(row) + "\n")


if __name__ == "__main__":
    main()
