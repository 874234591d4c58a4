"""The stages that are measured one by one, put together, draw the frames of the environment."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from benchmarks.subjects.stages import STAGES, make_stage

BATCH = 3


@pytest.fixture(scope="module")
def world():
    return jaxenstein.make("health-gathering", height=12, width=16)


def test_pixels_are_frames(world):
    """The last stage, whose inputs all the others make."""
    env, params = world
    keys = jax.random.split(jax.random.key(0), BATCH)
    frames, _ = jax.vmap(env.reset, (0, None))(keys, params)
    assert list(STAGES)[-1] == "pixels"
    program, given = make_stage(env, params, BATCH, "pixels")
    np.testing.assert_array_equal(program(*given), frames)


def test_rules_walk(world):
    env, params = world
    program, (keys, state) = make_stage(env, params, BATCH, "rules")
    action = jnp.full(BATCH, env.num_actions - 1, jnp.int32)
    after, *_ = program(keys, state)
    expected, *_ = jax.vmap(env.advance, (0, 0, 0, None))(keys, state, action, params)
    np.testing.assert_allclose(after.position, expected.position, rtol=1e-6)
    assert np.all(after.time == 1)


def test_an_unknown_stage_is_refused(world):
    env, params = world
    with pytest.raises(ValueError, match="known: keys, rules"):
        make_stage(env, params, BATCH, "lunch")
