"""Run by test_placement.py in a separate process with several simulated devices.

In a world whose frames compile in a moment; with "rendered", in one that the engine shows.
"""

import re
import sys

import jax
import numpy as np

import jaxenstein
from jaxenstein.baselines import Config, Learner
from jaxenstein.baselines.state import place
from tests.baselines.worlds import Memory

MOVES = re.compile(r"= .* (all-gather|all-to-all|collective-permute|all-reduce)(-start)?\(")


def compare(env, params, algo, **settings):
    config = Config(
        algo=algo, num_envs=8, rollout=8, minibatches=2, epochs=2, features=8, hidden=8, head=8,
        shards=4, total_steps=1000, normalise_bonus=True, **settings,
    )  # fmt: skip
    learner = Learner(env, params, config)
    state, numbers = learner.init(jax.random.key(0)), learner.loop.numbers(None)
    alone, expected = learner.train_chunk(state, numbers, 2)
    state = place(state, config)
    program = learner._train.lower(state, numbers, number=2).compile()
    # Byte arrays are frames, which must not move between devices.
    moved = [line for line in str(program.as_text()).splitlines() if MOVES.search(line)]
    assert moved
    assert not [line for line in moved if "u8[" in line]
    spread, metrics = program(state, numbers)
    assert len(spread.actors.memory.sharding.device_set) == 4
    for leaf, shape in ((spread.actors.memory, (2, 8)), (spread.scale.total, (2,))):
        assert {part.data.shape for part in leaf.addressable_shards} == {shape}
    assert {part.data.shape for part in spread.bonus.inverse.addressable_shards} == {(2, 8, 8)}
    for one, other in ((alone, spread), (expected, metrics)):
        jax.tree.map(
            lambda a, b: np.testing.assert_allclose(a, b, rtol=2e-4, atol=2e-5), one, other
        )


def main():
    assert jax.device_count() == 4
    env = Memory(delay=8)
    params = env.default_params
    if sys.argv[1:] == ["rendered"]:
        env, params = jaxenstein.from_ascii("####\n#SG#\n####", height=8, width=8)
    params = params.replace(max_steps_in_episode=5)
    compare(env, params, "e3b", bonus={"e3b_latent": 8, "e3b_hidden": 8})
    print("equal")


if __name__ == "__main__":
    main()
