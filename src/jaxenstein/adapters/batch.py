"""Many environments behind one compiled call, for training loops that live outside of JAX."""

from __future__ import annotations

import dataclasses
import os
import secrets
from collections.abc import Mapping, Sequence
from typing import Any, Generic, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from .._jax.packing import Packing
from ..drawing import Drawn
from ..environment import AnyEnvironment, Autoreset
from ..errors import SettingError, quoted
from ..fields import check_whole, is_whole
from ..params import differing, ranges_of, split_ranges, with_numbers
from . import batch_calls

# Environments that are reset and drawn in one call after a step in which some ended.
_TOGETHER = 8


H = TypeVar("H")


class Ended(NamedTuple, Generic[H]):
    """What a step that ended K episodes says of their ends: numpy arrays, or tensors.

    Attributes:
        indices: int64[K], which environments ended, ascending.
        observation: as of the environment, with a leading axis K: the last observations.
        info: arrays [K, ...]: what the step told of the last states.
    """

    indices: H
    observation: Any
    info: Mapping[str, H]


class Stepped(NamedTuple, Generic[H]):
    """What a step gives, with a leading axis N but for `ended`: numpy arrays, or tensors.

    Attributes:
        observation: what to act on next; arrays on the device, or tensors.
        reward: float32[N].
        terminated: bool[N], the tasks' own ends.
        truncated: bool[N], ends by the time limit.
        info: of the state in which each environment now is: after a reset in the same step that
            of the new episode.
        ended: only with `"same-step"`, where an episode ended; else None.
    """

    observation: Any
    reward: H
    terminated: H
    truncated: H
    info: Mapping[str, H]
    ended: Ended[H] | None


# The processes in which adapters have used JAX; a forked child inherits its parent's.
_USED_IN: set[int] = set()


def check_process() -> None:
    """Refuse to use JAX in a child forked from a process that has used it, where it would hang.

    A fork copies the memory of JAX, but none of the threads that its computations wait for.

    Raises:
        SettingError: this is such a child.
    """
    here = os.getpid()
    if _USED_IN and here not in _USED_IN:
        raise SettingError(
            f"process {here} was forked from one that has used JAX, which does not work in it: "
            'start it anew, with context="spawn", in Gymnasium gymnasium.make_vec(..., '
            'vectorization_mode="async", vector_kwargs={"context": "spawn"}); or let one process '
            "step all of them, as gymnasium.make_vec does without a vectorization_mode"
        )
    _USED_IN.add(here)


class Batch:
    """N environments of one kind that keep their own states and random streams.

    The last observations of a batch in which nothing ended are not drawn: a step in which K
    episodes end draws N + K frames, with K rounded up to a multiple of 8.
    """

    def __init__(
        self,
        env: AnyEnvironment,
        params: Any = None,
        num_envs: int = 1,
        *,
        autoreset: Autoreset | None = "same-step",
        spread: bool = True,
    ) -> None:
        """Hold `num_envs` environments; nothing is compiled or drawn before `reset`.

        Args:
            env: the environment; its own `autoreset` and `final_observation` do not matter.
            params: its params, each one number for all environments, an array with a leading
                axis N, or a range from which each episode draws by the stream of its environment.
                Params on another device are moved to that of the environments.
            num_envs: N, at least 1.
            autoreset: `"same-step"`, `"next-step"` or None, as `Environment.autoreset`.
            spread: whether the environments may lie on several processor cores, if
                `jaxenstein.use_cores` made these devices and N can be divided by their number.

        Raises:
            SettingError: for a wrong `num_envs`, `autoreset` or `params`, or in a forked process
                that JAX does not work in.
        """
        check_process()
        num_envs = check_whole("num_envs", num_envs)
        stepped = dataclasses.replace(env, autoreset=autoreset, final_observation=False)
        self.env = dataclasses.replace(stepped, autoreset=None)
        # Resets within the step are made here, after a look at which episodes ended.
        self._stepped = stepped if autoreset == "next-step" else self.env
        self.autoreset = autoreset
        self.num_envs = num_envs
        self._mesh = batch_calls.mesh_for(num_envs) if spread else None
        # Of each environment its stream and its state, and what a step tells beside them.
        self._kept: jax.Array | None = None
        self._layouts: tuple[Packing, Packing] | None = None
        self.params = params

    @property
    def params(self) -> Any:
        """The params: numbers, ranges, and arrays [N] where environments differ."""
        return self._params

    @params.setter
    def params(self, params: Any) -> None:
        plain, ranges = split_ranges(params)
        plain = self.env.check_params(plain)
        changed = set(ranges) ^ set(ranges_of(self._params)) if self.begun else set()
        if changed:
            raise SettingError(
                f"{', '.join(sorted(changed))}: after the first reset a range can only replace a "
                "range, and a number a number"
            )
        own = differing(plain, self.env.default_params, self.num_envs, self.env.name)
        plain = self._in_place(plain)
        leaves, tree = jax.tree.flatten(plain)
        axes = tree.unflatten([0 if mapped else None for mapped in own])
        one = tree.unflatten([leaf[0] if m else leaf for leaf, m in zip(leaves, own, strict=True)])
        self._params = params = with_numbers(plain, ranges)
        self._numbers = Packing(lambda: with_numbers(one, ranges))
        pack = self._numbers.pack
        self._packed_params = jax.vmap(pack, (axes,))(params) if any(own) else pack(params)

    def _in_place(self, params: Any) -> Any:
        """The params on the device of the environments; on no fixed one if these use several."""
        devices = set().union(*(leaf.devices() for leaf in jax.tree.leaves(params)))
        if self._mesh is None and len(devices) == 1:
            return params
        return jax.tree.map(lambda leaf: jnp.asarray(np.asarray(leaf)), params)

    @property
    def begun(self) -> bool:
        """Whether there has been a first reset."""
        return self._kept is not None

    @property
    def states(self) -> Any:
        """The states, with a leading axis N, taken out of their rows; None before a reset."""
        return None if self._kept is None else self._streams()[1].state

    @property
    def drawn_params(self) -> Any:
        """The params of the current episodes: float32[N] in the place of ranges.

        Before the first reset they are `params`.
        """
        return self._params if self._kept is None else self._streams()[1].params(self._params)

    def _streams(self) -> tuple[jax.Array, Drawn]:
        """The keys, and the states with the numbers that their episodes drew."""
        assert self._kept is not None
        return jax.vmap(self._layout[0].unpack)(self._kept)

    @property
    def _layout(self) -> tuple[Packing, Packing]:
        """Of the stream and state of an environment, and of reward, ends and info."""
        if self._layouts is None:
            self._layouts = batch_calls.layouts(self.env, self._numbers)
        return self._layouts

    @property
    def _plan(self) -> batch_calls.Plan:
        return self._mesh, *self._layout, self._numbers

    def reset(
        self, seed: int | Sequence[int | None] | None = None, mask: Any = None
    ) -> tuple[Any, dict[str, np.ndarray]]:
        """Begin new episodes: observations, on the device, and info.

        Args:
            seed: of the random streams: N numbers, or one, which stands for seed, seed + 1, ...
                None, for all or for one of them, goes on with the stream; before the first reset
                it begins a stream by chance.
            mask: bool[N], which environments to reset; None for all. The seeds of others are
                ignored. The first reset is of all.

        Raises:
            SettingError: a seed is not a whole number from 0 on, or there are not N of them; the
                mask has another shape or type, or leaves one out at the first reset.
        """
        chosen = np.ones(self.num_envs, bool) if mask is None else np.asarray(mask)
        if chosen.shape != (self.num_envs,) or chosen.dtype != bool:
            raise SettingError(
                f"the mask of a reset must be bool[{self.num_envs}], "
                f"not {chosen.dtype}{list(chosen.shape)}"
            )
        if self._kept is None and not chosen.all():
            raise SettingError("the first reset must be of all environments: leave the mask out")
        keys = self._seeded(seeds_of(seed, self.num_envs), chosen)
        numbers = self._packed_params
        if chosen.all():
            out = batch_calls.reset(self.env, self._plan, keys, numbers)
        else:
            states, mask = self._streams()[1], jnp.asarray(chosen)
            out = batch_calls.reset_some(self.env, self._plan, keys, states, mask, numbers)
        self._kept, observation, info = out
        return observation, {name: np.array(value) for name, value in info.items()}

    def step(self, actions: Any) -> Stepped[np.ndarray]:
        """Step every environment.

        Args:
            actions: integers [N], numpy or on the device. Actions outside of the action space do
                nothing.

        Raises:
            SettingError: the actions have another shape or type, or `reset` was not called.
        """
        if self._kept is None:
            raise SettingError("call reset before step")
        if not isinstance(actions, jax.Array):
            actions = np.asarray(actions)
        if actions.shape != (self.num_envs,) or not jnp.issubdtype(actions.dtype, jnp.integer):
            raise SettingError(
                f"actions must be {self.num_envs} integers, one for each environment, "
                f"not {actions.dtype}{list(actions.shape)}"
            )
        if isinstance(actions, np.ndarray):
            # Before a cast on the device could wrap them around.
            valid = (actions >= 0) & (actions < self.env.num_actions)
            actions = np.where(valid, actions, -1).astype(np.int32)
        self._kept, observation, outcome = batch_calls.step(
            self._stepped, self._plan, self._kept, actions, self._packed_params
        )
        stepped = Stepped(observation, *self._layout[1].read(outcome), ended=None)
        if self.autoreset == "same-step":
            indices = np.flatnonzero(stepped.terminated | stepped.truncated)
            if indices.size:
                return self._restart(stepped, indices)
        return stepped

    def observe(self, env: AnyEnvironment) -> Any:
        """The observations that `env` draws of the current states; after a reset."""
        states = self._streams()[1]
        return batch_calls.observe(env, self._numbers, states, self._packed_params)

    def _restart(self, stepped: Stepped[np.ndarray], indices: np.ndarray) -> Stepped[np.ndarray]:
        """Reset the environments `indices` after a step that ended their episodes."""
        observation, info = stepped.observation, dict(stepped.info)
        last = {name: value[indices] for name, value in info.items()}
        frames = []
        together = min(_TOGETHER, self.num_envs)
        for first in range(0, indices.size, together):
            some = indices[first : first + together]
            # Filled up with the last one again, which writes the same values once more.
            padded = np.pad(some, (0, together - some.size), mode="edge").astype(np.int32)
            self._kept, observation, final, first_info = batch_calls.restart(
                self.env, self._plan, self._kept, observation, padded, self._packed_params
            )
            frames.append(jax.tree.map(lambda leaf, n=some.size: np.asarray(leaf)[:n], final))
            for name, value in first_info.items():
                info[name][some] = np.asarray(value)[: some.size]
            for name in info.keys() - first_info.keys():
                info[name][some] = 0
        final = jax.tree.map(lambda *parts: np.concatenate(parts), *frames)
        ended = Ended(indices, final, last)
        return stepped._replace(observation=observation, info=info, ended=ended)

    def _seeded(self, seeds: list[int | None], chosen: np.ndarray) -> jax.Array:
        """The streams: new ones where there is a seed, and at first everywhere."""
        fresh = [int(i) for i in np.flatnonzero(chosen) if seeds[i] is not None]
        if self._kept is None:
            sampled = [secrets.randbits(32) if seed is None else seed for seed in seeds]
            return batch_calls.keys_of(sampled)
        keys = self._streams()[0]
        if not fresh:
            return keys
        return keys.at[np.array(fresh)].set(batch_calls.keys_of([seeds[i] or 0 for i in fresh]))


def seeds_of(seed: Any, count: int) -> list[int | None]:
    """A seed for each of `count` environments; see `Batch.reset`."""
    if seed is None:
        return [None] * count
    if is_whole(seed):
        seeds: list[Any] = [int(seed) + i for i in range(count)]
    elif isinstance(seed, (Sequence, np.ndarray)) and not isinstance(seed, str):
        seeds = list(seed)
    else:
        raise SettingError(
            f"seed must be a whole number, a list of them or None, not {quoted(seed)}"
        )
    if len(seeds) != count:
        raise SettingError(
            f"there must be one seed for each of {count} environments, not {len(seeds)}"
        )
    return [None if one is None else checked_seed(one) for one in seeds]


def checked_seed(seed: Any) -> int:
    """The seed of one random stream as an int.

    Raises:
        SettingError: it is no whole number from 0 to 2**64 - 1.
    """
    if not is_whole(seed) or not 0 <= seed < 2**64:
        raise SettingError(f"a seed must be a whole number from 0 to 2**64 - 1, not {quoted(seed)}")
    return int(seed)
