"""Train Stable-Baselines3's PPO in ViZDoom; the agent then plays in the game and here.

    python -m experiments.sb3_in_vizdoom [--scenario HealthGathering] [--minutes M] [--seed N]
        [--model FILE.zip] [--rows FILE.jsonl]

The settings are those of ViZDoom's example: 32 games of `vizdoom.gymnasium_wrapper`, frame skip 4,
80x60 pixels, a hundredth of the rewards, rollouts of 128 steps, and otherwise the defaults of
`stable_baselines3.PPO`. The frames are every fourth pixel of the screen, which our environments
draw, too. The agent then plays here without further training. The program prints the mean returns
of sampled actions, with 95 % intervals.

`--model` keeps the agent; if the file exists, there is no training. `--rows` keeps a row for each
rollout, like those of `experiments.in_vizdoom`; a success is an episode with a positive return, as
in My Way Home. Needs the extras `sb3` and `vizdoom`.
"""

# pyright: reportMissingImports=false

import argparse
import importlib
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.wrappers import TransformObservation, TransformReward
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.env_util import make_vec_env

from experiments.in_vizdoom import CLOCKS
from fidelity.commands import positive
from jaxenstein.adapters.registration import VIZDOOM_SCENARIOS
from jaxenstein.files import append, check_writable
from jaxenstein.intervals import mean_interval

FRAME_SKIP, APART, GAMES, SCALE = 4, 4, 32, 0.01
SETTINGS: dict[str, Any] = {"n_steps": 128}
# More steps than any training takes.
ENDLESS = 10**9


class Tally(BaseCallback):
    """Writes a row after each rollout, and ends the training after some minutes."""

    def __init__(self, minutes: float, clock: Callable[[], float], rows: Path | None) -> None:
        """Write rows to a file, unless it is None."""
        super().__init__()
        self._minutes, self._clock, self._rows = minutes, clock, rows
        self._returns: list[float] = []

    def _on_training_start(self) -> None:
        self._begin = self._clock()

    def _on_step(self) -> bool:
        ended = [info["episode"]["r"] for info in self.locals["infos"] if "episode" in info]
        self._returns += [value / SCALE for value in ended]
        return self._clock() - self._begin < 60 * self._minutes

    def _on_rollout_end(self) -> None:
        row = {
            "seed": self.model.seed,
            "steps": self.num_timesteps,
            "seconds": round(self._clock() - self._begin, 1),
            "episodes": len(self._returns),
            "return_sum": float(np.sum(self._returns)),
            "successes": int(np.sum(np.array(self._returns) > 0)),
        }
        self._returns = []
        if self._rows:
            append(self._rows, json.dumps(row) + "\n")


def seen(scenario: str, module: str) -> Any:
    """ViZDoom's environment or ours, by module: uint8[60, 80, 3], pixels of the screen."""
    importlib.import_module(module)
    start = "jaxenstein/" if module == "jaxenstein" else ""
    env = gymnasium.make(f"{start}Vizdoom{scenario}-v1", frame_skip=FRAME_SKIP)
    space = gymnasium.spaces.Box(0, 255, (240 // APART, 320 // APART, 3), np.uint8)
    return TransformObservation(env, lambda told: told["screen"][2::APART, 2::APART].copy(), space)


def trained(scenario: str, seed: int, tally: Tally) -> PPO:
    """The agent at the end of its training in the game."""
    game = lambda: seen(scenario, "vizdoom.gymnasium_wrapper")  # noqa: E731
    games = make_vec_env(
        lambda: TransformReward(game(), lambda reward: SCALE * float(reward)), GAMES, seed=seed
    )
    model = PPO("CnnPolicy", games, seed=seed, verbose=1, device="cpu", **SETTINGS)
    model.learn(ENDLESS, callback=tally)
    games.close()
    return model


def returns(model: PPO, env: Any, episodes: int) -> np.ndarray:
    """float64[1, episodes]: sums of the game's own rewards."""
    totals = np.zeros((1, episodes))
    for number in range(episodes):
        obs, over = env.reset(seed=number)[0], False
        while not over:
            obs, reward, *ends, _ = env.step(int(model.predict(obs)[0]))
            totals[0, number] += reward
            over = any(ends)
    return totals


def main(argv: Sequence[str] | None = None) -> None:
    """Train or load, play in both, print."""
    parser = argparse.ArgumentParser(description="Train in ViZDoom, act there and here.")
    parser.add_argument("--scenario", choices=VIZDOOM_SCENARIOS, default="HealthGathering")
    parser.add_argument("--minutes", type=positive, default=60.0, help="of training (default 60)")
    parser.add_argument("--clock", choices=CLOCKS, default="wall")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--episodes", type=int, default=100, help="episodes in each place")
    parser.add_argument("--model", type=Path, help="the agent's file, .zip")
    parser.add_argument("--rows", type=Path, help="a new JSON Lines file")
    told = parser.parse_args(argv)
    if told.episodes < 1:
        parser.error(f"--episodes should be at least 1, not {told.episodes}")
    if told.rows and told.rows.exists():
        parser.error(f"{told.rows} already exists")
    for file in filter(None, (told.rows, told.model)):
        check_writable(file)
    if kept := told.model and told.model.exists():
        model = PPO.load(told.model, device="cpu")
    else:
        tally = Tally(told.minutes, CLOCKS[told.clock], told.rows)
        model = trained(told.scenario, told.seed, tally)
    if told.model and not kept:
        model.save(told.model)
    for place, module in (("in ViZDoom", "vizdoom.gymnasium_wrapper"), ("here", "jaxenstein")):
        earned = mean_interval(returns(model, seen(told.scenario, module), told.episodes))
        print(f"{place}: {earned.mean:.4g} ({earned.low:.4g} to {earned.high:.4g})", flush=True)


if __name__ == "__main__":
    main()
