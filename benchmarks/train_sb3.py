"""Training speed of sb3-contrib's RecurrentPPO on ViZDoom's My Way Home, for `train_compare.py`.

    python benchmarks/train_sb3.py --envs 8 --seconds 20

Runs under an interpreter with PyTorch, stable-baselines3, sb3-contrib and ViZDoom (`python -m
benchmarks.peers training`); nothing of JAX or of this project is imported. The last line of the
output is JSON: the speed, or under `failed` why there is none. Every engine and worker that it
started has ended when it does.
"""

# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

import argparse
import contextlib
import importlib.metadata
import json
import os
import platform
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from typing import Any

from peer_subjects import SCENARIOS, resizer
from train_processes import end, engine_of, family, inside, memory, shared_memory_free

PACKAGES = ("torch", "stable-baselines3", "sb3-contrib", "vizdoom", "gymnasium", "numpy")
PRELOADED = ["stable_baselines3.common.vec_env.subproc_vec_env", "vizdoom.gymnasium_wrapper", "cv2"]
# Of the whole run, over which the learning rate falls; only its beginning is run.
TOTAL_STEPS = 10_000_000
MINIBATCHES = 4


def make_env() -> Any:
    """ViZDoom's My Way Home with 64x64 RGB frames, resized by area."""
    import gymnasium
    import numpy as np
    import vizdoom.gymnasium_wrapper  # noqa: F401

    resize = resizer("area")
    space = gymnasium.spaces.Box(0, 255, (64, 64, 3), np.uint8)
    env = gymnasium.make(SCENARIOS["my-way-home"][0])
    return gymnasium.wrappers.TransformObservation(env, lambda obs: resize(obs["screen"]), space)


def make_vector(count: int, kind: str) -> Any:
    """Environments side by side: `subproc`, a worker process each, or `dummy`, in this process.

    Either way each of them has a process of ViZDoom's engine.
    """
    import multiprocessing

    from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

    if kind == "dummy":
        return DummyVecEnv([make_env] * count)
    # Else every worker would import PyTorch for itself: seconds and 0.2 GB for each.
    multiprocessing.set_forkserver_preload(PRELOADED)
    return SubprocVecEnv([make_env] * count, start_method="forkserver")


def make_model(env: Any, rollout: int) -> Any:
    """RecurrentPPO with the numbers of this project's baseline."""
    import torch
    from sb3_contrib import RecurrentPPO

    minibatches = min(MINIBATCHES, env.num_envs)
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
    """Whole iterations until `seconds` have passed, after one that is not counted.

    Returns:
        `warm_up_seconds`, `rates`, steps a second of each iteration, and the most `memory_bytes`
        and `peak_rss_bytes` between two of them.
    """
    from stable_baselines3.common.callbacks import BaseCallback

    began: list[float] = []
    times: list[float] = []
    held: list[dict[str, int | None]] = []

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
    steps = model.n_envs * model.n_steps
    most = {name: max((each[name] or 0 for each in held), default=0) or None for name in held[0]}
    return {"warm_up_seconds": times[0], "rates": [steps / t for t in times[1:]], **most}


def measure(options: argparse.Namespace, found: dict[str, Any]) -> None:
    """Make the environments, train, and note what is known into `found` as soon as it is."""
    import torch

    threads = options.threads or _cores()
    torch.set_num_threads(threads)
    import sb3_contrib  # noqa: F401

    own = memory(family(os.getpid()))
    found |= {"versions": _versions(), "threads": threads, "base_bytes": own["memory_bytes"]}
    found["stage"] = "making the environments"
    free, began = shared_memory_free(), time.perf_counter()
    env = make_vector(options.envs, options.vector)
    try:
        with watched(env, found):
            env.reset()
            found["creation_seconds"] = time.perf_counter() - began
            found["stage"] = "making the networks"
            model = make_model(env, options.rollout)
            found["parameters"] = sum(p.numel() for p in model.policy.parameters())
            found["device"] = str(model.device)
            if model.device.type == "cuda":
                found["device"] = torch.cuda.get_device_name(model.device)
            found["stage"] = "training"
            found |= train(model, options.seconds)
        if free is not None:
            found["shared_memory_bytes"] = max(0, free - (shared_memory_free() or 0))
        del found["stage"]
    finally:
        # Workers that have died cannot be asked to end: whatever is left is killed.
        found.setdefault("engines_alive", engines())
        with contextlib.suppress(Exception):
            env.close()


@contextlib.contextmanager
def watched(env: Any, found: dict[str, Any]) -> Iterator[None]:
    """Notice a worker that dies, which else may not be noticed at all.

    Its engine lives on and holds its pipe open, so this process would wait for it for ever. All
    others are ended then, which does end the waiting.
    """
    workers, over = getattr(env, "processes", ()), threading.Event()

    def watch() -> None:
        while not over.wait(1.0):
            codes = [worker.exitcode for worker in workers if worker.exitcode is not None]
            if codes:
                found["workers_ended"] = codes
                found["engines_alive"] = engines()
                end(inside(os.getcwd()))
                return

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def engines() -> int:
    """How many of ViZDoom's engines run, of those started from here."""
    return sum(bool(engine_of(pid)) for pid in inside(os.getcwd()))


def _versions() -> dict[str, str]:
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            found[package] = importlib.metadata.version(package)
    return found


def _cores() -> int:
    allowed = getattr(os, "sched_getaffinity", None)
    return len(allowed(0)) if allowed else os.cpu_count() or 1


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, print one line of JSON, end all that was started; 1 if it failed."""
    parser = argparse.ArgumentParser(description="Training speed of RecurrentPPO on ViZDoom.")
    parser.add_argument("--envs", type=int, required=True, metavar="N")
    parser.add_argument("--rollout", type=int, default=128, metavar="T", help="(default 128)")
    parser.add_argument("--seconds", type=float, default=20.0, help="to measure (default 20)")
    parser.add_argument("--vector", choices=["auto", "subproc", "dummy"], default="auto")
    parser.add_argument("--threads", type=int, default=0, help="PyTorch's (default: a core each)")
    options = parser.parse_args(argv)
    # Read when libraries are loaded: workers have one thread, this process is told later.
    os.environ["OMP_NUM_THREADS"] = os.environ["MKL_NUM_THREADS"] = "1"
    found: dict[str, Any] = {"envs": options.envs, "rollout": options.rollout}
    if options.vector == "auto":
        # On one core workers only add their messages.
        options.vector = "dummy" if _cores() == 1 or options.envs == 1 else "subproc"
    found |= {"vector": options.vector, "stage": "importing"}
    # Told to end, it ends what it started before itself.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    here = os.getcwd()
    # ViZDoom leaves files in its working directory.
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        os.chdir(folder)
        try:
            measure(options, found)
        except (Exception, KeyboardInterrupt) as error:
            said = " ".join(str(error).split()) or "no message"
            found["failed"] = f"{type(error).__name__}: {said}, while {found.pop('stage')}"
            if codes := found.pop("workers_ended", None):
                found["failed"] += f"; workers ended with exit status {', '.join(map(str, codes))}"
        finally:
            end(inside(folder))
            os.chdir(here)
    print(json.dumps(found), flush=True)
    return int("failed" in found)


if __name__ == "__main__":
    sys.exit(main())
