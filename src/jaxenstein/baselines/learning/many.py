"""Many runs side by side in one program: seeds, numbers, or both."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from ...errors import SettingError
from .bonus import Metrics
from .evaluation import Evaluation, evaluate
from .hparams import HParams
from .loop import Loop
from .state import TrainState, key_data, wrap_key


class ManyRuns:
    """Runs side by side in one program: every argument and result has a leading axis [R].

    A run among others is the same as alone up to rounding.
    """

    def __init__(self, loop: Loop) -> None:
        """Take the loop of one run."""
        self._loop = loop
        self._start = jax.jit(loop.start)
        self._evaluate = jax.jit(self._play, static_argnames=("episodes", "greedy"))
        self._train = jax.jit(self._updates, static_argnames="updates")

    def init(self, keys: jax.Array, hparams: HParams | None = None) -> TrainState:
        """Begin a run for each of keys[R]; `hparams` as of `train_chunk`."""
        _spread(self._loop.numbers(hparams), keys.shape[0])
        # One after another, in one small program: a vmapped one of four runs never came to its
        # end on two CPU cores with JAX 0.10.2.
        states = [self._start(key) for key in key_data(keys)]
        return jax.tree.map(lambda *leaves: jnp.stack(leaves), *states)

    def train_chunk(
        self, state: TrainState, hparams: HParams | None, updates: int
    ) -> tuple[TrainState, Metrics]:
        """Train all runs; numbers of `hparams` are scalars, for all, or [R]. Metrics [R, updates].

        Raises:
            SettingError: a number is out of range or of another shape.
        """
        hparams = _spread(self._loop.numbers(hparams), state.update.shape[0])
        return self._train(state, hparams, updates=updates)

    def evaluate(
        self, params: Any, key: jax.Array, episodes: int, greedy: bool = False
    ) -> Evaluation:
        """Evaluate all runs on the same draws; results [R, episodes]."""
        return self._evaluate(params, key_data(key), episodes=episodes, greedy=greedy)

    def _updates(
        self, state: TrainState, hparams: HParams, updates: int
    ) -> tuple[TrainState, Metrics]:
        return jax.vmap(lambda s, h: self._loop.updates(s, h, updates))(state, hparams)

    def _play(self, params: Any, data: jax.Array, episodes: int, greedy: bool) -> Evaluation:
        loop, key = self._loop, wrap_key(data)
        return jax.vmap(lambda p: evaluate(loop.simulator, loop.network, p, key, episodes, greedy))(
            params
        )


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
