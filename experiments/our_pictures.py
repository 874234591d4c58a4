"""Play in ViZDoom from our pictures, to find out whether pictures explain a difference.

    python -m experiments.our_pictures AGENT [--episodes N] [--greedy]

AGENT is a run directory, an exported file or `pretrained/NAME`, of agents that see colours in a
scenario of ViZDoom. Each agent plays episodes of the game, and sees our picture of each state of
the game. Printed is the mean return over all agents and episodes, with its 95 % interval.

Compare it with `jaxenstein evaluate AGENT`, here, and with `--in vizdoom`, from the game's pixels
of the same episodes. If it equals the return here, the gap comes from the pictures. Otherwise the
rules differ, or what our pictures of the game's states lack: the game does not report the frames of
monsters and of the weapon, so ours show the first ones. Needs the extras `baselines` and `vizdoom`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Any

import jax
import numpy as np

from jaxenstein.adapters.vizdoom import play_game
from jaxenstein.baselines.runs.policies import TrainedPolicy
from jaxenstein.baselines.runs.trained import Trained, load_trained
from jaxenstein.episodes.policies import Policy
from jaxenstein.errors import JAXensteinError
from jaxenstein.intervals import mean_interval


def from_our_pictures(policy: TrainedPolicy) -> Policy:
    """The agent, with our picture of the game's state in place of the game's."""
    draw = jax.jit(policy.env.observe)

    def act(session: Any) -> int:
        session.observation = jax.device_get(draw(session.state, session.params))
        return policy(session)

    return act


def returns(trained: Trained, episodes: int, greedy: bool) -> np.ndarray:
    """float32[agents, episodes]: the sums of the game's rewards."""
    found = []
    for run in range(len(trained.experiment.runs)):
        policy = TrainedPolicy(trained, run, greedy)
        act = from_our_pictures(policy)
        found.append(play_game(policy.env, policy.params, act, episodes=episodes).returns)
    return np.stack(found)


def main(argv: Sequence[str] | None = None) -> int:
    """Play and print."""
    parser = argparse.ArgumentParser(description="Play in ViZDoom from our pictures.")
    parser.add_argument("agent", metavar="AGENT", help="a run directory or an agent")
    parser.add_argument(
        "--episodes", type=int, default=100, help="of each agent (default %(default)s)"
    )
    parser.add_argument("--greedy", action="store_true", help="take the most likely actions")
    options = parser.parse_args(argv)
    if options.episodes < 1:
        parser.error(f"--episodes should be at least 1, not {options.episodes}")
    try:
        trained = load_trained(options.agent)
        earned = mean_interval(returns(trained, options.episodes, options.greedy))
    except JAXensteinError as error:
        parser.error(str(error))
    print(f"{earned.mean:.4g} ({earned.low:.4g} to {earned.high:.4g})")
    return 0


if __name__ == "__main__":
    sys.exit(main())
