"""What surrounds a training: flags, logs, checkpoints, evaluation, and a file of results.

`flax_agent.py` and `equinox_agent.py` share this.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import importlib.util
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import optax

import jaxenstein
from examples.ppo import Settings
from examples.recurrent_ppo import Network, Trainer, policy_of
from jaxenstein import suite

Log = Callable[[int, Mapping[str, float]], object]


def parse(description: str, argv: Sequence[str] | None) -> argparse.Namespace:
    """The flags of both examples."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--env", default="miniworld-hallway", help="an id (default %(default)s)")
    help = "a task of the benchmark, for its number of decisions; instead of --env and --size"
    parser.add_argument("--task", help=help)
    numbers = {"size": (16, "pixels a side"), "hidden": (64, "size of the memory"),
               "envs": (32, "environments"), "steps": (64, "steps per rollout"),
               "every": (10, "updates between checkpoints"),
               "episodes": (100, "episodes of evaluation"), "seed": (0, "seed")}  # fmt: skip
    for name, (default, told) in numbers.items():
        help = f"{told} (default {default})"
        parser.add_argument(f"--{name}", type=int, default=default, help=help)
    parser.add_argument("--updates", type=int, help="updates (default 60, or those of --task)")
    parser.add_argument("--out", type=Path, default=Path("runs/own"), help="(default %(default)s)")
    options = parser.parse_args(argv)
    if options.updates is None:
        decisions = suite.suite_of("small").total_steps
        updates = -(-decisions // (options.envs * options.steps))
        options.updates = 60 if options.task is None else updates
    return options


def make_env(options: argparse.Namespace, *, test: bool = False) -> tuple[Any, Any]:
    """Make the environment; the step after the end of an episode resets it.

    A task of the benchmark may have other levels for the test.
    """
    if options.task is not None:
        return suite.make(options.task, test=test, autoreset="next-step")
    size = {"height": options.size, "width": options.size}
    return jaxenstein.make(options.env, autoreset="next-step", **size)


@contextlib.contextmanager
def logs(out: Path, name: str, config: Mapping[str, Any]) -> Iterator[list[Log]]:
    """The loggers: screen, and TensorBoard and Weights & Biases if they are installed."""
    found: list[Log] = [show]
    with contextlib.ExitStack() as stack:
        if importlib.util.find_spec("tensorboardX"):
            board: Any = importlib.import_module("tensorboardX")
            writer = board.SummaryWriter(f"{out}/tensorboard/{name}")
            stack.callback(writer.close)
            found.append(
                lambda steps, row: [writer.add_scalar(*item, steps) for item in row.items()]
            )
        if importlib.util.find_spec("wandb"):
            wandb: Any = importlib.import_module("wandb")
            # Offline; `wandb sync` uploads the folder later.
            run = wandb.init(
                project="jaxenstein", name=name, mode="offline", dir=out, config=dict(config)
            )
            stack.callback(run.finish)
            found.append(lambda steps, row: run.log(dict(row), step=steps))
        yield found


def show(steps: int, row: Mapping[str, float]) -> None:
    """Print a row."""
    print(f"{steps:>9,} steps: " + ", ".join(f"{k} {v:.3g}" for k, v in row.items()), flush=True)


def run(
    options: argparse.Namespace,
    world: tuple[Any, Any],
    network: Network,
    weights: Any,
    save: Callable[[Path, Any], object],
    name: str,
) -> tuple[Any, jaxenstein.Results]:
    """Train, log every update, save checkpoints, and evaluate the final weights.

    Args:
        options: the result of `parse`.
        world: an environment and its params, from `make_env`.
        network: the network, with a memory of size `options.hidden`.
        weights: the initial weights.
        save: writes weights to a file.
        name: name of the agent.

    Returns:
        The weights and the results; NAME-ENV-SEED.json has the results for `jaxenstein score`, or
        NAME-suite-ENV-SEED.json those in a task of the benchmark.
    """
    options.out.mkdir(parents=True, exist_ok=True)
    settings = Settings(envs=options.envs, steps=options.steps, epochs=2, minibatches=4)
    optimiser = optax.chain(
        optax.clip_by_global_norm(settings.largest_gradient),
        optax.adam(settings.learning_rate, eps=1e-5),
    )
    trainer = Trainer(*world, network, optimiser, settings)
    training = trainer.begin(jax.random.key(options.seed), weights, options.hidden)
    done, named = 0, ("episodes", "return", "length")
    file = f"{name}-{'suite-' * bool(options.task)}{world[0].name}-{options.seed}"
    with logs(options.out, file, {key: str(value) for key, value in vars(options).items()}) as told:
        while done < options.updates:
            training, report = trainer.run(training, min(options.every, options.updates - done))
            for row in zip(*jax.device_get(report), strict=True):
                done += 1
                # Means are NaN if no episode ended.
                shown = {k: float(v) for k, v in zip(named, row, strict=True) if v == v}
                for log in told:
                    log(done * options.envs * options.steps, shown)
            save(options.out / file, training.weights)
    start = jnp.zeros(options.hidden), jnp.bool_(True)
    policy = policy_of(network, training.weights)
    # All seeds play the same episodes.
    tested, run = make_env(options, test=True), f"{name}-{options.seed}"
    results = jaxenstein.evaluate(*tested, policy, start, options.episodes, seed=1, name=run)
    jaxenstein.write_results(options.out / f"{file}.json", [results])
    print(results.summary())
    return training.weights, results
