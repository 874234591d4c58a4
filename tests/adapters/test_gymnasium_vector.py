"""The vector environment compared with Gymnasium's vector of single environments."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest

import jaxenstein
from jaxenstein.adapters.batch import Batch
from tests.adapters.corridor import make_crowd

gymnasium = pytest.importorskip("gymnasium")
single = pytest.importorskip("jaxenstein.adapters.gymnasium")
vector = pytest.importorskip("jaxenstein.adapters.gymnasium_vector")

pytestmark = pytest.mark.usefixtures("plain_frames")
AutoresetMode = gymnasium.vector.AutoresetMode
SMALL = {"height": 8, "width": 12}
COUNT = 5


@pytest.fixture(scope="module")
def made() -> tuple[Any, Any]:
    return make_crowd(observation="dict", heading=(-10.0, 10.0), sprite_layers=1)


def both(made: Any, mode: Any) -> tuple[Any, Any]:
    """Our vector environment and Gymnasium's."""
    make = functools.partial(single.GymnasiumEnv, *made, render_mode="rgb_array")
    sync = gymnasium.vector.SyncVectorEnv([make] * COUNT, autoreset_mode=mode)
    ours = vector.GymnasiumVectorEnv(*made, COUNT, autoreset_mode=mode, render_mode="rgb_array")
    return ours, sync


def assert_same(ours: Any, theirs: Any, place: str = "") -> None:
    """Equal types, keys, shapes, data types and values, down to the bit."""
    assert type(ours) is type(theirs), place
    if isinstance(ours, dict):
        assert ours.keys() == theirs.keys(), place
        for key in ours:
            assert_same(ours[key], theirs[key], f"{place}/{key}")
    elif isinstance(ours, tuple) or (isinstance(ours, np.ndarray) and ours.dtype == object):
        assert len(ours) == len(theirs), place
        for i, (one, other) in enumerate(zip(ours, theirs, strict=True)):
            assert_same(one, other, f"{place}/{i}")
    elif isinstance(ours, np.ndarray):
        assert (ours.dtype, ours.shape) == (theirs.dtype, theirs.shape), place
        np.testing.assert_array_equal(ours, theirs, err_msg=place)
    else:
        assert ours == theirs, place


def some_actions(rng: np.random.Generator) -> np.ndarray:
    """Mostly forward and interact; the first environment idles by turning."""
    actions = rng.choice(5, size=COUNT, p=[0.1, 0.1, 0.6, 0.0, 0.2])
    actions[0] = 0
    return actions


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_equals_gymnasium_vector_of_single_environments(made: Any, mode: Any) -> None:
    ours, theirs = both(made, mode)
    assert ours.metadata["autoreset_mode"] is mode
    for name in ("observation_space", "action_space"):
        assert getattr(ours, name) == getattr(theirs, name)
        assert getattr(ours, f"single_{name}") == getattr(theirs, f"single_{name}")
    rng = np.random.default_rng(0)
    assert_same(ours.reset(seed=8), theirs.reset(seed=8), "reset")
    ends = np.zeros(3, int)
    for time in range(45):
        actions = some_actions(rng)
        one, other = ours.step(actions), theirs.step(actions)
        assert_same(one, other, f"step {time}")
        assert ours.observation_space.contains(one[0])
        over = one[2] | one[3]
        ends += one[2].sum(), one[3].sum(), over.any()
        if mode is AutoresetMode.DISABLED and over.any():
            mask = over | (rng.random(COUNT) < 0.2)
            seeds = [int(seed) for seed in rng.integers(100, size=COUNT)] if time % 2 else None
            told = [env.reset(seed=seeds, options={"reset_mask": mask}) for env in (ours, theirs)]
            assert_same(told[0], told[1], f"masked reset {time}")
        elif time in (20, 30):
            seeds = 3 if time == 20 else None
            assert_same(ours.reset(seed=seeds), theirs.reset(seed=seeds), f"reset {time}")
        if time % 20 == 0:
            assert_same(ours.render(), theirs.render(), f"frames {time}")
    # Both kinds of ends, not all at once.
    assert min(ends) > 0
    assert ends[2] > 3


def test_equals_gymnasium_after_all_episodes_end_together(made: Any) -> None:
    """No environment has events then, and Gymnasium leaves out their entries."""
    for mode in (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP):
        ours, theirs = both(made, mode)
        assert_same(ours.reset(seed=1), theirs.reset(seed=1))
        for _ in range(11):
            idle = np.zeros(COUNT, int)
            assert_same(ours.step(idle), theirs.step(idle))


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_gymnasium_statistics_match_the_environment(made: Any, mode: Any) -> None:
    ours, _ = both(made, mode)
    env = gymnasium.wrappers.vector.RecordEpisodeStatistics(ours)
    version = tuple(int(part) for part in gymnasium.__version__.split(".")[:2])
    if mode is AutoresetMode.SAME_STEP and version < (1, 4):
        pytest.skip("wrappers before 1.4 count as if resets came in the next step")
    env.reset(seed=2)
    rng = np.random.default_rng(3)
    count = 0
    for _ in range(40):
        _, _, terminated, truncated, infos = env.step(some_actions(rng))
        over = terminated | truncated
        assert ("episode" in infos) == over.any()
        if not over.any():
            continue
        count += over.sum()
        told = infos["final_info"] if mode is AutoresetMode.SAME_STEP else infos
        assert (infos["episode"]["l"][over] == told["episode_length"][over]).all()
        np.testing.assert_allclose(infos["episode"]["r"][over], told["episode_return"][over])
        assert (infos["_episode"] == over).all()
    assert env.episode_count == count > 5


def test_other_wrappers_of_gymnasium(made: Any) -> None:
    envs = vector.GymnasiumVectorEnv(*made, COUNT)
    wrappers = gymnasium.wrappers.vector
    envs = wrappers.ClipReward(wrappers.FlattenObservation(envs), -1, 1)
    envs = wrappers.DictInfoToList(envs)
    observation, infos = envs.reset(seed=1)
    assert observation.shape == (COUNT, 8 * 12 * 3 + 6)
    assert [info["episode_length"] for info in infos] == [0] * COUNT
    _, _, _, _, infos = envs.step(np.zeros(COUNT, int))
    assert [info["reached_goal"] for info in infos] == [False] * COUNT


def test_make_vec() -> None:
    envs = gymnasium.make_vec("jaxenstein/simple-v0", num_envs=3, **SMALL)
    assert type(envs) is vector.GymnasiumVectorEnv
    assert (envs.num_envs, envs.metadata["autoreset_mode"]) == (3, AutoresetMode.NEXT_STEP)
    assert vector.GymnasiumVectorEnv.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    again = gymnasium.make_vec(envs.spec)
    assert_same(again.reset(seed=1), envs.reset(seed=1))
    assert gymnasium.envs.registration.EnvSpec.from_json(envs.spec.to_json()) == envs.spec
    assert envs.np_random_seed == 1
    same = gymnasium.make_vec(
        "jaxenstein/simple-v0", num_envs=2, autoreset_mode="SameStep", goal_reward=7, **SMALL
    )
    assert same.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    assert float(same.unwrapped.params.goal_reward) == 7
    envs.close()
    assert envs.closed


def test_params_per_environment(made: Any) -> None:
    limits = made[1].replace(max_steps_in_episode=np.array([2, 9]))
    envs = vector.GymnasiumVectorEnv(made[0], limits, 2, max_episode_steps=4)
    assert envs.params.max_steps_in_episode.tolist() == [2, 4]
    envs.reset(seed=0)
    assert [envs.step(np.array([4, 4]))[3].tolist() for _ in range(2)][-1] == [True, False]
    rewards = np.array([1.0, 7.0], np.float32)
    byname = vector.GymnasiumVectorEnv("simple", num_envs=2, goal_reward=rewards, **SMALL)
    assert byname.params.goal_reward.tolist() == [1, 7]
    with pytest.raises(jaxenstein.SettingError, match=r"goal_reward must have .* not \(2,\)"):
        vector.GymnasiumVectorEnv("simple", num_envs=3, goal_reward=rewards, **SMALL)


def test_max_episode_steps_only_shortens_the_limit(made: Any) -> None:
    for limit, wanted in ((2, 2), (20, 9)):
        envs = vector.GymnasiumVectorEnv(*made, COUNT, max_episode_steps=limit)
        envs.reset(seed=1)
        ends = [envs.step(np.zeros(COUNT, int))[3].tolist() for _ in range(wanted)]
        assert ends == [[False] * COUNT] * (wanted - 1) + [[True] * COUNT]


def test_max_episode_steps_counts_agent_steps() -> None:
    env, params = make_crowd(frame_skip=2)
    envs = vector.GymnasiumVectorEnv(env, params, COUNT, max_episode_steps=3)
    envs.reset(seed=1)
    ends = [bool(envs.step(np.zeros(COUNT, int))[3].all()) for _ in range(3)]
    assert ends == [False, False, True]


def test_observations_are_not_copied(made: Any) -> None:
    envs = vector.GymnasiumVectorEnv(*made, COUNT)
    envs.reset(seed=1)
    for act in (envs.reset, lambda: envs.step(np.zeros(COUNT, int))):
        for name, view in act()[0].items():
            device = envs._observation[name]
            if next(iter(device.devices())).platform == "cpu":
                assert view.ctypes.data == device.unsafe_buffer_pointer()
            assert not view.flags.writeable
    own = vector.GymnasiumVectorEnv(*made, COUNT, copy=True)
    for observation in (own.reset(seed=1)[0], own.step(np.zeros(COUNT, int))[0]):
        assert all(view.flags.writeable and view.flags.owndata for view in observation.values())


def test_reset_does_not_change_options(made: Any) -> None:
    envs, _ = both(made, AutoresetMode.DISABLED)
    env = gymnasium.wrappers.vector.RecordEpisodeStatistics(envs)
    env.reset(seed=1)
    env.step(np.zeros(COUNT, int))
    env.reset(options={"reset_mask": np.arange(COUNT) == 1})
    # The wrapper looks for the mask after the environment did.
    assert env.episode_lengths.tolist() == [1, 0, 1, 1, 1]
    assert np.asarray(envs._batch.states.time).tolist() == [1, 0, 1, 1, 1]


def test_stepping_out_of_order(made: Any) -> None:
    envs, _ = both(made, AutoresetMode.DISABLED)
    idle = [0] * COUNT
    with pytest.raises(gymnasium.error.ResetNeeded, match="call reset"):
        envs.render()
    envs.reset(seed=1)
    with pytest.raises(jaxenstein.SettingError, match=r"mask.* must be True for at least one"):
        envs.reset(options={"reset_mask": np.zeros(COUNT, bool)})
    envs.step(idle)
    envs.reset(options={"reset_mask": np.arange(COUNT) == 1})
    for _ in range(8):
        envs.step(idle)
    with pytest.raises(gymnasium.error.ResetNeeded, match="over: 0, 2, 3, 4; reset them"):
        envs.step(idle)
    envs.reset(options={"reset_mask": np.arange(COUNT) != 1})
    envs.step(idle)


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        ({"autoreset_mode": "Sometimes"}, "'NextStep', 'SameStep', 'Disabled'"),
        ({"autoreset_mode": None}, "autoreset_mode must be"),
        ({"render_mode": "human"}, "render_mode must be one of 'rgb_array', None"),
        ({"max_episode_steps": 0}, "max_episode_steps must be"),
        ({"max_episode_steps": 2.5}, "max_episode_steps must be"),
        ({"num_envs": np.bool_(True)}, "num_envs must be"),
    ],
)
def test_wrong_arguments(arguments: dict[str, Any], what: str) -> None:
    with pytest.raises(jaxenstein.SettingError, match=what):
        vector.GymnasiumVectorEnv("simple", **arguments)


def test_rendering_without_render_mode(made: Any) -> None:
    envs = vector.GymnasiumVectorEnv(*made, COUNT)
    envs.reset(seed=1)
    with pytest.warns(UserWarning, match="without a render mode"):
        assert envs.render() is None


def test_step_does_not_unstack_states(monkeypatch: pytest.MonkeyPatch) -> None:
    """Unstacking outside compiled code takes milliseconds, so it happens only on demand."""
    envs = vector.GymnasiumVectorEnv("simple", num_envs=2, height=4, width=4)
    envs.reset(seed=0)
    monkeypatch.setattr(Batch, "_streams", lambda batch: pytest.fail("states were taken apart"))
    for _ in range(2):
        envs.step(np.zeros(2, np.int32))


def test_numpy_numbers_work_like_python_numbers() -> None:
    envs = vector.GymnasiumVectorEnv(
        "simple", num_envs=np.int64(2), max_episode_steps=np.int64(3), height=np.int64(4), width=4
    )
    assert type(envs.num_envs) is int
    assert int(envs.params.max_steps_in_episode) == 3
    observation, _ = envs.reset(seed=np.int64(5))
    assert observation.shape == (2, 4, 4, 3)
    # The generator is seeded as well.
    assert envs.np_random_seed == 5
    with pytest.raises(jaxenstein.SettingError, match="not True"):
        envs.reset(seed=True)
