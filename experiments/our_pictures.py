"""Play in ViZDoom from its pictures and from ours, to find out whether agents miss a difference.

    python -m experiments.our_pictures AGENT [--episodes N] [--greedy]

AGENT is a run directory, an exported file or `pretrained/NAME`, of agents that see colours in a
scenario of ViZDoom. Each agent plays the same episodes of the game twice: from the game's pixels,
and from our picture of each state of the game. If returns from our pictures are those that
`jaxenstein evaluate` finds here, the gap between here and the game comes from the pictures.
Otherwise the rules differ, or what our pictures of the game's states lack: the game does not report
the frames of monsters and of the weapon, so ours show the first ones. Printed are mean returns over
all agents and episodes, with 95 % intervals. Needs the extras `baselines` and `vizdoom`.
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


def returns(trained: Trained, episodes: int, greedy: bool, ours: bool) -> np.ndarray:
    """float32[agents, episodes]: the sums of the game's rewards."""
    found = []
    for run in range(len(trained.experiment.runs)):
        policy = TrainedPolicy(trained, run, greedy)
        acts = from_our_pictures(policy) if ours else policy
        found.append(play_game(policy.env, policy.params, acts, episodes=episodes).returns)
    return np.stack(found)


def main(argv: Sequence[str] | None = None) -> int:
    """Play from both pictures and print."""
    parser = argparse.ArgumentParser(description="Play in ViZDoom from its pictures and ours.")
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
        for whose, ours in (("the game's pictures", False), ("our pictures", True)):
            earned = mean_interval(returns(trained, options.episodes, options.greedy, ours))
            print(f"{whose}: {earned.mean:.4g} ({earned.low:.4g} to {earned.high:.4g})", flush=True)
    except JAXensteinError as error:
        parser.error(str(error))
    return 0


if __name__ == "__main__":
    sys.exit(main())
