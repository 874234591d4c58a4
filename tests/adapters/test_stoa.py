"""The Stoa adapter with Stoa: time steps, spaces, and the wrappers that Stoix uses."""

# The partner is an extra, which need not be there to check the types.
# pyright: reportMissingImports=false

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein.errors import SettingError

pytest.importorskip("stoa")
# Raised inside Stoa and its imports.
pytestmark = [
    pytest.mark.usefixtures("plain_frames"),
    pytest.mark.filterwarnings("ignore::DeprecationWarning:(stoa|chex|flax).*"),
]

import stoa  # noqa: E402
from stoa.core_wrappers.auto_reset import CachedAutoResetWrapper  # noqa: E402
from stoa.core_wrappers.vmap import VmapWrapper  # noqa: E402

from jaxenstein.adapters import stoa as adapter  # noqa: E402
from tests.adapters.corridor import FORWARD, MAP, SIZE  # noqa: E402

LEFT = 0
LIMIT = 12


def corridor(**settings: Any) -> adapter.StoaEnvironment:
    settings = {"autoreset": None, **SIZE, "heading": 0.0, **settings}
    env, params = jaxenstein.from_ascii(MAP, **settings)
    return adapter.StoaEnvironment(env, params.replace(max_steps_in_episode=LIMIT))


@pytest.fixture(scope="module")
def env() -> adapter.StoaEnvironment:
    return corridor()


def walk(env: Any, actions: Any, seed: int = 0) -> tuple[Any, Any]:
    """The first time step, and the steps of a scan [T, ...], which must have one structure."""
    state, first = env.reset(jax.random.key(seed))

    def step(carry: Any, action: jax.Array) -> Any:
        carry = env.step(carry[0], action)
        return carry, carry[1]

    return first, jax.jit(lambda c: jax.lax.scan(step, c, jnp.asarray(actions)))((state, first))[1]


def test_time_steps_separate_termination_from_truncation(env: adapter.StoaEnvironment) -> None:
    first, steps = walk(env, np.full(LIMIT + 2, FORWARD))
    assert first.first()
    assert (first.reward, first.discount) == (0, 1)
    goal = int(np.argmax(np.asarray(steps.reward) > 0))
    assert 0 < goal < LIMIT - 1
    kinds = np.asarray(steps.step_type)
    assert kinds.dtype == np.int8
    assert (kinds[:goal] == stoa.StepType.MID).all()
    assert kinds[goal] == stoa.StepType.TERMINATED
    assert steps.discount[goal] == 0
    assert (np.asarray(steps.discount[:goal]) == 1).all()
    assert steps.extras["episode_length"][goal] == goal + 1

    _, steps = walk(env, np.full(LIMIT, LEFT))
    assert steps.step_type[-1] == stoa.StepType.TRUNCATED
    assert steps.discount[-1] == 1
    assert (np.asarray(steps.step_type[:-1]) == stoa.StepType.MID).all()

    # Both ends in one step are an end of the task.
    params = env.params.replace(max_steps_in_episode=goal + 1)
    state, last = env.reset(jax.random.key(0))
    for _ in range(goal + 1):
        state, last = env.step(state, FORWARD, params)
    assert last.terminated()
    assert not last.truncated()
    assert last.discount == 0


@pytest.mark.parametrize("new_key", [jax.random.key, jax.random.PRNGKey])
def test_reset_and_step_have_the_same_structure(env: adapter.StoaEnvironment, new_key: Any) -> None:
    state, first = env.reset(new_key(0))
    after, step = env.step(state, LEFT)

    def described(tree: Any) -> Any:
        # Typed keys have no weak types.
        return jax.tree.map(
            lambda leaf: (leaf.shape, leaf.dtype, getattr(leaf, "weak_type", False)), tree
        )

    assert described(first) == described(step)
    assert described(state) == described(after)
    assert state.rng_key.dtype == new_key(0).dtype
    assert (jax.random.key_data(after.rng_key) != jax.random.key_data(state.rng_key)).any()
    np.testing.assert_array_equal(first.extras["position"], state.position)
    assert first.extras["episode_length"] == 0
    with jax.numpy_dtype_promotion("standard"):
        assert env.observation_space().contains(first.observation)
        assert env.action_space().contains(env.action_space().sample(new_key(1)))


def test_spaces_are_stoa_spaces(env: adapter.StoaEnvironment) -> None:
    assert isinstance(env, stoa.Environment)
    assert env.action_space() == stoa.DiscreteSpace(5, jnp.int32, "action")
    box = env.observation_space()
    assert type(box) is stoa.BoundedArraySpace
    assert (box.shape, box.dtype, box.minimum, box.maximum) == ((12, 16, 3), jnp.uint8, 0, 255)
    many = adapter.make("key-door", height=12, width=16, observation="dict").observation_space()
    assert type(many) is stoa.DictSpace
    assert set(many.spaces) == {"image", "carried_keys"}
    depth = adapter.make("simple", observation="depth").observation_space()
    assert depth.maximum == jnp.inf
    with pytest.raises(NotImplementedError, match="no space"):
        env.state_space()


@pytest.mark.usefixtures("partner_promotion")
@pytest.mark.parametrize("wrapper", [stoa.AutoResetWrapper, CachedAutoResetWrapper, None])
def test_stoix_style_loop(wrapper: Any) -> None:
    """Automatic resets, episode metrics and a batch, inside of a scan."""
    if wrapper is None:
        wrapped: Any = corridor(autoreset="same-step", final_observation=True)
    else:
        wrapped = wrapper(corridor(), next_obs_in_extras=True)
    wrapped = VmapWrapper(stoa.RecordEpisodeMetrics(wrapped), num_envs=3)
    space = wrapped.action_space()

    def step(carry: Any, key: jax.Array) -> Any:
        state, before = carry
        action = jax.vmap(space.sample)(jax.random.split(key, 3))
        action = jnp.where(jnp.arange(3) == 0, FORWARD, action)
        state, after = wrapped.step(state, action)
        return (state, after), (before, after)

    @jax.jit
    def rollout(key: jax.Array) -> Any:
        return jax.lax.scan(step, wrapped.reset(key), jax.random.split(key, 40))[1]

    before, after = rollout(jax.random.PRNGKey(0))
    metrics = after.extras["episode_metrics"]
    done = np.asarray(metrics["is_terminal_step"])
    np.testing.assert_array_equal(done, after.done())
    assert done[:, 0].sum() >= 3
    assert np.asarray(after.terminated())[:, 0].any()
    assert np.asarray(after.truncated())[:, 1:].any()
    for name in ("episode_return", "episode_length"):
        np.testing.assert_array_equal(metrics[name][done], after.extras[name][done])
    assert (np.asarray(metrics["episode_length"]) <= LIMIT).all()
    # The observation to act on is from the new episode; the last one is in `extras`.
    last, fresh = np.asarray(after.extras["next_obs"]), np.asarray(after.observation)
    np.testing.assert_array_equal(last[~done], fresh[~done])
    assert (last[done] != fresh[done]).any(axis=(1, 2, 3)).mean() > 0.8
    np.testing.assert_array_equal(before.observation[1:], fresh[:-1])


@pytest.mark.usefixtures("partner_promotion")
def test_other_wrappers(env: adapter.StoaEnvironment) -> None:
    wrapped = stoa.AddStepCountWrapper(stoa.FlattenObservationWrapper(env))
    state, first = wrapped.reset(jax.random.key(0))
    shapes = {leaf.shape for leaf in jax.tree.leaves(first.observation)}
    assert (12 * 16 * 3,) in shapes
    _, step = wrapped.step(state, LEFT)
    assert not step.done()
    limited = stoa.EpisodeStepLimitWrapper(env, 2)
    state, _ = limited.reset(jax.random.key(0))
    for _ in range(2):
        state, step = limited.step(state, LEFT)
    assert step.truncated()


def test_errors_name_the_mistake(env: adapter.StoaEnvironment) -> None:
    with pytest.raises(SettingError, match="autoreset=None or autoreset='same-step'"):
        adapter.make("simple", autoreset="next-step")
    assert env != corridor()
    assert env in {env}
    assert "autoreset=None" in repr(env)
