"""The table of algorithms: a row for each bonus, those of a user's own among them."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

from ...errors import SettingError, nearest
from ...fields import names_of
from ..learning.algorithms import Algorithm, BonusNumbers, BonusSettings, add, algorithms
from ..learning.bonus import Bonus
from ..learning.config import Config
from ..learning.hparams import HParams
from ..learning.observations import ObservationSpec
from .e3b import E3B, E3BNumbers, E3BSettings
from .icm import ICM, ICMNumbers, ICMSettings
from .none import NoBonus
from .rnd import RND, RNDNumbers, RNDSettings


def register_bonus(
    name: str,
    bonus: Callable[[ObservationSpec, int, Config], Bonus],
    settings: type[BonusSettings] = BonusSettings,
    numbers: type[BonusNumbers] = BonusNumbers,
    *,
    grid: Mapping[str, tuple[float, ...]] | None = None,
) -> None:
    """Give an exploration bonus a name, which `Config.algo` and `--algo` then know.

    Its settings and numbers are options beside the others, in flags and files.

    Args:
        name: small letters, digits and underscores.
        bonus: makes it for observations, a number of actions and a config: a class, mostly.
        settings: the class of its static settings; their names begin with its own and `_`.
        numbers: the class of its numbers, named in the same way.
        grid: values of numbers for `jaxenstein sweep`, which trains those with a grid if no
            algorithm is named.

    Raises:
        SettingError: the name is taken or cannot be one, or a field is wrongly named.
    """
    if not re.fullmatch("[a-z][a-z0-9_]*", name):
        raise SettingError(
            f"the name of a bonus must be small letters, digits and underscores, not {name!r}"
        )
    if name in algorithms():
        raise SettingError(f"there is an algorithm {name!r} already; choose another name")
    own = (*names_of(settings), *names_of(numbers))
    for field in own:
        if not field.startswith(f"{name}_"):
            raise SettingError(
                f"settings and numbers of {name!r} must begin with '{name}_', not {field!r}: they "
                "are options beside those of the others"
            )
    known = (*names_of(HParams), *names_of(numbers))
    for number in grid or ():
        if number not in known:
            raise SettingError(f"unknown number {number!r} in the grid{nearest(number, known)}")
    add(name, Algorithm(bonus, settings, numbers, grid))


_SIZES = (0.1, 1.0, 10.0)

register_bonus("ppo", NoBonus, grid={})
register_bonus(
    "rnd", RND, RNDSettings, RNDNumbers, grid={"bonus_reward": _SIZES, "rnd_loss": (0.01, 0.1)}
)
register_bonus(
    "icm", ICM, ICMSettings, ICMNumbers,
    grid={"bonus_learning_rate": (3e-4, 1e-4), "bonus_reward": _SIZES},
)  # fmt: skip
register_bonus("e3b", E3B, E3BSettings, E3BNumbers)
