"""The algorithms by name: PPO with one exploration bonus or another."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from ...errors import SettingError
from ...fields import Domain, check, check_value, names_of
from ...pytree import PyTreeNode

if TYPE_CHECKING:
    from .bonus import Bonus
    from .config import Config
    from .observations import ObservationSpec


@dataclasses.dataclass(frozen=True)
class BonusSettings:
    """What a bonus is told that shapes its program: frozen and hashable; here nothing.

    Those of a bonus are fields of a subclass, each a bool or declared by `jaxenstein.fields`:
    `number(8, 1)` for whole numbers from 1, `choice` for words. Options of their names are flags
    and lines of files, so they begin with the bonus'.
    """

    def __post_init__(self) -> None:
        """Check every field."""
        check(self)


class BonusNumbers(PyTreeNode):
    """Numbers of a bonus that may differ between runs of one program: here none.

    Those of a bonus are fields of a subclass, named as its settings are, and declared as
    `jaxenstein.fields.number(0.1, 0)` does for numbers from 0.
    """


@dataclasses.dataclass(frozen=True, eq=False)
class Algorithm:
    """PPO with a bonus.

    Attributes:
        bonus: makes it for observations, a number of actions and a config.
        settings: the class of its settings.
        numbers: the class of its numbers.
        grid: values of numbers that the paper sweeps, by name; None if it has not the bonus.
    """

    bonus: Callable[[ObservationSpec, int, Config], Bonus]
    settings: type[BonusSettings]
    numbers: type[BonusNumbers]
    grid: Mapping[str, tuple[float, ...]] | None


_ALGORITHMS: dict[str, Algorithm] = {}
# Options that are gone, with the value of files and runs of before that did nothing.
_REMOVED = {
    "normalise_advantages": "minibatch",
    "normalise_observations": False,
    "rnd_normalise_observations": False,
    "rnd_warm_up": 0,
    "rnd_deeper": 0,
    "rnd_fraction": 1.0,
}


def add(name: str, algorithm: Algorithm) -> None:
    """Put an algorithm into the table; see `bonuses.register_bonus`."""
    _ALGORITHMS[name] = algorithm


def algorithms() -> Mapping[str, Algorithm]:
    """All of them, by name."""
    return _ALGORITHMS


def algorithm(name: str) -> Algorithm:
    """The algorithm of a name.

    Raises:
        SettingError: there is none.
    """
    try:
        check_value("algo", Domain("choice", choices=tuple(_ALGORITHMS)), name)
    except SettingError as error:
        own = "a bonus of your own is known once its module is imported, in commands by --import"
        raise SettingError(f"{error}; {own}") from None
    return _ALGORITHMS[name]


def without_removed(values: Mapping[str, Any]) -> dict[str, Any]:
    """The values but for options of before that did nothing.

    Raises:
        SettingError: one did something.
    """
    for name, value in values.items():
        if name in _REMOVED and value != _REMOVED[name]:
            raise SettingError(
                f"{name} is gone, since it did not help (docs/ablations.md, 'What "
                f"RND needs'): only {_REMOVED[name]!r} can be read, not {value!r}"
            )
    return {name: value for name, value in values.items() if name not in _REMOVED}


def without_others(values: Mapping[str, Any], own: Algorithm) -> dict[str, Any]:
    """The values but for settings and numbers of the bonuses of other algorithms."""
    rows = [row for row in _ALGORITHMS.values() if row is not own]
    others = {name for row in rows for cls in (row.settings, row.numbers) for name in names_of(cls)}
    return {name: value for name, value in without_removed(values).items() if name not in others}
