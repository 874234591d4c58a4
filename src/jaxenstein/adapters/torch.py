"""PyTorch: many environments whose observations are tensors in the memory that JAX drew them in.

Nothing is copied on the way to torch: JAX hands each array over by DLPack, on the device on which
it lies, and torch waits for it as the protocol says.
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
    """What a step tells, by name: an array becomes a tensor when it is first read.

    Most loops read few entries, and handing over an array costs as much as a small step.
    """

    def __init__(self, arrays: Mapping[str, jax.Array | np.ndarray], convert: Any) -> None:
        """Hold the arrays and the function that makes a tensor of one."""
        self._arrays = arrays
        self._convert = convert
        self._tensors: dict[str, torch.Tensor] = {}

    def __getitem__(self, name: str) -> torch.Tensor:
        """The tensor of that name, each time the same."""
        if name not in self._tensors:
            self._tensors[name] = self._convert(self._arrays[name])
        return self._tensors[name]

    def __iter__(self) -> Iterator[str]:
        """The names."""
        return iter(self._arrays)

    def __len__(self) -> int:
        """How many entries there are."""
        return len(self._arrays)

    def __repr__(self) -> str:
        """As a dictionary."""
        return repr(dict(self))


class TorchBatch:
    """N environments of one kind for a training loop in PyTorch.

    Every tensor keeps its values for as long as it is held, and may be written to: no step reads
    or overwrites what an earlier one handed out. (Reading the same memory again as a JAX array
    would show what was written.)

    On a GPU each step waits for the work that torch has queued on its current stream before the
    step, and torch for the step. Work on other streams of torch is the caller's to order.
    """

    def __init__(
        self,
        env: AnyEnvironment,
        params: Any = None,
        num_envs: int = 1,
        *,
        autoreset: Autoreset | None = "same-step",
    ) -> None:
        """Hold `num_envs` environments; nothing is compiled or drawn before `reset`.

        Args:
            env: the environment, as `jaxenstein.make` returns it; its own `autoreset` and
                `final_observation` do not matter.
            params: its params, each one number for all environments, an array with a leading
                axis N, or a range from which each episode draws by its seed.
            num_envs: N, at least 1.
            autoreset: `"same-step"`, `"next-step"` or None, as `jaxenstein.Environment.autoreset`.

        Raises:
            SettingError: for a wrong `num_envs`, `autoreset` or `params`.
        """
        self.batch = Batch(env, params, num_envs, autoreset=autoreset, spread=False)
        self.num_envs = num_envs
        self.num_actions = env.num_actions
        # Where JAX puts what it computes is where the tensors are.
        self.device = torch.from_dlpack(jnp.zeros(1, jnp.uint8)).device

    def reset(
        self, seed: int | list[int | None] | None = None, mask: torch.Tensor | None = None
    ) -> tuple[Any, TensorInfo]:
        """Begin new episodes: observations and info.

        Args:
            seed: of the random streams: N numbers, or one, which stands for seed, seed + 1, ...
                None goes on with the stream; before the first reset it begins one by chance.
            mask: bool[N], which environments to reset; None for all.

        Returns:
            Observations of all environments (also of those that were not reset) and info.

        Raises:
            SettingError: for a wrong seed or mask.
        """
        host = mask.numpy(force=True) if mask is not None and torch.is_tensor(mask) else mask
        observation, info = self.batch.reset(seed, host)
        return self._tensors(observation), TensorInfo(info, self._tensor)

    def step(self, actions: torch.Tensor) -> Stepped[torch.Tensor]:
        """Step every environment.

        Args:
            actions: integers [N], on any device; they may be overwritten afterwards. Actions
                outside of the action space do nothing.

        Raises:
            SettingError: the actions have another shape or type, or `reset` was not called.
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
        # Cut off before the cast to int32 could wrap around. What JAX gets is always new memory:
        # it may read it later than the caller writes to theirs.
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
