"""The measurements of an accelerator, with tiny sizes on the CPU."""

import json
import sys
import types

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from benchmarks import device
from benchmarks.report.results import Result, device_row
from benchmarks.report.tables import table_of
from benchmarks.store import earlier
from benchmarks.subjects.frames import make_frames, make_keeping_rollout
from jaxenstein.files import OutputError
from jaxenstein.speed.random_rollout import make_random_rollout

TINY = ["--ids", "simple", "--batches", "2", "--seconds", "0.01", "--repeats", "2", "--steps", "2",
        "--copy-bytes", "4096"]  # fmt: skip


def test_frames_are_drawn_and_those_of_the_states():
    env, params = jaxenstein.make("simple", height=6, width=8)
    obs, state = jax.vmap(env.reset, (0, None))(jax.random.split(jax.random.key(0), 3), params)
    first = np.asarray(obs)
    place = np.asarray(state.position)
    state, obs, _ = make_frames(env, params, 5)((state, obs, jnp.copy(state.position)))
    assert (np.asarray(obs) != first).any()
    assert np.abs(np.asarray(state.position) - place).max() <= 1.0001e-4
    drawn = jax.jit(jax.vmap(lambda s: env.observe(s, params)))(state)
    np.testing.assert_array_equal(drawn, obs)


def test_kept_frames_are_those_of_the_rollout():
    env, params = jaxenstein.make("simple", height=6, width=8)
    rollout, start = make_keeping_rollout(env, params, 3, 4)
    once, first = make_random_rollout(env, params, 3, 1)
    carry, other = start(jax.random.key(1)), first(jax.random.key(1))
    # The second call begins with the last frame of the first.
    for _ in range(2):
        carry = rollout(carry)
        for frame in np.array(carry[1]):
            other = once(other)
            np.testing.assert_array_equal(frame, other.obs)
    np.testing.assert_array_equal(carry[0].state.time, other.state.time)


@pytest.mark.slow
def test_results_and_going_on(tmp_path, capsys, monkeypatch):
    file = tmp_path / "device.json"
    device.main([*TINY, "--sizes", "8x6", "--json", str(file), "--profile"])
    report = json.loads(file.read_text())
    (row,) = report["rows"]
    assert (row["id"], row["batch"], row["height"], row["width"]) == ("simple", 2, 6, 8)
    assert row["frame_bytes"] == 6 * 8 * 3
    assert len(row["steps_per_second"]["repeats"]) == 2
    assert row["steps_per_second"]["median"] > 0
    assert row["frames_per_second"]["median"] > 0
    assert row["program_bytes"] >= 2 * 6 * 8 * 3
    assert report["copy_bytes_per_second"] > 0
    measured = []

    def measure(name, batch, size, options):
        measured.append((name, batch, size))
        return row | {"height": size[0], "width": size[1]}

    monkeypatch.setattr(device, "measure_case", measure)
    profiled = [*TINY, "--json", str(file), "--profile"]
    device.main([*profiled, "--sizes", "8x6,6x5"])
    assert measured == [("simple", 2, (5, 6))]
    assert json.loads(file.read_text())["rows"][0] == row
    device.main([*profiled, "--sizes", "4x4", "--minutes", "1e-9"])
    assert "the same command goes on" in capsys.readouterr().out
    again = json.loads(file.read_text())
    assert len(again["rows"]) == 2
    assert again["copy_bytes_per_second"] == report["copy_bytes_per_second"]
    with pytest.raises(OutputError, match="measured with profile True, not False"):
        device.main([*TINY, "--sizes", "4x4", "--json", str(file)])


def test_reports_of_other_devices_are_kept(tmp_path):
    file, now = tmp_path / "device.json", {"device": "gpu: X"}
    assert earlier(file, now) is None
    file.write_text('{"rows": [1], "device": "gpu: X"}')
    assert earlier(file, now) == {"rows": [1], "device": "gpu: X"}
    with pytest.raises(OutputError, match="device gpu: X, not gpu: Y"):
        earlier(file, {"device": "gpu: Y"})
    for other in ("[]", "{", '"text"'):
        file.write_text(other)
        with pytest.raises(OutputError, match="no result of this command"):
            earlier(file, now)


def test_what_does_not_fit_is_told(monkeypatch):
    def fail(*_):
        raise jax.errors.JaxRuntimeError("RESOURCE_EXHAUSTED: Out of memory\nmore")

    monkeypatch.setattr(device, "make_random_rollout", fail)
    options = types.SimpleNamespace(steps=1, repeats=1, seconds=0.01, profile=False)
    row = device.measure_case("simple", 2, (4, 4), options)
    assert row["failed"] == "RESOURCE_EXHAUSTED: Out of memory"
    table = table_of("device", Result({}, [device_row(row, 1e9)]))
    assert table.splitlines()[-1].startswith("| simple | 4x4 | 2 | not measured |  |")


def test_kernels_are_those_of_the_streams_alone(monkeypatch):
    def named(name, **inside):
        return types.SimpleNamespace(name=name, **inside)

    events = [named("kernel", duration_ns=5.0), named("copy", duration_ns=7.0)]
    planes = [
        named("/host:CPU", lines=[named("Stream #1", events=events)]),
        named("/device:GPU:0", lines=[
            named("Stream #7(Compute)", events=events), named("XLA Ops", events=events),
        ]),
    ]  # fmt: skip

    class Data:
        @staticmethod
        def from_file(path):
            assert path.endswith(".xplane.pb")
            return named("profile", planes=planes)

    monkeypatch.setattr(jax.profiler, "ProfileData", Data, raising=False)
    found = device.count_kernels(lambda: jax.block_until_ready(jnp.ones(3, jnp.float32) * 2))
    assert found == {"count": 2.0, "seconds": pytest.approx(12e-9)}
    monkeypatch.delattr(jax.profiler, "ProfileData")
    assert device.count_kernels(lambda: sys.exit("must not run")) is None
