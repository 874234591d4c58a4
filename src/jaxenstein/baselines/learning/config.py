"""What a run is told: static settings, and numbers that may differ between runs of one program."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, Literal, get_args

import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from ...errors import SettingError, nearest
from ...pytree import PyTreeNode

Algorithm = Literal["ppo", "rnd", "icm"]
Precision = Literal["float32", "bfloat16"]
Convolution = Literal["matmul", "lax"]

_COUNTS = (
    *("total_steps", "num_envs", "rollout", "epochs", "minibatches", "shards"),
    *("features", "hidden", "head", "bonus_epochs"),
    *("rnd_hidden", "rnd_output", "rnd_layers", "icm_latent", "icm_hidden", "icm_layers"),
)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Config:
    """All that shapes the compiled program: frozen and hashable.

    The defaults are those of the paper where it prints them; the comments name the rest.

    Attributes:
        env: id of the environment, for `make_env`.
        env_settings: its settings as (name, value) pairs; a dictionary is taken as well.
        algo: `"ppo"`; `"rnd"` and `"icm"` are PPO with that exploration bonus.
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
        recurrent: if false, memory and previous action are cleared at every step, for
            comparison.
        dtype: of the networks' computations; parameters and losses are always float32.
        convolution: `"matmul"`: as matrix products, several times faster on a CPU and with many
            runs side by side; `"lax"`: XLA's own. The results are the same up to rounding.
        bonus_epochs: passes of the bonus' own update over a rollout.
        normalise_bonus: divide the bonus by the running deviation of its discounted sum.
        normalise_observations: whiten the frames that RND sees by running statistics.
        rnd_hidden: width of RND's hidden layers.
        rnd_output: size of RND's embedding.
        rnd_layers: number of RND's hidden layers behind its image features.
        icm_latent: size of ICM's embedding.
        icm_hidden: width of the hidden layers of ICM's two models.
        icm_layers: their number.
        icm_forward_trains_encoder: let the forward model's loss train the embedding too, as in
            the original; if false the inverse model alone does.
        random_clocks: draw the clock of each environment's first episode, so that episodes of
            one length do not all end at once.
        shards: groups of environments that minibatches are drawn from evenly: the number of
            devices that the environments are to be spread over.
    """

    env: str = "simple"
    env_settings: tuple[tuple[str, Any], ...] = ()
    algo: Algorithm = "ppo"
    total_steps: int = 10_000_000  # not printed; pobax uses 1e7 for its mazes
    num_envs: int = 64  # not printed
    rollout: int = 128
    epochs: int = 4
    minibatches: int = 4  # as pobax and purejaxrl
    anneal: bool = True  # as pobax
    value_loss_half: bool = False  # as pobax and SB3
    bootstrap_truncation: bool = True
    convolutions: tuple[tuple[int, int, int], ...] | None = None
    features: int = 256
    hidden: int = 256
    head: int = 256  # as pobax
    recurrent: bool = True
    dtype: Precision = "float32"
    convolution: Convolution = "matmul"
    bonus_epochs: int = 1
    normalise_bonus: bool = False
    normalise_observations: bool = False
    rnd_hidden: int = 128
    rnd_output: int = 128
    rnd_layers: int = 2
    icm_latent: int = 128
    icm_hidden: int = 256
    icm_layers: int = 2
    icm_forward_trains_encoder: bool = False
    random_clocks: bool = False
    shards: int = 1

    def __post_init__(self) -> None:
        """Check every field by itself, then those that must fit each other."""
        if isinstance(self.env_settings, dict):
            object.__setattr__(self, "env_settings", tuple(self.env_settings.items()))
        _check_choice("algo", self.algo, get_args(Algorithm))
        _check_choice("dtype", self.dtype, get_args(Precision))
        _check_choice("convolution", self.convolution, get_args(Convolution))
        for name in _COUNTS:
            _check_count(name, getattr(self, name))
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if isinstance(field.default, bool) and not isinstance(value, bool | np.bool_):
                raise SettingError(f"{field.name} must be True or False, not {value!r}")
        self._check_convolutions()
        self._check_batch()

    def _check_convolutions(self) -> None:
        if self.convolutions is None:
            return
        if not all(isinstance(layer, list | tuple) for layer in self.convolutions):
            raise SettingError(
                f"convolutions must hold (kernel, stride, features), not {self.convolutions!r}"
            )
        layers = tuple(tuple(layer) for layer in self.convolutions)
        for layer in layers:
            if len(layer) != 3 or any(not _whole(number) or number < 1 for number in layer):
                raise SettingError(
                    "convolutions must be (kernel, stride, features) of each layer, whole "
                    f"numbers from 1, not {layer!r}"
                )
        object.__setattr__(self, "convolutions", layers)

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
    def compute_dtype(self) -> Any:
        """The JAX dtype of `dtype`."""
        return jnp.bfloat16 if self.dtype == "bfloat16" else jnp.float32

    def replace(self, **changes: Any) -> Config:
        """Return a copy with the named fields changed.

        Raises:
            SettingError: there is no such field, or its value is out of range.
        """
        known = [field.name for field in dataclasses.fields(self)]
        for name in changes:
            if name not in known:
                raise SettingError(
                    f"unknown setting {name!r}{nearest(name, known)}; known: {', '.join(known)}"
                )
        return dataclasses.replace(self, **changes)

    def make_env(self) -> tuple[Any, Any]:
        """The environment and its params, as `jaxenstein.make` returns them."""
        from ...registry import make_with

        return make_with(self.env, dict(self.env_settings))


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
        bonus_learning_rate: of the bonus' Adam, at the start.
        bonus_reward: factor of the exploration bonus.
        bonus_advantage: weight of the intrinsic advantages beside the extrinsic ones (RND).
        bonus_gamma: discount of the intrinsic returns (RND); None: that of the extrinsic ones.
        rnd_loss: coefficient of RND's loss.
        rnd_fraction: share of the frames that RND's predictor is trained on.
        icm_inverse: coefficient of the inverse model's loss.
        icm_forward: coefficient of the forward model's loss.
    """

    learning_rate: Any = 2.5e-4
    gamma: Any = None
    gae_lambda: Any = 0.95
    clip: Any = 0.2
    value_clip: Any = 0.2
    entropy: Any = 0.01
    value: Any = 0.5
    gradient_norm: Any = 0.5
    advantage_floor: Any = 1e-8
    bonus_learning_rate: Any = 3e-4  # the paper prints none for RND
    bonus_reward: Any = 1.0
    bonus_advantage: Any = 1.0
    bonus_gamma: Any = None
    rnd_loss: Any = 0.1
    rnd_fraction: Any = 1.0
    icm_inverse: Any = 1.0
    icm_forward: Any = 1.0

    def check(self) -> HParams:
        """Check the values, and return them as float32 arrays; traced ones pass.

        Raises:
            SettingError: a value is no number, or out of range.
        """
        return HParams(
            **{
                field.name: _checked_number(field.name, getattr(self, field.name))
                for field in dataclasses.fields(self)
            }
        )


_SHARES = {"gamma", "bonus_gamma", "gae_lambda", "rnd_fraction"}
_POSITIVE = {"clip", "value_clip", "gradient_norm"}


def _checked_number(name: str, value: Any) -> Any:
    if value is None and name in ("gamma", "bonus_gamma"):
        return None
    if isinstance(value, Tracer):
        return value
    try:
        numbers = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        raise SettingError(f"{name} must be a number, not {value!r}") from None
    highest = 1.0 if name in _SHARES else math.inf
    good = np.isfinite(numbers) & (numbers >= 0) & (numbers <= highest)
    if name in _POSITIVE:
        good &= numbers > 0
    if not np.all(good):
        least = "above 0" if name in _POSITIVE else "at least 0"
        right = "from 0 to 1" if name in _SHARES else least
        raise SettingError(f"{name} must be a finite number {right}, not {value!r}")
    return jnp.asarray(numbers, jnp.float32)


def _check_choice(name: str, value: Any, choices: tuple[str, ...]) -> None:
    if value not in choices:
        close = nearest(str(value), choices)
        known = ", ".join(map(repr, choices))
        raise SettingError(f"{name} must be one of {known}, not {value!r}{close}")


def _whole(value: Any) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def _check_count(name: str, value: Any) -> None:
    if not _whole(value) or value < 1:
        raise SettingError(f"{name} must be a whole number from 1, not {value!r}")
