"""The contract of every environment, tested on every id."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein.tasks.doom.basic import DoomBasic
from jaxenstein.tasks.doom.deadly_corridor import DoomDeadlyCorridor
from jaxenstein.tasks.doom.health_gathering import DoomHealthGathering
from jaxenstein.tasks.doom.my_way_home import DoomMyWayHome
from jaxenstein.tasks.doom.predict_position import DoomPredictPosition
from jaxenstein.tasks.doom.scenario import DoomScenario
from jaxenstein.tasks.explore import Explore
from jaxenstein.tasks.health import HealthTask
from jaxenstein.tasks.health_gathering import HealthGathering
from jaxenstein.tasks.key_corridor import KeyCorridor
from jaxenstein.tasks.memory_maze import MemoryMaze
from jaxenstein.tasks.minigrid.doors import RedBlueDoors, Unlock
from jaxenstein.tasks.minigrid.instructions import GoToDoor, PutNear
from jaxenstein.tasks.minigrid.state import DONE, DROP, GONE, HELD, beside
from jaxenstein.tasks.minigrid.world import GridWorld, PickUpWorld
from jaxenstein.tasks.miniworld.collect_health import CollectHealth
from jaxenstein.tasks.miniworld.objects import PickupObjects, PutNext
from jaxenstein.tasks.miniworld.rooms import ReachBox
from reliability import golden
from tests.contract.ids import ALL_IDS
from tests.contract.played import EPISODES, Played, member

# The infos of every task; its own events and variables are additional.
INFO = {
    "position": ((2,), np.float32),
    "heading": ((), np.float32),
    "cell": ((2,), np.int32),
    "episode_return": ((), np.float32),
    "episode_length": ((), np.int32),
    "success": ((), np.bool_),
}
# Environments without randomness.
DETERMINISTIC = r"simple|key-door|minigrid-(empty-\d+x\d+|dist-shift\d)"
# The game leaves these levels in the tic after the aim was reached.
ENDS_LATER = (DoomMyWayHome, DoomBasic, DoomDeadlyCorridor, DoomPredictPosition)


@pytest.fixture(scope="module", params=ALL_IDS)
def played(request: pytest.FixtureRequest) -> Played:
    """All tests of an id run one after another, with one compiled program."""
    return Played(request.param)


def test_shapes_and_types(played: Played) -> None:
    env, params = played.env, played.params
    (first, _), (obs, state, reward, terminated, truncated, info) = played.member(0)
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


def test_behaviour_matches_golden_episode_of_the_version(played: Played) -> None:
    """Play the golden episode, which was recorded outside a batch, in a batch."""
    if played.name not in EPISODES:
        pytest.skip("a variant has no golden episode")
    problem = golden.problem(played.name, EPISODES[played.name], golden.trace_of(*played.member(0)))
    assert not problem, golden.message(played.name, problem)


def test_golden_episode_is_varied(played: Played) -> None:
    """A player takes several actions and moves, and observations change."""
    if played.name not in EPISODES:
        pytest.skip("a variant has no golden episode")
    found = golden.trace_of(*played.member(0))
    assert len(played.actions) == golden.STEPS
    assert len(set(played.actions.tolist())) > 3
    assert len(np.unique(found.poses, axis=0)) > 10
    assert len(np.unique(found.frames, axis=0)) > 10


def test_time_limit_truncates_and_resets(played: Played) -> None:
    _, (_, state, _, terminated, truncated, info) = played.member(0)
    done = terminated | truncated
    assert done.any()
    assert (truncated == (info["episode_length"] == golden.LIMIT)).all()
    assert (state.time[done] == 0).all()
    assert not state.done.any()
    assert (state.time[~done] == info["episode_length"][~done]).all()


def test_returns_add_up(played: Played) -> None:
    _, (_, _, reward, terminated, truncated, info) = played.member(0)
    total = 0.0
    for t in range(len(reward)):
        total += float(reward[t])
        assert info["episode_return"][t] == pytest.approx(total, abs=1e-6)
        if terminated[t] or truncated[t]:
            total = 0.0


def about_to_end(env, state):
    """A state from which the next step completes the task."""
    if isinstance(env, DoomMyWayHome | DoomDeadlyCorridor):
        return state.replace(taken=jnp.bool_(True))
    if isinstance(env, DoomBasic | DoomPredictPosition):
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
        last = jnp.zeros_like(state.left).at[jnp.argmax(state.good)].set(True)
        return state.replace(position=state.things[jnp.argmax(state.good)], left=last)
    if isinstance(env, MemoryMaze):
        return state.replace(position=state.things[state.wanted])
    if isinstance(env, PutNear):
        return about_to_put_target(env, state)
    if isinstance(env, GoToDoor):
        return beside_target(env, state)
    if isinstance(env, Unlock | RedBlueDoors):
        opened = jnp.ones_like(state.doors.opened)
        return state.replace(doors=state.doors.replace(opened=opened))
    if isinstance(env, PickupObjects):
        gone = jnp.full_like(state.things.place, GONE)
        return state.replace(things=state.things.replace(place=gone))
    if isinstance(env, PutNext):
        # The yellow box is the first, the red one the second.
        tile = jnp.asarray(state.things.tile)
        tile = tile.at[1].set(tile[0] + jnp.array([1, 0]))
        return state.replace(things=state.things.replace(tile=tile))
    if isinstance(env, PickUpWorld):
        return holding_target(env, state)
    if isinstance(env, GridWorld):
        row, column = np.argwhere(np.asarray(env.subgoal(state).tiles))[0]
        return state.replace(position=jnp.asarray([column + 0.5, row + 0.5], jnp.float32))
    return state.replace(position=jnp.asarray(env.tilemap.goals[state.goal], jnp.float32) + 0.5)


def holding_target(env, state):
    """The state in which the agent holds the target."""
    place = jnp.where(env.asked_for(state), HELD, state.things.place)
    return state.replace(things=state.things.replace(place=place))


def beside_target(env, state):
    """The state with the agent on a free tile beside its target."""
    free = np.asarray(state.level.walls[0]) == 0
    free[tuple(np.asarray(state.level.doors).T[::-1])] = False
    row, column = np.argwhere(free & np.asarray(beside(env.target(state))))[0]
    return state.replace(position=jnp.asarray([column + 0.5, row + 0.5], jnp.float32))


def about_to_put_target(env, state):
    """The state in which the agent holds the target, and faces a tile beside the other object."""
    state = holding_target(env, state)
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
def test_truth_table_of_episode_ends(played: Played, ending: bool, limit: bool) -> None:
    """All four combinations of both flags at the first step."""
    env, states = played.env, played.first[1]
    if ending:
        single = [about_to_end(env, member(states, i, 0)) for i in (0, 1)]
        states = jax.tree.map(
            lambda like, *leaves: np.stack(
                [np.broadcast_to(np.asarray(leaf, like.dtype), like.shape[1:]) for leaf in leaves]
            ),
            states,
            *single,
        )
    at = int(states.time[0]) + (1 if limit else 2)
    # Only an action can drop something or declare the task done.
    acts = [deed for kind, deed in ((PutNear, DROP), (GoToDoor, DONE)) if isinstance(env, kind)]
    standing = np.full_like(played.actions, acts[0] if ending and acts else -1)
    params = played.params.replace(max_steps_in_episode=jnp.int32(at))
    _, after, _, terminated, truncated, info = played.play(played.keys, states, standing, params)
    ends = ending and env.about().ends != ""
    np.testing.assert_array_equal(terminated[0], [ends, ends])
    np.testing.assert_array_equal(truncated[0], [limit, limit])
    # If only survival counts, the time limit is the goal; otherwise, the goal ends the task.
    survives = isinstance(env, HealthTask | DoomScenario) and not env.success_event
    aim = limit and not ending if survives else ending
    aim = aim and not isinstance(env, ENDS_LATER)
    np.testing.assert_array_equal(info["success"][0], [aim, aim])
    np.testing.assert_array_equal(info["episode_length"][0], int(states.time[0]) + 1)
    np.testing.assert_array_equal(after.time[0], 0 if ends or limit else int(states.time[0]) + 1)


def test_seeds_determine_episodes(played: Played) -> None:
    """The same keys give the same episodes; other keys give others, if the task is random."""
    again = played.episodes(played.seed)
    jax.tree.map(np.testing.assert_array_equal, again[1:], (played.first, played.steps))
    # Two draws can be equal, for example one of two arms.
    frames = [played.steps[0], *(played.episodes(played.seed + 2 * k)[2][0] for k in range(1, 4))]
    alone = np.concatenate(frames, axis=1)
    assert (alone[:, :1] != alone[:, 1:]).any() == (not re.fullmatch(DETERMINISTIC, played.name))


def test_equal_settings_make_equal_environments(played: Played) -> None:
    """A program that JAX compiled for one is used for the other."""
    same, _ = jaxenstein.make(played.name, **golden.SIZE)
    other, _ = jaxenstein.make(played.name, **golden.SIZE, sprite_layers=5)
    assert same == played.env
    assert hash(same) == hash(played.env)
    assert other != played.env
    with pytest.raises(AttributeError):
        same.height = 3  # pyright: ignore[reportAttributeAccessIssue]
    with pytest.raises(AttributeError):
        played.params.discount = 0.5
