"""Health gathering against a slow simulation of its rules, one medkit at a time."""

import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein.errors import SettingError
from jaxenstein.tasks.health_gathering import CAPACITY
from jaxenstein.tasks.hud import EMPTY, LEVELS, RIM, bar

LEFT, RIGHT, AHEAD = range(3)
# All rollouts have this many episodes and steps, to share one compilation.
EPISODES, STEPS = 12, 2100
LOW, HIGH = 1 + 20 / 32, 39 - 20 / 32
REACH = 36 / 32


@functools.cache
def task():
    env, params = jaxenstein.make("health-gathering", height=8, width=8, autoreset=None)
    return env, params, jax.jit(env.step)


@functools.cache
def rollout():
    """A compiled function of params, keys[B] and actions[B, T]: the states and outcomes.

    It draws nothing, to compile fast.
    """
    env = task()[0]

    def one(params, key, actions):
        params = env.check_params(params)
        start = env.init_state(key, params)

        def body(state, inputs):
            key, action = inputs
            state, reward, terminated, info = env.advance(key, state, action, params)
            return state, (state, reward, terminated, info["took_medkit"])

        keys = jax.random.split(key, actions.shape[0])
        return start, jax.lax.scan(body, start, (keys, actions))[1]

    return jax.jit(jax.vmap(one, (None, 0, 0)))


def simulate(params, seed, actions):
    """The first states, and the states, rewards, ends and medkits taken after each step."""
    count, length = actions.shape
    padded = np.full((EPISODES, STEPS), -1, np.int32)
    padded[:count, :length] = actions
    keys = jax.random.split(jax.random.key(seed), EPISODES)
    start, after = jax.device_get(rollout()(params, keys, padded))
    return pick(start, slice(count)), pick(after, slice(count), slice(length))


def pick(tree, *index):
    return jax.tree.map(lambda leaf: leaf[index], tree)


class Oracle:
    """The rules in Python numbers, given the positions of new medkits."""

    def __init__(self, state):
        self.position = np.array(state.position, np.float64)
        self.heading = float(state.heading)
        self.health, self.time = int(state.health), int(state.time)
        lying = zip(state.medkits.tolist(), state.present, strict=True)
        self.medkits = [tuple(place) if present else None for place, present in lying]
        self.placed = int(state.placed)

    def step(self, action, new_place):
        """Reward, whether dead, how many medkits were taken."""
        self.time += 1
        self.heading += {LEFT: -1, RIGHT: 1}.get(action, 0) * math.radians(15)
        if action == AHEAD:
            ahead = np.array([math.cos(self.heading), math.sin(self.heading)])
            target = self.position + 0.15 * ahead
            if (target >= 1).all() and (target < 39).all():
                self.position = target
        if self.time % 32 == 0:
            self.health -= 8
        dead = self.health <= 0
        self.health = max(self.health, 0)
        count = self.take() if action == AHEAD and not dead else 0
        if self.time % 30 == 0:
            self.medkits[self.placed] = new_place
            self.placed += 1
        return (-99 if dead else 1), dead, count

    def take(self):
        count = 0
        for i, place in enumerate(self.medkits):
            if place is None or self.health == 100:
                continue
            if all(abs(a - b) < REACH for a, b in zip(place, self.position, strict=True)):
                self.medkits[i] = None
                self.health = min(self.health + 25, 100)
                count += 1
        return count


def follow(start, states, outcomes, actions):
    """Compare a rollout with the oracle until death; return the medkits taken and whether dead."""
    oracle = Oracle(start)
    taken = 0
    for t, action in enumerate(actions):
        state = pick(states, t)
        reward, terminated, count = (part[t] for part in outcomes)
        new_place = tuple(state.medkits[int(state.placed) - 1].tolist())
        assert (reward, terminated, count) == oracle.step(int(action), new_place)
        np.testing.assert_allclose(state.position, oracle.position, atol=1e-4)
        oracle.position = np.array(state.position, np.float64)
        assert (state.health, state.placed) == (oracle.health, oracle.placed)
        assert state.time == oracle.time
        assert state.present.tolist() == [place is not None for place in oracle.medkits]
        lying = [place for place in oracle.medkits if place is not None]
        np.testing.assert_array_equal(state.medkits[state.present], lying)
        taken += count
        if terminated:
            return taken, True
    return taken, False


def test_random_episodes_match_a_slow_computation():
    params = task()[1]
    rng = np.random.default_rng(0)
    # Long runs ahead, so that medkits are met.
    actions = rng.choice(3, (12, 700), p=[0.05, 0.1, 0.85])
    actions[::3] = rng.choice(3, (4, 700))
    start, (states, *outcomes) = simulate(params.replace(medkits=32), 1, actions)
    ends = [
        follow(pick(start, i), pick(states, i), pick(outcomes, i), actions[i])
        for i in range(len(actions))
    ]
    assert sum(taken for taken, _ in ends) > 20
    assert sum(dead for _, dead in ends) > 3


def test_standing_still_dies_after_384_steps_with_return_284():
    params = task()[1]
    start, (states, reward, terminated, _) = simulate(params, 2, np.full((1, 700), -1))
    assert (start.health[0], start.present.sum(), start.placed[0]) == (92, 17, 17)
    assert start.position[0].tolist() == [20, 20]
    assert start.heading[0] == 0
    end = int(np.argmax(terminated[0]))
    assert end == 384 - 1
    assert not terminated[0, :end].any()
    assert reward[0, : end + 1].sum() == 284
    assert (states.episode_return[0, end], states.health[0, end]) == (284, 0)
    assert states.present[0, end].sum() == 17 + 384 // 30


def test_no_medkit_is_lost_in_the_longest_episode():
    params = task()[1]
    assert params.max_steps_in_episode == 2100
    assert CAPACITY >= 17 + 2100 // 30
    turning = np.full((1, 2100), LEFT)
    _, (states, _, terminated, _) = simulate(params.replace(damage=0), 3, turning)
    assert not terminated.any()
    assert np.flatnonzero(states.done[0]).tolist() == [2099]
    expected = 17 + np.arange(1, 2101) // 30
    np.testing.assert_array_equal(states.present[0].sum(axis=-1), expected)
    stays = (states.medkits[0, 1:] == states.medkits[0, :-1]).all(axis=-1)
    assert stays[states.present[0, :-1]].all()


@functools.cache
def first_state():
    env, params, _ = task()
    return env.init_state(jax.random.key(9), env.check_params(params))


def pile(count, offset=(0.0, 0.0), places=None, **fields):
    """A state with medkits at one point, relative to the end of a step forward, and no others."""
    spot = np.array([20.15, 20]) + offset
    # Every other slot, so that the order differs from that of the used slots.
    present = np.zeros(CAPACITY, bool)
    present[range(1, 2 * count, 2) if places is None else places] = True
    medkits = np.where(present[:, None], spot, 30).astype(np.float32)
    fields = {name: jnp.asarray(value, jnp.int32) for name, value in fields.items()}
    return first_state().replace(
        medkits=jnp.asarray(medkits), present=jnp.asarray(present), **fields
    )


def step(state, action, params=None, seed=0):
    env_params = task()[0].check_params(task()[1] if params is None else params)
    action = jnp.int32(action)
    _, state, reward, terminated, _, info = task()[2](
        jax.random.key(seed), state, action, env_params
    )
    return state, float(reward), bool(terminated), info


@pytest.mark.parametrize(
    ("health", "count", "taken", "after"),
    [
        (28, 5, 3, 100),
        (53, 5, 2, 100),
        (28, 2, 2, 78),
        (99, 5, 1, 100),
        (100, 5, 0, 100),
        (75, 5, 1, 100),
        (74, 5, 2, 100),
        (4, 88 // 2, 4, 100),
    ],
)
def test_medkits_on_one_spot_heal_one_after_another(health, count, taken, after):
    before = pile(count, health=health)
    state, reward, terminated, info = step(before, AHEAD)
    assert (int(state.health), int(info["took_medkit"])) == (after, taken)
    assert int(info["health"]) == after
    assert (reward, terminated) == (1, False)
    expected = np.array(before.present)
    expected[np.flatnonzero(expected)[:taken]] = False
    np.testing.assert_array_equal(state.present, expected)


def test_medkits_in_several_words_of_bits_are_taken_in_order():
    state, *_ = step(pile(4, places=[5, 40, 41, 42], health=53), AHEAD)
    assert np.flatnonzero(state.present).tolist() == [41, 42]


@pytest.mark.parametrize("action", [LEFT, RIGHT, -1, 3])
def test_only_forward_takes_medkits(action):
    state, *_, info = step(pile(3, health=28), action)
    assert (int(state.health), int(info["took_medkit"])) == (28, 0)
    assert int(state.present.sum()) == 3


def test_forward_against_a_wall_takes_medkits():
    before = pile(1, (18.7, 0), health=28).replace(position=jnp.array([38.95, 20], jnp.float32))
    state, *_ = step(before, AHEAD)
    np.testing.assert_array_equal(state.position, before.position)
    assert int(state.health) == 53


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("axis", [0, 1])
def test_pickup_range_is_a_box(axis, sign):
    for distance, taken in ((REACH - 0.001, 1), (REACH + 0.001, 0)):
        # In a corner of the box, to distinguish it from a disc.
        offset = np.full(2, REACH - 0.01)
        offset[axis] = sign * distance
        *_, info = step(pile(1, offset, health=28), AHEAD)
        assert int(info["took_medkit"]) == taken


def test_damage_comes_before_medkits():
    full, *_, info = step(pile(3, health=100, time=31), AHEAD)
    assert (int(full.health), int(info["took_medkit"])) == (100, 1)
    # Death comes before the medkit at one's feet.
    dead, reward, terminated, info = step(pile(3, health=8, time=31), AHEAD)
    assert (int(dead.health), reward, terminated) == (0, -99, True)
    assert bool(info["died"])
    assert int(dead.present.sum()) == 3
    alive, reward, terminated, info = step(pile(3, health=9, time=63), AHEAD)
    assert (int(alive.health), reward, terminated) == (1 + 75, 1, False)
    assert not bool(info["died"])


def test_a_new_medkit_is_not_taken_in_its_step():
    params = task()[1].replace(pickup_reach=100)
    state, *_, info = step(pile(0, health=28, time=29), AHEAD, params)
    assert (int(state.health), int(info["took_medkit"]), int(state.present.sum())) == (28, 0, 1)
    state, *_, info = step(state, AHEAD, params)
    assert (int(state.health), int(info["took_medkit"]), int(state.present.sum())) == (53, 1, 0)


def chi_square(counts, expected):
    return float(((counts - expected) ** 2 / expected).sum())


def test_medkit_positions_are_uniform():
    env, params, _ = task()
    params = env.check_params(params)
    keys = jax.random.split(jax.random.key(5), 600)
    start = jax.jit(jax.vmap(lambda key: env.init_state(key, params)))(keys)
    first = np.array(start.medkits)[np.array(start.present)]
    late = pile(0, time=29)

    def appear(key):
        after = env.transition(key, late, jnp.int32(0), params)[0]
        return after.medkits[17]

    new = np.array(jax.jit(jax.vmap(appear))(jax.random.split(jax.random.key(6), 8000)))
    assert first.shape == (600 * 17, 2)
    for places in (first, new):
        assert LOW <= places.min() < LOW + 0.05
        assert HIGH - 0.05 < places.max() < HIGH
        counts = np.histogram2d(*places.T, bins=8, range=[(LOW, HIGH)] * 2)[0]
        # 63 degrees of freedom: standard deviation 11.2.
        assert chi_square(counts, len(places) / 64) < 63 + 4 * 11.2


# The strip


HEALTHS = (0, 1, 3, 8, 28, 30, 31, 53, 60, 61, 92, 98, 100)


def test_hud_shows_health():
    size = {"width": 22, "observation": "dict"}
    env, params = jaxenstein.make("health-gathering", height=12, hud=True, **size)
    plain, _ = jaxenstein.make("health-gathering", height=8, **size)
    params = env.check_params(params)
    observe = jax.jit(lambda state: (env.observe(state, params), plain.observe(state, params)))
    for health in HEALTHS:
        state = first_state().replace(health=jnp.int32(health))
        seen, expected = jax.device_get(observe(state))
        assert env.observation_space().contains(seen)
        assert plain.observation_space().contains(expected)
        assert seen["health"].tolist() == expected["health"].tolist() == [health]
        np.testing.assert_array_equal(seen["image"][:8], expected["image"])
        strip = seen["image"][8:]
        assert (strip[[0, -1]] == RIM).all()
        assert (strip[:, [0, -1]] == RIM).all()
        # Red to 30, yellow to 60, green above.
        colour = LEVELS[0 if health <= 30 else 1 if health <= 60 else 2][1]
        filled = (strip[1:-1, 1:-1] == colour).all(axis=-1)
        # A column of the 20 is filled if its middle is below the health.
        count = sum((column + 0.5) * 5 < health for column in range(20))
        assert filled.sum(axis=1).tolist() == [count] * 2
        assert filled[:, :count].all()
        assert (strip[1:-1, 1 + count : -1] == EMPTY).all()


def test_hud_in_gray():
    env, params = jaxenstein.make(
        "health-gathering", height=12, width=22, hud=True, observation="gray"
    )
    image = jax.eval_shape(lambda state: env.observe(state, params), first_state())
    assert (image.shape, image.dtype) == ((12, 22), np.uint8)
    colour, gray = (np.array(bar(jnp.float32(0.53), 4, 22, kind)) for kind in ("rgb", "gray"))
    # The weights of Rec. 601.
    assert np.abs(gray - colour @ np.array([0.299, 0.587, 0.114])).max() <= 1


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"observation": "depth"}, "not 'depth'"),
        ({"observation": "labels"}, "not 'labels'"),
        ({"height": 7}, "at least 8 pixels, not 7"),
    ],
)
def test_hud_is_refused_where_it_cannot_be_drawn(settings, message):
    with pytest.raises(SettingError, match=message):
        jaxenstein.make("health-gathering", hud=True, **settings)
