"""Compare first states and random policies in MiniWorld's environments and ours.

    python -m fidelity.miniworld_places FOLDER [ID ...] [--resets N] [--episodes N]

FOLDER has MiniWorld's package `miniworld` (unpacked from `pip download --no-deps miniworld`). Its
rendering is disabled, since it needs OpenGL. Needs the extra `gymnasium`. It compares distributions
with Kolmogorov-Smirnov tests: positions of starts and boxes; in mazes their cells, the number of
dead ends and forks, and the distance to the box; with several things, the length of the shortest
path. The exit status is 1 if one differs by more than chance explains (5 % for all tests of all ids
together). `--episodes` plays that many episodes with a random policy in both.
"""

from __future__ import annotations

import argparse
import importlib
import itertools
import math
import sys
import types
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import MagicMock

import jax
import numpy as np

import jaxenstein
from fidelity import players
from fidelity.commands import run_command
from jaxenstein.cli.arguments import whole
from jaxenstein.players import UNIFORM, play
from jaxenstein.tasks.miniworld.box_maze import BoxMazeState
from jaxenstein.tasks.miniworld.collect_health import CollectHealthState
from jaxenstein.tasks.miniworld.rooms import BoxState

SIGNIFICANCE = 0.05
# The distance between cells of a maze, in metres and in tiles.
PITCHES = 3.25, 4
# Module and class, arguments, and the shift from x and z to our columns and rows.
ROOMS: dict[str, tuple[str, str, dict[str, Any], tuple[float, float]]] = {
    "one-room": ("oneroom", "OneRoom", {"size": 10}, (1, 1)),
    "one-room-s6": ("oneroom", "OneRoomS6", {"size": 6}, (1, 1)),
    "one-room-s6-fast": ("oneroom", "OneRoomS6Fast", {}, (1, 1)),
    "hallway": ("hallway", "Hallway", {"length": 12}, (2, 3)),
    "t-maze": ("tmaze", "TMaze", {"goal_pos": None}, (2, 9)),
    "four-rooms": ("fourrooms", "FourRooms", {}, (8, 8)),
    "wall-gap": ("wallgap", "WallGap", {}, (8, 9.5)),
    "sidewalk": ("sidewalk", "Sidewalk", {}, (4, 10)),
    "maze": ("maze", "Maze", {}, (0, 0)),
    "maze-s2": ("maze", "MazeS2", {}, (0, 0)),
    "maze-s3": ("maze", "MazeS3", {}, (0, 0)),
    "maze-s3-fast": ("maze", "MazeS3Fast", {}, (0, 0)),
    "sign": ("sign", "Sign", {}, (1, 1)),
    "pickup-objects": ("pickupobjects", "PickupObjects", {}, (1, 1)),
    "put-next": ("putnext", "PutNext", {}, (1, 1)),
    "collect-health": ("collecthealth", "CollectHealth", {}, (1, 1)),
}


class First(NamedTuple):
    """A first state, with positions float[2] in tiles, or in cells of a maze.

    Attributes:
        start: position of the agent.
        heading: radians clockwise from east.
        things: float[n, 2], positions of the things to reach or take.
        ways: pairs of connected cells of a maze.
    """

    start: np.ndarray
    heading: float
    things: np.ndarray
    ways: list[tuple[tuple[int, int], tuple[int, int]]]


def load(folder: Path) -> None:
    """Make the package importable without its rendering."""
    for name in ("pyglet", "pyglet.gl", "pyglet.window", "miniworld.opengl"):
        sys.modules[name] = MagicMock()
    for name in ("miniworld", "miniworld.envs"):
        package = types.ModuleType(name)
        package.__path__ = [str(folder / name.replace(".", "/"))]
        sys.modules[name] = package
    world: Any = importlib.import_module("miniworld.miniworld")
    world.gen_texcs_floor = lambda _, places: np.zeros((len(places), 2))
    world.gen_texcs_wall = lambda *_: np.zeros((4, 2))
    world.MiniWorldEnv._render_static = world.MiniWorldEnv.render_obs = lambda _: None


def original(name: str) -> Any:
    """MiniWorld's environment."""
    module, kind, arguments, _ = ROOMS[name]
    env = getattr(importlib.import_module(f"miniworld.envs.{module}"), kind)(**arguments)
    env.reset(seed=0)
    return env


def restart(env: Any) -> None:
    """Start an episode that is not over at once; ours never are."""
    while True:
        # In MiniWorld, the goal of Sign is an argument.
        env._color_index, env._goal = (int(env.np_random.integers(n)) for n in (3, 2))
        env.reset()
        put = (env.red_box, env.yellow_box) if hasattr(env, "red_box") else None
        boxes = put or ((env.box,) if hasattr(env, "box") and not hasattr(env, "health") else ())
        if not boxes or not env.near(*boxes):
            return


def from_miniworld(name: str, resets: int) -> list[First]:
    """First states of MiniWorld."""
    env, shift, found = original(name), np.array(ROOMS[name][3]), []
    maze = ROOMS[name][0] == "maze"
    for _ in range(resets):
        restart(env)
        boxes = [env.red_box, env.yellow_box] if name == "put-next" else []
        things = boxes or [e for e in env.entities if e is not env.agent and not e.is_static]
        places = np.array([(e.pos[0], e.pos[2]) for e in (env.agent, *things)]) + shift
        if name == "wall-gap":
            # MiniWorld's yards are half a metre shorter; margins to walls are 0.4 m, or 0.57 m for
            # the box.
            middles, spans = np.array([13.75, 5.25]), np.array([7.2 / 6.7, 6.869 / 6.369])
            places[:, 1] = (places[:, 1] - middles) * spans + (14, 5)
        ways = set()
        rooms: list[Any] = env.rooms if maze else []
        for room, edge in itertools.product(rooms, range(4)):
            cell = tuple(int(v // PITCHES[0]) for v in (room.mid_x, room.mid_z))
            across, _, down = -room.edge_norms[edge]
            if room.portals[edge] and round(across + down) == 1:
                ways.add((cell, (cell[0] + round(across), cell[1] + round(down))))
        places = places // PITCHES[0] if maze else places
        found.append(First(places[0], -env.agent.dir, places[1:], list(ways)))
    return found


def from_ours(name: str, resets: int) -> list[First]:
    """Our first states."""
    _, _, states = first_states(name, resets)
    found = []
    for i in range(resets):
        start: Any = states.position[i]
        things: Any
        if isinstance(states, BoxState):
            things = states.goal[i][None]
        elif isinstance(states, CollectHealthState):
            things = states.medkits[i]
        else:
            # The yellow box and the red one are the first two.
            things = states.things.tile[i][: 2 if name == "put-next" else None] + 0.5
        ways = []
        if isinstance(states, BoxMazeState):
            start, things = ((place - 1) // PITCHES[1] for place in (start, things))
            free = states.level.walls[i][0] == 0
            # Look at the middle tile between two cells.
            for row, column in np.argwhere(free[:, 4::4]).tolist():
                if row % 4 == 2:
                    ways.append(((column, row // 4), (column + 1, row // 4)))
            for row, column in np.argwhere(free[4::4]).tolist():
                if column % 4 == 2:
                    ways.append(((column // 4, row), (column // 4, row + 1)))
        found.append(First(start, float(states.heading[i]), things, ways))
    return found


def first_states(name: str, count: int) -> tuple[Any, Any, Any]:
    """Our environment, its params, and first states as NumPy arrays."""
    env, params = jaxenstein.make(f"miniworld-{name}", height=8, width=8)
    return env, params, jax.device_get(players.first_states(env, params, count, seed=0))


def numbers(name: str, first: First) -> dict[str, float]:
    """The numbers of a first state to compare, by name."""
    start, heading, things, ways = first
    found = {"start x": start[0], "start y": start[1], "heading": heading % (2 * math.pi)}
    if name in ("pickup-objects", "put-next"):
        # Our things lie in the middle of tiles.
        del found["start x"], found["start y"]
        orders = itertools.permutations(things)
        return {**found, "way": min(_length([start, *order]) for order in orders)}
    if name == "collect-health":
        apart = np.hypot(*(things[:, None] - things[None]).transpose(2, 0, 1))
        nearest = np.sort(apart, axis=1)[:, 1]
        found |= {"to a medkit": np.hypot(*(things - start).T).min(), "apart": nearest.mean()}
    elif name != "sign":
        found |= {"box x": things[0, 0], "box y": things[0, 1]}
    if not ways:
        return found
    exits = np.unique(np.array(ways).reshape(-1, 2), axis=0, return_counts=True)[1]
    steps = {tuple(start.astype(int).tolist()): 0}
    for cell, count in _spread(steps, ways):
        steps[cell] = count
    way = steps[tuple(things[0].astype(int).tolist())]
    return {**found, "ends": sum(exits == 1), "forks": sum(exits > 2), "way": way}


def _spread(steps: dict[Any, int], ways: list[Any]) -> Any:
    """Yield the cells not in `steps` with their distances, nearest first."""
    queue = list(steps)
    for cell in queue:
        for one, other in (*ways, *((b, a) for a, b in ways)):
            if one == cell and other not in steps:
                queue.append(other)
                yield other, steps[cell] + 1


def _length(places: Sequence[np.ndarray]) -> float:
    return float(np.hypot(*np.diff(places, axis=0).T).sum())


def distance(one: np.ndarray, other: np.ndarray) -> float:
    """The Kolmogorov-Smirnov distance of two samples."""
    every = np.concatenate([one, other])
    shares = [np.searchsorted(np.sort(some), every, "right") / len(some) for some in (one, other)]
    return float(np.abs(shares[0] - shares[1]).max())


def compared(name: str, resets: int, ids: int) -> bool:
    """Compare first states and print the result; return whether a test is significant."""
    sides = from_miniworld(name, resets), from_ours(name, resets)
    tables = [[numbers(name, first) for first in side] for side in sides]
    chance = SIGNIFICANCE / len(tables[0][0]) / ids
    bound = math.sqrt(-math.log(chance / 2) / resets)
    told, beyond = [], []
    for table in tables[0][0]:
        values = [np.array([row[table] for row in side], np.float64).round(4) for side in tables]
        apart = distance(*values)
        told.append(f"{table} {apart:.3f} ({values[0].mean():.2f}, {values[1].mean():.2f})")
        beyond += [table] if apart > bound else []
    print(f"{name}: {', '.join(told)}; bound {bound:.3f}; beyond: {', '.join(beyond) or 'none'}")
    return bool(beyond)


def by_chance(name: str, episodes: int) -> str:
    """A text with success rate and mean return of a random policy in both."""
    ours, params, states = first_states(name, episodes)
    played = play(ours, UNIFORM, params, jax.random.key(2), states)
    env, rng, theirs = original(name), np.random.default_rng(0), []
    for _ in range(episodes):
        restart(env)
        total, over, reward, terminated = 0.0, False, 0.0, False
        while not over:
            # Only the actions that we have; the others of MiniWorld's eight do nothing.
            _, reward, terminated, truncated, _ = env.step(rng.integers(ours.num_actions))
            total, over = total + reward, terminated or truncated
        theirs.append((terminated and reward > 0, total))
    sides = np.array(theirs, np.float64).T, np.array([played.successes > 0, played.returned])
    means = [side.mean(1) for side in sides]
    error = np.sqrt(sum(side.var(1) for side in sides) / episodes)
    shown = [
        f"{label} {a:.3f} in MiniWorld, {b:.3f} here, error of the difference {e:.3f}"
        for label, a, b, e in zip(("solved", "return"), *means, error, strict=True)
    ]
    return "; ".join(shown)


def main(argv: Sequence[str] | None = None) -> int:
    """Compare and print; return the exit status."""
    parser = argparse.ArgumentParser(description="Compare first states with MiniWorld's.")
    parser.add_argument("folder", type=Path, help="the folder that contains miniworld")
    parser.add_argument("ids", nargs="*", default=list(ROOMS), help="without miniworld-")
    parser.add_argument("--resets", type=whole(0), default=1000, help="first states of each")
    parser.add_argument(
        "--episodes", type=whole(0), default=0, help="episodes with a random policy"
    )
    options = parser.parse_args(argv)
    load(options.folder)
    ids = options.ids
    failed = [compared(name, options.resets, len(ids)) for name in ids if options.resets]
    for name in ids if options.episodes else ():
        print(f"{name}: random policy: {by_chance(name, options.episodes)}", flush=True)
    return int(any(failed))


if __name__ == "__main__":
    run_command(main)
