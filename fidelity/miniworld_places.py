"""MiniWorld's environments and ours, compared by their first states and by what chance gets.

    python -m fidelity.miniworld_places FOLDER [ID ...] [--resets N] [--episodes N]

FOLDER holds MiniWorld's package, `miniworld` (`pip download --no-deps miniworld`, unpacked); its
drawing, which needs OpenGL, is left out. Needs the `gymnasium` extra. Tables are the largest
distances between the cumulated frequencies of one number in both (Kolmogorov and Smirnov's test):
places of starts and boxes; in mazes their cells, the cells with one exit and with three or four,
and the cells on the way to the box; where there are several things, lengths of the shortest ways.
The status is 1 if one is beyond what chance explains (5 % for all tables of all ids together).
With `--episodes`, players who draw every action play as many in both, until the time is up.
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
from jaxenstein.players import UNIFORM, play
from jaxenstein.tasks.miniworld.box_maze import BoxMazeState
from jaxenstein.tasks.miniworld.collect_health import CollectHealthState
from jaxenstein.tasks.miniworld.rooms import BoxState

SIGNIFICANCE = 0.05
# Metres and tiles from one cell of a maze to the next.
PITCHES = 3.25, 4
# Module and class, arguments, and what is to be added to x and z to get our columns and rows.
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
    """A first state: float[2] places in tiles, or in cells of a maze, and what leads where.

    Attributes:
        start: where the agent is.
        heading: radians clockwise from east.
        things: float[n, 2], what is to be reached or taken.
        ways: pairs of cells of a maze between which is no wall, each once.
    """

    start: np.ndarray
    heading: float
    things: np.ndarray
    ways: list[tuple[tuple[int, int], tuple[int, int]]]


def load(folder: Path) -> None:
    """Make the package importable, with nothing behind what draws."""
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
    """Begin an episode that is not over at once, as none of ours is."""
    while True:
        # Which of the things Sign asks for is an argument there.
        env._color_index, env._goal = (int(env.np_random.integers(n)) for n in (3, 2))
        env.reset()
        put = (env.red_box, env.yellow_box) if hasattr(env, "red_box") else None
        boxes = put or ((env.box,) if hasattr(env, "box") and not hasattr(env, "health") else ())
        if not boxes or not env.near(*boxes):
            return


def from_miniworld(name: str, resets: int) -> list[First]:
    """Its first states."""
    env, shift, found = original(name), np.array(ROOMS[name][3]), []
    maze = ROOMS[name][0] == "maze"
    for _ in range(resets):
        restart(env)
        boxes = [env.red_box, env.yellow_box] if name == "put-next" else []
        things = boxes or [e for e in env.entities if e is not env.agent and not e.is_static]
        places = np.array([(e.pos[0], e.pos[2]) for e in (env.agent, *things)]) + shift
        if name == "wall-gap":
            # Yards are half a metre shorter there: 0.4 m is kept from walls, or 0.57 by the box.
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
    """Ours."""
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
            # The tile in the middle of a wall between two cells.
            for row, column in np.argwhere(free[:, 4::4]).tolist():
                if row % 4 == 2:
                    ways.append(((column, row // 4), (column + 1, row // 4)))
            for row, column in np.argwhere(free[4::4]).tolist():
                if column % 4 == 2:
                    ways.append(((column // 4, row), (column // 4, row + 1)))
        found.append(First(start, float(states.heading[i]), things, ways))
    return found


def first_states(name: str, count: int) -> tuple[Any, Any, Any]:
    """Our environment, its params, and first states on the host."""
    env, params = jaxenstein.make(f"miniworld-{name}", height=8, width=8)
    return env, params, jax.device_get(players.first_states(env, params, count, seed=0))


def numbers(name: str, first: First) -> dict[str, float]:
    """What is compared of a first state, by the names of the tables."""
    start, heading, things, ways = first
    found = {"start x": start[0], "start y": start[1], "heading": heading % (2 * math.pi)}
    if name in ("pickup-objects", "put-next"):
        # Things lie in the middle of tiles here.
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
    """Cells that are not in `steps` yet and how many steps away, the nearer ones first."""
    queue = list(steps)
    for cell in queue:
        for one, other in (*ways, *((b, a) for a, b in ways)):
            if one == cell and other not in steps:
                queue.append(other)
                yield other, steps[cell] + 1


def _length(places: Sequence[np.ndarray]) -> float:
    return float(np.hypot(*np.diff(places, axis=0).T).sum())


def distance(one: np.ndarray, other: np.ndarray) -> float:
    """The largest distance between the cumulated frequencies of two samples."""
    every = np.concatenate([one, other])
    shares = [np.searchsorted(np.sort(some), every, "right") / len(some) for some in (one, other)]
    return float(np.abs(shares[0] - shares[1]).max())


def compared(name: str, resets: int, ids: int) -> bool:
    """Compare first states of one of several ids, and print how; whether a table is beyond."""
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
    """Share of solved episodes and mean return of players who draw every action, told for both."""
    ours, params, states = first_states(name, episodes)
    played = play(ours, UNIFORM, params, jax.random.key(2), states)
    env, rng, theirs = original(name), np.random.default_rng(0), []
    for _ in range(episodes):
        restart(env)
        total, over, reward, terminated = 0.0, False, 0.0, False
        while not over:
            # The same actions as here: some of MiniWorld's eight do nothing.
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
    """Compare and print; returns the exit status."""
    parser = argparse.ArgumentParser(description="Compare first states with MiniWorld's.")
    parser.add_argument("folder", type=Path, help="where the folder miniworld is")
    parser.add_argument("ids", nargs="*", default=list(ROOMS), help="without miniworld-")
    parser.add_argument("--resets", type=int, default=1000, help="first states a side")
    parser.add_argument("--episodes", type=int, default=0, help="of players who act by chance")
    options = parser.parse_args(argv)
    load(options.folder)
    ids = options.ids
    failed = [compared(name, options.resets, len(ids)) for name in ids if options.resets]
    for name in ids if options.episodes else ():
        print(f"{name}: by chance {by_chance(name, options.episodes)}", flush=True)
    return int(any(failed))


if __name__ == "__main__":
    raise SystemExit(main())
