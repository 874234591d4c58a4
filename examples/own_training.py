"""Around a training of one's own: flags, logs, checkpoints, evaluation, a file of results.

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

Log = Callable[[int, Mapping[str, float]], object]


def parse(description: str, argv: Sequence[str] | None) -> argparse.Namespace:
    """The flags of both examples."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--env", default="miniworld-hallway", help="an id (default %(default)s)")
    numbers = {"size": (16, "pixels a side"), "hidden": (64, "size of the memory"),
               "envs": (32, "environments"), "steps": (64, "steps of a rollout"),
               "updates": (60, "updates"), "every": (10, "updates between two checkpoints"),
               "episodes": (100, "episodes of the evaluation"), "seed": (0, "seed")}  # fmt: skip
    for name, (default, told) in numbers.items():
        help = f"{told} (default {default})"
        parser.add_argument(f"--{name}", type=int, default=default, help=help)
    parser.add_argument("--out", type=Path, default=Path("runs/own"), help="(default %(default)s)")
    return parser.parse_args(argv)


def make_env(options: argparse.Namespace) -> tuple[Any, Any]:
    """The environment; a step that ends an episode shows its last frame, the next one resets."""
    size = {"height": options.size, "width": options.size}
    return jaxenstein.make(options.env, autoreset="next-step", **size)


@contextlib.contextmanager
def logs(out: Path, config: Mapping[str, Any]) -> Iterator[list[Log]]:
    """What a row is told to: the screen, TensorBoard and Weights & Biases where installed."""
    found: list[Log] = [show]
    with contextlib.ExitStack() as stack:
        if importlib.util.find_spec("tensorboardX"):
            board: Any = importlib.import_module("tensorboardX")
            writer = board.SummaryWriter(f"{out}/tensorboard")
            stack.callback(writer.close)
            found.append(
                lambda steps, row: [writer.add_scalar(*item, steps) for item in row.items()]
            )
        if importlib.util.find_spec("wandb"):
            wandb: Any = importlib.import_module("wandb")
            # Nothing is sent; `wandb sync` sends the folder later.
            run = wandb.init(project="jaxenstein", mode="offline", dir=out, config=dict(config))
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
    """Train, log every update, save the weights now and then, and evaluate the last ones.

    Args:
        options: those of `parse`.
        world: an environment and its params, as `make_env` returns them.
        network: with `options.hidden` numbers in its memory.
        weights: the first ones.
        save: writes weights into a file.
        name: of the agent in the results, and of the files.

    Returns:
        The weights and the results, which NAME.json has for `jaxenstein score`.
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
    with logs(options.out, {key: str(value) for key, value in vars(options).items()}) as told:
        while done < options.updates:
            training, report = trainer.run(training, min(options.every, options.updates - done))
            for row in zip(*jax.device_get(report), strict=True):
                done += 1
                # Where no episode ended there is no mean.
                shown = {k: float(v) for k, v in zip(named, row, strict=True) if v == v}
                for log in told:
                    log(done * options.envs * options.steps, shown)
            save(options.out / name, training.weights)
    start = jnp.zeros(options.hidden), jnp.bool_(True)
    policy = policy_of(network, training.weights)
    results = jaxenstein.evaluate(*world, policy, start, options.episodes, seed=1, name=name)
    jaxenstein.write_results(options.out / f"{name}.json", [results])
    print(results.summary())
    return training.weights, results
