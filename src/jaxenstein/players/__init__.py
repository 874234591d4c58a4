"""Scripted players: what a task yields to nobody, to chance, and to one who sees the whole state.

Nothing here knows a task. Tasks declare who else plays them (`Environment.about`), and find here
what such players are made of: `walking` has paths and steps, `playing` plays many episodes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..about import Choose, Player
from ..errors import SettingError, nearest
from .chance import IDLE, UNIFORM
from .playing import Played, play

if TYPE_CHECKING:
    from ..environment import AnyEnvironment

EXPERT = "expert"
"""Stands for the name of the player who does the task best."""


def players_of(env: AnyEnvironment) -> dict[str, Player]:
    """All players of an environment by name: nobody, chance, and those of its task."""
    return {"idle": IDLE, "uniform": UNIFORM, **env.about().players}


def player_of(env: AnyEnvironment, name: str = EXPERT) -> Player:
    """The player of a name; `"expert"` is the one who does the task best.

    Raises:
        SettingError: the environment has no such player; the message names those it has.
    """
    players = players_of(env)
    wanted = env.about().expert if name == EXPERT else name
    if wanted not in players:
        known = ", ".join(players)
        raise SettingError(
            f"{env.name!r} has no player {name!r}{nearest(name, players)}; it has {known}"
        )
    return players[wanted]


__all__ = [
    "EXPERT",
    "IDLE",
    "UNIFORM",
    "Choose",
    "Played",
    "Player",
    "play",
    "player_of",
    "players_of",
]
