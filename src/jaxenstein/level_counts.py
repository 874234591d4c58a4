"""The numbers of levels of the environments, and checks of `levels` and `split`."""

from __future__ import annotations

import dataclasses
import functools
import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from .errors import LevelWarning, SettingError, quoted
from .fields import names_of

FILE = Path(__file__).with_name("level_counts.json")
"""Written by `python -m reliability.levels`."""
# How many levels `make` draws to check that both sides of a split have some.
DRAWS = 4096
# From this share of all levels on, other seeds too often draw levels that were chosen.
MUCH = 0.1


@dataclasses.dataclass(frozen=True)
class LevelCount:
    """The number of levels of an environment.

    Attributes:
        levels: the number, or a lower bound.
        exact: whether `levels` is exact.
        version: the version of the environment when its levels were counted.
    """

    levels: int
    exact: bool
    version: int

    @property
    def short(self) -> str:
        """The number in digits, such as "108", or "10,000+" for a lower bound."""
        return f"{self.levels:,}{'' if self.exact else '+'}"

    @property
    def words(self) -> str:
        """The number in words, such as "108" or "at least 10,000"."""
        return f"{'' if self.exact else 'at least '}{self.levels:,}"


@functools.cache
def level_counts() -> dict[str, LevelCount]:
    """The level counts by id, for environments that draw a level at each reset."""
    stored = json.loads(FILE.read_text("utf-8"))
    return {name: LevelCount(**row) for name, row in stored.items()}


def check_levels(env: Any, stacklevel: int = 3) -> None:
    """Check that the `levels` and `split` of an environment leave unseen levels.

    Args:
        env: an environment of any task.
        stacklevel: as for `warnings.warn`.

    Raises:
        SettingError: a side of the split has no levels.

    Warns:
        LevelWarning: there is no split, and `levels` covers a tenth of all levels or more.
    """
    from .tasks.first_person import GeneratedTask

    if not isinstance(env, GeneratedTask):
        return
    if env.split is not None:
        _check_split(env)
        return
    count, seeds = level_counts().get(env.name), env.level_range
    # A single level is a deliberate choice.
    if count is None or not count.exact or seeds is None or seeds[1] - seeds[0] == 1:
        return
    share = 1 - (1 - 1 / count.levels) ** (seeds[1] - seeds[0])
    if share >= MUCH and _has_usual_levels(env):
        warnings.warn(
            f"{env.name} has {count.levels:,} level{'s' * (count.levels > 1)}, and "
            f"levels=({seeds[0]}, {seeds[1]}) covers about {share:.0%} of them: "
            "other seeds draw the same levels again; to test on unseen levels use split='train' "
            "and split='test'",
            LevelWarning,
            stacklevel=stacklevel,
        )


def _check_split(env: Any) -> None:
    """Raise if a side has no levels; with `levels`, only check the side of `env.split`."""
    from .tasks.splits import is_in_split

    levels, fraction = _drawn(_bare(env)), float(env.test_fraction)
    sides = ("train", "test") if env.level_range is None else (env.split,)
    empty = [side for side in sides if not np.any(is_in_split(side, fraction, levels.T))]
    if not empty:
        return
    different = len(np.unique(levels, axis=0))
    seeds = "" if env.level_range is None else f" with levels={env.level_range}"
    raise SettingError(
        f"the {empty[0]} split of {quoted(env.name)}{seeds} has no levels: {DRAWS} draws found "
        f"{different} level{'s' * (different > 1)}, none of them in it with "
        f"test_fraction={fraction:g}; give a {'larger' if empty[0] == 'test' else 'smaller'} "
        f"test_fraction{' or more levels' * (env.level_range is not None)}"
    )


def _has_usual_levels(env: Any) -> bool:
    """Whether an environment draws from the levels that its id has without settings."""
    from .registry import make_with

    usual = make_with(env.name, {})[0]
    one, other = (dataclasses.replace(_bare(each), levels=None) for each in (env, usual))
    return one == other


def _bare(env: Any) -> Any:
    """An environment with the same levels but without settings that do not affect them."""
    from .tasks.first_person import SETTINGS

    usual = {field.name: field.default for field in dataclasses.fields(env)}
    names = {"split", "test_fraction", *SETTINGS} & set(names_of(type(env)))
    return dataclasses.replace(env, **{name: usual[name] for name in names})


@functools.lru_cache(maxsize=64)
def _drawn(env: Any) -> np.ndarray:
    """uint32[DRAWS, 2]: the hashes of some levels."""
    from .tasks.splits import sample_levels

    return np.asarray(sample_levels(env, DRAWS, 0))
