"""An agent of `jaxenstein export --program`, which acts without jaxenstein being installed.

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
# Zeros for the memory begin an episode; zeros for the frames only stand for yours.
carry, observations, _ = jax.tree.map(
    lambda leaf: np.zeros((AGENTS, *leaf.shape[1:]), leaf.dtype), shapes
)
for step in range(STEPS):
    keys = jax.random.key_data(jax.random.split(jax.random.key(step), AGENTS))
    carry, actions = program.call(carry, observations, keys)
    print(*np.asarray(actions))  # one for each agent; "actions" in the .npz file names them
