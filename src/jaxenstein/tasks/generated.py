"""Tasks that draw a level at each reset, and which of all levels they draw."""

from __future__ import annotations

import dataclasses
from typing import TypeVar

import jax

from ..about import About
from ..batching import select, where_few
from ..environment import Params, State
from .draws import checked_seeds, sample_seed
from .first_person import FirstPerson

S = TypeVar("S", bound=State)
P = TypeVar("P", bound=Params)


@dataclasses.dataclass(frozen=True, kw_only=True)
class GeneratedTask(FirstPerson[S, P]):
    """Base of tasks that draw a level at each reset; other bases of a task follow this one.

    `init_state` draws what belongs to the level, such as walls and things, from one key and what
    an episode adds, such as its start, from another:

        level_key, start_key = jax.random.split(key)
        level = ...  # drawn from self.level_key(level_key) and nothing else

    Attributes:
        levels: None for levels without end, or seeds of levels: `range(first, stop)` or (first,
            stop), whole numbers from 0 to 2**32 and at most 2**24 of them. Every episode has one
            of these levels, each equally likely. A seed is the same level on every machine.
    """

    levels: tuple[int, int] | range | None = None

    def __post_init__(self) -> None:
        """Check the settings."""
        object.__setattr__(self, "levels", checked_seeds("levels", self.levels))
        super().__post_init__()

    @property
    def level_range(self) -> tuple[int, int] | None:
        """The first seed of a level and the one past the last; None for levels without end."""
        return None if self.levels is None else (int(self.levels[0]), int(self.levels[1]))

    def level_key(self, key: jax.Array) -> jax.Array:
        """The key that a level is drawn from: `key` itself, or that of one of the seeds.

        Args:
            key: of the episode, for nothing else.
        """
        if self.level_range is None:
            return key
        seed = sample_seed(key, self.level_range)
        # The kind of generator that users may change is not to change the levels.
        return jax.random.key(seed, impl="threefry2x32")

    def reset_where(self, over: jax.Array, key: jax.Array, state: S, params: P) -> S:
        """As `Environment.reset_where`; levels are expensive: only those needed are sampled."""
        fresh = where_few(self.first_state)(over, key, jax.lax.stop_gradient(params))
        return select(over, fresh, state)

    def about(self) -> About:
        """What the task says of itself."""
        several = self.level_range is None or self.level_range[1] > self.level_range[0] + 1
        return dataclasses.replace(super().about(), generated=several)
