"""Stable-Baselines3's `VecEnv`, compared with the native environment, and its algorithms."""

import warnings
from typing import Any

import numpy as np
import pytest

import jaxenstein

torch = pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")
pytestmark = pytest.mark.usefixtures("plain_frames")

from stable_baselines3 import PPO  # noqa: E402  # pyright: ignore[reportMissingImports]
from stable_baselines3.common.env_util import make_vec_env  # noqa: E402  # pyright: ignore[reportMissingImports]
from stable_baselines3.common.evaluation import evaluate_policy  # noqa: E402  # pyright: ignore[reportMissingImports]
from stable_baselines3.common.monitor import Monitor  # noqa: E402  # pyright: ignore[reportMissingImports]
from stable_baselines3.common.vec_env import (  # noqa: E402  # pyright: ignore[reportMissingImports]
    VecFrameStack,
    VecMonitor,
    VecTransposeImage,
)

from jaxenstein.adapters.sb3 import SB3VecEnv  # noqa: E402
from jaxenstein.maps import parse_ascii  # noqa: E402
from jaxenstein.tasks.maze import Maze  # noqa: E402
from tests.adapters.corridor import FORWARD, MAP, SIZE, STAY, N, make_corridor  # noqa: E402


@pytest.fixture(scope="module")
def made():
    return make_corridor()


@pytest.fixture
def venv(made):
    venv = SB3VecEnv(made[0], made[1], N, render_mode="rgb_array")
    venv.seed(0)
    return venv


def test_types(venv):
    observation = venv.reset()
    space = venv.observation_space
    assert (space.shape, space.dtype, observation.shape) == ((12, 16, 3), np.uint8, (N, 12, 16, 3))
    observation, rewards, dones, infos = venv.step(np.zeros(N, np.int64))
    assert (rewards.shape, rewards.dtype) == ((N,), np.float32)
    assert (dones.shape, dones.dtype) == ((N,), bool)
    assert all(space.contains(row) for row in observation)
    assert len(infos) == len({id(info) for info in infos}) == N
    assert [set(info) for info in infos] == [{"TimeLimit.truncated"}] * N
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        torch.as_tensor(observation)
    assert venv.action_space.n == 5
    assert len(venv.reset_infos) == N
    assert venv.reset_infos[0]["episode_length"] == 0
    assert venv.seed(7) == [7, 8, 9]


def test_info_describes_episode_at_its_end(venv):
    venv.reset()
    infos: Any = []
    for t in range(3):
        _, _, dones, infos = venv.step(np.array([FORWARD, STAY, STAY]))
        assert dones.tolist() == [t == 2, False, False]
    told = infos[0]
    assert (told["episode"]["r"], told["episode"]["l"]) == (1.0, 3)
    assert told["reached_goal"]
    assert told["is_success"] is True


def test_success_in_any_step_counts():
    """The goal moves the agent to a new start, and only the time limit ends the episode."""
    settings: Any = SIZE
    tilemap = parse_ascii("#####\n#SSG#\n#####\n")
    env = Maze(tilemap=tilemap, respawn=True, heading=0.0, **settings)
    params = env.default_params.replace(max_steps_in_episode=9, move_distance=0.9)
    venv = SB3VecEnv(env, params, 2)
    venv.reset()
    for episode in range(2):
        infos: Any = []
        for t in range(9):
            # The first agent reaches the goal in the first episode alone.
            go = FORWARD if episode == 0 and t < 4 else STAY
            _, _, _, infos = venv.step(np.array([go, STAY]))
        assert [info["is_success"] for info in infos] == [episode == 0, False]
        assert not infos[0]["success"]


@pytest.mark.parametrize("kind", ["gray", "dict"])
def test_kinds_of_observation(made, kind):
    env, params = jaxenstein.from_ascii(MAP, heading=0.0, observation=kind, **SIZE)
    venv = SB3VecEnv(env, params.replace(max_steps_in_episode=2), 2)
    first = venv.reset()
    venv.step(np.zeros(2, int))
    observation, _, dones, infos = venv.step(np.zeros(2, int))
    assert dones.all()
    if kind == "dict":
        assert venv.observation_space["image"].shape == (12, 16, 3)
        assert observation["image"].shape == (2, 12, 16, 3)
        np.testing.assert_array_equal(observation["image"], first["image"])
        last = infos[0]["terminal_observation"]
        assert last["image"].shape == (12, 16, 3)
        assert last["carried_keys"].shape == (6,)
        assert venv.observation_space.contains(last)
    else:
        assert observation.shape == (2, 12, 16, 1)
        assert venv.observation_space.contains(infos[1]["terminal_observation"])
        assert VecTransposeImage(venv).reset().shape == (2, 1, 12, 16)


def test_by_id():
    venv = SB3VecEnv("simple", num_envs=2, max_steps_in_episode=5, height=12, width=16)
    assert venv.get_attr("max_steps_in_episode") == [5, 5]
    assert venv.get_attr("render_mode") == [None, None]
    with pytest.raises(jaxenstein.SettingError, match="render_mode must be"):
        SB3VecEnv("simple", render_mode="human")


def test_attributes_and_methods(made, venv):
    env, _ = made
    assert venv.get_attr("name", indices=[0, 2]) == ["custom", "custom"]
    assert venv.get_attr("move_distance", indices=1) == [pytest.approx(0.6)]
    assert not venv.has_attr("nothing")
    assert venv.env_method("action_space", indices=1) == [env.action_space()]
    venv.set_attr("max_steps_in_episode", 1)
    venv.reset()
    assert venv.step(np.full(N, STAY))[2].all()
    with pytest.raises(jaxenstein.SettingError, match="did you mean 'move_distance'"):
        venv.set_attr("move_distanc", 1.0)
    with pytest.raises(jaxenstein.SettingError, match="move_distance must be"):
        venv.set_attr("move_distance", 1.5, indices=[0])
    with pytest.raises(jaxenstein.SettingError, match="no environment 3 among 3"):
        venv.get_attr("name", indices=[3])
    assert venv.env_is_wrapped(Monitor, indices=[0]) == [True]
    assert venv.env_is_wrapped(VecMonitor) == [False] * N


def test_params_of_each(made):
    env, params = made
    venv = SB3VecEnv(env, params.replace(move_distance=np.array([0.2, 0.3, 0.6])), N)
    assert venv.get_attr("move_distance") == pytest.approx([0.2, 0.3, 0.6])
    assert venv.get_attr("move_distance", indices=[2]) == pytest.approx([0.6])
    venv.set_attr("max_steps_in_episode", 1, indices=[1])
    assert venv.get_attr("max_steps_in_episode") == [7, 1, 7]
    venv.reset()
    assert venv.step(np.full(N, STAY))[2].tolist() == [False, True, False]
    venv.set_attr("max_steps_in_episode", 3)
    assert venv.get_attr("max_steps_in_episode") == [3, 3, 3]


def test_images(made, venv):
    with pytest.raises(jaxenstein.SettingError, match="call reset before render"):
        venv.render()
    observation = venv.reset()
    np.testing.assert_array_equal(venv.get_images(), observation)
    observation = venv.step(np.array([FORWARD, STAY, 0]))[0]
    np.testing.assert_array_equal(venv.env_method("render", indices=[1, 2]), observation[1:])
    picture = venv.render()
    assert picture.shape == (24, 32, 3)
    np.testing.assert_array_equal(picture[:12, :16], observation[0])
    assert SB3VecEnv(made[0], made[1], 2).get_images() == [None, None]


def test_wrong_calls(made, venv):
    venv.reset()
    with pytest.raises(jaxenstein.SettingError, match="step_async"):
        venv.step_wait()
    venv.set_options({"map": 3})
    with pytest.raises(jaxenstein.SettingError, match="no options"):
        venv.reset()
    venv.set_options()
    venv.close()
    with pytest.raises(jaxenstein.SettingError, match="call reset before step"):
        venv.step(np.zeros(N, int))


class Forward:
    """A model for `evaluate_policy` that walks straight on."""

    def predict(self, observations, state=None, episode_start=None, deterministic=True):
        del episode_start, deterministic
        return np.full(len(observations), FORWARD), state


def test_evaluation_and_wrappers(venv):
    # Warnings are errors here: evaluation without a Monitor would warn.
    mean, deviation = evaluate_policy(Forward(), venv, n_eval_episodes=4)  # type: ignore[arg-type]
    assert (mean, deviation) == (1.0, 0.0)
    stacked = VecFrameStack(venv, 2)
    first = stacked.reset()
    assert first.shape == (N, 12, 16, 6)
    second = stacked.step(np.full(N, STAY))[0]
    np.testing.assert_array_equal(second[..., :3], first[..., 3:])


@pytest.mark.training
@pytest.mark.parametrize("policy", ["CnnPolicy", "MlpPolicy"])
def test_ppo_trains(policy):
    size = {"height": 36, "width": 36} if policy == "CnnPolicy" else SIZE
    env, params = jaxenstein.from_ascii(MAP, heading=0.0, **size)
    venv = SB3VecEnv(env, params.replace(max_steps_in_episode=20, move_distance=0.6), 8)
    model = PPO(policy, venv, n_steps=32, batch_size=128, n_epochs=4, seed=0, learning_rate=1e-3)
    before = [p.detach().clone() for p in model.policy.parameters()]
    model.learn(4096)
    assert any(
        not torch.equal(a, b) for a, b in zip(before, model.policy.parameters(), strict=True)
    )
    assert all(bool(torch.isfinite(p).all()) for p in model.policy.parameters())
    # Its own bookkeeping reads `episode`.
    assert model.ep_info_buffer
    assert {episode["r"] for episode in model.ep_info_buffer} <= {0.0, 1.0}
    mean, _ = evaluate_policy(model, venv, n_eval_episodes=16, deterministic=False)
    assert mean > 0.9


def test_ppo_trains_on_dict_observations():
    """It names attributes of a network after the entries, so the names must be free."""
    venv = SB3VecEnv("key-door", num_envs=2, observation="dict", height=36, width=36)
    model = PPO("MultiInputPolicy", venv, n_steps=8, batch_size=16, n_epochs=1, seed=0)
    names = set(model.policy.features_extractor.extractors)
    assert names == set(venv.observation_space.spaces) > {"image"}
    before = [p.detach().clone() for p in model.policy.parameters()]
    model.learn(16)
    after = list(model.policy.parameters())
    assert all(bool(torch.isfinite(p).all()) for p in after)
    assert any(not torch.equal(a, b) for a, b in zip(before, after, strict=True))


def test_vizdooms_ids_are_a_batch_of_gymnasiums():
    """Through the end of an episode, also its last observation and whether time truncated it."""
    settings: dict = {"look": "plain", "height": 12, "width": 16}
    settings |= {"frame_skip": 4, "episode_timeout": 8}
    id = "jaxenstein/VizdoomHealthGathering-MultiBinary-v1"
    ours = SB3VecEnv(id, num_envs=2, **settings)
    theirs = make_vec_env(id, 2, env_kwargs=settings)
    assert ours.action_space == theirs.action_space
    assert ours.observation_space == theirs.observation_space
    seen = []
    for venv in (ours, theirs):
        venv.seed(3)
        seen.append(venv.reset())
    action, ends = np.array([[0, 1, 0], [1, 0, 1]], np.int8), 0
    for _ in range(3):
        np.testing.assert_equal(*seen)
        (mine, *told, infos), (other, *expected, last) = (v.step(action) for v in (ours, theirs))
        np.testing.assert_equal(told, expected)
        for info, wanted in zip(infos, last, strict=True):
            assert info["TimeLimit.truncated"] == wanted["TimeLimit.truncated"]
            assert ("terminal_observation" in info) == ("terminal_observation" in wanted)
            ends += "terminal_observation" in info
            for name in ("r", "l"):
                assert info.get("episode", {}).get(name) == wanted.get("episode", {}).get(name)
            np.testing.assert_equal(*(one.get("terminal_observation", 0) for one in (info, wanted)))
        seen = [mine, other]
    assert ends == 2
