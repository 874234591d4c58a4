"""How a task describes itself to people, players and tests."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import jax

Choose = Callable[[jax.Array, Any], jax.Array]
"""(key, state) -> int32[], the next action; a pure function without memory."""


@dataclasses.dataclass(frozen=True)
class Event:
    """An event that can happen in a step: an entry of `info` that is otherwise false or zero.

    Attributes:
        one: the event in words that follow "the agent", such as "opened a door".
        several: the same words for a count of two or more, with {} for the number; "" if the
            entry is not a count.
    """

    one: str
    several: str = ""

    def in_words(self, count: int) -> str:
        """Describe the event when it happened `count` times (at least once)."""
        return self.several.format(count) if self.several and count > 1 else self.one


@dataclasses.dataclass(frozen=True)
class Player:
    """A scripted player, which reads the state instead of the image.

    Attributes:
        summary: a one-line description.
        make: a function of an environment and its params that returns `choose(key, state)`, a
            pure function that works under `jax.jit`, `jax.vmap` and `jax.lax.scan`.
        waits: for captions, the reason why it sometimes takes no action.
    """

    summary: str
    make: Callable[[Any, Any], Choose]
    waits: str = ""

    def __call__(self, env: Any, params: Any) -> Choose:
        """The function that chooses actions in an environment with these params."""
        return self.make(env, params)


@dataclasses.dataclass(frozen=True)
class About:
    """How a task describes itself. Every part is optional; empty parts are not shown.

    Attributes:
        aim: the meaning of `info["success"]`, in words that follow "the agent".
        ends: when the task itself ends an episode, in words that follow "terminated"; "" if it
            never does.
        rewards: the rewards that params set, by param name, in words with {:+g} for the number.
        events: the events in `info` by name, in the order in which they are shown.
        variables: the meanings of the entries that `describe` adds to `info`, by name.
        captions: the variables that captions of pictures show.
        players: the scripted players that know the task, by name.
        expert: the name of the best of these players; "" if there is none.
        generated: whether every reset generates a new map.
        lasting: names of bool arrays in the state whose entries, once true, stay true until the
            agent is put back to a start.
        holds: invariants by their description: functions of a state that are true in every state
            of an unfinished episode.
    """

    aim: str = "ended the episode with a positive reward"
    ends: str = "by the task"
    rewards: Mapping[str, str] = dataclasses.field(default_factory=dict)
    events: Mapping[str, Event] = dataclasses.field(default_factory=dict)
    variables: Mapping[str, str] = dataclasses.field(default_factory=dict)
    captions: tuple[str, ...] = ()
    players: Mapping[str, Player] = dataclasses.field(default_factory=dict)
    expert: str = ""
    generated: bool = False
    lasting: tuple[str, ...] = ()
    holds: Mapping[str, Callable[[Any], jax.Array]] = dataclasses.field(default_factory=dict)
