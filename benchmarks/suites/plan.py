"""How much the suite measures: the sizes of its parts."""

from __future__ import annotations

from dataclasses import dataclass

from jaxenstein.catalogue import MAIN_IDS


@dataclass(frozen=True)
class Plan:
    """Sizes of everything: of the parts that have them in the plural, and `batch` of the others."""

    cores: int = 1
    batches: tuple[int, ...] = (1, 8, 64, 256, 1024, 4096)
    batch: int = 256
    ids: tuple[str, ...] = MAIN_IDS
    # Those that the other parts take.
    tasks: tuple[str, ...] = ("my-way-home", "health-gathering")
    sizes: tuple[str, ...] = ("64x64", "84x84", "160x120", "320x240")
    kinds: tuple[str, ...] = ("rgb", "gray", "depth", "labels", "dict")
    maps: tuple[int, ...] = (9, 16, 32, 64, 128, 256)
    sprites: tuple[int, ...] = (1, 2, 4, 8, 16, 32, 64, 128)
    skips: tuple[int, ...] = (1, 4)
    trained: tuple[int, ...] = (1, 2, 4, 8, 16, 32, 64, 128, 256)
    adapter_envs: tuple[int, ...] = (64, 1024)
    # Those whose resets and first frames are waited for.
    waits: tuple[str, ...] = (
        "my-way-home",
        "health-gathering",
        "key-corridor",
        "memory-maze-9x9",
        "minigrid-door-key-8x8",
        "doom-my-way-home",
    )
    # Of trainings: the environments side by side.
    learners: int = 64
    # Of the adapters' partners, whose environments to measure in.
    partners: tuple[str, ...] = ("gymnasium", "gymnax", "stoa", "sb3")


# Sizes to see the suite work with, not to learn anything from.
QUICK = Plan(
    batches=(1, 16),
    batch=16,
    ids=("simple", "my-way-home", "health-gathering"),
    tasks=("my-way-home",),
    sizes=("64x64", "160x120"),
    kinds=("rgb", "depth"),
    maps=(9, 32),
    sprites=(1, 16),
    trained=(2,),
    waits=("my-way-home",),
    learners=4,
    adapter_envs=(16,),
    partners=("gymnasium",),
)
