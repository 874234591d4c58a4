"""Exports a trained agent as a serialised program that runs without this package."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp

from ...errors import SettingError
from ...fields import check_names
from ...files import atomic, check_writable
from ...params import split_ranges
from ..learner import PolicyCarry
from ..state import wrap_key
from .policies import TrainedPolicy

SUFFIX = ".jaxexport"
PLATFORMS = ("cpu", "cuda")
KNOWN = (*PLATFORMS, "rocm", "tpu")


def check_program(path: str | Path) -> None:
    """Check early whether a program can be written to a path.

    Raises:
        SettingError: the suffix is wrong, or flatbuffers is not installed.
        OutputError: the file cannot be written.
    """
    if Path(path).suffix != SUFFIX:
        raise SettingError(f"{path} should end in {SUFFIX}")
    if importlib.util.find_spec("flatbuffers") is None:
        raise SettingError(
            f"{path}: JAX needs flatbuffers to write programs: pip install flatbuffers"
        )
    check_writable(path)


def write_program(
    path: str | Path, agent: TrainedPolicy, platforms: Sequence[str] = PLATFORMS
) -> None:
    """Write an agent as a `jax.export` program, with its weights as constants.

    Call the program as `call(carry, obs, keys)`; it returns `(carry, actions)`. It acts for any
    number N of agents at once, each in its own environment:

    - carry: a dictionary of `memory` float32[N, hidden], `previous` int32[N] (the last action) and
      `started` bool[N]. All zeros start an episode;
    - obs: observations of the agent's environment, stacked along a leading axis [N];
    - keys: uint32[N, 2], threefry2x32 keys from `jax.random.key_data`;
    - actions: int32[N].

    Args:
        path: the file, which must end in `.jaxexport`; it is complete or absent.
        agent: the agent; a greedy agent ignores the keys.
        platforms: the JAX platforms that the program runs on.

    Raises:
        SettingError: as in `check_program`, or JAX does not know a platform.
        OutputError: as in `check_program`.
    """
    from jax import export

    check_program(path)
    check_names(platforms, KNOWN, "platform")
    params = split_ranges(agent.params)[0]
    obs, _ = jax.eval_shape(agent.env.reset, jax.random.key(0), params)
    one = _plain(agent.initial_carry()), obs, jax.ShapeDtypeStruct((2,), jnp.uint32)
    (number,) = export.symbolic_shape("N")
    many = jax.tree.map(lambda leaf: jax.ShapeDtypeStruct((number, *leaf.shape), leaf.dtype), one)

    def act(carry: Any, obs: Any, key: jax.Array) -> tuple[Any, jax.Array]:
        before = PolicyCarry(carry["memory"], carry["previous"], ~carry["started"])
        after, action = agent.apply(before, obs, wrap_key(key))
        return _plain(after), action

    data = export.export(jax.jit(jax.vmap(act)), platforms=platforms)(*many).serialize()
    with atomic(path) as temporary:
        temporary.write_bytes(data)


def _plain(carry: PolicyCarry) -> dict[str, jax.Array]:
    """The carry as a dictionary, in which all zeros start an episode."""
    return {"memory": carry.memory, "previous": carry.previous, "started": ~carry.first}
