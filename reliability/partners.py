"""The packages for tests of adapters and examples, in separate environments.

Some packages exclude each other: gymnax 1.x has upper limits on JAX and Gymnasium, and rejax needs
gymnax 0.0.9. `make partners` runs the tests.
"""

from __future__ import annotations

from dataclasses import dataclass

TESTS = "tests"


@dataclass(frozen=True)
class Partner:
    """One environment.

    Attributes:
        requirements: requirements for pip, besides this package and pytest.
        tests: test files in the folder `TESTS`.
        modules: modules that must be importable.
        python: the required Python version, such as "3.11"; None for any.
    """

    requirements: tuple[str, ...]
    tests: tuple[str, ...]
    modules: tuple[str, ...]
    python: str | None = None


_TORCH = "torch==2.13.0"
_EVERY = ("adapters/test_contract.py", "adapters/test_ranges.py")
_GYMNASIUM = ("adapters/test_gymnasium.py", "adapters/test_gymnasium_vector.py", *_EVERY)
_GYMNAX = ("adapters/test_gymnax.py", *_EVERY)
# gymnax imports six without requiring it.
PARTNERS: dict[str, Partner] = {
    "gymnasium-1.1": Partner(("gymnasium==1.1.1",), _GYMNASIUM, ("gymnasium",)),
    "gymnasium": Partner(("gymnasium>=1.4",), _GYMNASIUM, ("gymnasium",)),
    "gymnax-0.0.9": Partner(("gymnax==0.0.9", "six"), _GYMNAX, ("gymnax",)),
    "gymnax": Partner(("gymnax>=1.0.1", "six"), _GYMNAX, ("gymnax",)),
    "rejax": Partner(("rejax>=0.1.3", "gymnax==0.0.9", "six"), _GYMNAX, ("gymnax", "rejax")),
    "stoa": Partner(("stoa-env>=0.1.2",), ("adapters/test_stoa.py", *_EVERY), ("stoa",)),
    "equinox": Partner(
        ("equinox>=0.13", "flax>=0.12", "optax>=0.2.4", "tensorboardX>=2.6", "wandb>=0.20"),
        ("examples/test_own_agents.py",),
        ("equinox", "tensorboardX", "wandb"),
    ),
    "tensorboard": Partner(
        ("tensorboard>=2.18", "tensorboardX>=2.6", "flax>=0.12", "optax>=0.2.4", "matplotlib>=3.9"),
        ("baselines/runs/test_foreign.py", "cli/test_train.py"),
        ("tensorboard", "tensorboardX", "matplotlib"),
    ),
    "vizdoom": Partner(
        ("vizdoom>=1.3", "flax>=0.12", "optax>=0.2.4", "matplotlib>=3.9"),
        (
            "adapters/test_vizdoom.py",
            "adapters/test_vizdoom_ids.py",
            "docs/test_doom_pixels.py",
            "docs/test_notebooks.py",
            "baselines/runs/test_configs.py",
            "baselines/runs/test_evaluate.py",
            "baselines/runs/test_trained.py",
            "experiments/test_other_pictures.py",
            "fidelity/test_doom_map.py",
            "tasks/doom/test_game_look.py",
            "tasks/doom/test_picture_reference.py",
            "tasks/doom/test_wad.py",
        ),
        ("vizdoom", "flax", "matplotlib"),
    ),
    "torch": Partner(
        (_TORCH,),
        ("adapters/test_torch.py", "examples/test_torch_loop.py", *_EVERY),
        ("torch",),
        "3.11",
    ),
    "torchrl": Partner(
        (_TORCH, "torchrl>=0.14", "gymnasium>=1.4"),
        ("adapters/test_torchrl.py",),
        ("torchrl",),
        "3.11",
    ),
    "sb3": Partner(
        (_TORCH, "stable-baselines3>=2.4", "flax>=0.12", "optax>=0.2.4"),
        ("adapters/test_sb3.py", "experiments/test_sb3_in_vizdoom.py", *_EVERY),
        ("torch", "stable_baselines3"),
        "3.11",
    ),
}
