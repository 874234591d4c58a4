"""RecurrentPPO of sb3-contrib on ViZDoom's My Way Home as a subject, `sb3-B`: whole updates.

Needs an interpreter with PyTorch, stable-baselines3, sb3-contrib and ViZDoom (`python -m
benchmarks.install training`). Imports neither JAX nor this project.
"""

# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

import atexit
import os
from typing import Any

from benchmarks.subjects.common import ROLLOUT, TRAINED_STEPS, Chunk, Options, Subjects, notes
from benchmarks.subjects.peers import resizer

PRELOADED = ["stable_baselines3.common.vec_env.subproc_vec_env", "vizdoom.gymnasium_wrapper", "cv2"]


def make_env() -> Any:
    """ViZDoom's My Way Home with 64x64 RGB frames, resized by area."""
    import gymnasium
    import numpy as np
    import vizdoom.gymnasium_wrapper  # noqa: F401

    resize = resizer("area")
    space = gymnasium.spaces.Box(0, 255, (64, 64, 3), np.uint8)
    env = gymnasium.make("VizdoomMyWayHome-v1")
    return gymnasium.wrappers.TransformObservation(env, lambda obs: resize(obs["screen"]), space)


def make_vector(count: int) -> Any:
    """Parallel environments, each with its own ViZDoom process.

    Each has a worker process, except on one core, where workers only add messages.
    """
    import multiprocessing

    from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

    if len(os.sched_getaffinity(0)) == 1 or count == 1:
        return DummyVecEnv([make_env] * count)
    # Otherwise every worker would import PyTorch, which takes seconds and 0.2 GB.
    multiprocessing.set_forkserver_preload(PRELOADED)
    return SubprocVecEnv([make_env] * count, start_method="forkserver")


def make_model(env: Any) -> Any:
    """RecurrentPPO with the hyperparameters of this project's baseline."""
    import torch
    from sb3_contrib import RecurrentPPO

    numbers: dict[str, Any] = {
        "learning_rate": lambda left: 2.5e-4 * left,
        "n_steps": ROLLOUT,
        "batch_size": env.num_envs * ROLLOUT // min(4, env.num_envs),
        "n_epochs": 4,
        "gamma": 0.999,
        "gae_lambda": 0.95,
        "clip_range": 0.2,
        "clip_range_vf": 0.2,
        "ent_coef": 0.01,
        "vf_coef": 0.5,
        "max_grad_norm": 0.5,
        "policy_kwargs": {
            "features_extractor_kwargs": {"features_dim": 256},
            "lstm_hidden_size": 256,
            "shared_lstm": True,
            "enable_critic_lstm": False,
            "net_arch": {"pi": [256], "vf": [256]},
            "activation_fn": torch.nn.ReLU,
        },
        "seed": 0,
    }
    return RecurrentPPO("CnnLstmPolicy", env, **numbers)


def sb3(batch: int, options: Options) -> Chunk:
    """Rollouts and updates, as in `learn`."""
    del options
    # Libraries read these when they load: workers use one thread; this process sets its own number.
    os.environ["OMP_NUM_THREADS"] = os.environ["MKL_NUM_THREADS"] = "1"
    import torch

    torch.set_num_threads(len(os.sched_getaffinity(0)))
    env = make_vector(batch)
    atexit.register(env.close)
    model = make_model(env)
    notes["parameters"] = f"{sum(each.numel() for each in model.policy.parameters()):,}"
    notes["device"] = str(model.device)
    _, callback = model._setup_learn(TRAINED_STEPS)

    def chunk() -> int:
        buffer = model.rollout_buffer
        model.collect_rollouts(model.env, callback, buffer, n_rollout_steps=model.n_steps)
        model._update_current_progress_remaining(model.num_timesteps, TRAINED_STEPS)
        model.train()
        return model.n_envs * model.n_steps

    return chunk


SUBJECTS: Subjects = {"sb3": sb3}
