"""Scripted players in many running games at a time, whose choices are one compiled call."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from jaxenstein.adapters.vizdoom import Games, GameSession
from jaxenstein.players import players_of

GAMES = 16

Watch = Callable[[int, GameSession], object]
"""Is called with an episode's number in each of its states but the last."""


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
