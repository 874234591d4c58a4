"""Compare frames of Doom's scenarios here and in the game, from the poses of random episodes.

    python -m fidelity.doom_frames [--frames N] [--seed N] [--picture FILE.png]

Needs the extra `vizdoom`. The game plays, and our frame is drawn from each of its states. It
compares the share of pixels with equal labels, the error of depth within the range of the game, and
the difference of colours; textures are a single colour here.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

import jaxenstein
from fidelity.commands import run_command
from jaxenstein.adapters.vizdoom import GameSession
from jaxenstein.cli.arguments import add_seed, whole
from jaxenstein.files import check_writable
from jaxenstein.view.recording import mosaic, save_png

IDS = ("doom-my-way-home", "doom-health-gathering", "doom-health-gathering-supreme")
SIZE = {"height": 120, "width": 160}
# Decisions between two compared frames; an action lasts four tics.
APART, HOLD = 5, 4
# Beyond this distance in map units, the game's depth is constant.
FARTHEST = 450
PICTURES = 4

Pairs = list[tuple[np.ndarray, np.ndarray]]


def collect(id: str, kind: str, frames: int, seed: int) -> Pairs:
    """`frames` frames here and in the game, from the states of random episodes."""
    env, params = jaxenstein.make(id, observation=kind, frame_skip=HOLD, **SIZE)
    draw, random, pairs = jax.jit(env.observe), np.random.default_rng(seed), []
    with GameSession(env, params, seed) as session:
        while len(pairs) < frames:
            for _ in range(APART):
                if session.over:
                    session.reset(session.seed + 1)
                session.step(int(random.integers(env.num_actions)))
            if not session.over:
                ours = np.asarray(draw(session.state, session.params))
                pairs.append((ours, np.asarray(session.observation)))
    return pairs


def compare(id: str, frames: int, seed: int) -> tuple[dict[str, Any], Pairs]:
    """The results of a scenario, and its pairs of pictures."""
    labels = collect(id, "labels", frames, seed)
    depths = collect(id, "depth", frames, seed)
    pictures = collect(id, "rgb", frames, seed)
    unit = jaxenstein.make(id)[0].unit  # type: ignore[attr-defined]
    here, there = (np.stack(side) * unit for side in zip(*depths, strict=True))
    near = here < FARTHEST
    error = np.abs(here - there)[near]
    figures = {
        "labels_equal": float(np.mean([np.mean(a == b) for a, b in labels])),
        "depth_within_range": float(near.mean()),
        "depth_error_units": {str(q): float(np.quantile(error, q / 100)) for q in (50, 90, 99)},
        "colour_difference": float(
            np.mean([np.abs(a.astype(int) - b).mean() for a, b in pictures])
        ),
    }
    return figures, pictures


def main(argv: Sequence[str] | None = None) -> None:
    """Compare all scenarios, print the results, and write pictures."""
    parser = argparse.ArgumentParser(description="Compare frames here and in the game.")
    parser.add_argument(
        "--frames", type=whole(), default=100, help="frames of each (default %(default)s)"
    )
    add_seed(parser)
    parser.add_argument(
        "--picture", type=Path, metavar="FILE", help="write some pairs, ours on top"
    )
    options = parser.parse_args(argv)
    if options.picture:
        check_writable(options.picture)
    shown = []
    for id in IDS:
        figures, pairs = compare(id, options.frames, options.seed)
        shown += pairs[:: max(1, len(pairs) // PICTURES)][:PICTURES]
        errors = ", ".join(f"{q} %: {v:.1f}" for q, v in figures["depth_error_units"].items())
        print(
            f"{id}: {figures['labels_equal']:.2%} of labels equal; depth errors in map units "
            f"({errors}) of the {figures['depth_within_range']:.0%} nearer than {FARTHEST}; "
            f"colours differ by {figures['colour_difference']:.1f} of 255",
            flush=True,
        )
    if options.picture:
        ours, theirs = (np.stack(side) for side in zip(*shown, strict=True))
        rowed = [np.concatenate(pair) for pair in zip(ours, theirs, strict=True)]
        save_png(mosaic(np.stack(rowed), PICTURES), options.picture)


if __name__ == "__main__":
    run_command(main)
