"""Many runs side by side in one program: seeds, numbers, or both."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp

from ...errors import SettingError
from .config import HParams
from .evaluation import Evaluation
from .state import Metrics, TrainState, key_data

if TYPE_CHECKING:
    from .learner import Learner


class ManyRuns:
    """Runs side by side in one program: every argument and result has a leading axis [R].

    A run among others is the same as alone up to rounding.
    """

    def __init__(self, learner: Learner) -> None:
        """Take the learner of one run."""
        self._learner = learner
        self._evaluate = jax.jit(self._play, static_argnames=("episodes", "greedy"))
        self._train = jax.jit(self._chunk, static_argnames="updates")

    def init(self, keys: jax.Array, hparams: HParams | None = None) -> TrainState:
        """Begin a run for each of keys[R]; `hparams` as of `train_chunk`."""
        _spread((hparams or HParams()).check(), keys.shape[0])
        # One after another, in one small program: a vmapped one of four runs never came to its
        # end on two CPU cores with JAX 0.10.2.
        states = [self._learner._init(key) for key in key_data(keys)]
        return jax.tree.map(lambda *leaves: jnp.stack(leaves), *states)

    def train_chunk(
        self, state: TrainState, hparams: HParams | None, updates: int
    ) -> tuple[TrainState, Metrics]:
        """Train all runs; numbers of `hparams` are scalars, for all, or [R]. Metrics [R, updates].

        Raises:
            SettingError: a number is out of range or of another shape.
        """
        hparams = _spread((hparams or HParams()).check(), state.update.shape[0])
        return self._train(state, hparams, updates=updates)

    def evaluate(
        self, params: Any, key: jax.Array, episodes: int, greedy: bool = False
    ) -> Evaluation:
        """Evaluate all runs on the same draws; results [R, episodes]."""
        return self._evaluate(params, key_data(key), episodes=episodes, greedy=greedy)

    def _chunk(self, state: TrainState, hparams: HParams, updates: int) -> Any:
        return jax.vmap(lambda s, h: self._learner._chunk(s, h, updates))(state, hparams)

    def _play(self, params: Any, key_data: jax.Array, episodes: int, greedy: bool) -> Evaluation:
        return jax.vmap(lambda p: self._learner._play(p, key_data, episodes, greedy))(params)


def _spread(hparams: HParams, runs: int) -> HParams:
    """Every number as float32[runs]."""

    def spread(number: jax.Array) -> jax.Array:
        if number.shape not in ((), (runs,)):
            raise SettingError(
                f"numbers of hparams must be scalars or [{runs}], one for each run, not of shape "
                f"{list(number.shape)}"
            )
        return jnp.broadcast_to(number, (runs,))

    return jax.tree.map(spread, hparams)
