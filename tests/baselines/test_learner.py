"""The training loop: bookkeeping across updates, many runs, evaluation, other environments."""

import functools
from typing import Any

import jax
import jax.flatten_util
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")

import jaxenstein
from jaxenstein.baselines import Config, HParams, Learner
from jaxenstein.baselines.rollout import rollout
from jaxenstein.baselines.simulator import GymnaxSimulator
from jaxenstein.errors import SettingError
from tests.baselines.worlds import BONUS_SIZES, SMALL, Countdown, Memory

KEY = jax.random.key(0)
# Numbers of two runs.
MANY = HParams(learning_rate=np.array([1e-3, 0.0]), gamma=np.array([0.9, 0.5]))


def learner_of(env, **settings):
    return Learner(env, env.default_params, Config(**(SMALL | settings)))


@functools.cache
def learner(algo="ppo"):
    """One for all tests."""
    return learner_of(Countdown(), algo=algo, bonus=BONUS_SIZES[algo])


def equal(one, other, **tolerance):
    compare = np.testing.assert_allclose if tolerance else np.testing.assert_array_equal
    jax.tree.map(functools.partial(compare, **tolerance), one, other)


def one_of(tree, index):
    """One of many runs; all runs share scalars."""
    return jax.tree.map(lambda leaf: leaf[index] if np.ndim(leaf) else leaf, tree)


@pytest.mark.parametrize(
    ("algo", "size"),
    [
        ("ppo", 2),
        # Bit for bit only as users compile: a loop of one is none.
        pytest.param("ppo", 1, marks=pytest.mark.slow),
        pytest.param("e3b", 1, marks=pytest.mark.slow),
    ],
)
def test_two_chunks_equal_one_of_twice_the_updates(algo, size):
    run = learner(algo)
    start = run.init(KEY)
    numbers = HParams(gamma=0.9)
    state, metrics = run.train_chunk(start, numbers, 2 * size)
    first, early = run.train_chunk(start, numbers, size)
    again, late = run.train_chunk(jax.tree.map(np.asarray, first), numbers, size)
    equal(state, again)
    equal(metrics, {name: np.concatenate([early[name], late[name]]) for name in early})
    assert all(np.all(np.isfinite(value)) for value in metrics.values())
    assert int(state.update) == 2 * size
    with pytest.raises(AssertionError):
        equal(first.params, state.params)


def test_state_has_plain_arrays_of_fixed_types():
    run = learner("rnd")
    start = run.init(KEY)
    # The program that one of many runs is compared with, too.
    state, _ = run.train_chunk(start, one_of(MANY.check(), 0), 2)
    kinds = lambda tree: [(a.shape, a.dtype) for a in jax.tree.leaves(tree)]  # noqa: E731
    assert kinds(start) == kinds(state)
    assert not any(jnp.issubdtype(a.dtype, jax.dtypes.prng_key) for a in jax.tree.leaves(state))
    assert jax.tree.structure(start) == jax.tree.structure(state)


@pytest.mark.parametrize("algo", ["rnd", pytest.param("icm", marks=pytest.mark.slow)])
def test_batched_runs_equal_single_runs(algo):
    run = learner(algo)
    keys, numbers = jax.random.split(KEY, 2), MANY
    states, metrics = run.many.train_chunk(run.many.init(keys, numbers), numbers, 2)
    assert metrics["entropy"].shape == (2, 2)
    for index in range(2):
        state, single = run.train_chunk(run.init(keys[index]), one_of(numbers.check(), index), 2)
        mine, measured = one_of(states, index), one_of(metrics, index)
        equal(mine.params, state.params, atol=1e-6)
        equal(mine.actors, state.actors, atol=1e-5)
        # A ratio of two variances, which may both be small.
        names = [name for name in single if "explained" not in name]
        expected = {name: single[name] for name in names}
        equal({name: measured[name] for name in names}, expected, atol=1e-5, rtol=1e-4)
    equal(one_of(states.params, 1), run.init(keys[1]).params)


def test_hparams_of_many_runs_need_one_number_per_run():
    run = learner()
    states = run.many.init(jax.random.split(KEY, 2))
    with pytest.raises(
        SettingError, match=r"scalars or have shape \[2\], one value per run, not \[3\]"
    ):
        run.many.train_chunk(states, HParams(clip=np.ones(3)), 1)
    with pytest.raises(SettingError, match="clip must be a finite number above 0"):
        run.train_chunk(run.init(KEY), HParams(clip=-1), 1)


def test_default_discount_comes_from_the_environment():
    run = learner()
    state = run.init(KEY)
    own, given, other = (
        jax.flatten_util.ravel_pytree(run.train_chunk(state, HParams(gamma=g), 2)[0].params)[0]
        for g in (None, 0.9, 0.5)
    )
    # A discount that is a constant of the program may be rounded otherwise.
    np.testing.assert_allclose(own, given, rtol=1e-4, atol=1e-8)
    assert np.abs(own - other).max() > 1e-5


def test_learning_rates_fall_linearly_and_nothing_compiles_between_chunks():
    run = learner()
    state, seen, sizes = run.init(KEY), [], []
    compiled: Any = run._train
    for clip in (0.1, 0.2, 0.3, 0.4, 0.5):
        numbers = HParams(learning_rate=1e-3, gamma=0.9, clip=clip)
        state, metrics = run.train_chunk(state, numbers, 2)
        seen += metrics["learning_rate"].tolist()
        sizes.append(compiled._cache_size())
    np.testing.assert_allclose(seen, 1e-3 * (1 - np.arange(10) / 10), rtol=1e-5)
    assert len(set(sizes)) == 1


def test_advantages_bootstrap_at_truncations():
    """If all values are 1, targets are known: the next value counts unless the task ended.

    Normalised rewards are divided by the deviation of their discounted sums, which end with the
    episodes; reported rewards are not divided.
    """
    numbers = HParams(gamma=0.9, gae_lambda=0.0, learning_rate=0.0)
    run = learner()
    state = run.init(KEY)
    heads = state.params["heads"]["params"]
    last = sorted(name for name in heads if heads[name]["bias"].shape == (1,))[-1]
    ones = {"kernel": jnp.zeros_like(heads[last]["kernel"]), "bias": jnp.ones(1)}
    params = state.params | {"heads": {"params": heads | {last: ones}}}
    # Count the kinds of ends by the same steps.
    play = jax.jit(rollout, static_argnums=(0, 1, 5, 6))
    actors, key, rewards = state.actors, state.key, []
    cases = {"default": {}, "ends": {"bootstrap_truncation": False}}
    cases["normalised"] = {"normalise_rewards": True}
    means = {case: [] for case in cases}
    total, totals = np.zeros(4), []
    for _ in range(2):
        split = jax.random.split(jax.random.wrap_key_data(key), 4)
        actors, steps, _, _ = play(run.simulator, run.network, params, split[1], actors, 6, 0)
        key = jax.random.key_data(split[0])
        reward, ended = np.asarray(steps.reward), np.asarray(steps.ended)
        rewards.append(reward.mean())
        for now, end in zip(reward, ended, strict=True):
            total = 0.9 * total + now
            totals.append(total)
            total = np.where(end, 0, total)
        scale = np.std(totals)
        assert scale > 1
        for case, divided, ends in (
            ("default", reward, steps.terminated),
            ("ends", reward, ended),
            ("normalised", reward / scale, steps.terminated),
        ):
            means[case].append(np.mean(divided + 0.9 * (1 - np.asarray(ends)) - 1))
    assert np.all(np.subtract(means["default"], means["ends"]) > 0)
    for case, settings in cases.items():
        run = learner_of(Countdown(), **settings) if settings else learner()
        start = run.init(KEY).replace(params=params)
        _, metrics = run.train_chunk(start, numbers, 2)
        np.testing.assert_allclose(metrics["advantage_mean"], means[case], rtol=1e-5)
        np.testing.assert_allclose(metrics["reward_mean"], rewards, rtol=1e-5)


def test_evaluation_plays_whole_episodes():
    run = learner()
    params = run.init(KEY).params
    result = run.evaluate(params, KEY, 50)
    length, total = np.asarray(result.episode_length), np.asarray(result.episode_return)
    assert length.min() == 1
    assert length.max() == 5
    base = length * (length + 1) / 2
    assert np.all((total >= base) & (total <= base + length / 2))
    # At five steps, most tasks are not over.
    assert np.all(np.asarray(result.success)[length < 5])
    assert not np.all(result.success)
    equal(result, run.evaluate(params, KEY, 50))
    several = jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), params)
    both = run.many.evaluate(several, KEY, 50)
    equal(jax.tree.map(lambda leaf: leaf[1], both), result)
    run.many.evaluate(several, KEY, 50, greedy=True)
    compiled: Any = run.many._advance
    assert compiled._cache_size() == 2  # of one run and of two, for both ways of acting


class EvenCountdown(Countdown):
    """Only an end after an even number of steps is a success."""

    def transition(self, key, state, action, params):
        state, reward, ended, events = super().transition(key, state, action, params)
        return state, jnp.where(state.cue % 2 == 0, reward, -reward), ended, events


def test_steps_after_the_first_episode_do_not_count():
    run = learner_of(EvenCountdown())
    result = run.evaluate(run.init(KEY).params, KEY, 50)
    length = np.asarray(result.episode_length)
    assert len(np.unique(length)) == 5
    np.testing.assert_array_equal(result.success, length % 2 == 0)


def test_greedy_agents_act_alike_in_equal_episodes():
    run = learner()
    params = run.init(KEY).params
    kinds = []
    for greedy in (True, False):
        result = run.evaluate(params, KEY, 50, greedy)
        length, total = np.asarray(result.episode_length), np.asarray(result.episode_return)
        # The length is that which is seen, but for episodes that the limit ended.
        kinds.append([len(set(total[length == steps])) for steps in (1, 2, 3, 4)])
    assert kinds[0] == [1, 1, 1, 1]
    assert max(kinds[1]) > 1


def test_policy_matches_evaluation():
    env = Memory(delay=4)
    run = learner_of(env)
    params = jax.tree.map(lambda leaf: 3 * leaf, run.init(KEY).params)
    result = run.evaluate(params, KEY, 1, greedy=True)
    start_key, _ = jax.random.split(KEY)
    reset_key = jax.random.split(jax.random.split(start_key)[0], 1)[0]
    obs, state = env.reset(reset_key)
    carry, total, memories, terminated = run.initial_carry(), 0.0, [], False
    for _ in range(int(result.episode_length[0])):
        action, carry = run.policy(params, obs, carry)
        memories.append(np.asarray(carry.memory))
        state, reward, terminated, _ = env.advance(KEY, state, action)
        obs = env.observe(state, env.default_params)
        total += float(reward)
    assert bool(terminated)
    assert total == float(result.episode_return[0])
    assert not np.allclose(memories[0], memories[-1])
    drawn = [
        int(run.policy(params, obs, run.initial_carry(), k)[0]) for k in jax.random.split(KEY, 20)
    ]
    assert set(drawn) == {0, 1}


@pytest.mark.usefixtures("plain_frames")
def test_random_clocks_end_episodes_at_different_times():
    env, params = jaxenstein.from_ascii(
        "####\n#SG#\n####", heading=180.0, height=8, width=8, frame_skip=4
    )
    params = params.replace(max_steps_in_episode=50)
    actors = Learner(env, params, Config(**SMALL, random_clocks=True)).init(KEY).actors
    times = np.asarray(actors.env_state.time)
    assert len(set(times.tolist())) > 1
    assert np.all((times >= 0) & (times < 50) & (times % 4 == 0))
    # Nothing was played yet.
    assert not np.asarray(actors.episode_length).any()


def test_random_clocks_belong_to_the_first_observations():
    """An observation of the countdown is its time."""
    config = Config(**SMALL, random_clocks=True)
    actors = Learner(Countdown(), None, config).init(KEY).actors
    times = np.asarray(actors.env_state.time)
    assert len(set(times.tolist())) > 1
    np.testing.assert_array_equal(actors.obs[:, 0], times)


def test_none_means_the_params_of_the_environment():
    config = Config(**SMALL)
    one, other = (
        Learner(Countdown(), params, config) for params in (None, Countdown().default_params)
    )
    assert one.loop.slots == other.loop.slots
    assert one.loop.discount == other.loop.discount == 0.9


def test_a_time_limit_of_ones_own_may_truncate_in_any_step():
    class Sooner(Countdown):
        def time_is_up(self, state, params):
            return state.time >= 2

    config = Config(**SMALL)
    assert Learner(Sooner(), None, config).loop.slots == config.rollout
    assert Learner(Countdown(), None, config).loop.slots < config.rollout


def test_run_stops_learning_at_target_success():
    """The agent does not affect its successes, so their mean grows slowly and surely."""
    run = learner_of(Countdown(), anneal=False, stop_success=0.2)
    state, recent, states, rates = run.init(KEY), 0.0, [], []
    for _ in range(12):
        states.append(state)
        state, metrics = run.train_chunk(state, HParams(gamma=0.9), 1)
        number, successes = float(metrics["episodes"][0]), float(metrics["successes"][0])
        if recent < 0.2 and number:
            old = np.exp(-number / 100)
            recent = old * recent + (1 - old) * successes / number
        assert state.recent is not None
        np.testing.assert_allclose(state.recent, recent, rtol=1e-5)
        rates.append(float(metrics["learning_rate"][0]))
        assert (rates[-1] == 0) == (recent >= 0.2)
    stopped = rates.index(0)
    assert 0 < stopped < 11
    equal(states[stopped].params, state.params)
    moved = jax.tree.map(np.array_equal, states[stopped - 1].params, state.params)
    assert not all(jax.tree.leaves(moved))


class Foreign:
    """An environment that follows the contract of gymnax only by its functions."""

    def __init__(self, final=True, values=6, frame_skip=1):
        self.env = Countdown(final_observation=True, frame_skip=frame_skip)
        self.final, self.values = final, values

    def __getattr__(self, name):
        return getattr(self.env, name)

    def step(self, key, state, action, params=None):
        *front, info = self.env.step(key, state, action, params)
        if not self.final:
            del info["final_observation"]
        return (*front, info)[: self.values]


@pytest.mark.parametrize("skip", [1, pytest.param(4, marks=pytest.mark.slow)])
def test_gymnax_style_environment_gives_the_same_run(skip):
    own = learner() if skip == 1 else learner_of(Countdown(frame_skip=skip))
    run = Learner(Foreign(frame_skip=skip), Countdown().default_params, own.config)
    assert run.loop.slots == own.loop.slots
    one, other, numbers = own.init(KEY), run.init(KEY), HParams(gamma=0.9)
    for a, b in zip(
        own.train_chunk(one, numbers, 2), run.train_chunk(other, numbers, 2), strict=True
    ):
        equal(a, b, atol=1e-6, rtol=1e-5)


def test_success_defaults_to_termination_with_a_reward():
    class Silent(Foreign):
        def step(self, key, state, action, params=None):
            """Odd actions end the task, and those above 1 pay."""
            reward = jnp.where(action > 1, 1.0, 0.0)
            ended = action % 2 == 1
            final = {"final_observation": self.env.observe(state, self.env.check_params(params))}
            return final["final_observation"], state, reward, ended, ~ended, final

    simulator = GymnaxSimulator(Silent(), Countdown().default_params)
    keys = jax.random.split(KEY, 4)
    out = simulator.step(keys, simulator.reset(keys)[1], jnp.arange(4, dtype=jnp.int32))
    assert out.terminated.tolist() == [False, True, False, True]
    assert out.reached.tolist() == [False, False, False, True]


def test_gymnax_style_environment_with_frame_skip_counts_truncations():
    own, run = learner_of(Countdown(frame_skip=4)), learner_of(Foreign(frame_skip=4))
    assert run.loop.slots == own.loop.slots > learner().loop.slots


def test_seeds():
    before = learner().init(KEY)
    equal(before, learner().init(jax.random.PRNGKey(0)))
    with pytest.raises(AssertionError):
        equal(before.params, learner().init(jax.random.key(1)).params)
    # A setting of JAX changes none.
    with jax.default_prng_impl("rbg"):
        equal(learner_of(Countdown()).init(KEY).params, before.params)
        with pytest.raises(SettingError, match="a key must be a threefry2x32 key"):
            learner().init(jax.random.key(0))


def test_unsuitable_environments_are_refused():
    params = Countdown().default_params
    config = Config(**SMALL)
    with pytest.raises(SettingError, match="no info\\['final_observation'\\]"):
        Learner(Foreign(final=False), params, config)
    Learner(Foreign(final=False), params, config.replace(bootstrap_truncation=False))
    with pytest.raises(SettingError, match="Foreign returns 5 values"):
        Learner(Foreign(values=5), params, config)
    with pytest.raises(SettingError, match="needs reset"):
        Learner(object(), params, config)
    with pytest.raises(SettingError, match="random_clocks"):
        Learner(Foreign(), params, config.replace(random_clocks=True))
    env, params = jaxenstein.make("simple", height=16, width=16)
    with pytest.raises(SettingError, match="too large for images of 16x16"):
        Learner(env, params, config.replace(convolutions=((8, 4, 32), (4, 2, 64))))
