"""The options of a training: static settings, numbers, and the table of algorithms."""

from __future__ import annotations

import dataclasses
import functools
import re
import typing
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

import jax.numpy as jnp
from flax.core import FrozenDict
from jax.typing import DTypeLike

from ..errors import SettingError, quoted
from ..fields import (
    Domain,
    as_arrays,
    check,
    check_names,
    check_value,
    choice,
    names_of,
    number,
    of_form,
    values_of,
)
from ..pytree import PyTreeNode

Precision = Literal["float32", "bfloat16"]
Convolution = Literal["matmul", "lax"]
OnDivergence = Literal["stop", "continue"]
Grid = Mapping[str, tuple[float, ...]]

# Updates are counted in int32.
MOST_UPDATES = 2**31 - 1


@dataclasses.dataclass(frozen=True)
class NoOptions:
    """The options of a bonus that has none."""


@dataclasses.dataclass(frozen=True, eq=False)
class Algorithm:
    """PPO with an exploration bonus.

    Attributes:
        bonus: makes the bonus for an `ObservationSpec`, a number of actions and a `Config`.
        options: a dataclass that declares the bonus' own options; see `register_bonus`.
        grid: values of numbers that `jaxenstein sweep` tries; None leaves the algorithm out of it.
    """

    bonus: Callable[..., Any]
    options: type
    grid: Grid | None

    @functools.cached_property
    def settings(self) -> tuple[str, ...]:
        """The names of the bonus' static settings."""
        return tuple(name for name in names_of(self.options) if name not in self.numbers)

    @functools.cached_property
    def numbers(self) -> tuple[str, ...]:
        """The names of the bonus' numbers."""
        hints = typing.get_type_hints(self.options)
        return tuple(name for name in names_of(self.options) if hints[name] is Any)


_ALGORITHMS: dict[str, Algorithm] = {}


def register_bonus(
    name: str, bonus: Callable[..., Any], options: type = NoOptions, *, grid: Grid | None = None
) -> None:
    """Register an exploration bonus, so that `Config.algo` and `--algo` know its name.

    The fields of `options` become flags and names in files, with the docstring's `Attributes` as
    help; `jaxenstein.fields` declares their ranges. A field annotated as `Any` is a number, which
    may differ between runs of one compiled program: the bonus reads it from `HParams.bonus`. Any
    other field is a static setting: the bonus reads it from `Config.bonus`.

    Args:
        name: lower-case letters, digits and underscores.
        bonus: makes a `Bonus` from an `ObservationSpec`, a number of actions and a `Config`.
        options: a dataclass with a default for every field; field names begin with `name` and `_`.
        grid: values of numbers that `jaxenstein sweep` tries when no algorithm is given.

    Raises:
        SettingError: the name is taken or invalid, or a field has a wrong name.
    """
    if not re.fullmatch("[a-z][a-z0-9_]*", name):
        raise SettingError(
            f"the name of a bonus must be small letters, digits and underscores, not {quoted(name)}"
        )
    if name in _ALGORITHMS:
        raise SettingError(f"there is an algorithm {quoted(name)} already; choose another name")
    for field in names_of(options):
        if not field.startswith(f"{name}_"):
            raise SettingError(
                f"options of {quoted(name)} must begin with '{name}_', not {quoted(field)}: they "
                "share one list with those of the others"
            )
    row = Algorithm(bonus, options, grid)
    known = (*names_of(HParams), *row.numbers)
    check_names(grid or (), known, "number in a grid:")
    _ALGORITHMS[name] = row


def algorithms() -> Mapping[str, Algorithm]:
    """All algorithms by name."""
    return _ALGORITHMS


def algorithm(name: str) -> Algorithm:
    """The algorithm of a name; a `SettingError` names the nearest if there is none."""
    try:
        check_value("algo", Domain("choice", choices=tuple(_ALGORITHMS)), name)
    except SettingError as error:
        own = "a bonus of your own is known once its module is imported, in commands by --import"
        raise SettingError(f"{error}; {own}") from None
    return _ALGORITHMS[name]


def _nested(
    cls: type, row: Algorithm, own: Sequence[str], values: Mapping[str, Any]
) -> dict[str, Any]:
    """The arguments of `cls` from flat values, with the bonus' own under `bonus`.

    Options of the bonuses of other algorithms are left out.
    """
    others = {name for other in _ALGORITHMS.values() if other is not row
              for name in names_of(other.options)}  # fmt: skip
    given = {name: value for name, value in values.items() if name not in others}
    check_names(given, [name for name in (*names_of(cls), *own) if name != "bonus"])
    bonus = {name: given.pop(name) for name in own if name in given}
    return {**given, "bonus": bonus}


def _flat(record: Any) -> dict[str, Any]:
    """The fields of a record, with the bonus' own among the others."""
    flat = values_of(record)
    own = flat.pop("bonus")
    return {**flat, **own}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Config:
    """Static settings: everything that shapes the compiled program; frozen and hashable.

    The defaults are those of the paper where it prints them; comments name the other sources.

    Attributes:
        algo: `"ppo"`, or the name of the exploration bonus that PPO has.
        total_steps: environment steps of the whole run, over all environments. The learning rate
            falls to zero over it, so it is part of the experiment.
        num_envs: parallel environments, `N`.
        rollout: steps of each environment between two updates, `T`.
        epochs: passes of PPO over a rollout.
        minibatches: parts of a rollout in one epoch: whole sequences of `N / minibatches`
            environments.
        anneal: let the learning rates fall linearly to zero; constant within one update.
        value_loss_half: halve the value loss.
        bootstrap_truncation: where the time limit cuts an episode off, continue its return with
            the value of the last observation; if false, the limit counts as an end.
        convolutions: (kernel, stride, features) of each convolution; None: those of the Nature
            paper, or two small ones for images below 36 pixels.
        features: size of the image features.
        hidden: size of the recurrent state.
        head: size of the hidden layer of the actor and of the critic.
        zero_values: start with values near zero (gain 0.01, as OpenAI's RND), so that before the
            first reward there is nothing to learn from.
        contrast: give the policy contrast * (x - 0.3) of the pixels x from 0 to 1, whose mean is
            about 0.3 and whose deviation is about 0.1 (labels are not changed); 0: x.
        persistence: added to the logit of the previous action, one learned number for each action
            that starts at this value: with 5 actions, 2 makes random play repeat itself in 65 %.
        recurrent: if false, memory and previous action are cleared at every step, for
            comparison.
        dtype: of the networks' computations; parameters and losses are always float32.
        convolution: `"matmul"`: as matrix products, several times faster on a CPU and with many
            parallel runs; `"lax"`: XLA's own. The results are the same up to rounding.
        bonus_epochs: passes of the bonus' own update over a rollout.
        normalise_bonus: divide the bonus by the running deviation of its discounted sum.
        bonus_values: give the bonus of ICM and E3B a value head of its own, as RND always has; if
            false the bonus is added to the reward.
        stop_success: stop learning once the mean success of about the last hundred episodes has
            reached this share: what was learned can be lost again; 0: never.
        on_divergence: what happens if a loss, gradient or parameter of a run is not finite:
            `"stop"`: the run stops learning and keeps its last finite parameters;
            `"continue"`: the run continues as it is.
        random_clocks: start each environment's first episode at a random time, so that episodes
            of one length do not all end at once.
        shards: groups of environments from which minibatches are sampled evenly: the number of
            devices that the environments are spread over.
        bonus: the bonus' own settings by name; those not given have their defaults.
    """

    algo: str = "ppo"
    total_steps: int = number(10_000_000, 1, 10**15)  # not printed; pobax uses 1e7 for its mazes
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
    on_divergence: OnDivergence = choice("stop", OnDivergence)
    random_clocks: bool = False
    shards: int = number(1, 1)
    bonus: Mapping[str, Any] = FrozenDict()

    def __post_init__(self) -> None:
        """Check every field alone, then those that must fit each other."""
        row = self.algorithm
        check_names(self.bonus, row.settings)
        own = row.options(**self.bonus)
        check(own)
        bonus = FrozenDict({name: getattr(own, name) for name in row.settings})
        object.__setattr__(self, "bonus", bonus)
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
        if self.updates > MOST_UPDATES:
            raise SettingError(
                f"total_steps must be at most {MOST_UPDATES} * num_envs * rollout = "
                f"{MOST_UPDATES * self.steps_per_update}, since int32 counts the updates, not "
                f"{self.total_steps}"
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

    @property
    def compute_dtype(self) -> DTypeLike:
        """The JAX dtype of `dtype`."""
        return jnp.bfloat16 if self.dtype == "bfloat16" else jnp.float32

    def replace(self, **changes: Any) -> Config:
        """Return a copy with the named settings changed, also the bonus' own.

        Raises:
            SettingError: a setting is unknown, or its value is out of range.
        """
        return Config.of({**self.flat(), **changes})

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Config:
        """A config from flat options: the bonus' settings among the others.

        Settings of the bonuses of other algorithms are left out.

        Raises:
            SettingError: a setting is unknown, or its value is out of range.
        """
        row = algorithm(values.get("algo", cls.algo))
        return cls(**_nested(cls, row, row.settings, values))

    def flat(self) -> dict[str, Any]:
        """The settings as flat options."""
        return _flat(self)


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
            minibatch), skip the rest of the update; None: never.
        bonus_learning_rate: of the bonus' Adam, at the start.
        bonus_reward: factor of the exploration bonus.
        bonus_advantage: weight of the intrinsic advantages beside the extrinsic ones, where the
            bonus has a value head of its own.
        bonus_gamma: discount of the intrinsic returns; None: that of the extrinsic ones.
        bonus_value_clip: as value_clip, for the bonus' own values; None: the same.
        bonus_memory: share of its weight that normalise_bonus keeps of earlier rollouts at each
            new one; 1 forgets nothing.
        bonus: the bonus' own numbers by name; those not given have their defaults.
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
    bonus: Mapping[str, Any] = FrozenDict()

    @classmethod
    def of(cls, algo: str, values: Mapping[str, Any]) -> HParams:
        """The numbers of an algorithm from flat options, complete with those of its bonus.

        Numbers of the bonuses of other algorithms are left out.

        Raises:
            SettingError: a number is unknown or out of range.
        """
        row = algorithm(algo)
        defaults = {name: getattr(row.options(), name) for name in row.numbers}
        numbers = cls(**_nested(cls, row, row.numbers, {**defaults, **values}))
        numbers.check(algo)
        return numbers

    def flat(self) -> dict[str, Any]:
        """The numbers as flat options."""
        return _flat(self)

    def check(self, algo: str = "ppo") -> HParams:
        """Check the numbers of an algorithm, and complete them with those of its bonus.

        Returns:
            All of them as float32 arrays; traced values pass unchecked.

        Raises:
            SettingError: a value is no number, or out of range.
        """
        row = algorithm(algo)
        check_names(self.bonus, row.numbers)
        own = as_arrays(row.options(**self.bonus), skip=row.settings)
        bonus = {name: getattr(own, name) for name in row.numbers}
        return as_arrays(self, skip=("bonus",)).replace(bonus=bonus)
