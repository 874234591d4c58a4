"""The batch compared with a loop over single environments, and its contract."""

from __future__ import annotations

import dataclasses
import inspect
import os
import subprocess
import sys
from functools import partial
from typing import Any

import jax
import numpy as np
import pytest

import jaxenstein
from jaxenstein.adapters import batch_calls
from jaxenstein.adapters.batch import Batch
from jaxenstein.tasks.navigation import Navigation
from tests.adapters.corridor import CROWD, make_crowd
from tests.devices import run_with_devices

pytestmark = pytest.mark.usefixtures("plain_frames")
COUNT = 9
MODES = ("same-step", "next-step", None)


@pytest.fixture(scope="module")
def made() -> tuple[Any, Any]:
    """Obstacles move at random in every step, and a reset places everything at random."""
    settings: dict[str, Any] = {"observation": "dict", "height": 8, "width": 8}
    env, params = jaxenstein.make("minigrid-dynamic-obstacles-6x6", **settings)
    return env, params.replace(max_steps_in_episode=9)


def batch_of(made: Any, mode: Any = "same-step") -> Any:
    return Batch(made[0], made[1], COUNT, autoreset=mode)


def step_record(observation: Any, reward: Any, ends: Any, info: Any) -> dict[str, Any]:
    ends = tuple(map(bool, ends))
    return {"observation": observation, "reward": float(reward), "ends": ends, "info": info}


class Loop:
    """The same, one environment after another, by the native functions alone."""

    def __init__(self, env: Any, params: Any, mode: str | None, seeds: list[int]) -> None:
        self.env = dataclasses.replace(env, autoreset=None)
        self.params, self.mode = params, mode
        self.describe = jax.jit(self.env.describe)
        self.keys = [jax.random.fold_in(jax.random.key(seed), 0) for seed in seeds]
        self.states: list[Any] = [None] * len(seeds)
        self.over = [False] * len(seeds)

    def draw(self, i: int) -> jax.Array:
        self.keys[i], used = jax.random.split(self.keys[i])
        return used

    def reset(self, i: int) -> tuple[Any, dict[str, Any]]:
        observation, self.states[i] = self.env.reset(self.draw(i), self.params)
        self.over[i] = False
        return observation, self.describe(self.states[i], self.params)

    def step(self, i: int, action: int) -> dict[str, Any]:
        if self.mode == "next-step" and self.over[i]:
            observation, info = self.reset(i)
            return step_record(observation, 0.0, (False, False), info)
        used = self.draw(i)
        out = self.env.step(used, self.states[i], np.int32(action), self.params)
        observation, self.states[i], reward, terminated, truncated, info = out
        self.over[i] = bool(terminated | truncated)
        told = step_record(observation, reward, (terminated, truncated), info)
        if self.mode == "same-step" and self.over[i]:
            told["last"] = observation, info
            told["observation"], told["info"] = self.reset(i)
        return told


def assert_same(one: Any, other: Any) -> None:
    assert jax.tree.structure(one) == jax.tree.structure(other)
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        a, b = np.asarray(a), np.asarray(b)
        assert (a.shape, a.dtype) == (b.shape, b.dtype)
        if a.dtype.kind == "f":
            np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-6)
        else:
            np.testing.assert_array_equal(a, b)


def at(tree: Any, index: Any) -> Any:
    return jax.tree.map(lambda leaf: np.asarray(leaf)[index], tree)


def some_actions(rng: np.random.Generator) -> np.ndarray:
    """Mostly forward; the first ones idle by turning."""
    actions = rng.choice(6, size=COUNT, p=[0.05, 0.05, 0.8, 0.0, 0.05, 0.05])
    actions[:2] = 0
    return actions


@pytest.mark.parametrize("mode", MODES)
def test_equals_a_loop_over_single_environments(made: Any, mode: Any) -> None:
    rng = np.random.default_rng(0)
    batch, loop = batch_of(made, mode), Loop(made[0], made[1], mode, [*range(40, 40 + COUNT)])
    observation, info = batch.reset(40)
    for i in range(COUNT):
        assert_same(at((observation, info), i), loop.reset(i))
    together, reached = set(), 0
    views: list[np.ndarray] = []
    copies: list[np.ndarray] = []
    for time in range(24):
        actions = some_actions(rng)
        out = batch.step(actions)
        told = [loop.step(i, action) for i, action in enumerate(actions)]
        compare(out, told)
        views.append(np.asarray(out.observation["image"]))
        copies.append(views[-1].copy())
        together.add(0 if out.ended is None else out.ended.indices.size)
        if time == 4 or (mode is None and time % 3 == 0):
            # From now on the episodes end at different times.
            mask = np.arange(COUNT) % 3 == time % 3
            observation, info = batch.reset(mask=mask)
            for i in np.flatnonzero(mask):
                assert_same(at((observation, info), i), loop.reset(int(i)))
            for i in np.flatnonzero(~mask):
                assert_same(at(observation, i), told[i]["observation"])
        reached += np.asarray(out.terminated).sum()
    assert reached > 0
    assert mode != "same-step" or len(together) > 3
    # Returned arrays do not change.
    np.testing.assert_array_equal(views, copies)


def compare(out: Any, told: list[dict[str, Any]]) -> None:
    last = {i: one["last"] for i, one in enumerate(told) if "last" in one}
    assert (out.ended is None) == (not last)
    if out.ended is not None:
        assert out.ended.indices.tolist() == [*last]
        for place, i in enumerate(last):
            assert_same(at((out.ended.observation, out.ended.info), place), last[i])
    reward, *ends = (np.asarray(part) for part in out[1:4])
    for i, one in enumerate(told):
        assert_same(at(out.observation, i), one["observation"])
        assert reward[i] == pytest.approx(one["reward"])
        assert tuple(end[i] for end in ends) == one["ends"]
        info = at(out.info, i)
        events = info.keys() - one["info"].keys()
        assert_same({name: info[name] for name in one["info"]}, one["info"])
        assert not any(info[name].any() for name in events)


@pytest.mark.parametrize("mode", MODES)
def test_each_environment_can_have_its_own_params(mode: Any) -> None:
    env, params = make_crowd(heading=(-10.0, 10.0))
    speeds, limits = np.array([0.3, 0.5, 0.7], np.float32), np.array([4, 9, 6])
    own = params.replace(move_distance=speeds, max_steps_in_episode=limits)
    batch = Batch(env, own, 3, autoreset=mode)
    loops = []
    for i, seed in enumerate((5, 6, 7)):
        one = params.replace(move_distance=speeds[i], max_steps_in_episode=limits[i])
        loops.append(Loop(env, one, mode, [seed]))
    observation, info = batch.reset(5)
    for i, loop in enumerate(loops):
        assert_same(at((observation, info), i), loop.reset(0))
    ended = np.zeros(3, int)
    for time in range(14):
        out = batch.step(np.array([2, 2, 0]))
        compare(out, [loop.step(0, action) for loop, action in zip(loops, (2, 2, 0), strict=True)])
        ended += out.terminated | out.truncated
        if time == 7:
            mask = np.array([True, False, True])
            observation, info = batch.reset(mask=mask)
            for i in (0, 2):
                assert_same(at((observation, info), i), loops[i].reset(0))
    assert (ended > 0).all()
    # The images of all environments equal those of each one.
    dim = dataclasses.replace(env, observation="gray")
    for i, image in enumerate(np.asarray(batch.observe(dim))):
        np.testing.assert_array_equal(image, dim.observe(at(batch.states, i), params))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"turn_angle": [0.1] * 2}, r"turn_angle must .* \(\) \(one .* or \(3,\) .*\(2,\)"),
        ({"discount": [[0.5] * 3]}, r"discount must have .* not \(1, 3\)"),
        ({"turn_angle": [0.1] * 3, "goal_radius": [1.0]}, r"goal_radius must have .* not \(1,\)"),
    ],
)
def test_params_for_wrong_number_of_environments(changes: Any, message: str) -> None:
    env, params = make_crowd()
    wrong = params.replace(**{name: np.array(value) for name, value in changes.items()})
    with pytest.raises(jaxenstein.SettingError, match=message):
        Batch(env, wrong, 3)


def test_more_episodes_than_a_block_end_at_once(made: Any) -> None:
    batch = batch_of(made)
    batch.reset(0)
    idle = np.zeros(COUNT, np.int32)
    out = [batch.step(idle) for _ in range(9)][-1]
    assert out.ended is not None
    assert out.ended.indices.tolist() == [*range(COUNT)]
    assert (np.asarray(out.info["episode_length"]) == 0).all()
    assert (out.ended.info["episode_length"] == 9).all()
    assert not np.asarray(batch.states.done).any()


def test_each_step_draws_one_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    env, params = jaxenstein.from_ascii(CROWD, height=5, width=6)
    drawn = []
    observe = Navigation.observe

    def count(self: Any, state: Any, params: Any) -> Any:
        drawn.append(1)
        return observe(self, state, params)

    monkeypatch.setattr(Navigation, "observe", count)
    batch = Batch(env, params, 3)
    keys, actions = batch_calls.keys_of([1, 2, 3]), np.zeros(3, np.int32)
    plan = batch._plan
    reset = inspect.unwrap(batch_calls.reset)
    rows = jax.eval_shape(lambda: reset(env, plan, keys, batch._packed_params))[0]
    assert len(drawn) == 1
    for mode in (None, "next-step"):
        drawn.clear()
        stepped = dataclasses.replace(env, autoreset=mode)
        whole = partial(inspect.unwrap(batch_calls.step), stepped, plan)
        jax.eval_shape(whole, rows, actions, batch._packed_params)
        assert len(drawn) == 1


def test_seeds_do_not_depend_on_the_default_generator() -> None:
    keys = []
    for kind in ("threefry2x32", "rbg"):
        with jax.default_prng_impl(kind):
            keys.append(np.asarray(jax.random.key_data(batch_calls.keys_of([7, 2**40]))))
    np.testing.assert_array_equal(*keys)


def test_batch_spreads_over_cores() -> None:
    run_with_devices(2, "-m", "tests.adapters.cores_run")


@pytest.mark.parametrize("wrong", [0, True, 1.0, 10**6])
def test_wrong_numbers_of_cores(wrong: Any) -> None:
    with pytest.raises(jaxenstein.SettingError, match="cores must be a whole number from 1 to"):
        jaxenstein.use_cores(wrong)


@pytest.mark.parametrize("seed", ["1", True, [1], [*range(10)], ["1"] * COUNT, [-1] * COUNT, {}])
def test_wrong_seeds(made: Any, seed: Any) -> None:
    batch = batch_of(made)
    with pytest.raises(jaxenstein.SettingError, match="seed"):
        batch.reset(seed)
    assert batch.states is None


def test_wrong_modes(made: Any) -> None:
    with pytest.raises(jaxenstein.SettingError, match="autoreset"):
        batch_of(made, "never")


ASYNC = """
import gymnasium, jaxenstein
gymnasium.make_vec(
    "jaxenstein/simple-v0", 2, vectorization_mode="async", vector_kwargs={"context": "fork"}
)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there are no forks here")
def test_forked_process_gives_advice_and_does_not_hang() -> None:
    """Gymnasium makes one environment before it forks, so that JAX has run."""
    pytest.importorskip("gymnasium")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", ASYNC]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 1
    assert "SettingError: process" in done.stderr
    assert 'use context="spawn"' in done.stderr
