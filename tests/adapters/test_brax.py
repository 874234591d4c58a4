"""The Brax adapter beside Brax: its state, its training wrappers, and its PPO on pixels."""

# The partner is an extra, which need not be there to check the types.
# pyright: reportMissingImports=false

from __future__ import annotations

import functools
import warnings
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein.errors import SettingError

pytest.importorskip("brax")
# Raised inside of Brax and of what it imports.
pytestmark = pytest.mark.filterwarnings(
    "ignore::DeprecationWarning:(brax|jaxopt|mujoco|flax|orbax|etils).*"
)

with warnings.catch_warnings():
    warnings.filterwarnings("ignore", "JAXopt is no longer maintained", DeprecationWarning)
    from brax.envs import base
    from brax.envs.wrappers import training

    from jaxenstein.adapters import brax as adapter

CORRIDOR = """
#####
#S.G#
#####
"""
LEFT, FORWARD = 0, 2
LIMIT = 12


def corridor(limit: int = LIMIT, **settings: Any) -> adapter.BraxEnvironment:
    settings = {"autoreset": None, "height": 12, "width": 16, "heading": 0.0, **settings}
    env, params = jaxenstein.from_ascii(CORRIDOR, **settings)
    return adapter.BraxEnvironment(env, params.replace(max_steps_in_episode=limit))


@pytest.fixture(scope="module")
def env() -> adapter.BraxEnvironment:
    return corridor()


def one_hot(action: int, batch: int | None = None) -> jax.Array:
    scores = jax.nn.one_hot(action, 5)
    return scores if batch is None else jnp.tile(scores, (batch, 1))


def walk(env: base.Env, state: base.State, action: jax.Array, steps: int) -> base.State:
    """The states after each of some steps [T, ...], by a scan."""

    def step(state: base.State, _: None) -> Any:
        state = env.step(state, action)
        return state, state

    return jax.jit(lambda state: jax.lax.scan(step, state, None, steps))(state)[1]


def described(state: base.State) -> Any:
    # Typed keys have no weak types.
    return jax.tree.map(
        lambda leaf: (leaf.shape, leaf.dtype, getattr(leaf, "weak_type", False)), state
    )


@pytest.mark.parametrize("new_key", [jax.random.key, jax.random.PRNGKey])
def test_a_state_is_that_of_brax(env: adapter.BraxEnvironment, new_key: Any) -> None:
    assert isinstance(env, base.Env)
    first = env.reset(new_key(0))
    assert isinstance(first, base.State)
    assert first.reward.dtype == first.done.dtype == jnp.float32
    assert first.info["truncation"].dtype == jnp.float32
    assert described(first) == described(env.step(first, one_hot(LEFT)))
    assert env.observation_size == {adapter.PIXELS: (12, 16, 3)}
    assert (env.action_size, env.backend, env.episode_length) == (5, "jaxenstein", LIMIT)
    pixels = first.obs[adapter.PIXELS]
    frame = np.asarray(env.env.observe(first.pipeline_state, env.params))
    assert pixels.dtype == jnp.float32
    assert (
        np.abs(np.asarray(pixels) * 255 - frame) > 0.01
    ).mean() < 0.02  # rounding of compilations
    assert 0 <= pixels.min() < pixels.max() <= 1


@pytest.mark.parametrize(
    ("observation", "sizes"),
    [
        ("gray", {"pixels/view_0": (12, 16, 1)}),
        ("depth", {"pixels/view_0": (12, 16, 1)}),
        ("dict", {"pixels/view_0": (12, 16, 3), "state": (6,)}),
    ],
)
def test_observations(observation: str, sizes: dict[str, tuple[int, ...]]) -> None:
    env = adapter.make("key-door", height=12, width=16, observation=observation)
    assert env.observation_size == sizes
    seen = jax.eval_shape(env.reset, jax.random.key(0)).obs
    assert all(leaf.dtype == jnp.float32 for leaf in seen.values())


def test_scores_and_integers_mean_the_same_action(env: adapter.BraxEnvironment) -> None:
    first = env.reset(jax.random.key(0))
    for action in range(5):
        scores = jnp.array([-1.0, -0.5, -0.9, -1.5, -3.0]).at[action].set(0.1)
        by_score, by_number = env.step(first, scores), env.step(first, action)
        np.testing.assert_array_equal(
            by_score.pipeline_state.position, by_number.pipeline_state.position
        )
        assert by_score.pipeline_state.heading == by_number.pipeline_state.heading
    moved = env.step(first, one_hot(FORWARD)).pipeline_state
    assert moved.position[0] > first.pipeline_state.position[0]


def test_done_is_the_tasks_end_alone(env: adapter.BraxEnvironment) -> None:
    first = env.reset(jax.random.key(0))
    steps = walk(env, first, one_hot(FORWARD), LIMIT)
    goal = int(np.argmax(np.asarray(steps.reward) > 0))
    assert 0 < goal < LIMIT - 1
    assert steps.done[goal] == 1
    assert not np.asarray(steps.done[:goal]).any()
    assert not np.asarray(steps.info["truncation"][: LIMIT - 1]).any()
    cut = walk(env, first, one_hot(LEFT), LIMIT)
    assert not np.asarray(cut.done).any()
    np.testing.assert_array_equal(cut.info["truncation"], np.arange(LIMIT) == LIMIT - 1)
    both = walk(corridor(goal + 1), first, one_hot(FORWARD), goal + 1)
    assert both.done[-1] == 1
    assert both.info["truncation"][-1] == 0


@pytest.mark.parametrize("new_key", [jax.random.key, jax.random.PRNGKey])
def test_nothing_happens_after_the_end(env: adapter.BraxEnvironment, new_key: Any) -> None:
    steps = walk(env, env.reset(new_key(0)), one_hot(FORWARD), LIMIT)
    goal = int(np.argmax(np.asarray(steps.done)))
    assert 0 < goal < LIMIT - 1
    np.testing.assert_array_equal(steps.reward, np.arange(LIMIT) == goal)
    np.testing.assert_array_equal(steps.done, np.arange(LIMIT) >= goal)
    np.testing.assert_array_equal(steps.metrics["reached_goal"], np.arange(LIMIT) >= goal)
    np.testing.assert_array_equal(steps.pipeline_state.time[goal:], goal + 1)
    frames = np.asarray(steps.obs[adapter.PIXELS])
    np.testing.assert_array_equal(frames[goal:], frames[[goal] * (LIMIT - goal)])


@pytest.mark.usefixtures("partner_promotion")
@pytest.mark.parametrize("wrap", [training.wrap, adapter.wrap])
def test_repeated_actions_pay_the_goal_once(env: adapter.BraxEnvironment, wrap: Any) -> None:
    """Also where an action's first half reaches it, and the second would leave it again."""
    batch = wrap(env, episode_length=LIMIT, action_repeat=4)
    state = batch.reset(jax.random.split(jax.random.PRNGKey(0), 2))
    steps = walk(batch, state, one_hot(FORWARD, 2), 2 * LIMIT // 4)
    done = np.asarray(steps.done) > 0
    assert done.any(axis=0).all()
    np.testing.assert_array_equal(steps.reward, done)
    returns = np.asarray(steps.info["episode_metrics"]["sum_reward"])
    goals = np.asarray(steps.info["episode_metrics"]["reached_goal"])
    assert (returns[done] == 1).all()
    assert (goals[done] == 1).all()


def test_events_are_metrics() -> None:
    env = adapter.make("key-door", height=12, width=16)
    first = env.reset(jax.random.key(0))
    assert first.metrics
    assert all(leaf.dtype == jnp.float32 for leaf in first.metrics.values())
    assert not set(first.metrics) & set(first.info)
    # What wrappers put into a state stays there.
    first.info["steps"] = jnp.float32(7.0)
    first.metrics["reward"] = jnp.float32(3.0)
    after = env.step(first, one_hot(LEFT))
    assert after.info["steps"] == 7
    assert after.metrics["reward"] == 3


@pytest.mark.usefixtures("partner_promotion")
@pytest.mark.parametrize("wrap", [training.wrap, adapter.wrap])
def test_in_the_wrappers_of_brax(env: adapter.BraxEnvironment, wrap: Any) -> None:
    batch = wrap(env, episode_length=LIMIT)
    state = batch.reset(jax.random.split(jax.random.PRNGKey(0), 3))
    first = np.asarray(state.obs[adapter.PIXELS])
    actions = jnp.stack([one_hot(FORWARD), one_hot(LEFT), one_hot(1)])
    steps = walk(batch, state, actions, 3 * LIMIT)
    done = np.asarray(steps.done) > 0
    truncation = np.asarray(steps.info["truncation"])
    lengths = np.asarray(steps.info["episode_metrics"]["length"])
    returns = np.asarray(steps.info["episode_metrics"]["sum_reward"])
    np.testing.assert_array_equal(np.flatnonzero(done[:, 1]), [11, 23, 35])
    np.testing.assert_array_equal(truncation[:, 1:], done[:, 1:])
    assert done[:, 0].sum() >= 3
    assert not truncation[:, 0].any()
    assert (returns[:, 0][done[:, 0]] == 1).all()
    assert (lengths[:, 1][done[:, 1]] == LIMIT).all()
    # After an end the frame is that of a first state: here all look east from one cell.
    fresh = np.asarray(steps.obs[adapter.PIXELS])[done]
    assert (np.abs(fresh - first[:1]) > 0.01).mean() < 0.02
    assert (np.asarray(steps.pipeline_state.time)[done] == 0).all()


@pytest.mark.usefixtures("partner_promotion")
def test_wrap_draws_new_first_states() -> None:
    native, params = jaxenstein.make("my-way-home", height=4, width=4, autoreset=None)
    env = adapter.BraxEnvironment(native, params.replace(max_steps_in_episode=1))
    seen = {}
    for wrap in (training.wrap, adapter.wrap):
        batch = wrap(env, episode_length=1)
        state = batch.reset(jax.random.split(jax.random.PRNGKey(0), 1))
        positions = walk(batch, state, one_hot(LEFT, 1), 30).pipeline_state.position
        seen[wrap] = len(np.unique(np.asarray(positions).reshape(-1, 2), axis=0))
    assert seen[training.wrap] == 1
    assert seen[adapter.wrap] > 10


@pytest.mark.usefixtures("partner_promotion")
def test_wrap_draws_one_frame_a_step(env: adapter.BraxEnvironment) -> None:
    def operations(batch: Any) -> float:
        state = jax.eval_shape(batch.reset, jax.random.split(jax.random.PRNGKey(0), 64))
        cost = jax.jit(batch.step).lower(state, one_hot(LEFT, 64)).compile().cost_analysis()
        assert cost is not None
        return cost["flops"]

    plain = operations(training.EpisodeWrapper(training.VmapWrapper(env), LIMIT, 1))
    assert operations(adapter.wrap(env, LIMIT)) < 1.3 * plain


@pytest.mark.slow
@pytest.mark.usefixtures("partner_promotion")
@pytest.mark.parametrize("wrap", [None, adapter.wrap])
def test_ppo_of_brax_trains(wrap: Any) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        from brax.training.agents.ppo import networks_vision, train
    env = corridor()
    factory = functools.partial(
        networks_vision.make_ppo_networks_vision,
        policy_hidden_layer_sizes=(16,),
        value_hidden_layer_sizes=(16,),
        cnn_output_channels=(4, 4, 4),
    )
    told: list[dict[str, Any]] = []
    make_policy, params, _ = train.train(
        environment=env,
        num_timesteps=256,
        episode_length=env.episode_length,
        wrap_env_fn=wrap,
        vision=True,
        num_envs=4,
        unroll_length=8,
        batch_size=4,
        num_minibatches=2,
        num_updates_per_batch=2,
        num_evals=2,
        num_eval_envs=2,
        network_factory=factory,
        progress_fn=lambda steps, metrics: told.append({"steps": steps, **metrics}),
    )
    assert told[-1]["steps"] >= 256
    losses = {name: value for name, value in told[-1].items() if name.startswith("training/")}
    assert losses
    assert all(np.isfinite(float(value)) for value in losses.values())
    assert 1 <= told[-1]["eval/avg_episode_length"] <= LIMIT
    state = env.reset(jax.random.PRNGKey(0))
    batched = jax.tree.map(lambda leaf: leaf[None], state.obs)
    action, _ = make_policy(params)(batched, jax.random.PRNGKey(1))
    assert action.shape == (1, env.action_size)


def test_mistakes_are_named(env: adapter.BraxEnvironment) -> None:
    for mode in ("same-step", "next-step"):
        with pytest.raises(SettingError, match=r"Brax needs .*autoreset=None"):
            adapter.make("simple", autoreset=mode)
    with pytest.raises(SettingError, match="must be a NavigationParams"):
        adapter.BraxEnvironment(env.env, jaxenstein.make("health-gathering")[1])
    with pytest.raises(SettingError, match=r"as jaxenstein\.make returns it"):
        adapter.BraxEnvironment("simple")  # type: ignore[arg-type]
    first = env.reset(jax.random.key(0))
    with pytest.raises(SettingError, match="5 scores or one integer"):
        env.step(first, jnp.zeros(4))
    with pytest.raises(SettingError, match="integer"):
        env.step(first, jnp.zeros(5, jnp.int32))
    with pytest.raises(SettingError, match="randomization_fn must be None"):
        adapter.wrap(env, LIMIT, randomization_fn=lambda: None)

    class Other(base.Wrapper):
        @property
        def unwrapped(self) -> Any:
            return self

    with pytest.raises(SettingError, match="a BraxEnvironment"):
        adapter.wrap(Other(env), LIMIT)
