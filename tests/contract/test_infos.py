"""Steps give the same bits for one environment, in a batch, and in a loop on the device.

Only programs that are compiled as users compile them differ where something is amiss.
"""

from __future__ import annotations

from typing import Any

import jax
import numpy as np
import pytest

import jaxenstein
from jaxenstein.catalogue import MAIN_IDS
from jaxenstein.environment import outcome_of

MEMBERS, STEPS = 3, 60


def assert_same(one: Any, other: Any) -> None:
    for (path, a), b in zip(
        jax.tree_util.tree_leaves_with_path(one), jax.tree.leaves(other), strict=True
    ):
        np.testing.assert_array_equal(a, b, err_msg=jax.tree_util.keystr(path))


def at(tree: Any, index: Any) -> Any:
    return jax.tree.map(lambda leaf: leaf[index], tree)


@pytest.mark.slow
@pytest.mark.parametrize("name", MAIN_IDS)
def test_infos_alone_in_a_batch_and_in_a_loop(name: str) -> None:
    env, params = jaxenstein.make(name, height=8, width=8)
    keys = jax.random.split(jax.random.key(1), (STEPS + 1, 2, MEMBERS))
    keys = np.asarray(jax.random.key_data(keys))
    rng = np.random.default_rng(0)
    actions = rng.integers(0, env.num_actions, (STEPS, MEMBERS)).astype(np.int32)
    forward = [i for i, words in enumerate(env.action_names) if "forward" in words]
    if forward:
        actions = np.where(rng.random(actions.shape) < 0.6, np.int32(forward[0]), actions)

    def step(state: Any, given: Any) -> tuple[Any, Any]:
        step_key, reset_key, action = given
        out = outcome_of(env, step_key, reset_key, state, action, params)
        return out.state, (out.reward, out.terminated, out.truncated, out.info)

    first = jax.jit(jax.vmap(env.first_state, (0, None)))
    starts = jax.device_get(first(keys[0, 0], env.check_params(params)))
    given = keys[1:, 0], keys[1:, 1], actions
    batch, alone = jax.jit(jax.vmap(step)), jax.jit(step)
    loop = jax.jit(lambda state, given: jax.lax.scan(step, state, given)[1])
    states, told = starts, []
    for time in range(STEPS):
        states, out = batch(states, at(given, time))
        told.append(jax.device_get(out))
    wanted = jax.tree.map(lambda *rows: np.stack(rows), *told)
    for i in range(MEMBERS):
        state, own, member = (
            at(starts, i),
            at(given, (slice(None), i)),
            at(wanted, (slice(None), i)),
        )
        assert_same(jax.device_get(loop(state, own)), member)
        for time in range(STEPS):
            state, out = alone(state, at(own, time))
            assert_same(jax.device_get(out), at(member, time))
