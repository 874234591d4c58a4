"""How many levels the environments have, and what that means for those who hold some out."""

from __future__ import annotations

import dataclasses
import functools
import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from .errors import LevelWarning, SettingError
from .fields import names_of

FILE = Path(__file__).with_name("level_counts.json")
"""Written by `python -m reliability.levels`."""
# Levels that `make` draws to see that a split has some; more than any split needs that is of use.
DRAWS = 4096
# Other seeds are no test where so many of their levels are among the chosen ones.
MUCH = 0.1


@dataclasses.dataclass(frozen=True)
class LevelCount:
    """How many levels an environment has.

    Attributes:
        levels: how many, or fewer than there are.
        exact: whether it is their number; else there are at least so many.
        version: of the environment whose levels were counted.
    """

    levels: int
    exact: bool
    version: int

    @property
    def short(self) -> str:
        """Such as "108", or "10,000+" for at least so many."""
        return f"{self.levels:,}{'' if self.exact else '+'}"

    @property
    def words(self) -> str:
        """Such as "108", or "at least 10,000"."""
        return f"{'' if self.exact else 'at least '}{self.levels:,}"


@functools.cache
def level_counts() -> dict[str, LevelCount]:
    """The environments that draw a level at each reset, by their ids, with how many they have."""
    stored = json.loads(FILE.read_text("utf-8"))
    return {name: LevelCount(**row) for name, row in stored.items()}


def check_levels(env: Any, stacklevel: int = 3) -> None:
    """Tell where what `make` was asked for holds no levels out.

    Args:
        env: an environment of any task.
        stacklevel: whose line a warning names, as for `warnings.warn`.

    Raises:
        SettingError: a side of the split has no levels.
    """
    from .tasks.first_person import GeneratedTask

    if not isinstance(env, GeneratedTask):
        return
    if env.split is not None:
        _check_split(env)
        return
    count, seeds = level_counts().get(env.name), env.level_range
    # One level alone is chosen to be the only one.
    if count is None or not count.exact or seeds is None or seeds[1] - seeds[0] == 1:
        return
    share = 1 - (1 - 1 / count.levels) ** (seeds[1] - seeds[0])
    if share >= MUCH:
        warnings.warn(
            f"{env.name} has {count.levels:,} levels in all, and levels=({seeds[0]}, {seeds[1]}) "
            f"has about {share:.0%} of them: other seeds draw these again, and are no test with "
            "levels never seen; split='train' and split='test' have none in common",
            LevelWarning,
            stacklevel=stacklevel,
        )


def _check_split(env: Any) -> None:
    """Raise where a side has no levels; of some seeds only the side that is asked for counts."""
    from .tasks.splits import is_of

    levels, fraction = _drawn(_bare(env)), float(env.test_fraction)
    sides = ("train", "test") if env.level_range is None else (env.split,)
    empty = [side for side in sides if not np.any(is_of(side, fraction, levels.T))]
    if not empty:
        return
    different = len(np.unique(levels, axis=0))
    seeds = "" if env.level_range is None else f" with levels={env.level_range}"
    raise SettingError(
        f"the {empty[0]} split of {env.name!r}{seeds} has no levels: of {DRAWS} that were drawn, "
        f"{different} different one{'s' * (different > 1)}, none is in it with "
        f"test_fraction={fraction:g}; take a {'larger' if empty[0] == 'test' else 'smaller'} one"
        f"{' or more levels' * (env.level_range is not None)}"
    )


def _bare(env: Any) -> Any:
    """An environment with the same levels, which is equal for all splits and kinds of frames."""
    from .tasks.first_person import SETTINGS

    usual = {field.name: field.default for field in dataclasses.fields(env)}
    names = {"split", "test_fraction", *SETTINGS} & set(names_of(type(env)))
    return dataclasses.replace(env, **{name: usual[name] for name in names})


@functools.lru_cache(maxsize=64)
def _drawn(env: Any) -> np.ndarray:
    """uint32[DRAWS, 2]: the hashes of some levels."""
    from .tasks.splits import sample_levels

    return np.asarray(sample_levels(env, DRAWS, 0))
