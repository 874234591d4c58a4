"""Many runs side by side in one program: seeds, numbers, or both."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ...errors import SettingError
from .bonus import Metrics
from .evaluation import Evaluation, Playing, advance, begin
from .hparams import HParams
from .loop import Loop
from .state import TrainState, key_data, wrap_key

# Steps of an evaluation in one call, between which it is told how far it is.
SLICE = 16


class ManyRuns:
    """Runs side by side in one program: every argument and result has a leading axis [R].

    A run among others is the same as alone up to rounding.
    """

    def __init__(self, loop: Loop) -> None:
        """Take the loop of one run."""
        self._loop = loop
        self._start = jax.jit(loop.start)
        self._begin = jax.jit(self._first, static_argnames=("runs", "episodes"))
        self._advance = jax.jit(self._play)
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
        self,
        params: Any,
        key: jax.Array,
        episodes: int,
        greedy: bool = False,
        notify: Callable[[np.ndarray, np.ndarray], object] = lambda running, length: None,
    ) -> Evaluation:
        """Evaluate all runs on the same draws; results [R, episodes].

        `notify` is called now and then with which episodes go on, bool[R, episodes], and how long
        they are, int32[R, episodes].
        """
        data, until, running = key_data(key), 0, np.True_
        runs = len(jax.tree.leaves(params)[0])
        playing = self._begin(data, runs=runs, episodes=episodes)
        while np.any(running):
            until += SLICE
            playing = self._advance(params, data, playing, np.int32(until), np.bool_(greedy))
            running, length = jax.device_get((playing.running, playing.result.episode_length))
            notify(running, length)
        return playing.result

    def _updates(
        self, state: TrainState, hparams: HParams, updates: int
    ) -> tuple[TrainState, Metrics]:
        return jax.vmap(lambda s, h: self._loop.updates(s, h, updates))(state, hparams)

    def _first(self, data: jax.Array, runs: int, episodes: int) -> Playing:
        loop = self._loop
        return begin(loop.simulator, loop.network, wrap_key(data), runs, episodes)

    def _play(
        self, params: Any, data: jax.Array, playing: Playing, until: jax.Array, greedy: jax.Array
    ) -> Playing:
        loop, key = self._loop, wrap_key(data)
        return advance(loop.simulator, loop.network, params, key, playing, until, greedy)


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
