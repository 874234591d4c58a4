"""Every adapter behind one interface, for tests of their common contract."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxenstein.adapters.batch import Batch


class Step(NamedTuple):
    """A step of N environments: the observations to act on, and the last ones by index."""

    obs: Any
    reward: Any
    done: Any
    cut: Any
    last: dict[Any, Any]


class Player:
    """N environments; `of` is the adapter, or a list of adapters with one environment each."""

    of: Any

    def changed(self, change: Callable[[Any], Any]) -> Any:
        """The same player with a changed adapter, such as a copy."""
        other = copy.copy(self)
        several = isinstance(self.of, list)
        other.of = [change(one) for one in self.of] if several else change(self.of)
        return other


class BatchPlayer(Player):
    """`Batch` itself."""

    def __init__(self, env: Any, params: Any, count: int) -> None:
        self.of = Batch(env, params, count)

    def reset(self, seed: Any, mask: Any = None) -> Any:
        return self.of.reset(seed, mask)[0]

    def step(self, actions: Any) -> Step:
        obs, reward, terminated, truncated, _, ended = self.of.step(actions)
        last = {} if ended is None else dict(zip(ended.indices.tolist(), ended[1], strict=True))
        return Step(obs, reward, terminated | truncated, truncated & ~terminated, last)


class TorchPlayer(BatchPlayer):
    """`TorchBatch`, whose actions and masks are tensors."""

    def __init__(self, env: Any, params: Any, count: int) -> None:
        self.tensor = pytest.importorskip("torch").from_numpy
        from jaxenstein.adapters.torch import TorchBatch

        self.of = TorchBatch(env, params, count)

    def reset(self, seed: Any, mask: Any = None) -> Any:
        return super().reset(seed, None if mask is None else self.tensor(np.asarray(mask)))

    def step(self, actions: Any) -> Step:
        return super().step(self.tensor(np.asarray(actions)))


class SB3Player(Player):
    """`SB3VecEnv`."""

    def __init__(self, env: Any, params: Any, count: int, **settings: Any) -> None:
        pytest.importorskip("stable_baselines3")
        from jaxenstein.adapters.sb3 import SB3VecEnv

        self.of = SB3VecEnv(env, params, count, **settings)

    def reset(self, seed: int | None) -> Any:
        if seed is not None:
            self.of.seed(seed)
        return self.of.reset()

    def step(self, actions: Any) -> Step:
        obs, reward, done, infos = self.of.step(np.asarray(actions))
        last = {i: infos[i]["terminal_observation"] for i in np.flatnonzero(done)}
        return Step(obs, reward, done, [info["TimeLimit.truncated"] for info in infos], last)


class VectorPlayer(Player):
    """`GymnasiumVectorEnv` with resets in the same step."""

    def __init__(self, env: Any, params: Any, count: int, **settings: Any) -> None:
        pytest.importorskip("gymnasium")
        from jaxenstein.adapters.gymnasium_vector import GymnasiumVectorEnv

        self.of = GymnasiumVectorEnv(env, params, count, autoreset_mode="SameStep", **settings)

    def reset(self, seed: Any, mask: Any = None) -> Any:
        return self.of.reset(seed=seed, options=None if mask is None else {"reset_mask": mask})[0]

    def step(self, actions: Any) -> Step:
        obs, reward, terminated, truncated, infos = self.of.step(actions)
        done = terminated | truncated
        last = {i: infos["final_obs"][i] for i in np.flatnonzero(done)}
        return Step(obs, reward, done, truncated & ~terminated, last)


class SinglePlayer(Player):
    """As many of `GymnasiumEnv`, reset by hand."""

    def __init__(self, env: Any, params: Any, count: int, **settings: Any) -> None:
        pytest.importorskip("gymnasium")
        from jaxenstein.adapters.gymnasium import GymnasiumEnv

        self.of = [GymnasiumEnv(env, params, **settings) for _ in range(count)]

    def reset(self, seed: int | None) -> Any:
        seeds = [None if seed is None else seed + i for i in range(len(self.of))]
        return [env.reset(seed=one)[0] for env, one in zip(self.of, seeds, strict=True)]

    def step(self, actions: Any) -> Step:
        if np.shape(actions) != (len(self.of),):
            return self.of[0].step(actions)
        out = [env.step(action) for env, action in zip(self.of, actions, strict=True)]
        obs, reward, terminated, truncated, _ = map(list, zip(*out, strict=True))
        last = {i: obs[i] for i in range(len(obs)) if terminated[i] or truncated[i]}
        for i in last:
            obs[i] = self.of[i].reset()[0]
        done = [i in last for i in range(len(obs))]
        return Step(obs, reward, done, np.array(truncated) & ~np.array(terminated), last)


class GymnaxPlayer(Player):
    """gymnax' contract, mapped over a batch."""

    def __init__(self, env: Any, params: Any, count: int) -> None:
        pytest.importorskip("gymnax")
        from jaxenstein.adapters import gymnax

        env = dataclasses.replace(env, final_observation=True)
        self.of, self.params = gymnax.from_env(env, params)
        self.count, self.play = count, jax.jit(jax.vmap(self.of.step, (0, 0, 0, None)))
        self.begin = jax.jit(jax.vmap(self.of.reset, (0, None)))

    def reset(self, seed: int | None) -> Any:
        self.keys = jax.random.split(jax.random.key(seed or 0), self.count)
        obs, self.state = self.begin(self.keys, self.params)
        return obs

    def step(self, actions: Any) -> Step:
        obs, self.state, reward, *_, info = self.play(
            self.keys, self.state, jnp.asarray(actions), self.params
        )
        terminated, truncated = np.asarray(info["terminated"]), np.asarray(info["truncated"])
        last = {i: info["final_observation"][i] for i in np.flatnonzero(terminated | truncated)}
        return Step(obs, reward, terminated | truncated, truncated & ~terminated, last)


class StoaPlayer(Player):
    """Stoa's interface with its own resets, mapped over a batch."""

    def __init__(self, env: Any, params: Any, count: int) -> None:
        pytest.importorskip("stoa")
        from jaxenstein.adapters.stoa import StoaEnvironment

        self.of = StoaEnvironment(dataclasses.replace(env, final_observation=True), params)
        self.count, self.play = count, jax.jit(jax.vmap(self.of.step))
        self.begin = jax.jit(jax.vmap(self.of.reset))

    def reset(self, seed: int | None) -> Any:
        self.state, first = self.begin(jax.random.split(jax.random.key(seed or 0), self.count))
        return first.observation

    def step(self, actions: Any) -> Step:
        self.state, told = self.play(self.state, jnp.asarray(actions))
        done = np.asarray(told.done())
        last = {i: told.extras["next_obs"][i] for i in np.flatnonzero(done)}
        return Step(told.observation, told.reward, done, np.asarray(told.truncated()), last)


STREAMS = (BatchPlayer, TorchPlayer, SB3Player, VectorPlayer, SinglePlayer)
"""Adapters that keep a random stream for each environment."""
FUNCTIONS = (GymnaxPlayer, StoaPlayer)
"""Adapters that are functions of keys and states."""
PLAYERS = (*STREAMS, *FUNCTIONS)
"""All adapters."""
MASKED = (BatchPlayer, TorchPlayer, VectorPlayer)
"""Adapters that can reset some of their environments, and take a seed for each."""
STRICT = (VectorPlayer, SinglePlayer)
"""Adapters that refuse actions outside the action space; in others, these do nothing."""
BY_ID = (SB3Player, *STRICT)
"""Adapters that can also be made from an id and settings."""
