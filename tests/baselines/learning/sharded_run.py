"""Run by test_sharding.py in a process of its own, with several simulated devices."""

import re

import jax
import numpy as np

import jaxenstein
from jaxenstein.baselines import Config, HParams, make_learner
from jaxenstein.baselines.learning.sharding import make_mesh, shard

MOVES = re.compile(r"= .* (all-gather|all-to-all|collective-permute|all-reduce)(-start)?\(")


def compare(env, params, algo, **settings):
    config = Config(
        algo=algo, num_envs=8, rollout=8, minibatches=2, epochs=2, features=8, hidden=8, head=8,
        rnd_hidden=8, rnd_output=8, icm_latent=8, icm_hidden=8, shards=4, total_steps=1000,
        normalise_bonus=True, **settings,
    )  # fmt: skip
    learner = make_learner(env, params, config)
    state = learner.init(jax.random.key(0))
    alone, expected = learner.train_chunk(state, HParams(), 2)
    state, numbers = shard(state, make_mesh(), config), HParams().check()
    program = learner._train.lower(state, numbers, updates=2).compile()
    # Bytes are frames: none may go from one device to another.
    moved = [line for line in str(program.as_text()).splitlines() if MOVES.search(line)]
    assert moved
    assert not [line for line in moved if "u8[" in line]
    spread, metrics = program(state, numbers)
    assert len(spread.actors.memory.sharding.device_set) == 4
    assert {s.data.shape for s in spread.actors.memory.addressable_shards} == {(2, 8)}
    for one, other in ((alone, spread), (expected, metrics)):
        jax.tree.map(
            lambda a, b: np.testing.assert_allclose(a, b, rtol=2e-4, atol=2e-5), one, other
        )


def main():
    assert jax.device_count() == 4
    env, params = jaxenstein.from_ascii("####\n#SG#\n####", height=8, width=8)
    params = params.replace(max_steps_in_episode=5)
    compare(env, params, "rnd")
    print("equal")


if __name__ == "__main__":
    main()
