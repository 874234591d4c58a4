"""What every environment keeps, tried on every id."""

import dataclasses
import functools
import importlib
import inspect
from collections.abc import Iterator
from typing import Any, cast
from unittest import mock

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein.environment import Environment
from jaxenstein.tasks.doom.basic import DoomBasic
from jaxenstein.tasks.doom.deadly_corridor import DoomDeadlyCorridor
from jaxenstein.tasks.doom.health_gathering import DoomHealthGathering
from jaxenstein.tasks.doom.my_way_home import DoomMyWayHome
from jaxenstein.tasks.doom.scenario import DoomScenario
from jaxenstein.tasks.explore import Explore
from jaxenstein.tasks.health import HealthTask
from jaxenstein.tasks.health_gathering import HealthGathering
from jaxenstein.tasks.key_corridor import KeyCorridor
from jaxenstein.tasks.memory_maze import MemoryMaze
from jaxenstein.tasks.minigrid.instructions import PutNear
from jaxenstein.tasks.minigrid.state import DROP, HELD
from jaxenstein.tasks.minigrid.world import GridWorld, PickUpWorld
from jaxenstein.tasks.miniworld.collect_health import CollectHealth
from jaxenstein.tasks.miniworld.rooms import ReachBox
from tests.contract.ids import IDS
from tests.reference.frames import plain_frame

SIZE = {"height": 12, "width": 16}
# What every task tells; events and variables of its own come besides.
INFO = {
    "position": ((2,), np.float32),
    "heading": ((), np.float32),
    "cell": ((2,), np.int32),
    "episode_return": ((), np.float32),
    "episode_length": ((), np.int32),
    "success": ((), np.bool_),
}


def build(name: str, **settings: Any) -> tuple[Environment[Any, Any], Any]:
    """A small environment of any id."""
    return jaxenstein.make(name, **SIZE, **settings)


# Environments whose frames are drawn here: walls alone, and things. The others' are stripes, which
# compile in a third of the time: there is one renderer, and golden episodes hold all pictures.
DRAWN = ("key-door", "health-gathering")


@pytest.fixture(autouse=True)
def _stripes(request: pytest.FixtureRequest) -> Iterator[None]:
    """Frames without rays for tests of an id that is not in `DRAWN`."""
    params = request.node.callspec.params if hasattr(request.node, "callspec") else {}
    if params.get("name", DRAWN[0]) in DRAWN:
        yield
        return
    with mock.patch("jaxenstein.tasks.first_person.render", plain_frame):
        yield


SEEDS = (3, 4)
HORIZON = 50


@functools.cache
def compiled(name: str):
    """Reset, and a scan of steps, of a batch of environments; compiled once for all tests.

    `reset(keys, params)` gives observations and states, `play(keys, states, actions, params)`
    with actions int32[T] for all of them the six values of each step, stacked over time.
    """
    env, _ = build(name)

    @jax.jit
    def play(keys, states, actions, params):
        def step(carry, action):
            keys, states = carry
            pairs = jax.vmap(jax.random.split)(keys)
            out = jax.vmap(env.step, (0, 0, None, None))(pairs[:, 1], states, action, params)
            return (pairs[:, 0], out[1]), out

        return jax.lax.scan(step, (keys, states), actions)[1]

    return jax.jit(jax.vmap(env.reset, (0, None))), play


@functools.cache
def setting(name: str, limit: int = HORIZON, old_keys: bool = False):
    """Keys, actions and params of the scan that the tests play."""
    env, params = build(name)
    kind = jax.random.PRNGKey if old_keys else jax.random.key
    keys = jnp.stack([kind(seed) for seed in SEEDS])
    actions = np.random.default_rng(0).integers(0, env.num_actions, 120, np.int32)
    return keys, actions, params.replace(max_steps_in_episode=jnp.int32(limit))


def member(tree, i: int, axis: int):
    """One environment's part of what a batch returned, as numpy."""
    return jax.tree.map(lambda leaf: np.take(np.asarray(leaf), i, axis), tree)


@functools.cache
def rollout(name: str, old_keys: bool = False):
    """The first seed's reset and steps of random actions, stacked over time, as numpy."""
    keys, actions, params = setting(name, old_keys=old_keys)
    reset, play = compiled(name)
    obs, states = reset(keys, params)
    return *member((obs, states), 0, 0), member(play(keys, states, actions, params), 0, 1)


@pytest.mark.parametrize("name", IDS)
def test_shapes_and_types(name):
    env, params = jaxenstein.make(name, **SIZE)
    first, _, (obs, state, reward, terminated, truncated, info) = rollout(name)
    space = env.observation_space(params)
    assert space.contains(first)
    assert all(space.contains(frame) for frame in obs)
    assert reward.dtype == np.float32
    assert terminated.dtype == truncated.dtype == np.bool_
    kinds = {k: (v.shape[1:], v.dtype.type) for k, v in info.items()}
    assert kinds.items() >= INFO.items()
    own = [kind for name, kind in kinds.items() if name not in INFO]
    assert all(shape == () and kind in (np.float32, np.int32, np.bool_) for shape, kind in own)
    for leaf in jax.tree.leaves((state, reward, info)):
        if leaf.dtype == np.float32:
            assert np.isfinite(leaf).all()
    assert ((state.heading >= 0) & (state.heading < 2 * np.pi)).all()
    assert env.action_space(params).n == env.num_actions == len(env.action_names)


@pytest.mark.parametrize("name", IDS)
def test_time_limit_truncates_and_resets(name):
    _, _, (_, state, _, terminated, truncated, info) = rollout(name)
    done = terminated | truncated
    assert done.any()
    assert (truncated == (info["episode_length"] == HORIZON)).all()
    assert (state.time[done] == 0).all()
    assert not state.done.any()
    assert (state.time[~done] == info["episode_length"][~done]).all()


@pytest.mark.parametrize("name", IDS)
def test_returns_add_up(name):
    _, _, (_, _, reward, terminated, truncated, info) = rollout(name)
    total = 0.0
    for t in range(len(reward)):
        total += float(reward[t])
        assert info["episode_return"][t] == pytest.approx(total, abs=1e-6)
        if terminated[t] or truncated[t]:
            total = 0.0


def about_to_end(env, state):
    """The state with whatever the next step must find for the task to be over."""
    if isinstance(env, DoomMyWayHome | DoomDeadlyCorridor):
        return state.replace(taken=jnp.bool_(True))
    if isinstance(env, DoomBasic):
        return state.replace(killed=jnp.bool_(True))
    if isinstance(env, HealthGathering | DoomHealthGathering):
        time = jnp.int32(int(env.default_params.damage_period) - 1)
        nothing = jnp.zeros_like(state.present)
        return state.replace(health=jnp.int32(1), time=time, present=nothing)
    if isinstance(env, DoomScenario):
        return state.replace(health=jnp.int32(0))
    if isinstance(env, CollectHealth):
        return state.replace(health=jnp.int32(1))
    if isinstance(env, KeyCorridor | ReachBox):
        return state.replace(position=state.goal)
    if isinstance(env, Explore):
        return state.replace(position=state.things[0])
    if isinstance(env, MemoryMaze):
        return state.replace(position=state.things[state.wanted])
    if isinstance(env, PutNear):
        return about_to_put(env, state)
    if isinstance(env, PickUpWorld):
        return in_hand(env, state)
    if isinstance(env, GridWorld):
        row, column = np.argwhere(np.asarray(env.subgoal(state).tiles))[0]
        return state.replace(position=jnp.asarray([column + 0.5, row + 0.5], jnp.float32))
    return state.replace(position=jnp.asarray(env.tilemap.goals[state.goal], jnp.float32) + 0.5)


def in_hand(env, state):
    """The state with what is asked for in the hand."""
    place = jnp.where(env.asked_for(state), HELD, state.things.place)
    return state.replace(things=state.things.replace(place=place))


def about_to_put(env, state):
    """The state with what is asked for in the hand, before a tile beside the other thing."""
    state = in_hand(env, state)
    lies = np.asarray(env.tiles_of(state, state.things.lying))
    free = (np.asarray(state.level.walls[0]) == 0) & ~lies
    for row, column in np.argwhere(np.asarray(env.subgoal(state).tiles)).tolist():
        for quarter, (right, down) in enumerate(((1, 0), (0, 1), (-1, 0), (0, -1))):
            if free[row - down, column - right]:
                place = [column - right + 0.5, row - down + 0.5]
                heading = jnp.float32(quarter * np.pi / 2)
                return state.replace(position=jnp.asarray(place, jnp.float32), heading=heading)
    raise AssertionError("there is no place beside the other thing")


@pytest.mark.parametrize("limit", [False, True], ids=["in time", "at the limit"])
@pytest.mark.parametrize("ending", [False, True], ids=["going on", "ending"])
@pytest.mark.parametrize("name", IDS)
def test_truth_table_of_ends(name, ending, limit):
    """Both flags, each by itself, together, and neither, at the first of the steps."""
    env, _ = build(name)
    keys, actions, params = setting(name)
    reset, play = compiled(name)
    states = reset(keys, params)[1]
    if ending:
        single = [about_to_end(env, jax.tree.map(lambda x, i=i: x[i], states)) for i in (0, 1)]
        states = jax.tree.map(
            lambda like, *leaves: jnp.stack(
                [jnp.broadcast_to(jnp.asarray(leaf, like.dtype), like.shape[1:]) for leaf in leaves]
            ),
            states,
            *single,
        )
    at = int(states.time[0]) + (1 if limit else 2)
    # Something is put down by an action alone.
    standing = np.full_like(actions, DROP if ending and isinstance(env, PutNear) else -1)
    params = params.replace(max_steps_in_episode=jnp.int32(at))
    _, after, _, terminated, truncated, info = play(keys, states, standing, params)
    ends = ending and env.about().ends != ""
    np.testing.assert_array_equal(terminated[0], [ends, ends])
    np.testing.assert_array_equal(truncated[0], [limit, limit])
    # Where nothing but survival counts, the limit is the aim; elsewhere it is what ends the task.
    survives = isinstance(env, HealthTask | DoomScenario) and not env.success_event
    aim = limit and not ending if survives else ending
    # The game leaves these levels in the tic after the aim was reached.
    aim = aim and not isinstance(env, DoomMyWayHome | DoomBasic | DoomDeadlyCorridor)
    np.testing.assert_array_equal(info["success"][0], [aim, aim])
    np.testing.assert_array_equal(info["episode_length"][0], int(states.time[0]) + 1)
    np.testing.assert_array_equal(after.time[0], 0 if ends or limit else int(states.time[0]) + 1)


@pytest.mark.parametrize("name", IDS)
def test_jit_vmap_and_scan_change_nothing(name):
    """A step by itself is that of the compiled scan of a batch; of some ids without compilation."""
    env, params = build(name)
    keys, actions, params = setting(name)
    reset, play = compiled(name)
    first, states = reset(keys, params)
    obs, after, *wanted = member(member(play(keys, states, actions, params), 1, 1), 0, 0)
    key = jax.random.split(keys[1])[1]
    if name in DRAWN:
        with jax.disable_jit():
            state = env.init_state(keys[1], params)
            alike(env.reset(keys[1], params)[0], member(first, 1, 0))
            alike(env.step(key, state, actions[0], params), (obs, after, *wanted))
    else:
        state = jax.jit(env.init_state)(keys[1], params)
        reward, terminated, _, info = wanted
        out = env.advance(jax.random.split(key)[0], state, actions[0], params)
        alike(out, (after, reward, terminated, info))
    alike(state, member(states, 1, 0))


def alike(one, other) -> None:
    """Equal but for rounding; of a picture's values few may differ, at the edges of things."""
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        a, b = np.asarray(a), np.asarray(b)
        assert a.dtype == b.dtype
        if a.dtype == np.uint8:
            assert (a != b).mean() < 0.02
        else:
            np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("name", IDS)
def test_seeds_decide(name):
    """The same keys give the same episodes again, and other keys others, where any are drawn."""
    keys, actions, params = setting(name)
    reset, play = compiled(name)
    one, other = (play(keys, reset(keys, params)[1], actions, params) for _ in range(2))
    jax.tree.map(np.testing.assert_array_equal, one, other)
    frames = np.asarray(one[0])
    alike = ("simple", "key-door")
    assert (frames[:, 0] != frames[:, 1]).any() == (name not in alike)


def test_old_and_typed_keys_agree():
    typed, old = rollout("key-door"), rollout("key-door", old_keys=True)
    jax.tree.map(np.testing.assert_array_equal, typed, old)


@pytest.mark.parametrize("name", IDS)
def test_equal_settings_share_one_compilation(name):
    one, params = jaxenstein.make(name, **SIZE)
    two, _ = jaxenstein.make(name, **SIZE)
    other, _ = jaxenstein.make(name, **SIZE, sprite_layers=5)
    assert one == two
    assert hash(one) == hash(two)
    assert one != other
    keys, _, _ = setting(name)
    state = jax.tree.map(lambda leaf: leaf[0], compiled(name)[0](keys, params)[1])
    one.advance(keys[0], state, np.int32(0), params)
    cache_size = inspect.unwrap(
        Environment.advance, stop=lambda f: hasattr(f, "_cache_size")
    )._cache_size
    before = cache_size()
    two.advance(keys[1], state, np.int32(1), params)
    assert cache_size() == before


@pytest.mark.parametrize("name", IDS)
def test_environments_are_frozen(name):
    env, params = jaxenstein.make(name)
    with pytest.raises(AttributeError):
        env.height = 3  # pyright: ignore[reportAttributeAccessIssue]
    with pytest.raises(AttributeError):
        params.discount = 0.5


@pytest.mark.parametrize("observation", ["rgb", "gray", "depth", "labels", "dict"])
def test_observation_kinds(observation):
    env, params = jaxenstein.make("key-door", observation=observation, **SIZE)
    obs, state = env.reset(jax.random.key(0), params)
    space = env.observation_space(params)
    assert space.contains(jax.tree.map(np.asarray, obs))
    assert space.contains(jax.tree.map(np.asarray, space.sample(jax.random.key(1))))
    after = env.step(jax.random.key(0), state, 2, params)[0]
    assert space.contains(jax.tree.map(np.asarray, after))


def test_step_renders_once():
    """Auto-reset selects a state, not a frame: `step` costs hardly more without resets."""
    env, params = jaxenstein.make("my-way-home")
    keys = jax.random.split(jax.random.key(0), 8)
    _, states = jax.vmap(env.reset, (0, None))(keys, params)
    actions = jnp.zeros(8, jnp.int32)

    def flops(step):
        lowered = jax.jit(jax.vmap(step, (0, 0, 0, None))).lower(keys, states, actions, params)
        return cast(dict, lowered.compile().cost_analysis())["flops"]

    once = flops(dataclasses.replace(env, autoreset=None).step)
    assert once < flops(env.step) <= 1.15 * once
    twice, _ = jaxenstein.make("my-way-home", final_observation=True)
    assert flops(twice.step) > 1.5 * once


@pytest.mark.parametrize("drawn", ["my-way-home", "doom-health-gathering"])
def test_a_choice_that_differs_within_the_batch(drawn) -> None:
    """A user's `lax.cond` around `reset` and `step`, whose arrays it makes a batch of."""
    env, params = jaxenstein.make(drawn, height=6, width=6)

    def either(anew, key, state):
        step = lambda key, state: env.step(key, state, jnp.int32(0), params)[:2]  # noqa: E731
        return jax.lax.cond(anew, lambda key, _: env.reset(key, params), step, key, state)

    keys = jax.random.split(jax.random.key(3), 3)
    reset = jax.vmap(env.reset, (0, None))(keys, params)
    actions = jnp.zeros(3, jnp.int32)
    step = jax.vmap(env.step, (0, 0, 0, None))(keys, reset[1], actions, params)[:2]
    chosen = jnp.array([False, True, False])
    got = jax.jit(jax.vmap(either))(chosen, keys, reset[1])
    for i, anew in enumerate(chosen):
        alike(member(got, i, 0), member(reset if anew else step, i, 0))


def test_a_batch_of_no_environments():
    env, params = build("key-door")
    obs, states = jax.vmap(env.reset, (0, None))(jax.random.split(jax.random.key(0), 0), params)
    assert obs.shape == (0, 12, 16, 3)
    keys, actions = jax.random.split(jax.random.key(0), 0), jnp.zeros(0, jnp.int32)
    obs, _, reward, *_ = jax.vmap(env.step, (0, 0, 0, None))(keys, states, actions, params)
    assert (obs.shape, reward.shape) == ((0, 12, 16, 3), (0,))


def test_params_can_be_batched():
    env, params = jaxenstein.make("simple", **SIZE)
    batch = params.replace(
        move_distance=jnp.array([0.1, 0.2, 0.3]), max_steps_in_episode=jnp.array([1, 2, 3])
    )
    axes = jax.tree.map(lambda leaf: 0 if jnp.ndim(leaf) else None, batch)
    keys = jax.random.split(jax.random.key(0), 3)
    _, states = jax.vmap(env.reset, (0, axes))(keys, batch)
    out = jax.vmap(env.step, (0, 0, None, axes))(keys, states, 2, batch)
    moved = out[5]["position"] - states.position
    np.testing.assert_allclose(moved[:, 0], [0.1, 0.2, 0.3], rtol=1e-6)
    assert out[4].tolist() == [True, False, False]


def test_params_are_traced_not_compiled_in():
    env, params = jaxenstein.make("simple", **SIZE)
    traces = []

    @jax.jit
    def step(key, state, params):
        traces.append(1)
        return env.step(key, state, 2, params)

    _, state = env.reset(jax.random.key(0), params)
    for distance in (0.1, 0.2, 0.3):
        step(jax.random.key(0), state, params.replace(move_distance=distance))
    assert len(traces) == 1


@pytest.mark.parametrize("action", [-1, 5, 127, -(2**31), 2**31 - 1, np.int8(-3), np.uint32(2**31)])
def test_invalid_actions_do_nothing(action):
    env, params = jaxenstein.make("my-way-home", **SIZE)
    _, state = env.reset(jax.random.key(0), params)
    _, after, reward, terminated, truncated, _ = env.step(jax.random.key(1), state, action, params)
    np.testing.assert_array_equal(after.position, state.position)
    np.testing.assert_array_equal(after.heading, state.heading)
    assert after.time == 1
    assert reward == np.float32(-0.0001)
    assert not terminated
    assert not truncated


@pytest.mark.parametrize("action", [0.0, np.zeros(3, np.int32), True])
def test_wrong_kinds_of_action_are_refused(action):
    env, params = jaxenstein.make("simple", **SIZE)
    _, state = env.reset(jax.random.key(0), params)
    with pytest.raises(jaxenstein.SettingError, match="one integer of shape"):
        env.step(jax.random.key(1), state, action, params)


def test_wrong_params_are_refused():
    env, _ = jaxenstein.make("simple", **SIZE)
    with pytest.raises(jaxenstein.SettingError, match="NavigationParams"):
        env.reset(jax.random.key(0), jaxenstein.Params())


def test_x64_changes_no_type():
    env, params = jaxenstein.make(DRAWN[1], **SIZE)
    key = jax.random.key(5)
    narrow = env.step(key, env.reset(key, params)[1], 2, params)
    # Older versions of JAX have it among the experiments, newer ones only at the top.
    home = jax if hasattr(jax, "enable_x64") else importlib.import_module("jax.experimental")
    with home.enable_x64(True):
        wide = env.step(key, env.reset(key, params)[1], 2, params)
    for a, b in zip(jax.tree.leaves(narrow), jax.tree.leaves(wide), strict=True):
        assert a.dtype == b.dtype
        if a.dtype != np.uint8:
            np.testing.assert_allclose(a, b, rtol=1e-6)
    assert (np.asarray(narrow[0]) != np.asarray(wide[0])).mean() < 0.01
