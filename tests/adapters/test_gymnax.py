"""The gymnax adapter with gymnax itself, of either contract, and its clients."""

# The partner is an extra, which need not be there to check the types.
# pyright: reportMissingImports=false

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein

pytest.importorskip("gymnax")
pytestmark = [
    pytest.mark.usefixtures("plain_frames"),
    # Raised inside gymnax and its imports.
    pytest.mark.filterwarnings("ignore::DeprecationWarning:(gymnax|gymnasium|flax|chex|distrax).*"),
    pytest.mark.filterwarnings("ignore::DeprecationWarning:(jaxopt|tensorflow_probability).*"),
]

import gymnax  # noqa: E402
from gymnax.environments import environment, spaces  # noqa: E402
from gymnax.wrappers import purerl  # noqa: E402

from jaxenstein.adapters import gymnax as adapter  # noqa: E402
from tests.adapters.corridor import FORWARD, MAP, SIZE  # noqa: E402

SIX_VALUES = adapter.STEP_VALUES == 6
LEFT = 0


def corridor(**settings: Any) -> tuple[Any, Any]:
    return jaxenstein.from_ascii(MAP, heading=0.0, **SIZE, **settings)


@pytest.fixture(scope="module")
def made() -> tuple[Any, Any]:
    return adapter.from_env(*corridor())


def split(values: tuple[Any, ...]) -> tuple[Any, Any, Any, Any, Any, dict[str, Any]]:
    """A step's values as observation, state, reward, terminated, truncated, info."""
    obs, state, reward, *ends, info = values
    assert len(ends) == (2 if SIX_VALUES else 1)
    if SIX_VALUES:
        return obs, state, reward, *ends, info
    np.testing.assert_array_equal(ends[0], info["terminated"] | info["truncated"])
    return obs, state, reward, info["terminated"], info["truncated"], info


def test_contract_matches_installed_gymnax(made: tuple[Any, Any]) -> None:
    theirs, their_params = gymnax.make("Catch-bsuite")
    with jax.numpy_dtype_promotion("standard"):
        _, state = theirs.reset(jax.random.key(0), their_params)
        values = theirs.step(jax.random.key(1), state, jnp.int32(0), their_params)
        plain = theirs.step_env(jax.random.key(1), state, jnp.int32(0), their_params)
    env, params = made
    _, state = env.reset(jax.random.key(0), params)
    assert len(values) == len(env.step(jax.random.key(1), state, LEFT, params))
    assert len(plain) == len(env.step_env(jax.random.key(1), state, LEFT, params))
    assert len(values) == adapter.STEP_VALUES
    assert isinstance(env, environment.Environment)
    missing = {name for name in dir(theirs) if not name.startswith("_")} - set(dir(env))
    assert missing <= {"rows", "columns", "render"}  # of Catch alone


def test_spaces_are_gymnax_spaces() -> None:
    env, params = adapter.make("key-door", **SIZE)
    assert type(env.action_space(params)) is spaces.Discrete
    assert env.action_space(params).n == env.num_actions == 5
    assert env.action_space(params).sample(jax.random.key(0)).dtype == jnp.int32
    box = env.observation_space(params)
    assert type(box) is spaces.Box
    assert (box.shape, box.dtype, box.low, box.high) == ((12, 16, 3), jnp.uint8, 0, 255)
    assert box.contains(env.reset(jax.random.key(0), params)[0])
    many = adapter.make("key-door", **SIZE, observation="dict")[0].observation_space()
    assert type(many) is spaces.Dict
    assert set(many.spaces) == {"image", "carried_keys"}
    assert all(isinstance(space, spaces.Space) for space in many.spaces.values())


def test_params_are_a_dataclass_with_max_steps_in_episode(made: tuple[Any, Any]) -> None:
    env, params = made
    names = {field.name for field in dataclasses.fields(env.default_params)}
    assert "max_steps_in_episode" in names
    shorter = dataclasses.replace(params, max_steps_in_episode=1)
    _, state = env.reset(jax.random.key(0), shorter)
    assert hasattr(state, "time")
    *_, truncated, info = split(env.step(jax.random.key(0), state, LEFT, shorter))
    assert truncated
    assert info["episode_length"] == 1


@pytest.mark.parametrize("new_key", [jax.random.key, jax.random.PRNGKey])
def test_step_matches_the_environment(made: tuple[Any, Any], new_key: Any) -> None:
    env, params = made
    obs, state = env.reset(new_key(3), params)
    expected_obs, _ = env.env.reset(new_key(3), params)
    np.testing.assert_array_equal(obs, expected_obs)
    for action in (FORWARD, LEFT, 4):
        ours = split(env.step(new_key(5), state, action, params))
        native = env.env.step(new_key(5), state, action, params)
        jax.tree.map(np.testing.assert_array_equal, ours[:5], native[:5])
        for name, value in native[5].items():
            np.testing.assert_array_equal(ours[5][name], value)
        assert set(ours[5]) == set(native[5]) | {"terminated", "truncated", "discount"}
        state = ours[1]


def walk(env: Any, params: Any, action: int, steps: int) -> list[tuple[Any, ...]]:
    _, state = env.reset(jax.random.key(0), params)
    out = []
    for i in range(steps):
        out.append(split(env.step(jax.random.key(i), state, action, params)))
        state = out[-1][1]
    return out


def test_discount_separates_termination_from_truncation(made: tuple[Any, Any]) -> None:
    env, params = made
    steps = walk(env, params, FORWARD, 40)
    first = next(i for i, step in enumerate(steps) if step[3])
    assert [float(step[5]["discount"]) for step in steps[first - 1 : first + 1]] == [1, 0]
    cut = walk(env, params.replace(max_steps_in_episode=3), LEFT, 4)
    assert [float(step[5]["discount"]) for step in cut] == [1, 1, 1, 1]
    both = walk(env, params.replace(max_steps_in_episode=first + 1), FORWARD, first + 1)[-1]
    assert (bool(both[3]), bool(both[4]), float(both[5]["discount"])) == (True, True, 0)


def test_step_env_and_terminal_queries(made: tuple[Any, Any]) -> None:
    env, params = made
    obs, state = env.reset_env(jax.random.key(0), params)
    end, info = False, {}
    while not env.is_terminated(state, params):
        obs, state, _, end, info = env.step_env(jax.random.key(0), state, FORWARD, params)
    assert end
    assert info["terminated"]
    assert not info["truncated"]
    assert state.time > 0
    assert env.is_terminal(state, params)
    assert not env.is_truncated(state, params)
    assert env.discount(state, params) == 0
    np.testing.assert_array_equal(obs, env.observe(jax.random.key(0), state, 0, params))
    tight = params.replace(max_steps_in_episode=1)
    _, state = env.reset_env(jax.random.key(0), tight)
    _, state, _, end, info = env.step_env(jax.random.key(0), state, LEFT, tight)
    assert info["truncated"]
    assert not info["terminated"]
    assert bool(end) is not SIX_VALUES
    assert env.is_truncated(state, tight)
    assert bool(env.is_terminal(state, tight)) is not SIX_VALUES
    assert env.discount(state, tight) == 1


def test_info_is_small(made: tuple[Any, Any]) -> None:
    env, params = made
    _, state = env.reset(jax.random.key(0), params)
    info = env.step(jax.random.key(0), state, LEFT, params)[-1]
    assert all(np.size(leaf) <= 2 for leaf in jax.tree.leaves(info))


def test_equal_environments_compile_once() -> None:
    traced = []

    def step(env: Any, key: jax.Array) -> Any:
        traced.append(env)
        return env.reset(key)

    compiled = jax.jit(step, static_argnums=0)
    for _ in range(2):
        compiled(adapter.make("simple", **SIZE)[0], jax.random.key(0))
    assert len(traced) == 1
    one, other = (adapter.make("simple", height=height)[0] for height in (12, 13))
    assert one != other
    assert one != one.env
    assert "simple" in repr(one)


@pytest.mark.usefixtures("partner_promotion")
def test_log_wrapper_agrees_with_info() -> None:
    """In a scan over a batch with old keys, as in purejaxrl, which keeps all of `info`."""
    env, params = adapter.from_env(*corridor())
    logged = purerl.LogWrapper(env)
    assert logged.num_actions == 5  # passed on
    step = jax.vmap(logged.step, (0, 0, None, None))

    def play(carry: Any, key: jax.Array) -> Any:
        _, state, *_, info = step(jax.random.split(key, 2), carry, FORWARD, params)
        return state, info

    keys = jax.random.split(jax.random.PRNGKey(0), 30)
    first = jax.vmap(logged.reset, (0, None))(keys[:2], params)[1]
    # gymnax 0.0.9 starts with Python numbers, which a scan cannot carry.
    info = jax.jit(lambda s: jax.lax.scan(play, jax.tree.map(jnp.asarray, s), keys))(first)[1]
    ends = np.asarray(info["returned_episode"])
    assert (ends.sum(axis=0) >= 2).all()
    np.testing.assert_array_equal(ends, info["terminated"] | info["truncated"])
    for theirs, ours in (("returns", "return"), ("lengths", "length")):
        told = info[f"returned_episode_{theirs}"][ends]
        np.testing.assert_array_equal(told, info[f"episode_{ours}"][ends])


@pytest.mark.usefixtures("partner_promotion")
def test_flatten_observation_wrapper() -> None:
    # That of gymnax 1.x flattens the last frame as well, and so needs it.
    env, params = adapter.from_env(*corridor(final_observation=SIX_VALUES))
    flat = purerl.FlattenObservationWrapper(env)
    obs, state = flat.reset(jax.random.key(0), params)
    assert obs.shape == flat.observation_space(params).shape == (12 * 16 * 3,)
    after, *_, info = flat.step(jax.random.key(0), state, LEFT, params)
    assert after.shape == obs.shape
    if SIX_VALUES:
        assert info["final_observation"].shape == obs.shape
        bare = purerl.FlattenObservationWrapper(adapter.from_env(*corridor())[0])
        with pytest.raises(KeyError, match="final_observation"):
            bare.step(jax.random.key(0), state, LEFT, params)


@pytest.mark.usefixtures("partner_promotion")
@pytest.mark.skipif(not SIX_VALUES, reason="of gymnax 1.x")
def test_wrappers_of_gymnax_1() -> None:
    wrappers = __import__("gymnax.wrappers", fromlist=["LegacyStepAPIWrapper"])
    env, params = adapter.from_env(*corridor(final_observation=True))
    legacy = wrappers.LegacyStepAPIWrapper(env)
    _, state = legacy.reset(jax.random.key(0), params)
    assert len(legacy.step(jax.random.key(0), state, LEFT, params)) == 5
    sticky = wrappers.StickyActionWrapper(env, 0.5)
    _, state = sticky.reset(jax.random.key(0), params)
    assert len(sticky.step(jax.random.key(0), state, LEFT, params)) == 6
    dm_env = wrappers.GymnaxToDmEnvWrapper(env)
    step = dm_env.reset(jax.random.key(0), params)
    for i in range(30):
        step = dm_env.step(jax.random.key(i), step, FORWARD, params)
        if step.discount == 0:
            break
    assert step.discount == 0
    assert step.reward == 1


@pytest.mark.usefixtures("partner_promotion")
def test_gym_wrappers_of_gymnax() -> None:
    """They make deep copies and replace functions of the copies."""
    from gymnax.wrappers import gym

    env, params = adapter.from_env(*corridor())
    single = gym.GymnaxToGymWrapper(env, params, seed=1)
    obs, _ = single.reset()
    assert single.observation_space.contains(np.asarray(obs))
    assert len(single.step(LEFT)) == 5
    assert single.action_space.n == 5  # type: ignore[attr-defined]
    vector = gym.GymnaxToVectorGymWrapper(env, 3, params)
    obs, _ = vector.reset()
    assert obs.shape == (3, 12, 16, 3)
    assert vector.step(jnp.zeros(3, jnp.int32))[1].shape == (3,)
    # The copies' functions did not reach the environment itself.
    assert env.reset(jax.random.key(0), params)[0].shape == (12, 16, 3)


ROLLOUT = {"num_steps": 8, "num_epochs": 2, "num_minibatches": 2, "normalize_observations": True}
REPLAY = {"buffer_size": 512, "fill_buffer": 40, "batch_size": 32, "num_epochs": 2, "gamma": 0.5}
# For each algorithm: its observations, its settings, and the networks that it trains.
REJAX = {
    "PPO": ("rgb", ROLLOUT | {"max_grad_norm": 0.5}, ("actor_ts", "critic_ts")),
    "DQN": ("depth", REPLAY | {"exploration_fraction": 0.5, "polyak": 0.5}, ("q_ts",)),
    "PQN": ("rgb", ROLLOUT, ("q_ts",)),
}


@pytest.mark.training
@pytest.mark.usefixtures("partner_promotion")
@pytest.mark.parametrize("algorithm", REJAX)
def test_rejax_trains(algorithm: str) -> None:
    rejax = pytest.importorskip("rejax")
    observation, settings, networks = REJAX[algorithm]
    # One step forward from the goal, so that chance finds it.
    near = "####\n#SG#\n####"
    made = jaxenstein.from_ascii(near, heading=0.0, observation=observation, **SIZE)
    env, params = adapter.from_env(*made)
    params = params.replace(max_steps_in_episode=20, move_distance=0.7)
    learner = getattr(rejax, algorithm).create(
        env=env,
        env_params=params,
        num_envs=4,
        total_timesteps=512,
        eval_freq=256,
        skip_initial_evaluation=True,
        learning_rate=1e-3,
        **settings,
    )
    state, (lengths, returns) = jax.jit(learner.train)(jax.random.PRNGKey(0))
    assert lengths.shape == returns.shape == (2, 128)
    assert state.global_step == 512
    assert np.isin(returns, (0, 1)).all()
    # Who does not come to the goal has all the time there is.
    np.testing.assert_array_equal(lengths[returns == 0], 20)
    assert (lengths[returns == 1] <= 20).all()
    assert returns[-1].mean() > 0.9
    before = learner.init_state(jax.random.PRNGKey(0))
    for network in networks:
        trained = getattr(state, network).params
        assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(trained))
        start = getattr(before, network).params
        moved = jax.tree.map(lambda new, old: bool((new != old).any()), trained, start)
        assert all(jax.tree.leaves(moved))
