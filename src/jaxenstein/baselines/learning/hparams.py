"""Numbers of a run, which may differ between runs of one program."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from ...errors import SettingError
from ...fields import as_arrays, check_names, names_of, number, values_of
from ...pytree import PyTreeNode
from .algorithms import Algorithm, BonusNumbers, without_others

_Numbers = TypeVar("_Numbers", bound=BonusNumbers)


class HParams(PyTreeNode):
    """Numbers of a run: a pytree of scalars, traced, so `jax.vmap` can run many at once.

    Attributes:
        learning_rate: of PPO's Adam, at the start.
        gamma: discount; None: the environment's own.
        gae_lambda: weight of longer returns in the advantages, 0 to 1.
        clip: range of the probability ratio around 1.
        value_clip: how far a value may move from its old one within an update.
        entropy: coefficient of the entropy.
        value: coefficient of the value loss.
        gradient_norm: global norm that gradients are clipped to, PPO's and the bonus' alike.
        advantage_floor: added to the advantages' deviation where they are divided by it.
        target_kl: once the policy has moved so far from the one that played (approximate_kl of a
            minibatch), the rest of the update is left out; None: never.
        bonus_learning_rate: of the bonus' Adam, at the start.
        bonus_reward: factor of the exploration bonus.
        bonus_advantage: weight of the intrinsic advantages beside the extrinsic ones, where the
            bonus has values of its own.
        bonus_gamma: discount of the intrinsic returns; None: that of the extrinsic ones.
        bonus_value_clip: as value_clip, of values of the bonus' own; None: the same.
        bonus_memory: share of its weight that normalise_bonus leaves to what it saw before a
            rollout, in the size that it divides by; 1 forgets nothing.
        bonus: the bonus' own numbers; None: their defaults.
    """

    learning_rate: Any = number(2.5e-4, 0)
    gamma: Any = number(None, 0, 1)
    gae_lambda: Any = number(0.95, 0, 1)
    clip: Any = number(0.2, above=0)
    value_clip: Any = number(0.2, above=0)
    entropy: Any = number(0.01, 0)
    value: Any = number(0.5, 0)
    gradient_norm: Any = number(0.5, above=0)
    advantage_floor: Any = number(1e-8, 0)
    target_kl: Any = number(None, above=0)
    bonus_learning_rate: Any = number(3e-4, 0)  # the paper prints none for RND
    bonus_reward: Any = number(1.0, 0)
    bonus_advantage: Any = number(1.0, 0)
    bonus_gamma: Any = number(None, 0, 1)
    bonus_value_clip: Any = number(None, above=0)
    bonus_memory: Any = number(1.0, 0, 1)
    bonus: BonusNumbers | None = None

    @classmethod
    def of(cls, algorithm: Algorithm, values: Mapping[str, Any]) -> HParams:
        """The numbers by the names that options have: the bonus' among the others.

        Numbers of the bonuses of other algorithms are left out.

        Raises:
            SettingError: there is no such number.
        """
        shared = without_others(values, algorithm)
        own = names_of(algorithm.numbers)
        check_names(shared, [name for name in (*names_of(cls), *own) if name != "bonus"])
        bonus = algorithm.numbers(**{name: shared.pop(name) for name in own if name in shared})
        return cls(bonus=bonus, **shared)

    def flat(self) -> dict[str, Any]:
        """The numbers by the names that options have."""
        flat = values_of(self)
        own = flat.pop("bonus")
        return flat if own is None else flat | values_of(own)

    def check(self) -> HParams:
        """Check the values, and return them as float32 arrays; traced ones pass.

        Raises:
            SettingError: a value is no number, or out of range.
        """
        checked = as_arrays(self, skip=("bonus",))
        return checked if self.bonus is None else checked.replace(bonus=as_arrays(self.bonus))

    def bonus_as(self, cls: type[_Numbers]) -> _Numbers:
        """The bonus' numbers, which are of that class.

        Raises:
            SettingError: they are another bonus'.
        """
        if not isinstance(self.bonus, cls):
            raise SettingError(f"bonus of these numbers must be {cls.__name__}, not {self.bonus!r}")
        return self.bonus
