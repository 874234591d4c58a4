"""Train in ViZDoom itself, with the same trainer and options, for a given time.

    python -m experiments.in_vizdoom --out FILE [--minutes M] [--clock cpu] [--scale S] OPTIONS ...

OPTIONS are flags of `jaxenstein train`, such as `--config`, `--env`, `--seed` and `--gamma`, and
describe a `doom-` environment. Instead of that environment, the program steps `num_envs` ViZDoom
games (`jaxenstein.adapters.vizdoom.GameSession`); everything else is the same as in
`jaxenstein train`. FILE gets a row of metrics after each update. Rewards are those of the game;
`--scale 0.01` divides them by 100 for training, and not in FILE. If other programs share the core,
use `--clock cpu` (Linux), which counts the CPU time of this program and its games. Needs the extras
`baselines` and `vizdoom`.

With `--run RUN` the program trains here instead, in the new run directory RUN and for
`--total-steps`, and tests the agent in the game after each twelfth of its training, with sampled
actions. FILE gets a row of each test; its `seconds` are wall-clock seconds of training.
"""

from __future__ import annotations

import contextlib
import itertools
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

from fidelity.commands import positive
from jaxenstein.adapters.vizdoom import GameSession
from jaxenstein.baselines import RunFolder, resolve
from jaxenstein.baselines import train as run_training
from jaxenstein.baselines.learner import Learner
from jaxenstein.baselines.runs.agents import evaluate_in_game
from jaxenstein.baselines.runs.experiment import Experiment
from jaxenstein.baselines.runs.metrics import read_seconds
from jaxenstein.baselines.runs.trained import load_trained
from jaxenstein.cli.arguments import Parser, UsageError
from jaxenstein.cli.opening import add_config, add_training_options, given_training
from jaxenstein.environment import Environment
from jaxenstein.errors import JAXensteinError
from jaxenstein.files import append, check_writable
from jaxenstein.pytree import PyTreeNode

# With --run: the parts of a training, and the episodes after each.
PARTS, EPISODES = 12, 20


class GameState(PyTreeNode):
    """The number of a game and of its steps, which forces JAX to execute every step.

    Attributes:
        game: int32[].
        steps: int32[].
    """

    game: jax.Array
    steps: jax.Array


class Games:
    """Games with gymnax' interface, reset in the step that ends an episode; only for `jax.vmap`."""

    def __init__(
        self, env: Environment[Any, Any], params: Any, number: int, scale: float = 1.0
    ) -> None:
        """Start `number` games; rewards are multiplied by `scale`."""
        self._scale, self.frame_skip = scale, env.frame_skip
        self.action_space, self.observation_space = env.action_space, env.observation_space
        self._sessions = [GameSession(env, params, seed) for seed in range(number)]
        self._next = 0
        first: Any = self._sessions[0].observation
        self._seen = jax.ShapeDtypeStruct(first.shape, first.dtype)

    def reset(self, key: jax.Array, params: Any) -> tuple[jax.Array, GameState]:
        """The first game not yet in use, at the start of an episode."""
        del params
        shapes = (self._seen, jax.ShapeDtypeStruct((), np.int32))
        obs, game = io_callback(self._begin, shapes, jax.random.bits(key))
        return obs, GameState(game, jnp.int32(0))

    def step(
        self, key: jax.Array, state: GameState, action: jax.Array, params: Any
    ) -> tuple[jax.Array, GameState, jax.Array, jax.Array, jax.Array, dict[str, Any]]:
        """Take an action in a game; `final_observation` is the last frame before a reset."""
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
    """The CPU time of this program and its games so far."""
    own, tick = str(os.getpid()), os.sysconf("SC_CLK_TCK")
    total = 0.0
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):  # the process may have ended
            # Fields after the name in brackets: state, parent, ..., user and system time.
            fields = path.read_text().rpartition(")")[2].split()
            if own in (path.parent.name, fields[1]):
                total += (int(fields[11]) + int(fields[12])) / tick
    return total


CLOCKS: dict[str, Callable[[], float]] = {"wall": time.perf_counter, "cpu": cpu_seconds}


def train(
    experiment: Experiment,
    minutes: float,
    clock: Callable[[], float] = time.perf_counter,
    scale: float = 1.0,
) -> Iterator[dict[str, float]]:
    """Train one run in the game for some minutes of a clock; yield a row for each update.

    The agent learns from rewards multiplied by `scale`; rows have the game's own.
    """
    env, params = experiment.environment.build()
    with contextlib.closing(Games(env, params, experiment.config.num_envs, scale)) as games:
        learner = Learner(games, params, experiment.config)
        state = learner.init(experiment.keys()[0], experiment.numbers())
        updates, begin, seconds = 0, 0.0, 0.0
        while seconds < 60 * minutes:
            state, metrics = learner.train_chunk(state, experiment.numbers(), 1)
            row = {name: float(values[0]) for name, values in jax.device_get(metrics).items()}
            row["return_sum"] /= scale
            updates += 1
            steps = updates * experiment.config.steps_per_update
            # Time counts from the end of the first update, which includes compilation.
            begin = begin or clock()
            seconds = clock() - begin
            mean = row["return_sum"] / max(row["episodes"], 1)
            print(
                f"{seconds:6.0f} s  {steps} decisions  {row['successes']:.0f} of "
                f"{row['episodes']:.0f} episodes with success, return {mean:.3g}",
                file=sys.stderr,
            )
            yield {
                "seed": experiment.seeds[0], "steps": steps, "seconds": round(seconds, 1), **row
            }  # fmt: skip


def train_here(folder: RunFolder) -> Iterator[dict[str, float]]:
    """Train here; yield the results of a test in the game after each part of the training."""
    config, at = folder.experiment.config, [0]
    for part in range(1, PARTS + 1):
        due = round(part * config.updates / PARTS)
        update = run_training(
            folder,
            notify=lambda update, _: at.append(update),
            stop=lambda due=due: at[-1] >= due,
        )
        results = evaluate_in_game(load_trained(folder.path), episodes=EPISODES)
        yield {
            "seed": folder.experiment.seeds[0],
            "steps": update * config.steps_per_update,
            "seconds": round(float(read_seconds(folder.path, update)[-1]), 1),
            "episodes": EPISODES,
            "return_sum": float(results.returns.sum()),
            "successes": int(results.successes.sum()),
        }


def main(argv: Sequence[str] | None = None) -> None:
    """Train, and write each row at once."""
    parser = Parser(description="Train in ViZDoom itself.")
    parser.add_argument("--out", required=True, help="a JSON Lines file")
    parser.add_argument("--minutes", type=positive, default=8.0)
    parser.add_argument("--clock", choices=CLOCKS, default="wall")
    parser.add_argument("--scale", type=positive, default=1.0, help="factor on rewards (default 1)")
    parser.add_argument("--run", type=Path, help="train here, in this new run directory")
    add_config(parser)
    add_training_options(parser, without=["seeds"])
    try:
        told = parser.parse_args(argv)
        if told.run and (told.minutes, told.clock, told.scale) != (8.0, "wall", 1.0):
            parser.error("--run takes neither --minutes nor --clock nor --scale")
        experiment = resolve({**given_training(told), "seeds": 1})
        check_writable(told.out)
        if told.run:
            rows = train_here(RunFolder.create(told.run, experiment))
        else:
            rows = train(experiment, told.minutes, CLOCKS[told.clock], told.scale)
        first = next(rows)
    except (UsageError, JAXensteinError) as error:
        raise SystemExit(str(error)) from None
    # An old file stays until the first row replaces it.
    Path(told.out).unlink(missing_ok=True)
    for row in itertools.chain([first], rows):
        append(Path(told.out), json.dumps(row) + "\n")


if __name__ == "__main__":
    main()
