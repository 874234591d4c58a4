"""What players get in Doom's scenarios, here and in the game: mean returns side by side.

    python -m fidelity.doom_players [--episodes N] [--seed N] [--json FILE] [ID ...]

Needs the extra `vizdoom`. The same players act in both; a difference of means that is more than
two of its standard errors is marked.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import jax
import numpy as np

import jaxenstein
from fidelity.players import mean_and_error
from jaxenstein.adapters.vizdoom import play_game
from jaxenstein.episodes.policies import named_policy
from jaxenstein.files import atomic, check_writable
from jaxenstein.players import play, players_of

IDS = (
    "doom-my-way-home",
    "doom-health-gathering",
    "doom-health-gathering-supreme",
    "doom-basic",
    "doom-simpler-basic",
    "doom-defend-the-center",
    "doom-defend-the-line",
    "doom-take-cover",
    "doom-rocket-basic",
    "doom-predict-position",
    "doom-deadly-corridor",
)
# A player of `players_of`, or the expert, and the tics for which it keeps an action.
PLAYERS = (("idle", 1), ("uniform", 1), ("uniform", 4), ("expert", 1))
# Nobody looks: the smallest image that there is.
UNSEEN = {"height": 1, "width": 1, "observation": "depth"}


class Row(NamedTuple):
    """One player in one scenario; means with their standard errors.

    Attributes:
        scenario: id of the environment.
        player: its name.
        frame_skip: tics for which it keeps an action.
        here: mean return and its error.
        there: the same in the game.
        successes: shares of episodes with success, here and there.
        errors_apart: how many standard errors the means are apart.
    """

    scenario: str
    player: str
    frame_skip: int
    here: tuple[float, float]
    there: tuple[float, float]
    successes: tuple[float, float]
    errors_apart: float


def compare(id: str, name: str, frame_skip: int, episodes: int, seed: int) -> Row:
    """Play a player's episodes in both."""
    env, params = jaxenstein.make(id, frame_skip=frame_skip, **UNSEEN)
    params = env.check_params(params)
    players = players_of(env)
    chosen = env.about().expert if name == "expert" else name
    keys = jax.random.split(jax.random.key(seed), episodes)
    states = jax.vmap(lambda key: env.init_state(key, params))(keys)
    played = jax.device_get(play(env, players[chosen], params, jax.random.key(seed + 1), states))
    policy = named_policy("random" if name == "uniform" else name, env, params, seed)
    games = play_game(env, params, policy, episodes=episodes, seed=seed)
    here, there = mean_and_error(played.returned), mean_and_error(games.returns)
    # Rewards are summed as float32.
    apart = 0.0 if math.isclose(here[0], there[0], rel_tol=1e-4) else abs(here[0] - there[0])
    error = math.hypot(here[1], there[1])
    return Row(
        id,
        name,
        frame_skip,
        here,
        there,
        (float(np.mean(played.successes > 0)), float(games.successes.mean())),
        apart / error if error else math.inf if apart else 0.0,
    )


def in_words(row: Row) -> str:
    """A line of the table."""
    means = [f"{mean:.4g} +- {error:.2g}" for mean, error in (row.here, row.there)]
    shares = [f"{share:.0%}" for share in row.successes]
    mark = "  APART" if row.errors_apart > 2 else ""
    return (
        f"{row.scenario:30} {row.player:8} skip {row.frame_skip}  here {means[0]:16} {shares[0]:>5}"
        f"  there {means[1]:16} {shares[1]:>5}{mark}"
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Play, print the table, write the file; 1 if a difference is beyond the noise."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    parser.add_argument("ids", nargs="*", metavar="ID", default=IDS, help="(default: all of them)")
    parser.add_argument("--episodes", type=int, default=100, help="in each (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the draws (default %(default)s)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures here")
    options = parser.parse_args(argv)
    if options.json:
        check_writable(options.json)
    rows = []
    for id in options.ids:
        for name, frame_skip in PLAYERS:
            rows.append(compare(id, name, frame_skip, options.episodes, options.seed))
            print(in_words(rows[-1]), flush=True)
    if options.json:
        with atomic(options.json) as path:
            path.write_text(json.dumps([row._asdict() for row in rows], indent=1))
    return int(any(row.errors_apart > 2 for row in rows))


if __name__ == "__main__":
    sys.exit(main())
