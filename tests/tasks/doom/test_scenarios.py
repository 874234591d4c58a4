"""Doom's scenarios as environments: poses, ends, and what the game did in recordings."""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from fidelity.doom_recording import Recording, load
from jaxenstein.tasks.doom.fixed import ONE
from jaxenstein.tasks.doom.free_places import load_free_places
from jaxenstein.tasks.doom.maps import ends_of, load_map, rasterise
from tests.reference.doom import Wall, World
from tests.tasks.doom.cases import first_state, make, player, started

RECORDINGS = Path(__file__).parent / "recordings"
HEALTH = ("doom-health-gathering", "doom-health-gathering-supreme")


def action_of(env, held: int) -> int:
    return env.action_buttons.tolist().index(held)


def begun(state, recording: Recording):
    """The state in the first pose of a recording."""
    return state.replace(
        fixed_position=jnp.asarray(recording.position[0]),
        fixed_velocity=jnp.asarray(recording.velocity[0]),
        angle=jnp.asarray(recording.angle[0]),
    )


def assert_poses(after, recording: Recording) -> None:
    """After every tic but the last, after which the game tells nothing; down to the last bit."""
    known = len(recording.position) - 1
    np.testing.assert_array_equal(after.fixed_position[:known], recording.position[1:])
    np.testing.assert_array_equal(after.fixed_velocity[:known], recording.velocity[1:])
    np.testing.assert_array_equal(after.angle[:known], recording.angle[1:])


@pytest.mark.parametrize("number", [0, 1])
def test_my_way_home_continues_from_a_pose_as_in_the_game(number: int) -> None:
    """Rewards, length and end, and the pose after every tic, with any combination of buttons."""
    env, state, play = started("doom-my-way-home", buttons="all")
    recording = load(RECORDINGS / "my-way-home.npz")[number]
    actions = [action_of(env, held) for held in recording.buttons.tolist()]
    reward, terminated, info, after = play(begun(state, recording), actions)
    assert_poses(after, recording)
    np.testing.assert_allclose(reward, recording.reward, atol=1e-7)
    assert np.flatnonzero(after.done).tolist() == [len(actions) - 1]
    assert terminated[-1] == (recording.finished and len(actions) < 2100)
    if terminated[-1]:
        assert np.flatnonzero(info["reached_goal"]).tolist() == [len(actions) - 2]


def things_of(env, recording: Recording) -> dict[str, np.ndarray]:
    """The fields of the state for what lay there in the game, before each tic."""
    shape = len(recording.buttons), len(env.pickups.kind_of)
    places, number = np.zeros((*shape, 2), np.int32), np.zeros(shape, np.int32)
    present = np.zeros(shape, bool)
    for time in range(len(present)):
        alive = (recording.things[:, 4] <= time) & (recording.things[:, 5] > time)
        for kind in range(len(env.pickups.kinds)):
            own = recording.things[alive & (recording.things[:, 0] == kind)]
            slots = np.flatnonzero(env.pickups.kind_of == kind)[: len(own)]
            places[time, slots], number[time, slots] = own[:, 2:4], own[:, 1]
            present[time, slots] = True
    return {"places": places, "number": number, "present": present}


@pytest.mark.parametrize("name", HEALTH)
def test_health_matches_the_game_tic_by_tic(name: str) -> None:
    """Things lie where they lay in the game; all else follows from the buttons."""
    env, state, play = started(name, buttons="all")
    for recording in load(RECORDINGS / f"{name.removeprefix('doom-')}.npz"):
        first = begun(state, recording)
        assert int(first.health) == recording.health[0] == 92
        actions = [action_of(env, held) for held in recording.buttons.tolist()]
        tics = play(first, actions, **things_of(env, recording))
        np.testing.assert_array_equal(tics.reward, recording.reward)
        known = len(recording.health) - 1
        np.testing.assert_array_equal(tics.state.health[:known], recording.health[1:])
        assert_poses(tics.state, recording)
        assert tics.ends[-1]


@pytest.mark.parametrize("name", [HEALTH[0], pytest.param(HEALTH[1], marks=pytest.mark.slow)])
def test_idle_player_dies_in_tic_384(name: str) -> None:
    env, params = make(name)
    first = first_state(env, params, 3)
    reward, terminated, _, after = player(env, params)(first, [0] * 384, seed=3)
    assert np.flatnonzero(terminated).tolist() == [383]
    assert reward.sum() == 284
    assert reward[-1] == -99
    lost = np.flatnonzero(np.diff(np.concatenate([[92], after.health])))
    np.testing.assert_array_equal(lost, np.arange(31, 384, 32))
    periods = [kind.period for kind in env.pickups.kinds]
    at_first = sum(kind.at_first for kind in env.pickups.kinds)
    assert int(first.present.sum()) == at_first
    times = np.arange(1, 385)
    expected = at_first + sum(times // period for period in periods)
    np.testing.assert_array_equal(after.present.sum(axis=1), expected)


def test_health_reward_pays_for_medkits_and_not_for_the_floor() -> None:
    env, params = make(HEALTH[0])
    play, first = player(env, params.replace(health_reward=2.0)), first_state(env, params, 3)
    actions = [env.index_of("forward")] * 100
    rewards, _, _, after = play(first.replace(health=np.int32(40)), actions, seed=3)
    gained = np.diff(np.concatenate([[40], after.health]))
    gained[31::32] += 8
    assert gained[gained > 0].tolist() == [25, 25]
    np.testing.assert_array_equal(rewards, 1 + 2 * gained)


@pytest.mark.parametrize("name", ["health-gathering", "health-gathering-supreme"])
def test_things_are_placed_uniformly_where_they_fit(name: str) -> None:
    """No box of half-width 20 overlaps a wall, and quarters of the room get what they measure."""
    places = load_free_places(name)
    bits = jax.random.bits(jax.random.key(0), (20_000, 3), jnp.uint32)
    drawn = np.asarray(places.sample(bits))
    world = World(
        walls := [Wall(*ends) for ends in ends_of(load_map(name).walls).reshape(-1, 4).tolist()]
    )
    ends = np.array([(w.x0, w.y0, w.x1, w.y1) for w in walls]).reshape(-1, 2, 2)
    least, most = ends.min(axis=1), ends.max(axis=1)
    x, y = drawn[:, 0] / ONE, drawn[:, 1] / ONE
    for low, high in zip(least, most, strict=True):
        inside = (x > low[0] - 20) & (x < high[0] + 20) & (y > low[1] - 20) & (y < high[1] + 20)
        assert not inside.any()
    assert x.min() > world.west / ONE + 20 - 1e-9
    size = 1216 if name == "health-gathering" else 1856
    assert drawn.max() <= (size - 20) * ONE
    # By a raster of the free area, in 4 by 4 fields.
    grid = (np.arange(size // 4) + 0.5) * 4
    # First row of the tiles in the north, and a tile of wall around them.
    solid = rasterise(load_map(name), 32).solid[1:-1, 1:-1]
    free = ~np.repeat(np.repeat(solid[::-1].T, 8, axis=0), 8, axis=1)
    for low, high in zip(least, most, strict=True):
        near = [(grid > low[i] - 20) & (grid < high[i] + 20) for i in (0, 1)]
        free &= ~(near[0][:, None] & near[1][None])
    share = free.reshape(4, len(grid) // 4, 4, -1).sum(axis=(1, 3)) / free.sum()
    found = np.histogram2d(x, y, bins=4, range=((0, size), (0, size)))[0]
    expected = share * len(drawn)
    assert (((found - expected) ** 2 / expected).sum()) < 60


def test_several_things_are_taken_newest_first() -> None:
    """At health 60 two medkits of 25 are needed; of three the oldest is left."""
    env, _ = make("doom-health-gathering")
    n = len(env.pickups.kind_of)
    reach = np.zeros(n, bool)
    reach[[3, 7, 11]] = True
    number = np.arange(n, dtype=np.int32)
    places = np.full((n, 2), 600 * ONE, np.int32)
    target = jnp.asarray((600 * ONE, 600 * ONE), jnp.int32)
    health, taken = env.pickups.take_some(
        target, jnp.asarray(places), jnp.asarray(number), jnp.int32(60), jnp.asarray(reach)
    )
    assert int(health) == 100
    assert np.flatnonzero(taken).tolist() == [7, 11]


@pytest.mark.parametrize(("health", "after", "left"), [(50, 75, 0), (90, 100, 0), (100, 100, 1)])
def test_single_medkit(health: int, after: int, left: int) -> None:
    env, _ = make("doom-health-gathering")
    reach = jnp.zeros(len(env.pickups.kind_of), bool).at[5].set(True)
    got, taken = env.pickups.take_one(jnp.int32(health), reach)
    assert (int(got), int((reach & ~taken).sum())) == (after, left)


def test_position_and_heading_are_computed_from_the_pose() -> None:
    _, state, play = started("doom-my-way-home", buttons="all")
    state = state.replace(
        fixed_position=jnp.array((200 * ONE, -100 * ONE), jnp.int32), angle=jnp.uint32(2**30)
    )
    after = play(state, [0]).state
    # The map begins at x 144 and y 144, a tile before its westernmost and northernmost walls.
    np.testing.assert_allclose(after.position, [[(200 - 144) / 16, (144 + 100) / 16]])
    assert float(after.heading[0]) == pytest.approx(1.5 * np.pi)


def test_buttons_setting() -> None:
    with pytest.raises(jaxenstein.SettingError, match="buttons must be one of 'single', 'all'"):
        make("doom-my-way-home", buttons="two")
    env, _ = make("doom-my-way-home", buttons="all")
    assert env.num_actions == 32
    assert env.action_names[-1] == "turn left + turn right + forward + move left + move right"


def test_initial_headings_match_the_scripts() -> None:
    for name, low, high in (("sparse", 0, 3.6), ("very-sparse", 176.4, 183.6)):
        env, params = make(f"doom-my-way-home-{name}")
        keys = jax.random.split(jax.random.key(0), 500)
        states = jax.jit(jax.vmap(lambda key, e=env, p=params: e.init_state(key, p)))(keys)
        degrees = np.asarray(states.angle).astype(float) * 360 / 2**32
        assert low <= degrees.min() < low + 0.2
        assert high - 0.2 < degrees.max() <= high
        assert len(np.unique(np.asarray(states.fixed_position), axis=0)) == 1
        assert not (np.asarray(states.angle) % 65536).any()


def test_one_row_view_is_the_horizon() -> None:
    env, params = make("doom-my-way-home", height=1, width=32, observation="depth", frame_skip=4)
    low, low_params = make("doom-my-way-home", height=65, width=32, observation="depth")
    state = first_state(env, params, 4)
    seen, wanted = env.observe(state, params), low.observe(state, low_params)
    assert seen.shape == (1, 32)
    np.testing.assert_allclose(wanted[32], seen[0], rtol=1e-5)
