"""Static settings of a run: all that shapes its program but the environment."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Literal, TypeVar

import jax.numpy as jnp
from jax.typing import DTypeLike

from ...errors import SettingError
from ...fields import check, check_names, choice, names_of, number, of_form, values_of
from .algorithms import Algorithm, BonusSettings, algorithm, without_others

Precision = Literal["float32", "bfloat16"]
Convolution = Literal["matmul", "lax"]

_Settings = TypeVar("_Settings", bound=BonusSettings)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Config:
    """All that shapes the compiled program: frozen and hashable.

    The defaults are those of the paper where it prints them; the comments name the rest.

    Attributes:
        algo: `"ppo"`, or the name of the exploration bonus that PPO has.
        total_steps: environment steps of the whole run, over all environments. The learning rate
            falls to zero over it, so it is part of the experiment.
        num_envs: environments side by side, `N`.
        rollout: steps of each environment between two updates, `T`.
        epochs: passes of PPO over a rollout.
        minibatches: parts of a rollout in one epoch: whole sequences of `N / minibatches`
            environments.
        anneal: let the learning rates fall linearly to zero; constant within one update.
        value_loss_half: halve the value loss.
        bootstrap_truncation: where the time limit cuts an episode off, continue its return with
            the value of the observation it ended in; if false, the limit counts as an end.
        convolutions: (kernel, stride, features) of each convolution; None: those of the Nature
            paper, or two small ones for images below 36 pixels.
        features: size of the image features.
        hidden: size of the recurrent state.
        head: size of the hidden layer of the actor and of the critic.
        zero_values: begin with values near zero (gain 0.01, as OpenAI's RND), so that before the
            first reward there is nothing to learn from.
        contrast: the policy sees contrast * (x - 0.3) of the pixels x from 0 to 1, whose mean is
            about 0.3 and their deviation 0.1 (labels as they are); 0: x.
        persistence: added to the logit of the previous action, one learned number for each action
            that begins with this one: of 5 actions 2 makes random play repeat itself in 65 %.
        recurrent: if false, memory and previous action are cleared at every step, for
            comparison.
        dtype: of the networks' computations; parameters and losses are always float32.
        convolution: `"matmul"`: as matrix products, several times faster on a CPU and with many
            runs side by side; `"lax"`: XLA's own. The results are the same up to rounding.
        bonus_epochs: passes of the bonus' own update over a rollout.
        normalise_bonus: divide the bonus by the running deviation of its discounted sum.
        bonus_values: give the bonus of ICM and E3B a value of its own, as RND's always has; if
            false it is added to the reward.
        stop_success: learn no more once the mean success of about the last hundred episodes has
            reached this share: what was learned can be lost again; 0: never.
        random_clocks: draw the clock of each environment's first episode, so that episodes of
            one length do not all end at once.
        shards: groups of environments that minibatches are drawn from evenly: the number of
            devices that the environments are to be spread over.
        bonus: the bonus' own settings; None: their defaults.
    """

    algo: str = "ppo"
    total_steps: int = number(10_000_000, 1)  # not printed; pobax uses 1e7 for its mazes
    num_envs: int = number(64, 1)  # not printed
    rollout: int = number(128, 1)
    epochs: int = number(4, 1)
    minibatches: int = number(4, 1)  # as pobax and purejaxrl
    anneal: bool = True  # as pobax
    value_loss_half: bool = False  # as pobax and SB3
    bootstrap_truncation: bool = True
    convolutions: tuple[tuple[int, int, int], ...] | None = of_form(None, "layers")
    features: int = number(256, 1)
    hidden: int = number(256, 1)
    head: int = number(256, 1)  # as pobax
    zero_values: bool = False
    contrast: float = number(0.0, 0)
    persistence: float = number(0.0, 0)
    recurrent: bool = True
    dtype: Precision = choice("float32", Precision)
    convolution: Convolution = choice("matmul", Convolution)
    bonus_epochs: int = number(1, 1)
    normalise_bonus: bool = False
    bonus_values: bool = False
    stop_success: float = number(0.0, 0, 1)
    random_clocks: bool = False
    shards: int = number(1, 1)
    bonus: BonusSettings | None = None

    def __post_init__(self) -> None:
        """Check every field by itself, then those that must fit each other."""
        settings = self.algorithm.settings
        if self.bonus is None:
            object.__setattr__(self, "bonus", settings())
        if type(self.bonus) is not settings:
            raise SettingError(
                f"bonus must be {settings.__name__}, the settings of {self.algo!r}, not "
                f"{self.bonus!r}"
            )
        check(self)
        self._check_batch()

    def _check_batch(self) -> None:
        groups = self.minibatches * self.shards
        if self.num_envs % groups:
            shards = f" times shards = {self.shards}" if self.shards > 1 else ""
            raise SettingError(
                f"num_envs must be a multiple of minibatches = {self.minibatches}{shards}, since "
                f"a minibatch holds whole sequences of environments, not {self.num_envs}"
            )
        if self.total_steps < self.steps_per_update:
            raise SettingError(
                "total_steps must be at least num_envs * rollout = "
                f"{self.steps_per_update}, one update, not {self.total_steps}"
            )

    @property
    def steps_per_update(self) -> int:
        """Environment steps between two updates, over all environments."""
        return self.num_envs * self.rollout

    @property
    def updates(self) -> int:
        """Number of updates of the whole run, rounded down."""
        return self.total_steps // self.steps_per_update

    @property
    def algorithm(self) -> Algorithm:
        """The algorithm of the name `algo`."""
        return algorithm(self.algo)

    def bonus_as(self, cls: type[_Settings]) -> _Settings:
        """The bonus' settings, which are of that class.

        Raises:
            SettingError: they are another bonus'.
        """
        if not isinstance(self.bonus, cls):
            raise SettingError(f"bonus of this config must be {cls.__name__}, not {self.bonus!r}")
        return self.bonus

    @property
    def compute_dtype(self) -> DTypeLike:
        """The JAX dtype of `dtype`."""
        return jnp.bfloat16 if self.dtype == "bfloat16" else jnp.float32

    def replace(self, **changes: Any) -> Config:
        """Return a copy with the named settings changed, the bonus' own among them.

        Raises:
            SettingError: there is no such setting, or its value is out of range.
        """
        return Config.of({**self.flat(), **changes})

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Config:
        """A config by the names that options have: the bonus' settings among the others.

        Settings of the bonuses of other algorithms are left out.

        Raises:
            SettingError: there is no such setting, or its value is out of range.
        """
        row = algorithm(values.get("algo", cls.algo))
        shared = without_others(values, row)
        own = names_of(row.settings)
        check_names(shared, [name for name in (*names_of(cls), *own) if name != "bonus"])
        bonus = row.settings(**{name: shared.pop(name) for name in own if name in shared})
        return cls(bonus=bonus, **shared)

    def flat(self) -> dict[str, Any]:
        """The settings by the names that options have."""
        flat = values_of(self)
        return flat | values_of(flat.pop("bonus"))
