"""The options of a training: static settings, hyperparameters, and the registered algorithms."""

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
from ..settings import environment_options

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
        bonus: makes the bonus from an `ObservationSpec`, a number of actions and a `Config`.
        options: a dataclass that declares the bonus' own options; see `register_bonus`.
        grid: the default grid of `jaxenstein sweep`; None leaves the algorithm out of sweeps.
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
    """Register an exploration bonus under a name for `Config.algo` and `--algo`.

    The fields of `options` become flags and names in config files; `Attributes` in the docstring
    is their help. Use `jaxenstein.fields` to declare ranges. A field of type `Any` is a number that
    may differ between the runs of one compiled program; the bonus reads it from `HParams.bonus`.
    Any other field is static; the bonus reads it from `Config.bonus`.

    Args:
        name: lower-case letters, digits and underscores, with a letter first.
        bonus: makes a `Bonus` from an `ObservationSpec`, a number of actions and a `Config`.
        options: a dataclass with a default for every field; field names begin with `name` and `_`.
        grid: values for `jaxenstein sweep`, which trains this algorithm by default if a grid is
            given.

    Raises:
        SettingError: the name is taken or invalid, or a field has a wrong name.
    """
    if not re.fullmatch("[a-z][a-z0-9_]*", name):
        raise SettingError(
            "the name of a bonus must begin with a lower-case letter and have only lower-case "
            f"letters, digits and underscores, not {quoted(name)}"
        )
    if name in _ALGORITHMS:
        raise SettingError(f"there already is an algorithm {quoted(name)}; choose another name")
    taken = {*names_of(Config), *names_of(HParams), *environment_options()}
    taken.update(*(names_of(row.options) for row in _ALGORITHMS.values()))
    for field in names_of(options):
        if not field.startswith(f"{name}_"):
            raise SettingError(
                f"options of {quoted(name)} must begin with '{name}_', not {quoted(field)}, since "
                "all bonuses share one list of options"
            )
        if field in taken:
            raise SettingError(f"there already is an option {quoted(field)}; choose another name")
    row = Algorithm(bonus, options, grid)
    known = (*names_of(HParams), *row.numbers)
    check_names(grid or (), known, "hyperparameter in a grid:")
    _ALGORITHMS[name] = row


def algorithms() -> Mapping[str, Algorithm]:
    """All algorithms by name."""
    return _ALGORITHMS


def algorithm(name: str) -> Algorithm:
    """The algorithm with a name; if there is none, a `SettingError` suggests the nearest."""
    try:
        check_value("algo", Domain("choice", choices=tuple(_ALGORITHMS)), name)
    except SettingError as error:
        own = "for your own bonus, import its module first (commands: --import MODULE)"
        raise SettingError(f"{error}; {own}") from None
    return _ALGORITHMS[name]


def _nested(
    cls: type, row: Algorithm, own: Sequence[str], values: Mapping[str, Any]
) -> dict[str, Any]:
    """The arguments of `cls` from flat values, with the options of the bonus under `bonus`.

    Leaves out options of other bonuses.
    """
    others = {name for other in _ALGORITHMS.values() if other is not row
              for name in names_of(other.options)}  # fmt: skip
    given = {name: value for name, value in values.items() if name not in others}
    check_names(given, [name for name in (*names_of(cls), *own) if name != "bonus"])
    bonus = {name: given.pop(name) for name in own if name in given}
    return {**given, "bonus": bonus}


def _flat(record: Any) -> dict[str, Any]:
    """The fields of a record as one flat dictionary, including those of the bonus."""
    flat = values_of(record)
    own = flat.pop("bonus")
    return {**flat, **own}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Config:
    """Static settings, which shape the compiled program; frozen and hashable.

    Defaults are those of the paper where it states them; comments name other sources.

    Attributes:
        algo: `"ppo"`, or the name of an exploration bonus to add to PPO.
        total_steps: decisions of each seed, summed over its environments; with annealing
            the learning rate depends on it.
        num_envs: number of parallel environments, `N`.
        rollout: steps in each environment between two updates, `T`.
        epochs: PPO epochs per rollout.
        minibatches: minibatches per epoch; each has whole sequences of `N / minibatches`
            environments.
        anneal: decay the learning rates linearly to zero, in steps of one update.
        value_loss_half: halve the value loss.
        bootstrap_truncation: if the time limit ends an episode, bootstrap its return from the value
            of the last observation; if false, the time limit counts as termination.
        convolutions: (kernel, stride, features) of each layer; None: the Nature DQN layers, or two
            small layers for images below 36 pixels.
        features: size of the image features.
        hidden: size of the recurrent state.
        head: size of the hidden layers of actor and critic.
        zero_values: start with values near zero (gain 0.01, as in OpenAI's RND), so that initial
            values do not affect learning before the first reward.
        contrast: feed the policy contrast * (x - 0.3) for pixels x from 0 to 1, whose mean is about
            0.3 and standard deviation about 0.1; labels are unchanged; 0: feed x.
        persistence: initial value of learned numbers, one per action, added to the logit of the
            previous action; with 5 actions, 2 makes a new policy repeat 65 % of its actions.
        recurrent: keep memory and previous action; if false, clear both at every step.
        dtype: dtype of network computations; parameters and losses are always float32. With
            bfloat16 an agent may learn less reliably.
        convolution: how to compute convolutions; `"matmul"`: as matrix products, several times
            faster on a CPU or with many parallel runs; `"lax"`: with XLA's convolution; results are
            equal up to rounding.
        bonus_epochs: epochs per rollout that train the bonus.
        normalise_rewards: learn from rewards divided by the running standard deviation of their
            discounted sum in an episode, if that deviation is above 1; reported returns are not
            divided.
        normalise_bonus: divide the bonus by the running standard deviation of its discounted sum.
        bonus_values: give ICM and E3B a separate value head for the bonus, as RND always has; if
            false, the bonus is added to the reward.
        stop_success: stop learning once the mean success over about the last hundred episodes
            reaches this rate, since further training can unlearn the task; 0: never stop.
        on_divergence: what to do with a run whose loss, gradient or parameters are not finite;
            `"stop"`: stop learning and keep the last finite parameters; `"continue"`: continue as
            it is.
        random_clocks: start the first episode of each environment at a random time, so that
            episodes of equal length do not all end together.
        shards: groups of environments that contribute equally to each minibatch; set it to the
            number of devices over which the environments are spread.
        bonus: settings of the bonus by name; missing ones have their defaults.
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
    normalise_rewards: bool = False
    normalise_bonus: bool = False
    bonus_values: bool = False
    stop_success: float = number(0.0, 0, 1)
    on_divergence: OnDivergence = choice("stop", OnDivergence)
    random_clocks: bool = False
    shards: int = number(1, 1)
    bonus: Mapping[str, Any] = FrozenDict()

    def __post_init__(self) -> None:
        """Check every field, then combinations of fields."""
        row = self.algorithm
        check_names(self.bonus, row.settings)
        own = row.options(**self.bonus)
        check(own)
        bonus = FrozenDict({name: getattr(own, name) for name in row.settings})
        object.__setattr__(self, "bonus", bonus)
        check(self)
        if self.persistence and not self.recurrent:
            raise SettingError(
                "persistence needs recurrent: without it, the network does not see the last action"
            )
        self._check_batch()

    def _check_batch(self) -> None:
        groups = self.minibatches * self.shards
        if self.num_envs % groups:
            shards = f" times shards = {self.shards}" if self.shards > 1 else ""
            raise SettingError(
                f"num_envs must be a multiple of minibatches = {self.minibatches}{shards}, not "
                f"{self.num_envs}, since a minibatch holds whole sequences of environments"
            )
        if self.total_steps < self.steps_per_update:
            raise SettingError(
                "total_steps must be at least num_envs * rollout = "
                f"{self.steps_per_update}, one update, not {self.total_steps}"
            )
        if self.updates > MOST_UPDATES:
            raise SettingError(
                f"total_steps must be at most {MOST_UPDATES} * num_envs * rollout = "
                f"{MOST_UPDATES * self.steps_per_update}, not {self.total_steps}, since updates "
                "are counted in int32"
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
        """The algorithm named `algo`."""
        return algorithm(self.algo)

    @property
    def compute_dtype(self) -> DTypeLike:
        """The JAX dtype of `dtype`."""
        return jnp.bfloat16 if self.dtype == "bfloat16" else jnp.float32

    def replace(self, **changes: Any) -> Config:
        """Return a copy with changed settings, which may be settings of the bonus.

        Raises:
            SettingError: a setting is unknown, or its value is out of range.
        """
        return Config.of({**self.flat(), **changes})

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Config:
        """Make a config from flat options, which include the settings of the bonus.

        Leaves out settings of other bonuses.

        Raises:
            SettingError: a setting is unknown, or its value is out of range.
        """
        row = algorithm(values.get("algo", cls.algo))
        return cls(**_nested(cls, row, row.settings, values))

    def flat(self) -> dict[str, Any]:
        """The settings as flat options."""
        return _flat(self)


class HParams(PyTreeNode):
    """Hyperparameters of a run: a pytree of traced scalars, so `jax.vmap` can train many runs.

    Attributes:
        learning_rate: initial learning rate of PPO.
        gamma: discount; None: the environment's own.
        gae_lambda: lambda of generalised advantage estimation.
        clip: PPO's clip range of the probability ratio.
        value_clip: clip range of value changes within an update.
        entropy: coefficient of the policy's entropy in the loss.
        value: coefficient of the value loss.
        gradient_norm: clip gradients, also of the bonus, to this global norm.
        advantage_floor: added to the standard deviation that normalises the advantages.
        target_kl: skip the rest of an update once the approximate KL divergence of a minibatch from
            the rollout policy exceeds this; None: never.
        bonus_learning_rate: initial learning rate of the bonus.
        bonus_reward: factor on the exploration bonus.
        bonus_advantage: weight of the intrinsic advantages, if the bonus has a separate value head.
        bonus_gamma: discount of the intrinsic returns; None: gamma.
        bonus_value_clip: clip range for the values of the bonus; None: value_clip.
        bonus_memory: for normalise_bonus, the share of their weight that past rollouts keep at each
            rollout; 1: never forget.
        bonus: hyperparameters of the bonus by name; missing ones have their defaults.
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
        """Make the hyperparameters of an algorithm from flat options, with all of its bonus.

        Leaves out hyperparameters of other bonuses.

        Raises:
            SettingError: a number is unknown or out of range.
        """
        row = algorithm(algo)
        defaults = {name: getattr(row.options(), name) for name in row.numbers}
        numbers = cls(**_nested(cls, row, row.numbers, {**defaults, **values}))
        numbers.check(algo)
        return numbers

    def flat(self) -> dict[str, Any]:
        """The hyperparameters as flat options."""
        return _flat(self)

    def check(self, algo: str = "ppo") -> HParams:
        """Check the hyperparameters of an algorithm, and fill in the defaults of its bonus.

        Returns:
            All of them as float32 arrays; traced values are not checked.

        Raises:
            SettingError: a value is not a number, or out of range.
        """
        row = algorithm(algo)
        check_names(self.bonus, row.numbers)
        own = as_arrays(row.options(**self.bonus), skip=row.settings)
        bonus = {name: getattr(own, name) for name in row.numbers}
        return as_arrays(self, skip=("bonus",)).replace(bonus=bonus)
