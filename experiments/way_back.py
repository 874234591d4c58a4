"""The way back: train in ViZDoom with Stable-Baselines3, then act here without further training.

    python -m experiments.way_back [--scenario HealthGathering] [--steps N] [--model FILE.zip]

PPO learns in eight games of `vizdoom.gymnasium_wrapper`, at frame skip 4, from every fourth pixel
of the screen and a hundredth of the rewards. The agent then plays in the game and in our
environment with the same id. Printed are mean returns of sampled actions, with 95 % intervals.
FILE.zip keeps the agent; if it exists, there is no training. Needs extras `sb3` and `vizdoom`.
"""

# pyright: reportMissingImports=false

import argparse
import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.wrappers import TransformObservation, TransformReward
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env

from jaxenstein.adapters.registration import VIZDOOM_SCENARIOS
from jaxenstein.intervals import mean_interval

FRAME_SKIP, APART, GAMES, SCALE = 4, 4, 8, 0.01
SETTINGS: dict[str, Any] = {"n_steps": 128, "batch_size": 256, "n_epochs": 4, "ent_coef": 0.01}


def seen(scenario: str, module: str) -> Any:
    """ViZDoom's environment or ours, by module: uint8[60, 80, 3], pixels of the screen."""
    importlib.import_module(module)
    start = "jaxenstein/" if module == "jaxenstein" else ""
    env = gymnasium.make(f"{start}Vizdoom{scenario}-v1", frame_skip=FRAME_SKIP)
    space = gymnasium.spaces.Box(0, 255, (240 // APART, 320 // APART, 3), np.uint8)
    return TransformObservation(env, lambda told: told["screen"][2::APART, 2::APART].copy(), space)


def trained(scenario: str, steps: int) -> PPO:
    """PPO after so many decisions in the game."""
    game = lambda: seen(scenario, "vizdoom.gymnasium_wrapper")  # noqa: E731
    games = make_vec_env(lambda: TransformReward(game(), lambda r: SCALE * float(r)), GAMES, seed=0)
    model = PPO("CnnPolicy", games, seed=0, verbose=1, device="cpu", **SETTINGS).learn(steps)
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
    parser = argparse.ArgumentParser(description="Train in ViZDoom, act here.")
    parser.add_argument("--scenario", choices=VIZDOOM_SCENARIOS, default="HealthGathering")
    parser.add_argument("--steps", type=int, default=1_000_000, help="decisions in training")
    parser.add_argument("--episodes", type=int, default=100, help="episodes in each place")
    parser.add_argument("--model", type=Path, help="the agent's file, .zip")
    told = parser.parse_args(argv)
    kept = told.model and told.model.exists()
    model = PPO.load(told.model, device="cpu") if kept else trained(told.scenario, told.steps)
    if told.model and not kept:
        model.save(told.model)
    for place, module in (("in ViZDoom", "vizdoom.gymnasium_wrapper"), ("here", "jaxenstein")):
        earned = mean_interval(returns(model, seen(told.scenario, module), told.episodes))
        print(f"{place}: {earned.mean:.4g} ({earned.low:.4g} to {earned.high:.4g})", flush=True)


if __name__ == "__main__":
    main()
