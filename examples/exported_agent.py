"""Use an agent from `jaxenstein export --program` without jaxenstein.

python examples/exported_agent.py agent.jaxexport          needs pip install jax flatbuffers
"""

import sys

import jax
import numpy as np
from jax import export

AGENTS, STEPS = 2, 3  # any numbers

with open(sys.argv[1], "rb") as file:
    program = export.deserialize(bytearray(file.read()))
shapes, _ = jax.tree.unflatten(program.in_tree, program.in_avals)
# Zeros in the memory start an episode. Replace the zeros in the observations by your frames.
carry, observations, _ = jax.tree.map(
    lambda leaf: np.zeros((AGENTS, *leaf.shape[1:]), leaf.dtype), shapes
)
for step in range(STEPS):
    keys = jax.random.key_data(jax.random.split(jax.random.key(step), AGENTS))
    carry, actions = program.call(carry, observations, keys)
    print(*np.asarray(actions))  # one per agent; "actions" in the .npz file names them
