"""Run by test_batch.py: compare a batch on two simulated devices with one on a single device."""

from typing import Any
from unittest import mock

import jax
import numpy as np
import pytest

import jaxenstein
from jaxenstein.adapters.batch import Batch
from jaxenstein.environment import Autoreset
from tests.adapters.corridor import make_crowd
from tests.reference.frames import plain_frame

# What is done with frames matters here, not what they show; these compile in a third of the time.
mock.patch("jaxenstein.tasks.first_person.render", plain_frame).start()
COUNT, STEPS = 6, 12

env, params = make_crowd()
assert jax.device_count() == 2
assert Batch(env, params, COUNT + 1)._mesh is None
params_per_environment = params.replace(
    move_distance=np.linspace(0.3, 0.6, COUNT, dtype=np.float32)
)
modes: tuple[tuple[Autoreset, Any], ...] = (
    ("same-step", params_per_environment),
    ("next-step", params),
)
# Where params lie does not matter.
params_on_second_device = jax.device_put(env.check_params(params), jax.devices()[1])
for mode, given in modes:
    rng = np.random.default_rng(0)
    there = jax.device_put(env.check_params(given), jax.devices()[1])
    spread = Batch(env, there, COUNT, autoreset=mode)
    alone = Batch(env, given, COUNT, autoreset=mode, spread=False)
    first = [batch.reset(3)[0] for batch in (spread, alone)]
    np.testing.assert_array_equal(*first)
    ended = 0
    for time in range(STEPS):
        actions = rng.choice(5, size=COUNT, p=[0.1, 0.1, 0.8, 0.0, 0.0]).astype(np.int32)
        if time == 5:
            mask = np.arange(COUNT) % 2 == 0
            np.testing.assert_array_equal(*(b.reset(mask=mask)[0] for b in (spread, alone)))
        one, other = spread.step(actions), alone.step(actions)
        if one.ended is None:
            assert len(one.observation.sharding.device_set) == 2
        for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
            np.testing.assert_allclose(np.asarray(a), np.asarray(b), rtol=1e-6, atol=1e-6)
        ended += int((one.terminated | one.truncated).sum())
    assert ended > 0
params_on_two_devices = params_on_second_device.replace(
    discount=jax.device_put(np.float32(0.5), jax.devices()[0])
)
Batch(env, params_on_two_devices, COUNT, spread=False).reset(0)
with pytest.raises(jaxenstein.SettingError, match="already in use"):
    jaxenstein.use_cores(1)
print("equal")
