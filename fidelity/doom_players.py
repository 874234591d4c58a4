"""Compare the returns of scripted players in Doom's scenarios here and in the game.

    python -m fidelity.doom_players [--episodes N] [--seed N] [--only PLAYER ...] [ID ...]

Needs the extra `vizdoom`. The same players act in both: in the game, they see our state, filled
from the objects and the variables of the game. It prints mean returns and lengths, and marks
differences of more than two standard errors.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

import jaxenstein
from fidelity.commands import run_command
from fidelity.players import mean_and_error
from jaxenstein.adapters.vizdoom import Games, GameSession
from jaxenstein.cli.arguments import whole
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
# Players for all scenarios, with the tics that an action lasts; other players use one tic.
PLAYERS = (("idle", 1), ("random", 1), ("random", 4))
# The smallest image, since players do not use it.
UNSEEN = {"height": 1, "width": 1, "observation": "depth"}
GAMES = 16

Watch = Callable[[int, GameSession], object]
"""Called with the number of an episode in each of its states except the last."""
APART = 2
"""The number of standard errors from which a difference is marked."""

Mean = tuple[float, float]
"""A mean and its standard error."""


class Row(NamedTuple):
    """One player in one scenario.

    Attributes:
        scenario: id of the environment.
        player: name of the player.
        frame_skip: tics per action.
        episodes: number of episodes, here and in the game each.
        returns: mean returns, here and in the game.
        lengths: mean numbers of decisions, here and in the game.
        successes: success rates, here and in the game.
    """

    scenario: str
    player: str
    frame_skip: int
    episodes: int
    returns: tuple[Mean, Mean]
    lengths: tuple[Mean, Mean]
    successes: tuple[float, float]


def apart(here: Mean, there: Mean) -> float:
    """The difference of two means in standard errors; `inf` if the error is 0."""
    # Rewards are summed as float32.
    if math.isclose(here[0], there[0], rel_tol=1e-4):
        return 0.0
    error = math.hypot(here[1], there[1])
    return abs(here[0] - there[0]) / error if error else math.inf


def compare(id: str, name: str, frame_skip: int, episodes: int, seed: int) -> Row:
    """Play the episodes of a player here and in the game."""
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
    """Play episodes in our environment; lengths count decisions."""
    keys = jax.random.split(jax.random.key(seed), episodes)
    states = jax.vmap(lambda key: env.init_state(key, params))(keys)
    player = players_of(env)[name]
    return jax.device_get(play(env, player, params, jax.random.key(seed + 1), states))


def ignore(number: int, session: GameSession) -> None:
    """Do nothing."""


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
        env: an environment with a ViZDoom scenario.
        params: params of the environment.
        name: name of the player, from `players_of(env)`.
        episodes: number of episodes.
        seed: seed of the first episode; the next episodes have the next seeds.
        games: number of parallel games.
        watch: called in every state.
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
    """A function that maps a key and the states of some games to actions."""
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
        # Always the same shape, so that it is compiled once.
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
    """Play and print the table; return 1 if a difference is larger than chance explains."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    parser.add_argument(
        "ids",
        nargs="*",
        metavar="ID",
        default=IDS,
        help="scenarios (default: all but doom-deathmatch)",
    )
    parser.add_argument(
        "--episodes", type=whole(), default=200, help="episodes (default %(default)s)"
    )
    parser.add_argument(
        "--seed", type=whole(0), default=0, help="random seed (default %(default)s)"
    )
    parser.add_argument("--only", nargs="+", metavar="PLAYER", help="only these players")
    options = parser.parse_args(argv)
    played = [
        (id, name, frame_skip)
        for id in options.ids
        for own in [jaxenstein.make(id, **UNSEEN)[0].about().players]
        for name, frame_skip in (*PLAYERS, *((name, 1) for name in own))
    ]
    known = dict.fromkeys(name for _, name, _ in played)
    for name in options.only or ():
        if name not in known:
            parser.error(f"--only: {name!r} should be one of {', '.join(known)}")
    rows: list[Row] = []
    for id, name, frame_skip in played:
        if not options.only or name in options.only:
            rows.append(compare(id, name, frame_skip, options.episodes, options.seed))
            print(in_words(rows[-1]), flush=True)
    return int(any(apart(*pair) > APART for row in rows for pair in (row.returns, row.lengths)))


if __name__ == "__main__":
    run_command(main)
