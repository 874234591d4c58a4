"""What players get in Doom's scenarios, here and in the game: mean returns and lengths.

    python -m fidelity.doom_players [--episodes N] [--seed N] [ID ...]

Needs the extra `vizdoom`. The same rules act in both: in the game a scripted player sees our state
of what it shows, the places of its things and its variables. A difference of means that is more
than two of its standard errors is marked.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

import jaxenstein
from fidelity.players import mean_and_error
from jaxenstein.adapters.vizdoom import Games, GameSession
from jaxenstein.players import Played, play, players_of

IDS = (
    "doom-my-way-home",
    "doom-health-gathering",
    "doom-health-gathering-supreme",
    "doom-basic",
    "doom-simpler-basic",
    "doom-rocket-basic",
    "doom-defend-the-center",
    "doom-defend-the-line",
    "doom-deadly-corridor",
    "doom-predict-position",
    "doom-take-cover",
)
# Players of any scenario, and the tics for which they keep an action; its own keep theirs for one.
PLAYERS = (("idle", 1), ("random", 1), ("random", 4))
# Nobody looks: the smallest image that there is.
UNSEEN = {"height": 1, "width": 1, "observation": "depth"}
GAMES = 16

Watch = Callable[[int, GameSession], object]
"""Is called with an episode's number in each of its states but the last."""
APART = 2
"""Standard errors of a difference of means that count as more than chance."""

Mean = tuple[float, float]
"""A mean and its standard error."""


class Row(NamedTuple):
    """One player in one scenario.

    Attributes:
        scenario: id of the environment.
        player: its name.
        frame_skip: tics for which it keeps an action.
        episodes: in each of the two.
        returns: means of the returns, here and in the game.
        lengths: of the decisions that episodes took, likewise.
        successes: shares of episodes with success, likewise.
    """

    scenario: str
    player: str
    frame_skip: int
    episodes: int
    returns: tuple[Mean, Mean]
    lengths: tuple[Mean, Mean]
    successes: tuple[float, float]


def apart(here: Mean, there: Mean) -> float:
    """How many standard errors of their difference two means are apart; `inf` if there is none."""
    # Rewards are summed as float32.
    if math.isclose(here[0], there[0], rel_tol=1e-4):
        return 0.0
    error = math.hypot(here[1], there[1])
    return abs(here[0] - there[0]) / error if error else math.inf


def compare(id: str, name: str, frame_skip: int, episodes: int, seed: int) -> Row:
    """Play a player's episodes in both."""
    env, params = jaxenstein.make(id, frame_skip=frame_skip, **UNSEEN)
    params = env.check_params(params)
    here = play_here(env, params, name, episodes, seed)
    there = play_games(env, params, name, episodes=episodes, seed=seed)
    return Row(
        id,
        name,
        frame_skip,
        episodes,
        (mean_and_error(here.returned), mean_and_error(there.returns)),
        (mean_and_error(here.length), mean_and_error(there.lengths)),
        (float(np.mean(here.successes > 0)), float(there.successes.mean())),
    )


def play_here(env: Any, params: Any, name: str, episodes: int, seed: int) -> Played:
    """Episodes of a player of `players_of` in our environment; their lengths are decisions."""
    keys = jax.random.split(jax.random.key(seed), episodes)
    states = jax.vmap(lambda key: env.init_state(key, params))(keys)
    player = players_of(env)[name]
    return jax.device_get(play(env, player, params, jax.random.key(seed + 1), states))


def ignore(number: int, session: GameSession) -> None:
    """Watch nothing."""


def play_games(
    env: Any,
    params: Any,
    name: str,
    *,
    episodes: int,
    seed: int = 0,
    games: int = GAMES,
    watch: Watch = ignore,
) -> Games:
    """Play whole episodes of a player in the game.

    Args:
        env: a scenario that comes with ViZDoom.
        params: of the environment.
        name: of the player, one of `players_of(env)`.
        episodes: how many.
        seed: of the first episode; the others have the numbers after it.
        games: how many are played side by side.
        watch: looks at the games as they go.
    """
    returns, lengths = np.zeros(episodes, np.float32), np.zeros(episodes, np.int32)
    successes = np.zeros(episodes, bool)
    choose = _chooser(env, params, name)
    sessions = [GameSession(env, params, seed + i) for i in range(min(games, episodes))]
    numbers, following = list(range(len(sessions))), len(sessions)
    try:
        key = jax.random.key(seed)
        while sessions:
            for number, session in zip(numbers, sessions, strict=True):
                watch(number, session)
            key, draw = jax.random.split(key)
            actions = choose(draw, [session.told for session in sessions])
            for i in reversed(range(len(sessions))):
                session, number = sessions[i], numbers[i]
                session.step(actions[i])
                if not session.over:
                    continue
                returns[number] = session.episode_return
                lengths[number] = len(session.actions)
                successes[number] = session.info["success"]
                if following < episodes:
                    numbers[i], following = following, following + 1
                    session.reset((seed + numbers[i]) % 2**32)
                else:
                    session.close()
                    del sessions[i], numbers[i]
    finally:
        for session in sessions:
            session.close()
    return Games(returns, lengths, successes)


def _chooser(env: Any, params: Any, name: str) -> Callable[[jax.Array, list[Any]], list[int]]:
    """A function of a key and of what at most as many games tell as there were first."""
    player = players_of(env)[name]
    choose = player(env, params)
    most = 0

    @jax.jit
    def chosen(key: jax.Array, states: Any) -> jax.Array:
        def one(key: jax.Array, state: Any) -> jax.Array:
            pose = state.fixed_position, state.fixed_velocity, state.angle
            return choose(key, env.at_pose(state, *pose))

        return jax.vmap(one)(jax.random.split(key, states.done.shape[0]), states)

    def ask(key: jax.Array, told: list[Any]) -> list[int]:
        nonlocal most
        most = max(most, len(told))
        # Always of one shape, so that it is compiled once.
        filled = told + told[:1] * (most - len(told))
        actions = chosen(key, jax.tree.map(lambda *leaves: np.stack(leaves), *filled))
        return np.asarray(actions)[: len(told)].tolist()

    return ask


def in_words(row: Row) -> str:
    """A line of the table."""
    columns = [f"{row.scenario:30} {row.player:14} skip {row.frame_skip}"]
    for name, pair in (("return", row.returns), ("length", row.lengths)):
        means = [f"{mean:.4g} +- {error:.2g}" for mean, error in pair]
        mark = "APART" if apart(*pair) > APART else ""
        columns.append(f"{name} {means[0]:>16} {means[1]:>16} {mark:5}")
    columns.append(" ".join(f"{share:4.0%}" for share in row.successes))
    return "  ".join(columns)


def main(argv: Sequence[str] | None = None) -> int:
    """Play, print the table; 1 if a difference is beyond the noise."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    parser.add_argument("ids", nargs="*", metavar="ID", default=IDS, help="(default: all of them)")
    parser.add_argument("--episodes", type=int, default=200, help="in each (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the draws (default %(default)s)")
    parser.add_argument("--only", nargs="+", metavar="PLAYER", help="these players alone")
    options = parser.parse_args(argv)
    rows: list[Row] = []
    for id in options.ids:
        own = [(name, 1) for name in jaxenstein.make(id, **UNSEEN)[0].about().players]
        for name, frame_skip in (*PLAYERS, *own):
            if options.only and name not in options.only:
                continue
            rows.append(compare(id, name, frame_skip, options.episodes, options.seed))
            print(in_words(rows[-1]), flush=True)
    return int(any(apart(*pair) > APART for row in rows for pair in (row.returns, row.lengths)))


if __name__ == "__main__":
    sys.exit(main())
