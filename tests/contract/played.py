"""An environment and a batch of its episodes, in one compiled program for all tests."""

from __future__ import annotations

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from reliability import golden

EPISODES = golden.load()


class Played:
    """A small environment and two members of a batch of it, played in one compiled program.

    The first member plays the id's golden episode, whose digests were made outside of a batch. An
    id without one plays actions drawn at random. The other member has the same actions and a seed
    of its own.

    Attributes:
        env, params: the environment, whose episodes end after `golden.LIMIT` steps.
        keys: of the resets and of the steps, stacked over time and then over the members.
        seed: of the first member; that of the other is the next one.
        actions: int32[T], those of both.
        first: observations and states of the resets.
        steps: the six values of the steps, stacked over time and then over the members.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.env, params = golden.made(name)
        self.params = self.env.check_params(params)
        rng = np.random.default_rng(0)
        drawn = rng.integers(-1, self.env.num_actions + 1, golden.STEPS).tolist()
        seed, actions = 3, drawn
        if name in EPISODES:
            seed, actions = EPISODES[name]["seed"], golden.actions_of(EPISODES[name])
        self.seed, self.actions = seed, np.array(actions, np.int32)
        self.reset = jax.jit(jax.vmap(self.env.reset, (0, None)))
        self.keys, self.first, self.steps = self.episodes(seed)

    def episodes(self, seed: int) -> tuple[Any, Any, Any]:
        """Keys, first observations and states, and steps, with a seed and the next one."""
        keys = jnp.stack([golden.keys_of(seed), golden.keys_of(seed + 1)], axis=1)
        first = jax.device_get(self.reset(keys[0], self.params))
        return keys, first, self.play(keys, first[1], self.actions)

    def play(self, keys: Any, states: Any, actions: np.ndarray, params: Any = None) -> Any:
        """The six results of the steps from given states, in NumPy."""
        params = self.params if params is None else params
        return jax.device_get(self._scan(keys[1:], states, actions, params))

    @functools.cached_property
    def _scan(self) -> Any:
        step = jax.vmap(self.env.step, (0, 0, None, None))

        @jax.jit
        def scan(keys: Any, states: Any, actions: Any, params: Any) -> Any:
            def one(states: Any, given: Any) -> Any:
                out = step(given[0], states, given[1], params)
                return out[1], out

            return jax.lax.scan(one, states, (keys, actions))[1]

        return scan

    def member(self, i: int) -> tuple[Any, Any]:
        """The results of the reset and the steps of one member."""
        return member(self.first, i, 0), member(self.steps, i, 1)


def member(tree: Any, i: int, axis: int) -> Any:
    """The results of one environment of a batch, in NumPy."""
    return jax.tree.map(lambda leaf: np.take(np.asarray(leaf), i, axis), tree)
