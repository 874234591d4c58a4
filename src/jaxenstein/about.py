"""What a task says of itself beside its rules, for people, for players and for tests."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import jax

Choose = Callable[[jax.Array, Any], jax.Array]
"""(key, state) -> int32[], the next action; it keeps nothing from one step to the next."""


@dataclasses.dataclass(frozen=True)
class Event:
    """What may happen in a step: an entry of `info` that is false, or zero, where it does not.

    Attributes:
        one: what happened, in words that follow "the agent", such as "opened a door".
        several: the same for a count of two or more, {} standing for the number; "" if the entry
            is no count.
    """

    one: str
    several: str = ""

    def in_words(self, count: int) -> str:
        """What happened `count` times, at least once."""
        return self.several.format(count) if self.several and count > 1 else self.one


@dataclasses.dataclass(frozen=True)
class Player:
    """A scripted player: it reads the state, not the picture.

    Attributes:
        summary: what it does, for people.
        make: a function of an environment and its params that returns `choose(key, state)`, which
            is pure, so that it runs under `jax.jit`, `jax.vmap` and `jax.lax.scan`.
        waits: why it takes no action where it takes none, for captions.
    """

    summary: str
    make: Callable[[Any, Any], Choose]
    waits: str = ""

    def __call__(self, env: Any, params: Any) -> Choose:
        """The function that chooses the actions in an environment with these params."""
        return self.make(env, params)


@dataclasses.dataclass(frozen=True)
class About:
    """What a task says of itself. Whatever is left out is not shown, and no task must say more.

    Attributes:
        aim: what `info["success"]` means, in words that follow "the agent".
        ends: where the task itself ends an episode, in words that follow "terminated"; "" if it
            never does.
        rewards: what its params pay: words for each by its name, {:+g} standing for the number.
        events: the events of `info` by name, in the order in which they are told.
        variables: what `describe` adds to `info`: the meaning of each by its name.
        captions: which of them the captions of pictures show.
        players: the scripted players that know the task, by name.
        expert: the name of the one who does it best; "" if there is none.
        generated: whether every reset generates a new map.
        lasting: fields of the state, bool arrays, what is true in which stays so until the agent
            is put at a start again.
        holds: what is true of every state from which an episode goes on, in words.
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
