"""Several processes that train together, on one machine or more.

Each process runs the same program on its own devices. Process 0 has the files; the other processes
get from it what they need. With one process, these functions do nothing.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import socket
import sys
import time
from collections.abc import Iterator
from typing import Any, NoReturn

import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental import multihost_utils

from ...errors import SettingError, one_line
from .checkpoints import raw, typed

AUTO = "auto"
# Seconds to wait for the other processes at the start.
WAIT = 300


@contextlib.contextmanager
def joined(coordinator: str, processes: int | None, process: int | None) -> Iterator[None]:
    """Train in the block together with other processes, which make the same calls.

    If one process fails, it ends at once with its message, and JAX ends the others.

    Args:
        coordinator: address of process 0, as HOST:PORT; `AUTO` if Slurm, Open MPI or a TPU pod
            tells JAX all three arguments.
        processes: the number of processes.
        process: the number of this process, from 0.

    Raises:
        SettingError: the address is wrong, or no process listens there.
        RuntimeError: JAX cannot start, or a process failed.
    """
    if process:
        _reach(coordinator)
    try:
        if coordinator == AUTO:
            jax.distributed.initialize(initialization_timeout=WAIT)
        else:
            jax.distributed.initialize(coordinator, processes, process, initialization_timeout=WAIT)
    except ValueError as error:
        raise SettingError(f"--coordinator {coordinator}: {one_line(str(error))}") from error
    try:
        yield
    except BaseException as error:
        # Runs before JAX's own function, which would wait for the other processes.
        atexit.register(_leave)
        # JAX also raises a ValueError if a connection breaks.
        lost = type(error) is ValueError and "Gloo" in str(error)
        if lost or isinstance(error, jax.errors.JaxRuntimeError):
            me = f"process {jax.process_index()} of {jax.process_count()}"
            raise RuntimeError(
                f"{me} stopped because another process ended or a computation failed; if another "
                f"ended, its own output says why. JAX: {one_line(str(error))}"
            ) from error
        raise


def _reach(coordinator: str) -> None:
    """Wait until a process listens at an address, since JAX would abort without a message."""
    if coordinator == AUTO:
        return
    host, _, port = coordinator.rpartition(":")
    end = time.monotonic() + WAIT
    while True:
        try:
            socket.create_connection((host.strip("[]"), int(port)), timeout=5).close()
            return
        except OSError as error:
            if time.monotonic() > end:
                raise SettingError(
                    f"no process listens at {coordinator} ({error}): start process 0 there, and "
                    f"the others within {WAIT} seconds"
                ) from error
        time.sleep(0.2)


def _leave() -> NoReturn:
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(1)


def is_leader() -> bool:
    """Whether this process has the files: it is process 0, or the only one."""
    return jax.process_index() == 0


def shared(value: Any) -> Any:
    """The value of process 0, plain JSON; the other processes may pass anything."""
    if jax.process_count() == 1:
        return value
    return json.loads(_sent(json.dumps(value).encode() if is_leader() else b""))


def _sent(data: bytes) -> bytes:
    """The bytes of process 0. JAX sends arrays as sums, which turn -0.0 into 0.0."""
    mine = np.frombuffer(data, np.uint8)
    size = int(multihost_utils.broadcast_one_to_all(np.uint32(mine.size)))
    whole = multihost_utils.broadcast_one_to_all(mine if is_leader() else np.zeros(size, np.uint8))
    return np.asarray(whole).tobytes()


def shared_state(state: Any, like: Any) -> Any:
    """The state of process 0; `like` has its structure in every process."""
    if jax.process_count() == 1:
        return state
    leaves, structure = jax.tree.flatten(like)
    mine = jax.tree.leaves(state) if is_leader() else [None] * len(leaves)

    # One array after another, since a copy of each is on a device for a moment.
    def sent(leaf: Any, one: Any) -> Any:
        like = raw(one)
        data = _sent(np.asarray(raw(leaf)).tobytes() if is_leader() else b"")
        return typed(jnp.asarray(np.frombuffer(data, like.dtype).reshape(like.shape)), one)

    return jax.tree.unflatten(structure, list(map(sent, mine, leaves)))


def any_process(*flags: bool) -> tuple[bool, ...]:
    """Whether each flag is true in any process."""
    if jax.process_count() == 1:
        return flags
    together = multihost_utils.process_allgather(np.array(flags))
    return tuple(map(bool, together.any(axis=0)))


def gathered(tree: Any) -> Any:
    """A tree of arrays as NumPy arrays, whole in every process, with raw data of typed keys.

    With one process, the tree itself.
    """
    if jax.process_count() == 1:
        return tree
    return jax.tree.map(lambda leaf: multihost_utils.process_allgather(raw(leaf), tiled=True), tree)
