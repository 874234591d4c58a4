"""Many environments in one compiled call, for training loops outside of JAX."""

from __future__ import annotations

import dataclasses
import functools
import os
import secrets
from collections.abc import Mapping, Sequence
from typing import Any, Generic, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from .._jax.inline import inline_device
from .._jax.packing import Packing
from ..environment import AnyEnvironment, Autoreset
from ..errors import SettingError, quoted
from ..fields import check_seed, check_whole, is_whole
from ..params import differing, ranges_of, split_ranges, with_numbers
from ..ranged import Drawn
from . import batch_calls

# How many environments whose episode ended are reset and rendered per call.
_TOGETHER = 8


H = TypeVar("H")


class Ended(NamedTuple, Generic[H]):
    """The ends of the K episodes that a step ended, as numpy arrays or tensors.

    Attributes:
        indices: int64[K], the environments whose episode ended, ascending.
        observation: the last observations, with a leading axis K.
        info: arrays [K, ...], the info of the last states.
    """

    indices: H
    observation: Any
    info: Mapping[str, H]


class Stepped(NamedTuple, Generic[H]):
    """The result of a step, with a leading axis N except in `ended`: numpy arrays or tensors.

    Attributes:
        observation: the observations to act on next; arrays on the device, or tensors.
        reward: float32[N].
        terminated: bool[N], whether the task ended the episode.
        truncated: bool[N], whether the time limit ended the episode.
        info: the info of the current states; after a reset in the same step, of the new episode.
        ended: with `"same-step"`, the ends of episodes; None if no episode ended.
    """

    observation: Any
    reward: H
    terminated: H
    truncated: H
    info: Mapping[str, H]
    ended: Ended[H] | None


# The processes in which adapters have used JAX; a forked child inherits its parent's entry.
_USED_IN: set[int] = set()


def check_process() -> None:
    """Refuse to use JAX in a child forked from a process that has used it: it would hang.

    A fork copies JAX's memory but not the threads on which its computations wait.

    Raises:
        SettingError: this is such a child.
    """
    here = os.getpid()
    if _USED_IN and here not in _USED_IN:
        raise SettingError(
            f"process {here} was forked from a process that has used JAX, and JAX does not work "
            'in it: use context="spawn", in Gymnasium gymnasium.make_vec(..., '
            'vectorization_mode="async", vector_kwargs={"context": "spawn"}); or step all '
            "environments in one process, as gymnasium.make_vec does without a vectorization_mode"
        )
    _USED_IN.add(here)


class Batch:
    """N environments of one kind, which keep their own states and random streams.

    A step renders N frames. With `"same-step"`, a step in which K episodes end renders K more, with
    K rounded up to a multiple of 8 or, if that is smaller, of N.
    """

    def __init__(
        self,
        env: AnyEnvironment,
        params: Any = None,
        num_envs: int = 1,
        *,
        autoreset: Autoreset | None = "same-step",
        spread: bool = True,
        inline: bool = False,
    ) -> None:
        """Create `num_envs` environments; compiles and renders nothing before `reset`.

        Args:
            env: the environment; its own `autoreset` and `final_observation` do not matter.
            params: its params, each one number for all environments, an array with a leading
                axis N, or a range from which each episode draws by the stream of its environment.
                Params on another device are moved to that of the environments.
            num_envs: N, at least 1.
            autoreset: `"same-step"`, `"next-step"` or None; see `Environment`.
            spread: whether to spread the environments over several CPU cores, if
                `jaxenstein.use_cores` made these devices and their number divides N.
            inline: whether programs run in the calling thread, which is faster for one
                environment of a caller who waits for each step. Arrays are then on a device of
                their own.

        Raises:
            SettingError: `num_envs`, `autoreset` or `params` is invalid, or the process was forked
                from one that has used JAX.
        """
        check_process()
        num_envs = check_whole("num_envs", num_envs)
        stepped = dataclasses.replace(env, autoreset=autoreset, final_observation=False)
        self.env = dataclasses.replace(stepped, autoreset=None)
        # Same-step resets happen in this class, after it knows which episodes ended.
        self._stepped = stepped if autoreset == "next-step" else self.env
        self.autoreset = autoreset
        self.num_envs = num_envs
        self._inline = inline
        self._mesh = batch_calls.mesh_for(num_envs) if spread else None
        # A packed row per environment with its stream and state, and the layouts of rows.
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
        pack = functools.partial(batch_calls.packed, self._numbers)
        packed = jax.vmap(pack, (axes,))(params) if any(own) else pack(params)
        self._packed_params = self._placed(packed)

    def _placed(self, array: jax.Array) -> jax.Array:
        """An array on the device of the programs."""
        device = inline_device() if self._inline else None
        return array if device is None else jax.device_put(array, device)

    def _in_place(self, params: Any) -> Any:
        """The params on the device of the environments; uncommitted if these use several."""
        devices = set().union(*(leaf.devices() for leaf in jax.tree.leaves(params)))
        if self._mesh is None and len(devices) == 1 and not self._inline:
            return params
        return jax.tree.map(lambda leaf: jax.device_put(np.asarray(leaf)), params)

    @property
    def begun(self) -> bool:
        """Whether `reset` has been called."""
        return self._kept is not None

    @property
    def states(self) -> Any:
        """The states with a leading axis N, unpacked; None before the first reset."""
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
        return batch_calls.unpacked(self._layout[0], self._kept)

    @property
    def _layout(self) -> tuple[Packing, Packing]:
        """The layouts of an environment's stream and state, and of reward, ends and info."""
        if self._layouts is None:
            self._layouts = batch_calls.layouts(self.env, self._numbers)
        return self._layouts

    @property
    def _plan(self) -> batch_calls.Plan:
        return self._mesh, *self._layout, self._numbers

    def reset(
        self, seed: int | Sequence[int | None] | None = None, mask: Any = None
    ) -> tuple[Any, dict[str, np.ndarray]]:
        """Start new episodes; returns observations, on the device, and info.

        Args:
            seed: seeds of the random streams: N numbers, or one number for seed, seed + 1, ...
                None, for all or some environments, continues the stream; before the first reset
                it draws a random seed.
            mask: bool[N], which environments to reset; None for all. Seeds of the others are
                ignored. The first reset must reset all.

        Raises:
            SettingError: a seed is not a whole number >= 0, there are not N of them, the mask has
                another shape or dtype, or the first reset leaves an environment out.
        """
        chosen = np.ones(self.num_envs, bool) if mask is None else np.asarray(mask)
        if chosen.shape != (self.num_envs,) or chosen.dtype != bool:
            raise SettingError(
                f"the mask of a reset must be bool[{self.num_envs}], "
                f"not {chosen.dtype}{list(chosen.shape)}"
            )
        if self._kept is None and not chosen.all():
            raise SettingError("the first reset must reset all environments: leave the mask out")
        keys = self._placed(self._seeded(seeds_of(seed, self.num_envs), chosen))
        # A copy of this object has lost the device.
        numbers = self._packed_params = self._placed(self._packed_params)
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
            actions: integers [N], numpy or on the device. Actions outside the action space do
                nothing.

        Raises:
            SettingError: the actions have another shape or dtype, or `reset` was not called.
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
            # Clamp before a cast on the device could wrap around.
            valid = (actions >= 0) & (actions < self.env.num_actions)
            actions = np.where(valid, actions, -1).astype(np.int32)
        observation, outcome = self._advance(actions)
        stepped = Stepped(observation, *self._layout[1].read(outcome), ended=None)
        if self.autoreset == "same-step":
            indices = np.flatnonzero(stepped.terminated | stepped.truncated)
            if indices.size:
                return self._restart(stepped, indices)
        return stepped

    def step_one(self, action: np.ndarray) -> tuple[Any, np.float32, bool, bool, dict[str, Any]]:
        """As `step` for a single environment that the caller resets, without a leading axis.

        Args:
            action: int32[1], in the action space.

        Returns:
            The observation, on the device and with its leading axis; reward, terminated,
            truncated, info, as numpy scalars, Python's bools, and new arrays.
        """
        observation, outcome = self._advance(action)
        return observation, *self._layout[1].read_one(outcome)

    def _advance(self, actions: Any) -> tuple[Any, jax.Array]:
        """Step all environments: observations and packed outcomes."""
        self._kept, observation, outcome = batch_calls.step(
            self._stepped, self._plan, self._kept, actions, self._packed_params
        )
        return observation, outcome

    def observe(self, env: AnyEnvironment) -> Any:
        """The observations of the current states by `env`; needs a reset first."""
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
            # Pad with the last index, which then writes the same values again.
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
        """The streams: new ones where there is a seed; before the first reset, all new."""
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
    return [None if one is None else check_seed(one, 64) for one in seeds]
