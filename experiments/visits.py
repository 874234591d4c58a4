"""Where agents have been while they learned: maps of visits, one for each algorithm and stage.

    python -m experiments.visits CONFIG --algo NAME [NAME ...] --out DIR [--stages 5]

trains CONFIG, a file of `jaxenstein train --config`, with each of the algorithms into DIR/NAME, as
`jaxenstein sweep --no-grid` does. At the start and after equal parts of the training all seeds play
some episodes, with drawn actions, and the tiles they stand on are counted: DIR/NAME/visits.json.
DIR/visits.png shows the counts on the map, brighter by a power of ten. The same command goes on
where it was interrupted.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from PIL import Image

from jaxenstein.baselines import resolve
from jaxenstein.baselines.learner import Learner
from jaxenstein.baselines.runs.folder import RunFolder
from jaxenstein.baselines.runs.options import read_file
from jaxenstein.baselines.runs.trained import load_trained
from jaxenstein.baselines.runs.training import train
from jaxenstein.files import atomic
from jaxenstein.progress import Progress
from jaxenstein.view.topdown import draw_map

# Episodes of each seed at each stage; a picture's length in pixels, and the space between two.
EPISODES, SIZE, GAP = 32, 192, 6
COLOUR = np.array([255.0, 96.0, 0.0])
# Of the share of all time: what is drawn in full colour, and what is not drawn any more.
MOST, LEAST = 1e-1, 1e-5


def main(argv: Sequence[str] | None = None) -> None:
    """Train, count and draw."""
    parser = argparse.ArgumentParser(prog="python -m experiments.visits", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("config", type=Path, metavar="CONFIG")
    parser.add_argument("--algo", nargs="+", required=True, metavar="NAME")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("--stages", type=int, default=5, metavar="N")
    options = parser.parse_args(argv)
    given = read_file(options.config)
    folders = [
        RunFolder.open_or_create(options.out / algo, resolve(given | {"algo": algo}))
        for algo in options.algo
    ]
    rows = [counted(folder, options.stages) for folder in folders]
    draw(folders[0].experiment.learner.env.tilemap, rows).save(options.out / "visits.png")
    print(f"wrote {options.out / 'visits.png'}: from above {', '.join(options.algo)}")


def counted(folder: RunFolder, stages: int) -> list[np.ndarray]:
    """int[rows, columns] of each stage, after training up to it."""
    file, updates = folder.path / "visits.json", folder.experiment.config.updates
    kept = json.loads(file.read_text("utf-8")) if file.exists() else {}
    for until in np.linspace(0, updates, stages).round().astype(int).tolist():
        if str(until) not in kept:
            train_until(folder, until)
            kept[str(until)] = visits(folder).tolist()
            with atomic(file) as temporary:
                temporary.write_text(json.dumps(kept), "utf-8")
    train_until(folder, updates)
    return [np.array(kept[until]) for until in sorted(kept, key=int)]


def train_until(folder: RunFolder, until: int) -> None:
    """Train to a stage, with a checkpoint there; one that is further on stays as it is."""
    done = 0

    def notify(update: int, rows: object) -> None:
        nonlocal done
        done = update
        progress.update(update)

    updates = folder.experiment.config.updates
    with Progress(updates, folder.path.name, unit="updates", compiles=True) as progress:
        train(folder, notify=notify, stop=lambda: done >= until)


def visits(folder: RunFolder) -> np.ndarray:
    """int[rows, columns], the steps that all seeds spent on each tile."""
    trained = load_trained(folder.path)
    learner = trained.experiment.learner
    tilemap = learner.env.tilemap
    counts = np.zeros((tilemap.rows, tilemap.columns), int)
    for cells in np.asarray(jax.jit(lambda params: play(learner, params))(trained.params)):
        np.add.at(counts, (cells[:, 1], cells[:, 0]), 1)
    return counts


def play(learner: Learner, params: Any) -> jax.Array:
    """int32[runs, episodes * steps, 2], tiles, for as many steps as an episode can have.

    An episode that ends is followed by the next one.
    """
    env, env_params = dataclasses.replace(learner.env, autoreset="same-step"), learner.env_params
    steps = -(-int(env_params.max_steps_in_episode) // env.frame_skip)
    fresh = jax.tree.map(lambda leaf: jnp.stack([leaf] * EPISODES), learner.initial_carry())

    def of_run(params: Any) -> jax.Array:
        def step(carry: Any, key: jax.Array) -> tuple[Any, jax.Array]:
            obs, state, memory = carry
            action_key, step_key = jax.random.split(key)
            action, memory = learner.act(params, obs, memory, action_key)
            keys = jax.random.split(step_key, EPISODES)
            obs, state, _, terminated, truncated, info = jax.vmap(
                lambda key, state, action: env.step(key, state, action, env_params)
            )(keys, state, action)
            memory = memory.replace(first=terminated | truncated)
            return (obs, state, memory), info["cell"]

        reset_key, step_key = jax.random.split(jax.random.key(0))
        obs, state = jax.vmap(lambda key: env.reset(key, env_params))(
            jax.random.split(reset_key, EPISODES)
        )
        keys = jax.random.split(step_key, steps)
        return jax.lax.scan(step, (obs, state, fresh), keys)[1].reshape(-1, 2)

    return jax.vmap(of_run)(params)


def draw(tilemap: Any, rows: Sequence[Sequence[np.ndarray]]) -> Image.Image:
    """A row for each algorithm, a column for each stage."""
    ground = np.asarray(draw_map(tilemap, size=SIZE).image().convert("RGB"), np.float64)
    high, wide = ground.shape[:2]
    sheet = Image.new(
        "RGB", ((wide + GAP) * len(rows[0]) - GAP, (high + GAP) * len(rows) - GAP), "white"
    )
    for down, stages in enumerate(rows):
        for along, counts in enumerate(stages):
            share = counts / max(counts.sum(), 1)
            bright = np.log10(np.maximum(share, LEAST) / LEAST) / np.log10(MOST / LEAST)
            repeat = high // counts.shape[0]
            weight = np.clip(bright, 0, 1).repeat(repeat, 0).repeat(repeat, 1)[:, :, None]
            mixed = ground * (1 - weight) + COLOUR * weight
            picture = Image.fromarray(mixed.round().astype(np.uint8))
            sheet.paste(picture, (along * (wide + GAP), down * (high + GAP)))
    return sheet


if __name__ == "__main__":
    main()
