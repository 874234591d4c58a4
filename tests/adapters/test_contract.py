"""What every adapter must do, beside the native environment."""

from __future__ import annotations

import dataclasses
import importlib
from typing import Any

import jax
import numpy as np
import pytest

import jaxenstein
from jaxenstein.errors import SettingError
from tests.adapters.corridor import FORWARD, SIZE, STAY, N, make_corridor
from tests.adapters.players import PLAYERS, STREAMS, BatchPlayer, Step

pytestmark = [
    pytest.mark.usefixtures("plain_frames"),
    pytest.mark.filterwarnings("ignore::DeprecationWarning:(gymnax|stoa|chex|flax|distrax).*"),
]


class Native:
    """One environment by `reset` and `advance`; the corridor has nothing drawn by chance."""

    def __init__(self, env: Any, params: Any) -> None:
        self.env, self.params, self.key = env, params, jax.random.key(0)

    def reset(self) -> Any:
        obs, self.state = self.env.reset(self.key, self.params)
        return np.asarray(obs)

    def step(self, action: int) -> tuple[Any, float, bool, bool]:
        """The observation before a reset, the reward, and both ends."""
        out = self.env.advance(self.key, self.state, np.int32(action), self.params)
        self.state, reward, terminated, _ = out
        truncated = int(self.state.time) >= int(self.params.max_steps_in_episode)
        obs = self.env.observe(self.state, self.params)
        return np.asarray(obs), float(reward), bool(terminated), truncated


@pytest.mark.parametrize("player", PLAYERS)
def test_steps_and_ends_are_those_of_the_environment(player: Any) -> None:
    made = make_corridor()
    natives, ours = [Native(*made) for _ in range(N)], player(*made, N)
    np.testing.assert_array_equal(ours.reset(0), [native.reset() for native in natives])
    rng = np.random.default_rng(0)
    kinds = set()
    for t in range(40):
        # Three steps to the goal: at once; so late that time is up with the last; by chance.
        late = FORWARD if t % 7 >= 4 else STAY
        actions = np.array([FORWARD, late, rng.integers(0, 5)])
        out = ours.step(actions)
        for i, native in enumerate(natives):
            obs, reward, terminated, truncated = native.step(int(actions[i]))
            done = terminated or truncated
            told = float(out.reward[i]), bool(out.done[i]), bool(out.cut[i])
            assert told == (reward, done, truncated and not terminated)
            if done:
                kinds.add((terminated, truncated))
                np.testing.assert_array_equal(out.last[i], obs)
                obs = native.reset()
            np.testing.assert_array_equal(out.obs[i], obs)
    assert kinds == {(True, False), (False, True), (True, True)}


@pytest.mark.parametrize("player", STREAMS)
def test_seeds(player: Any) -> None:
    """Of each environment its own, the number after that of the one before; then streams go on."""
    made = jaxenstein.from_ascii("######\n#S..G#\n######", **SIZE)

    def starts(ours: Any, seed: int | None) -> np.ndarray:
        shown = [ours.reset(seed), ours.reset(None)]
        return np.stack([np.asarray(obs) for obs in shown])

    ours = player(*made, N)
    first = starts(ours, 7)
    for other in (ours, player(*made, N), BatchPlayer(*made, N)):
        np.testing.assert_array_equal(starts(other, 7), first)
    assert (first[0] != first[1]).any()
    assert (first[0, 0] != first[0, 1]).any()
    np.testing.assert_array_equal(starts(ours, 8)[:, :-1], first[:, 1:])


def plain(array: Any) -> np.ndarray:
    """The same memory for NumPy, where it may."""
    return array.numpy() if hasattr(array, "numpy") else np.asarray(array)


def arrays(out: Step) -> list[Any]:
    """All arrays of a step."""
    several = [*out.obs] if isinstance(out.obs, list) else [out.obs]
    rest = [part for part in (out.reward, out.done) if not isinstance(part, list)]
    return [*several, *rest, *out.last.values()]


@pytest.mark.parametrize("player", STREAMS)
def test_what_was_handed_out_never_changes_and_is_never_read(player: Any) -> None:
    """Not by later steps, and no step reads what the caller writes into it."""
    made = make_corridor()
    written, clean = player(*made, N), player(*made, N)
    held: list[Any] = [*written.reset(3), *clean.reset(3)]
    rng = np.random.default_rng(1)
    kept, ends = [plain(obs).copy() for obs in held], 0
    for _ in range(30):
        actions = rng.integers(0, 5, N)
        mine, theirs = arrays(written.step(actions.copy())), arrays(clean.step(actions))
        ends += len(theirs) > 3
        held += theirs
        kept += [plain(one).copy() for one in theirs]
        for a, b in zip(mine, theirs, strict=True):
            np.testing.assert_array_equal(plain(a), plain(b))
            if plain(a).flags.writeable:
                a[:] = 1
    assert ends
    for view, copy in zip(held, kept, strict=True):
        np.testing.assert_array_equal(plain(view), copy)


@pytest.mark.parametrize("player", STREAMS)
@pytest.mark.parametrize("wrong", [np.zeros(N), np.zeros(N, bool), np.zeros((N, 1), int), [0] * 9])
def test_wrong_actions_are_named(player: Any, wrong: Any) -> None:
    ours = player(*make_corridor(), N)
    ours.reset(0)
    with pytest.raises(Exception, match=r"must be (a torch tensor of )?(one|3) integer"):
        ours.step(wrong)


def functional(name: str) -> Any:
    """The adapter that runs inside of JAX: a function of an environment and its params."""
    pytest.importorskip(name)
    module = importlib.import_module(f"jaxenstein.adapters.{name}")
    return module.from_env if name == "gymnax" else lambda *made: (module.StoaEnvironment(*made), 0)


@pytest.mark.parametrize("name", ["gymnax", "stoa"])
def test_wrong_environments_and_params_are_named(name: str) -> None:
    adapt, (env, params) = functional(name), make_corridor()
    with pytest.raises(SettingError, match=r"needs an environment with .*autoreset='same-step'"):
        adapt(dataclasses.replace(env, autoreset="next-step"), params)
    with pytest.raises(SettingError, match="must be a NavigationParams"):
        adapt(env, jaxenstein.make("health-gathering")[1])
    with pytest.raises(SettingError, match=r"as jaxenstein\.make returns it"):
        adapt("simple", None)


@pytest.mark.parametrize("name", ["gymnax", "stoa"])
@pytest.mark.parametrize("last", [False, True])
def test_a_step_draws_one_frame_and_one_more_for_the_last(
    monkeypatch: pytest.MonkeyPatch, name: str, last: bool
) -> None:
    env, params = make_corridor()
    # A name of its own, so that nothing traced before is used again.
    env = dataclasses.replace(env, name=f"counted-{name}-{last}", final_observation=last)
    adapted, _ = functional(name)(env, params)
    key = jax.random.key(0)
    state = adapted.reset(key)[0 if name == "stoa" else 1]
    drawn, observe = [], type(env).observe
    monkeypatch.setattr(type(env), "observe", lambda *a: (drawn.append(1), observe(*a))[1])
    given = (state, STAY) if name == "stoa" else (key, state, STAY)
    jax.make_jaxpr(lambda *given: adapted.step(*given))(*given)
    assert len(drawn) == 1 + last
