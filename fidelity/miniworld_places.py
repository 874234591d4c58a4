"""Where MiniWorld's rooms and ours have the start and the box, compared by their distributions.

    python -m fidelity.miniworld_places FOLDER [--resets N] [ID ...]

FOLDER holds MiniWorld's package, `miniworld` (`pip download --no-deps miniworld`, unpacked); its
drawing, which needs OpenGL, is left out. Needs the `gymnasium` extra. Tables are the largest
distances between the cumulated frequencies of one number in both (Kolmogorov and Smirnov's test);
the status is 1 if one is beyond what chance explains (5 % for all tables of all ids together).
"""

from __future__ import annotations

import argparse
import importlib
import math
import sys
import types
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import numpy as np

SIGNIFICANCE = 0.05
TABLES = ("start x", "start y", "heading", "box x", "box y")
# Module and class, arguments, and what is to be added to x and z to get our columns and rows.
ROOMS: dict[str, tuple[str, str, dict[str, Any], tuple[int, int]]] = {
    "one-room": ("oneroom", "OneRoom", {"size": 10}, (1, 1)),
    "one-room-s6": ("oneroom", "OneRoomS6", {"size": 6}, (1, 1)),
    "hallway": ("hallway", "Hallway", {"length": 12}, (2, 3)),
    "t-maze": ("tmaze", "TMaze", {"goal_pos": None}, (2, 9)),
    "four-rooms": ("fourrooms", "FourRooms", {}, (8, 8)),
    "sidewalk": ("sidewalk", "Sidewalk", {}, (4, 10)),
}


def load(folder: Path) -> None:
    """Make the package importable, with nothing behind what draws."""
    for name in ("pyglet", "pyglet.gl", "pyglet.window", "miniworld.opengl", "miniworld.objmesh"):
        sys.modules[name] = MagicMock()
    for name in ("miniworld", "miniworld.envs"):
        package = types.ModuleType(name)
        package.__path__ = [str(folder / name.replace(".", "/"))]
        sys.modules[name] = package
    world: Any = importlib.import_module("miniworld.miniworld")
    world.gen_texcs_floor = lambda _, places: np.zeros((len(places), 2))
    world.gen_texcs_wall = lambda *_: np.zeros((4, 2))
    # Cones and buildings are meshes, which keep no one away from where episodes begin.
    mesh = MagicMock(max_coords=(0.3, 1.0, 0.3))
    sys.modules["miniworld.entity"].ObjMesh.get = lambda _: mesh  # type: ignore[attr-defined]


def from_miniworld(name: str, resets: int) -> np.ndarray:
    """float[resets, 5], the tables of its first states."""
    module, kind, arguments, (right, down) = ROOMS[name]
    entity = importlib.import_module("miniworld.entity")
    cls = getattr(importlib.import_module(f"miniworld.envs.{module}"), kind)
    env = cls.__new__(cls)
    settings = importlib.import_module("miniworld.params").DEFAULT_PARAMS
    vars(env).update(arguments, params=settings, domain_rand=False)
    env._np_random = np.random.default_rng(0)
    rows = []
    for _ in range(resets):
        vars(env).update(agent=entity.Agent(), entities=[], rooms=[], wall_segs=[], step_count=0)
        env._gen_world()
        places = [(e.pos[0] + right, e.pos[2] + down) for e in (env.agent, env.box)]
        rows.append((*places[0], -env.agent.dir, *places[1]))
    return np.array(rows, np.float64)


def from_ours(name: str, resets: int) -> np.ndarray:
    """The same of ours."""
    import jax

    import jaxenstein

    env, params = jaxenstein.make(f"miniworld-{name}", height=8, width=8)
    keys = jax.random.split(jax.random.key(0), resets)
    states: Any = jax.device_get(jax.jit(jax.vmap(lambda k: env.init_state(k, params)))(keys))
    return np.column_stack([states.position, states.heading, states.goal]).astype(np.float64)


def distance(one: np.ndarray, other: np.ndarray) -> float:
    """The largest distance between the cumulated frequencies of two samples."""
    every = np.concatenate([one, other])
    shares = [np.searchsorted(np.sort(some), every, "right") / len(some) for some in (one, other)]
    return float(np.abs(shares[0] - shares[1]).max())


def main(argv: Sequence[str] | None = None) -> int:
    """Compare and print; returns the exit status."""
    parser = argparse.ArgumentParser(description="Compare starts and boxes with MiniWorld's.")
    parser.add_argument("folder", type=Path, help="where the folder miniworld is")
    parser.add_argument("ids", nargs="*", default=list(ROOMS), help="without miniworld-")
    parser.add_argument("--resets", type=int, default=1000, help="first states a side")
    options = parser.parse_args(argv)
    load(options.folder)
    failed = False
    for name in options.ids:
        theirs, ours = from_miniworld(name, options.resets), from_ours(name, options.resets)
        # There an episode may begin at the box, here it does not.
        theirs = theirs[np.hypot(*(theirs[:, :2] - theirs[:, 3:]).T) > 1.153]
        for table in (theirs, ours):
            table[:, 2] = (table[:, 2] + math.pi) % (2 * math.pi)
        chance = SIGNIFICANCE / len(TABLES) / len(options.ids)
        bound = math.sqrt(-math.log(chance / 2) / 2 * (1 / len(theirs) + 1 / len(ours)))
        found = {t: distance(theirs[:, i], ours[:, i]) for i, t in enumerate(TABLES)}
        beyond = [table for table, value in found.items() if value > bound]
        shown = ", ".join(f"{table} {value:.3f}" for table, value in found.items())
        print(f"{name}: {shown}; bound {bound:.3f}; beyond: {', '.join(beyond) or 'none'}")
        failed |= bool(beyond)
    return int(failed)


if __name__ == "__main__":
    raise SystemExit(main())
