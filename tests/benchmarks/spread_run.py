"""Run by test_programs.py: compare trajectories on several devices with those on one.

python -m tests.benchmarks.spread_run 8                      # devices of one process
python -m tests.benchmarks.spread_run 2 HOST:PORT 2 INDEX    # devices of each of two
"""

import re
import sys
from unittest import mock

import jax
import jax.numpy as jnp
import numpy as np

import jaxenstein
from benchmarks.spread import make_mesh, make_spread_rollout
from tests.reference.frames import plain_frame

BATCH, STEPS = 16, 12
# An own map: short episodes, so that many end within a few steps.
MAP = "#####\n#S.G#\n#S..#\n#####"


def rows(array):
    """The environments of an array that this process holds: index and values."""
    if jnp.issubdtype(array.dtype, jax.dtypes.prng_key):
        array = jax.random.key_data(array)
    for shard in array.addressable_shards:
        yield shard.index[0], np.asarray(shard.data)


def main():
    devices, *processes = sys.argv[1:]
    jax.config.update("jax_num_cpu_devices", int(devices))
    count = 1
    if processes:
        count = int(processes[1])
        jax.distributed.initialize(processes[0], count, int(processes[2]))
    assert jax.device_count() == int(devices) * count
    env, params = jaxenstein.from_ascii(MAP, height=8, width=8)
    params = params.replace(max_steps_in_episode=9)
    carries = []
    for mesh in (make_mesh(jax.local_devices()[:1]), make_mesh(jax.devices())):
        rollout, start = make_spread_rollout(env, params, BATCH, STEPS, mesh)
        carry = start(np.uint32(3))
        program = rollout.lower(carry).compile()
        # Nothing goes from one device to another.
        assert not re.search("all-(reduce|gather|to-all)|collective", str(program.as_text()))
        carries.append(program(program(carry)))
    for one, many in zip(*map(jax.tree.leaves, carries), strict=True):
        assert len(many.sharding.device_set) == jax.device_count()
        ((_, expected),) = rows(one)
        held = 0
        for index, values in rows(many):
            np.testing.assert_allclose(values, expected[index], rtol=1e-6, atol=1e-6)
            held += len(values)
        # An empty array can be on any device.
        assert held == BATCH // count or not many.size
    episodes = np.concatenate([values for _, values in rows(carries[1].episodes)])
    assert (episodes >= 1).all()
    print("equal")


if __name__ == "__main__":
    # The device of a frame does not depend on its content.
    with mock.patch("jaxenstein.tasks.first_person.render", plain_frame):
        main()
