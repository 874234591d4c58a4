"""Training speed of sb3-contrib's RecurrentPPO on ViZDoom's My Way Home, for `compare.py`.

    python -m benchmarks.training.sb3 --envs 8 --json FILE

Runs under an interpreter with PyTorch, stable-baselines3, sb3-contrib and ViZDoom (`python -m
benchmarks.suites.peers training`); nothing of JAX or of this project is imported. FILE gets what
`python -m benchmarks.training` writes of a configuration. Engines and workers may be left:
`compare.py` ends them.
"""

# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

import argparse
import contextlib
import importlib.metadata
import json
import os
import platform
import time
from pathlib import Path
from typing import Any

from benchmarks.subjects.peers import resizer
from benchmarks.suites.processes import cores_allowed, family, memory

PACKAGES = ("torch", "stable-baselines3", "sb3-contrib", "vizdoom", "gymnasium", "numpy")
# Of the whole run, over which the learning rate falls; only its beginning is run.
TOTAL_STEPS = 10_000_000
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


def make_vector(count: int, kind: str) -> Any:
    """Environments side by side: `subproc`, a worker process each, or `dummy`, in this process.

    Either way each of them has a process of ViZDoom's engine. On one core workers only add their
    messages, so `auto` does without.
    """
    import multiprocessing

    from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

    if kind == "dummy" or (kind == "auto" and (cores_allowed() == 1 or count == 1)):
        return DummyVecEnv([make_env] * count)
    # Else every worker would import PyTorch for itself: seconds and 0.2 GB for each.
    multiprocessing.set_forkserver_preload(PRELOADED)
    return SubprocVecEnv([make_env] * count, start_method="forkserver")


def make_model(env: Any, rollout: int) -> Any:
    """RecurrentPPO with the numbers of this project's baseline."""
    import torch
    from sb3_contrib import RecurrentPPO

    minibatches = min(4, env.num_envs)
    return RecurrentPPO(
        "CnnLstmPolicy",
        env,
        learning_rate=lambda left: 2.5e-4 * left,
        n_steps=rollout,
        batch_size=env.num_envs * rollout // minibatches,
        n_epochs=4,
        gamma=0.999,
        gae_lambda=0.95,
        clip_range=0.2,
        clip_range_vf=0.2,
        ent_coef=0.01,
        vf_coef=0.5,
        max_grad_norm=0.5,
        policy_kwargs={
            "features_extractor_kwargs": {"features_dim": 256},
            "lstm_hidden_size": 256,
            "shared_lstm": True,
            "enable_critic_lstm": False,
            "net_arch": {"pi": [256], "vf": [256]},
            "activation_fn": torch.nn.ReLU,
        },
        seed=0,
    )


def train(model: Any, seconds: float) -> dict[str, Any]:
    """Whole iterations until `seconds` have passed, after one that is not counted."""
    from stable_baselines3.common.callbacks import BaseCallback

    began: list[float] = []
    times: list[float] = []
    held: list[int | None] = []

    class Clock(BaseCallback):
        def _on_rollout_start(self) -> None:
            now = time.perf_counter()
            if began:
                times.append(now - began[-1])
            held.append(memory(family(os.getpid())))
            # What looking at the memory took belongs to no iteration.
            began.append(time.perf_counter())

        def _on_step(self) -> bool:
            return len(times) < 2 or sum(times[1:]) < seconds

    model.learn(TOTAL_STEPS, callback=Clock())
    steps, most = model.n_envs * model.n_steps, max(each or 0 for each in held)
    return {"rates": [steps / each for each in times[1:]], "memory_bytes": most or None}


def measure(options: argparse.Namespace) -> dict[str, Any]:
    """Make the environments and train."""
    # Read when libraries are loaded: workers have one thread, this process is told its number.
    os.environ["OMP_NUM_THREADS"] = os.environ["MKL_NUM_THREADS"] = "1"
    import torch

    torch.set_num_threads(cores_allowed())
    versions = {"python": platform.python_version()}
    for package in PACKAGES:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            versions[package] = importlib.metadata.version(package)
    began = time.perf_counter()
    env = make_vector(options.envs, options.vector)
    env.reset()
    ready = time.perf_counter() - began
    model = make_model(env, options.rollout)
    on_gpu = model.device.type == "cuda"
    return {
        "versions": versions,
        "creation_seconds": ready,
        "parameters": sum(parameter.numel() for parameter in model.policy.parameters()),
        "device": torch.cuda.get_device_name(model.device) if on_gpu else str(model.device),
        **train(model, options.seconds),
    }


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description="Training speed of RecurrentPPO on ViZDoom.")
    add = parser.add_argument
    add("--envs", type=int, required=True, metavar="N")
    add("--rollout", type=int, default=128, metavar="T", help="steps of an update (default 128)")
    add("--seconds", type=float, default=20.0, help="repeat for so long at least (default 20)")
    add("--vector", choices=["auto", "subproc", "dummy"], default="auto")
    add("--json", type=Path, required=True, metavar="FILE")
    options = parser.parse_args()
    options.json.write_text(json.dumps({"rows": [measure(options)]}))


if __name__ == "__main__":
    main()
