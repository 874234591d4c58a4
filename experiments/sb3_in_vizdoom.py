"""Train sb3-contrib's RecurrentPPO on ViZDoom's My Way Home for a given time.

    python -m experiments.sb3_in_vizdoom --out FILE [--minutes M] [--seed N] [--envs 16]

Network and hyperparameters are those of the paper (`benchmarks/subjects/sb3.py`), except for two
that the tuned recipe found better on this map: a discount of 0.99 and a constant learning rate.
Frames are 64x64, with frame skip 4. FILE gets a row after each rollout, like those of
`experiments.in_vizdoom`. Run it with the interpreter of `python -m benchmarks.install training`. It
uses no environment of this project.
"""

# pyright: reportMissingImports=false

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.subjects.sb3 import make_model, make_vector

FRAME_SKIP = 4
# More steps than any training takes.
ENDLESS = 10**9


def train(out: Path, minutes: float, seed: int, envs: int) -> None:
    """Train one agent, and write a row after each rollout."""
    from stable_baselines3.common.callbacks import BaseCallback

    class Tally(BaseCallback):
        """Counts episodes, and those that ended at the armour: the only positive reward."""

        def _on_training_start(self) -> None:
            self.begin = time.perf_counter()
            self.episodes = self.successes = 0

        def _on_step(self) -> bool:
            ended = self.locals["dones"]
            self.episodes += int(ended.sum())
            self.successes += int((ended & (self.locals["rewards"] > 0.5)).sum())
            return time.perf_counter() - self.begin < 60 * minutes

        def _on_rollout_end(self) -> None:
            seconds = time.perf_counter() - self.begin
            row = {"seed": seed, "steps": self.num_timesteps, "seconds": round(seconds, 1)}
            row |= {"episodes": self.episodes, "successes": self.successes}
            self.episodes = self.successes = 0
            with out.open("a") as file:
                file.write(json.dumps(row) + "\n")
            print(row, file=sys.stderr)

    env = make_vector(envs, "dummy", frame_skip=FRAME_SKIP)
    changed: dict[str, Any] = {"gamma": 0.99, "learning_rate": 2.5e-4, "seed": seed}
    make_model(env, 128, **changed).learn(ENDLESS, callback=Tally())
    env.close()


def main(argv: Sequence[str] | None = None) -> None:
    """Read the command line and train."""
    parser = argparse.ArgumentParser(description="Train RecurrentPPO in ViZDoom.")
    parser.add_argument("--out", required=True, type=Path, help="a new JSON Lines file")
    parser.add_argument("--minutes", type=float, default=15.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--envs", type=int, default=16)
    options = parser.parse_args(argv)
    if options.out.exists():
        parser.error(f"{options.out} already exists")
    options.out.touch()
    train(options.out, options.minutes, options.seed, options.envs)


if __name__ == "__main__":
    main()
