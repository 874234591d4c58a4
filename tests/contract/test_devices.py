"""Environments and players inside `jax.shard_map` with its default checks."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein.players import play, player_of

SIZE = {"height": 8, "width": 8}
WIDE = "#" * 90 + "\n#S" + "." * 86 + "G#\n" + "#" * 90


KEYS = jax.random.split(jax.random.key(0), 3)


def sharded():
    """`jax.shard_map` over one device, its spec, and keys on that device."""
    mesh = jax.make_mesh((1,), ("env",))
    spec = jax.sharding.PartitionSpec("env")
    keys = jax.device_put(KEYS, jax.sharding.NamedSharding(mesh, spec))
    return functools.partial(jax.shard_map, mesh=mesh, in_specs=spec), spec, keys


def play_batch(env, params, keys):
    """Play some steps of a batch: the last state, and the observations."""
    choose = player_of(env)(env, params)
    obs, states = jax.vmap(env.reset, (0, None))(keys, params)

    def step(carry, key):
        states, _ = carry
        actions = jax.vmap(choose)(keys, states)
        each = jax.vmap(lambda k: jax.random.fold_in(k, key))(keys)
        obs, states, reward, *_, info = jax.vmap(env.step, (0, 0, 0, None))(
            each, states, actions, params
        )
        return (states, obs), (reward, info["success"])

    carry, told = jax.lax.scan(step, (states, obs), jnp.arange(2, dtype=jnp.uint32))
    return carry, jax.tree.map(lambda t: t.T, told)


CASES = [
    ("key-door", {"frame_skip": 3}),
    ("my-way-home", {"autoreset": "next-step"}),
    ("health-gathering", {"observation": "depth"}),
    ("health-gathering", {"frame_skip": 2}),
    ("key-corridor", {"autoreset": None}),
    ("key-corridor-s3r1", {"split": "test"}),
    ("dmlab-random-goal-01", {"final_observation": True}),
    ("doom-my-way-home", {}),
    ("doom-health-gathering", {"frame_skip": 4}),
]


@pytest.mark.parametrize(("name", "settings"), CASES)
def test_replication_checks_pass(name, settings):
    """The checks run when the program is traced."""
    spread, spec, keys = sharded()
    env, params = jaxenstein.make(name, **SIZE, **settings)
    out = jax.eval_shape(spread(functools.partial(play_batch, env, params), out_specs=spec), keys)
    assert all(leaf.shape[0] == len(KEYS) for leaf in jax.tree.leaves(out))


def test_whole_episodes_and_wide_maps():
    spread, spec, keys = sharded()
    env, params = jaxenstein.from_ascii(WIDE, **SIZE)

    def run(keys):
        obs, states = jax.vmap(env.reset, (0, None))(keys, params)
        return obs, play(env, player_of(env), params, keys[0], states)

    _, played = jax.eval_shape(spread(run, out_specs=spec), keys)
    assert played.length.shape == (len(KEYS),)


def test_steps_inside_shard_map_equal_those_outside():
    spread, spec, keys = sharded()
    env, params = jaxenstein.make("key-door", **SIZE)
    run = functools.partial(play_batch, env, params)
    got = jax.jit(spread(run, out_specs=spec))(keys)
    jax.tree.map(np.testing.assert_array_equal, got, jax.jit(run)(KEYS))
