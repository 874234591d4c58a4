"""TorchRL's wrappers around the environments of Gymnasium."""

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")
envs = pytest.importorskip("torchrl.envs")

import jaxenstein  # noqa: E402, F401

COUNT, STEPS = 2, 9
SMALL = {"height": 8, "width": 8, "max_steps_in_episode": 4, "observation": "dict"}


def both(mode):
    """A vector of environments, and another in TorchRL's wrapper, with the same seed."""
    made = [
        gymnasium.make_vec(
            "jaxenstein/key-door-v0", num_envs=COUNT, autoreset_mode=mode, copy=True, **SMALL
        )
        for _ in range(2)
    ]
    wrapped = envs.GymWrapper(made[1])
    wrapped.set_seed(3)
    return made[0], wrapped


@pytest.mark.parametrize("mode", ["SameStep", "Disabled"])
def test_rollout_matches_plain_vector_environment(mode):
    plain, wrapped = both(mode)
    told = wrapped.rollout(STEPS, break_when_any_done=False)
    assert told.batch_size == (COUNT, STEPS)
    plain.reset(seed=3)
    observation, _ = plain.reset()
    for t in range(STEPS):
        now = told[:, t]
        np.testing.assert_array_equal(now["image"], observation["image"])
        action = now["action"].numpy().argmax(-1)
        observation, reward, terminated, truncated, _ = plain.step(action)
        np.testing.assert_array_equal(now["next", "reward"][:, 0], reward.astype(np.float32))
        np.testing.assert_array_equal(now["next", "truncated"][:, 0], truncated)
        over = terminated | truncated
        np.testing.assert_array_equal(now["next", "done"][:, 0], over)
        if mode == "Disabled" and over.any():
            observation, _ = plain.reset(options={"reset_mask": over})
    assert told["next", "done"].sum() == COUNT * (STEPS // 4)


def test_next_step_autoreset_is_refused():
    with pytest.raises(RuntimeError, match="must be one of SAME_STEP or DISABLED"):
        both("NextStep")


@pytest.mark.parametrize("skip", [1, 3])
def test_by_id(skip):
    """TorchRL's name for the setting reaches the environment, which draws one frame per step."""
    env = envs.GymEnv("jaxenstein/key-door-v0", frame_skip=skip, **SMALL)
    assert env.unwrapped.env.frame_skip == skip
    told = env.rollout(STEPS, break_when_any_done=False)
    assert told["next", "done"].sum() == STEPS // -(-4 // skip)
    assert told["next", "image"].shape == (STEPS, 8, 8, 3)
