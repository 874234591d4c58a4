"""A device for one environment at a time: the CPU, without other threads.

JAX hands every program for the CPU to another thread, and parts of it to more threads. For a step
of one environment, that takes several times as long as the step itself.
"""

from __future__ import annotations

import contextlib
import functools
import os
from collections.abc import Iterator
from typing import Any

import jax

# From this variable, jaxlib takes the number of threads of a new client.
_THREADS = "NPROC"


@functools.cache
def inline_device() -> Any:
    """A CPU device whose programs run in the calling thread; None if there cannot be one.

    The device belongs to a client of its own, so that no setting of the process changes. Arrays of
    other devices can be passed to its programs, which copies them. There is none where JAX uses
    another backend or several processes, or where jaxlib no longer makes such clients, which is
    not part of its public interface.
    """
    if jax.default_backend() != "cpu" or jax.process_count() > 1:
        return None
    try:
        from jaxlib import xla_client

        with _one_thread():
            client = xla_client.make_cpu_client(asynchronous=False, num_devices=1)
    except (ImportError, AttributeError, TypeError):
        return None
    return client.local_devices()[0]


@contextlib.contextmanager
def _one_thread() -> Iterator[None]:
    before = os.environ.get(_THREADS)
    os.environ[_THREADS] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[_THREADS]
        else:
            os.environ[_THREADS] = before
