"""The contract of every adapter, against the native environment."""

from __future__ import annotations

import copy
import dataclasses
import functools
import importlib
import pickle
from typing import Any

import jax
import numpy as np
import pytest

import jaxenstein
from jaxenstein.errors import SettingError, UnknownEnvironmentError
from tests.adapters.corridor import FORWARD, SIZE, STAY, N, make_corridor
from tests.adapters.players import (
    BY_ID,
    FUNCTIONS,
    MASKED,
    PLAYERS,
    STREAMS,
    STRICT,
    GymnaxPlayer,
    SinglePlayer,
    Step,
)

pytestmark = [
    pytest.mark.usefixtures("plain_frames"),
    pytest.mark.filterwarnings("ignore::DeprecationWarning:(gymnax|stoa|chex|flax|distrax).*"),
]
IDLE = np.full(N, STAY)


class Native:
    """One environment by `reset` and `advance`; the corridor has nothing drawn by chance."""

    def __init__(self, env: Any, params: Any) -> None:
        self.env, self.params, self.key = env, params, jax.random.key(0)

    def reset(self) -> np.ndarray:
        obs, self.state = self.env.reset(self.key, self.params)
        return np.asarray(obs)

    def step(self, action: int) -> tuple[np.ndarray, float, bool, bool]:
        """The observation before a reset, the reward, and both ends."""
        out = self.env.advance(self.key, self.state, np.int32(action), self.params)
        self.state, reward, terminated, _ = out
        truncated = int(self.state.time) >= int(self.params.max_steps_in_episode)
        obs = self.env.observe(self.state, self.params)
        return np.asarray(obs), float(reward), bool(terminated), truncated


@pytest.fixture(scope="module")
def played() -> Any:
    """The observations of resets, and forty actions with the results of `Native.step`."""
    natives = [Native(*make_corridor()) for _ in range(N)]
    first = [native.reset() for native in natives]
    rng, steps = np.random.default_rng(0), []
    for t in range(40):
        # Three steps to the goal: at once; so late that time is up with the last; by chance.
        late = FORWARD if t % 7 >= 4 else STAY
        actions = np.array([FORWARD, late, rng.integers(0, 5)])
        told = [native.step(int(action)) for native, action in zip(natives, actions, strict=True)]
        for native, (*_, terminated, truncated) in zip(natives, told, strict=True):
            if terminated or truncated:
                native.reset()
        steps.append((actions, told))
    ends = {(one[2], one[3]) for _, told in steps for one in told}
    assert ends == {(False, False), (True, False), (False, True), (True, True)}
    return first, steps


@pytest.mark.parametrize("player", PLAYERS)
def test_steps_and_episode_ends_match_the_environment(player: Any, played: Any) -> None:
    ours, (first, steps) = player(*make_corridor(), N), played
    np.testing.assert_array_equal(ours.reset(0), first)
    for actions, wanted in steps:
        out = ours.step(actions)
        for i, (obs, reward, terminated, truncated) in enumerate(wanted):
            done = terminated or truncated
            told = float(out.reward[i]), bool(out.done[i]), bool(out.cut[i])
            assert told == (reward, done, truncated and not terminated)
            if done:
                np.testing.assert_array_equal(out.last[i], obs)
            np.testing.assert_array_equal(out.obs[i], first[i] if done else obs)


def make_chance() -> tuple[Any, Any]:
    """A corridor in which each episode begins with another heading, and lasts four steps."""
    env, params = jaxenstein.from_ascii("######\n#S..G#\n######", **SIZE)
    return env, params.replace(max_steps_in_episode=4)


@functools.cache
def first_frame(seed: int, calls: int) -> np.ndarray:
    """The observation of a reset after a number of steps and resets of a stream, from its keys."""
    env, params = make_chance()
    key = jax.random.fold_in(jax.random.key(seed % 2**32), seed // 2**32)
    for _ in range(calls):
        key, _ = jax.random.split(key)
    return np.asarray(env.reset(jax.random.split(key)[1], params)[0])


LARGE = 2**32 + 7, 2**33 + 7, 2**64 - N


@pytest.mark.parametrize("player", STREAMS)
def test_seeds(player: Any) -> None:
    """Environments get consecutive seeds; without a seed their streams continue."""
    ours = player(*make_chance(), N)
    for seed in (7, 8, *LARGE, 7):
        for calls, given in enumerate((seed, None, None)):
            wanted = [first_frame(seed + i, calls) for i in range(N)]
            np.testing.assert_array_equal(ours.reset(given), wanted)
    seeds = [7, *LARGE, 8]
    shown = {np.array([first_frame(seed, n) for n in range(3)]).tobytes() for seed in seeds}
    assert len(shown) == len(seeds)


@pytest.mark.parametrize("player", STREAMS)
def test_reset_without_seed_is_random(player: Any) -> None:
    both = [player(*make_chance(), N) for _ in range(2)]
    one, other = ([np.asarray(ours.reset(None)) for _ in range(3)] for ours in both)
    assert (np.array(one) != np.array(other)).any()


@pytest.mark.parametrize("player", MASKED)
def test_seeds_and_resets_of_some_environments(player: Any) -> None:
    """Each stream continues independently of the others; seeds of unmasked ones are ignored."""
    ours = player(*make_chance(), N)
    ours.reset(np.array([7, 20, 9]))
    wanted = first_frame(30, 0), first_frame(20, 1), first_frame(9, 0)
    np.testing.assert_array_equal(ours.reset([30, None, 9]), wanted)
    second = plain(ours.step(IDLE).obs)[1].copy()
    seen = ours.reset([40, 41, None], np.array([True, False, True]))
    np.testing.assert_array_equal(seen, [first_frame(40, 0), second, first_frame(9, 2)])
    # The fourth step of an episode, after two resets and three steps, for the second one alone.
    steps = [ours.step(IDLE) for _ in range(3)]
    ends = [[bool(done) for done in out.done] for out in steps]
    assert ends == [[False] * N, [False] * N, [False, True, False]]
    np.testing.assert_array_equal(steps[-1].obs[1], first_frame(20, 6))


@pytest.mark.parametrize("player", MASKED)
def test_error_names_wrong_mask(player: Any) -> None:
    ours = player(*make_chance(), N)
    with pytest.raises(SettingError, match="the first reset must reset all"):
        ours.reset(None, np.arange(N) == 1)
    ours.reset(0)
    for mask in ([True], [1] * N, np.ones((N, 1), bool)):
        with pytest.raises(SettingError, match=rf"mask .*must be bool\[{N}\]"):
            ours.reset(None, mask)


CHANGES = (copy.deepcopy, lambda adapter: pickle.loads(pickle.dumps(adapter)))


@pytest.mark.parametrize("player", STREAMS)
def test_copies_continue_like_the_original(player: Any) -> None:
    """From the middle of an episode, and into episodes drawn from the stream."""
    ours = player(*make_chance(), N)
    ours.reset(5)
    ours.step(IDLE)
    others = [ours.changed(change) for change in CHANGES]
    # A shallow one stands in its original's place.
    others.append(ours.changed(copy.deepcopy).changed(copy.copy))
    rng = np.random.default_rng(0)
    wanted = [(actions, ours.step(actions)) for actions in rng.integers(0, 5, (9, N))]
    assert sum(bool(out.last) for _, out in wanted) >= 2
    for other in others:
        for actions, out in wanted:
            for mine, theirs in zip(arrays(out), arrays(other.step(actions)), strict=True):
                np.testing.assert_array_equal(plain(mine), plain(theirs))


@pytest.mark.parametrize("player", FUNCTIONS)
def test_copies_of_functions_keep_the_environment(player: Any) -> None:
    ours = player(*make_corridor(), N)
    for change in CHANGES:
        other = ours.changed(change).of
        assert (repr(other), other.env) == (repr(ours.of), ours.of.env)
        name = "default_params" if player is GymnaxPlayer else "params"
        params = (getattr(one, name) for one in (other, ours.of))
        jax.tree.map(np.testing.assert_array_equal, *params)


def plain(array: Any) -> np.ndarray:
    """A NumPy view of the same memory, if possible."""
    return array.numpy() if hasattr(array, "numpy") else np.asarray(array)


def arrays(out: Step) -> list[Any]:
    """All arrays of a step."""
    several = [*out.obs] if isinstance(out.obs, list) else [out.obs]
    rest = [part for part in (out.reward, out.done) if not isinstance(part, list)]
    return [*several, *rest, *out.last.values()]


@pytest.mark.parametrize("player", STREAMS)
def test_returned_arrays_never_change_and_are_never_read(player: Any) -> None:
    """Later steps and resets do not change it, and steps do not read what callers write to it."""
    made = make_corridor()
    written, clean = player(*made, N), player(*made, N)
    held: list[Any] = [*written.reset(3), *clean.reset(3)]
    rng = np.random.default_rng(1)
    kept, ends = [plain(obs).copy() for obs in held], 0
    for t in range(30):
        actions = rng.integers(0, 5, N)
        if player in MASKED and t % 8 == 7:
            mask = np.arange(N) == t % N
            mine, theirs = [written.reset(None, mask)], [clean.reset(None, mask)]
        else:
            mine, theirs = arrays(written.step(actions.copy())), arrays(clean.step(actions))
            ends += len(theirs) > 3
        held += theirs
        kept += [plain(one).copy() for one in theirs]
        for a, b in zip(mine, theirs, strict=True):
            np.testing.assert_array_equal(plain(a), plain(b))
            if plain(a).flags.writeable:
                a[:] = 1
    assert ends
    for view, copied in zip(held, kept, strict=True):
        np.testing.assert_array_equal(plain(view), copied)


@pytest.mark.parametrize("player", STREAMS)
def test_wrong_seed_raises_before_any_reset(player: Any) -> None:
    ours = player(*make_corridor(), N)
    for seed in (-1, 1.5, 2**64):
        with pytest.raises(Exception, match=r"[Ss]eed"):
            ours.reset(seed)
        with pytest.raises(Exception, match="call reset before step"):
            ours.step(IDLE)


@pytest.mark.parametrize("player", STREAMS)
def test_wrong_action_raises_and_changes_nothing(player: Any) -> None:
    ours = player(*make_corridor(), N)
    first = plain(ours.reset(0)).copy()
    wrong = [np.zeros(N), np.zeros(N, bool), np.zeros((N, 1), int), [0] * 9]
    for actions in wrong:
        with pytest.raises(Exception, match=r"must be (a torch tensor of )?(one|3) integer"):
            ours.step(actions)
    for dtype in (np.int64, np.int32, np.int8):
        most = np.iinfo(dtype).max
        # A number that a cast to 32 bits would turn into an action.
        far = (-1, most, 2**32 + FORWARD, FORWARD - 2**32)[: 4 if dtype is np.int64 else 2]
        for action in far:
            actions = np.full(N, action, dtype)
            if player in STRICT:
                with pytest.raises(Exception, match="an action must be 0 to 4, not"):
                    ours.step(actions)
                continue
            out = ours.step(actions)
            np.testing.assert_array_equal(out.obs, first)
            if out.last:
                np.testing.assert_array_equal([*out.last.values()], first)
    # Only time may have passed.
    for t in range(3):
        out = ours.step(np.full(N, FORWARD))
        assert [float(reward) for reward in out.reward] == [float(t == 2)] * N


@pytest.mark.parametrize(
    "player", [one for one in PLAYERS if one not in (*FUNCTIONS, SinglePlayer)]
)
@pytest.mark.parametrize("count", [0, True, 2.0])
def test_error_names_wrong_number_of_environments(player: Any, count: Any) -> None:
    with pytest.raises(SettingError, match="num_envs must be a whole number >= 1"):
        player(*make_corridor(), count)


@pytest.mark.parametrize("player", PLAYERS)
def test_error_names_wrong_param(player: Any) -> None:
    with pytest.raises(SettingError, match="must be a NavigationParams"):
        player(make_corridor()[0], jaxenstein.make("health-gathering")[1], N)


WRONG_SETTINGS: list[tuple[dict[str, Any], str]] = [
    ({"hight": 5}, "no setting or param 'hight', did you mean 'height'"),
    ({"autoreset": None}, "no effect here: the adapter decides when to reset"),
    ({"final_observation": True}, "no effect here"),
    ({"hud": True}, "simple has no setting or param 'hud'"),
    ({"goal_reward": "much"}, "goal_reward must be a number"),
    ({"goal_reward": [1, 2]}, "goal_reward must be a number"),
    ({"damage": 3}, "no setting or param 'damage'"),
    ({"render_mode": "ansi"}, "render_mode must be one of .*'rgb_array', None, not 'ansi'"),
    ({"height": 0}, "height must be"),
]


@pytest.mark.parametrize("player", BY_ID)
def test_error_names_wrong_id_or_setting(player: Any) -> None:
    for settings, what in WRONG_SETTINGS:
        with pytest.raises(SettingError, match=what):
            player("simple", None, N, **settings)
    with pytest.raises(SettingError, match="params of 'simple' must be"):
        player("simple", {}, N)
    with pytest.raises(UnknownEnvironmentError, match="did you mean 'simple'"):
        player("simpel", None, N)
    with pytest.raises(SettingError, match="need an id"):
        player(*make_corridor(), N, height=5)
    with pytest.raises(SettingError, match="must be an id or an environment"):
        player(None, None, N)


def functional(name: str) -> Any:
    """The adapter that runs inside of JAX: a function of an environment and its params."""
    pytest.importorskip(name)
    module = importlib.import_module(f"jaxenstein.adapters.{name}")
    return module.from_env if name == "gymnax" else lambda *made: (module.StoaEnvironment(*made), 0)


@pytest.mark.parametrize("name", ["gymnax", "stoa"])
def test_error_names_unsuitable_environment(name: str) -> None:
    adapt, (env, params) = functional(name), make_corridor()
    with pytest.raises(SettingError, match=r"needs an environment with .*autoreset='same-step'"):
        adapt(dataclasses.replace(env, autoreset="next-step"), params)
    with pytest.raises(SettingError, match=r"as jaxenstein\.make returns"):
        adapt("simple", None)


@pytest.mark.parametrize("name", ["gymnax", "stoa"])
@pytest.mark.parametrize("last", [False, True])
def test_step_draws_one_frame_and_another_for_final_observation(
    monkeypatch: pytest.MonkeyPatch, name: str, last: bool
) -> None:
    env, params = make_corridor()
    # A unique name, so that no earlier trace is reused.
    env = dataclasses.replace(env, name=f"counted-{name}-{last}", final_observation=last)
    adapted, _ = functional(name)(env, params)
    key = jax.random.key(0)
    state = adapted.reset(key)[0 if name == "stoa" else 1]
    drawn, observe = [], type(env).observe
    monkeypatch.setattr(type(env), "observe", lambda *a: (drawn.append(1), observe(*a))[1])
    given = (state, STAY) if name == "stoa" else (key, state, STAY)
    jax.make_jaxpr(lambda *given: adapted.step(*given))(*given)
    assert len(drawn) == 1 + last
