"""The device for one environment at a time."""

import os

import jax
import jax.numpy as jnp
import pytest

from jaxenstein._jax.inline import inline_device


def test_a_call_returns_when_its_program_has_finished() -> None:
    """With JAX's asynchronous dispatch, this call returns long before."""
    device = inline_device()
    assert device is not None
    assert device not in jax.devices()
    program = jax.jit(lambda x: jax.lax.fori_loop(0, 1_000_000, lambda i, y: jnp.sin(y + i), x))
    x = jax.device_put(jnp.float32(1), device)
    program(x).block_until_ready()
    assert program(x).is_ready()


@pytest.mark.parametrize("before", [None, "7"])
def test_the_environment_of_the_process_stays(
    before: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("NPROC", raising=False)
    if before is not None:
        monkeypatch.setenv("NPROC", before)
    inline_device.__wrapped__()
    assert os.environ.get("NPROC") == before


def test_a_jaxlib_without_such_clients_gives_no_device(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr("jaxlib.xla_client.make_cpu_client")
    before = os.environ.get("NPROC")
    assert inline_device.__wrapped__() is None
    assert os.environ.get("NPROC") == before
