"""PyTorch: many environments whose observations are tensors, without copies.

JAX hands each array over to torch by DLPack, on the device where it is stored. DLPack makes torch
wait until the array is ready.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..environment import AnyEnvironment, Autoreset
from ..errors import SettingError
from .batch import Batch, Ended, Stepped

try:
    import torch  # pyright: ignore[reportMissingImports]
except ImportError as error:
    raise ImportError(
        f"PyTorch is not installed ({error}): pip install 'jaxenstein[torch]'"
    ) from error

_INTEGERS = (torch.int64, torch.int32, torch.int16, torch.int8, torch.uint8)


class TensorInfo(Mapping[str, torch.Tensor]):
    """The info of a step by name; an array becomes a tensor when it is first read.

    Most loops read few entries, and converting an array takes as long as a small step.
    """

    def __init__(self, arrays: Mapping[str, jax.Array | np.ndarray], convert: Any) -> None:
        """Store the arrays and a function that converts an array to a tensor."""
        self._arrays = arrays
        self._convert = convert
        self._tensors: dict[str, torch.Tensor] = {}

    def __getitem__(self, name: str) -> torch.Tensor:
        """The tensor of that name; each call returns the same one."""
        if name not in self._tensors:
            self._tensors[name] = self._convert(self._arrays[name])
        return self._tensors[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self._arrays)

    def __len__(self) -> int:
        """The number of entries."""
        return len(self._arrays)

    def __repr__(self) -> str:
        """Shown as a dictionary."""
        return repr(dict(self))


class TorchBatch:
    """N environments of one kind for a training loop in PyTorch.

    You may keep tensors and write to them: no later step reads or overwrites them. (A JAX array
    that shares the memory would show what you wrote.)

    On a GPU, each step waits for the work that torch queued on its current stream before the step,
    and torch waits for the step. If you use other torch streams, synchronise them yourself.
    """

    def __init__(
        self,
        env: AnyEnvironment,
        params: Any = None,
        num_envs: int = 1,
        *,
        autoreset: Autoreset | None = "same-step",
    ) -> None:
        """Create `num_envs` environments; compiles and renders nothing before `reset`.

        Args:
            env: the environment from `jaxenstein.make`; its own `autoreset` and
                `final_observation` do not matter.
            params: its params, each one number for all environments, an array with a leading
                axis N, or a range from which each episode draws by its seed.
            num_envs: N, at least 1.
            autoreset: `"same-step"`, `"next-step"` or None; see `jaxenstein.Environment`.

        Raises:
            SettingError: `num_envs`, `autoreset` or `params` is invalid.
        """
        self.batch = Batch(env, params, num_envs, autoreset=autoreset, spread=False)
        self.num_envs = num_envs
        self.num_actions = env.num_actions
        # Tensors are on the device on which JAX computes.
        self.device = torch.from_dlpack(jnp.zeros(1, jnp.uint8)).device

    def reset(
        self, seed: int | list[int | None] | None = None, mask: torch.Tensor | None = None
    ) -> tuple[Any, TensorInfo]:
        """Start new episodes; returns observations and info.

        Args:
            seed: seeds of the random streams: N numbers, or one number for seed, seed + 1, ...
                None continues the streams; before the first reset it draws random seeds.
            mask: bool[N], which environments to reset; None for all.

        Returns:
            Observations of all environments (also of those that were not reset) and info.

        Raises:
            SettingError: the seed or mask is invalid.
        """
        host = mask.numpy(force=True) if mask is not None and torch.is_tensor(mask) else mask
        observation, info = self.batch.reset(seed, host)
        return self._tensors(observation), TensorInfo(info, self._tensor)

    def step(self, actions: torch.Tensor) -> Stepped[torch.Tensor]:
        """Step every environment.

        Args:
            actions: integers [N] on any device; you may overwrite them afterwards. Actions
                outside the action space do nothing.

        Raises:
            SettingError: the actions have another shape or dtype, or `reset` was not called.
        """
        *values, info, ended = self.batch.step(self._to_jax(actions))
        observation, reward, terminated, truncated = self._tensors(values)
        tensors = TensorInfo(info, self._tensor)
        return Stepped(observation, reward, terminated, truncated, tensors, self._ended(ended))

    def _to_jax(self, actions: torch.Tensor) -> jax.Array:
        if not isinstance(actions, torch.Tensor) or actions.dtype not in _INTEGERS:
            kind = getattr(actions, "dtype", type(actions).__name__)
            raise SettingError(
                f"actions must be a torch tensor of {self.num_envs} integers, not {kind}"
            )
        # Clamp before the cast to int32 could wrap around. The result is new memory, because JAX
        # may read it after the caller has overwritten the actions.
        known = actions.to(self.device, torch.int64).clamp(-1, self.num_actions)
        return jnp.from_dlpack(known.to(torch.int32))

    def _ended(self, ended: Ended[np.ndarray] | None) -> Ended[torch.Tensor] | None:
        if ended is None:
            return None
        indices, observation = self._tensors(ended[:2])
        return Ended(indices, observation, TensorInfo(ended.info, self._tensor))

    def _tensors(self, values: Any) -> Any:
        return jax.tree.map(self._tensor, values)

    def _tensor(self, value: jax.Array | np.ndarray) -> torch.Tensor:
        if isinstance(value, np.ndarray):
            return torch.from_numpy(value).to(self.device)
        return torch.from_dlpack(value)
