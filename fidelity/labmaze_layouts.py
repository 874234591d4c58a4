"""Compare the statistics of labmaze's random mazes and ours.

    python -m fidelity.labmaze_layouts [--mazes N] [--plans memory-9 ...]

Needs the package labmaze. It also checks the rules in each of our mazes: rooms are rectangles of
allowed sizes, and all cells are connected. `--null` compares labmaze with itself with another seed.
The exit status is 1 if one of our mazes breaks a rule, or if a table differs by more than chance
explains (5 % for all tables together).
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Sequence

import numpy as np

from fidelity.commands import run_command
from fidelity.frequencies import Observation, chances
from jaxenstein.cli.arguments import whole
from jaxenstein.maps.reach import flood
from jaxenstein.tasks.random_maze import MazePlan

PLANS = {
    "memory-9": MazePlan(11, 6),
    "memory-11": MazePlan(13, 6),
    "memory-13": MazePlan(15, 6),
    "memory-15": MazePlan(17, 9, most=3),
    "explore-small": MazePlan(11, 4),
}
"""Memory Maze's sizes, and the small size of DeepMind Lab; its large size is memory-15."""
SIGNIFICANCE = 0.05
Maze = tuple[np.ndarray, np.ndarray]
"""bool[N, N], open cells; int[N, N], the room number of each cell, or 0."""


def labmaze_mazes(plan: MazePlan, count: int, seed: int) -> list[Maze]:
    """Mazes of the original."""
    import labmaze  # pyright: ignore[reportMissingImports]

    maze = labmaze.RandomMaze(
        height=plan.size,
        width=plan.size,
        max_rooms=plan.rooms,
        room_min_size=plan.least,
        room_max_size=plan.most,
        simplify=True,
        random_seed=seed + 1,
    )
    found = []
    for _ in range(count):
        maze.regenerate()
        letters = np.array(maze.variations_layer)
        room = np.where(letters == ".", 0, letters.view(np.int32) - ord("A") + 1)
        found.append((np.array(maze.entity_layer) == " ", room))
    return found


def our_mazes(plan: MazePlan, count: int, seed: int) -> list[Maze]:
    """Mazes of this project."""
    import jax

    from jaxenstein.tasks.random_maze import sample_maze

    keys = jax.random.split(jax.random.key(seed), count)
    mazes = jax.device_get(jax.jit(jax.vmap(lambda key: sample_maze(key, plan)))(keys))
    return list(zip(mazes.open, mazes.room, strict=True))


def broken_rules(maze: Maze, plan: MazePlan) -> list[str]:
    """The rules that a maze breaks."""
    paved, room = maze
    border = np.concatenate([paved[0], paved[-1], paved[:, 0], paved[:, -1]])
    broken = ["open border"] if border.any() else []
    numbers = np.unique(room[room > 0])
    if not (0 < len(numbers) <= plan.rooms and (numbers == np.arange(len(numbers)) + 1).all()):
        broken.append("numbers of rooms")
    for number in numbers:
        rows, columns = np.nonzero(room == number)
        height, width = np.ptp(rows) + 1, np.ptp(columns) + 1
        if len(rows) != height * width or not paved[rows, columns].all():
            broken.append("room is no rectangle")
        if not {height, width} <= set(range(plan.least, plan.most + 1, 2)):
            broken.append("size of a room")
        if not (rows.min() % 2 and columns.min() % 2):
            broken.append("place of a room")
    row, column = np.argwhere(paved)[0].tolist()
    if (flood(paved, [(column, row)]) != paved).any():
        broken.append("parts apart")
    return broken


def observe(maze: Maze) -> Observation:
    """The categories of a maze in each table."""
    paved, room = maze
    wide = np.pad(paved, 1)
    rolled = [np.roll(wide, s, a)[1:-1, 1:-1] for s in (1, -1) for a in (0, 1)]
    ways = np.sum(rolled, axis=0)
    corridor = paved & (room == 0)
    around = np.pad(room, 1)
    beside = [np.roll(around, s, a)[1:-1, 1:-1] for s in (1, -1) for a in (0, 1)]
    near = np.sum([one > 0 for one in beside], axis=0)
    shapes = []
    for number in np.unique(room[room > 0]):
        rows, columns = np.nonzero(room == number)
        shapes.append(f"{np.ptp(rows) + 1}x{np.ptp(columns) + 1}")
    rows, columns = np.nonzero(paved)
    quarter, middle = paved.sum() // 4, len(room) // 2
    return {
        "rooms": [str(len(shapes))],
        "shapes": shapes,
        "open cells": [str(4 * quarter)],
        "dead ends": [str(int((paved & (ways == 1)).sum()))],
        "ways on from corridors": [str(n) for n in ways[corridor]],
        "doorways between rooms": [str(int((corridor & (near >= 2)).sum()))],
        "ends of corridors": [str(int((corridor & (near == 1)).sum()))],
        "rows": [str(row) for row in np.nonzero(corridor)[0]],
        "columns": [str(column) for column in np.nonzero(corridor)[1]],
        "detours": [str(_detours(corridor))],
        "middle": [str(int(room[middle, middle] > 0) + 2 * int(corridor[middle, middle]))],
    }


def _detours(corridor: np.ndarray) -> int:
    """The number of wall cells with corridors around three of their sides."""
    wide = np.pad(corridor, 1)
    count = 0
    for turns in range(4):
        view = np.rot90(wide, turns)
        ring = view[:-2, :-2] & view[:-2, 1:-1] & view[:-2, 2:] & view[1:-1, :-2] & view[1:-1, 2:]
        count += int((ring & ~view[1:-1, 1:-1]).sum())
    return count


def main(argv: Sequence[str] | None = None) -> int:
    """Compare and print; return the exit status."""
    arguments = _parser().parse_args(argv)
    title, draw = ("labmaze again", labmaze_mazes) if arguments.null else ("ours", our_mazes)
    failed = False
    for name in arguments.plans:
        plan, count = PLANS[name], arguments.mazes
        theirs = labmaze_mazes(plan, count, arguments.seed)
        ours = draw(plan, count, arguments.seed + 1)
        found = chances([observe(maze) for maze in theirs], [observe(maze) for maze in ours])
        print(f"\n## {name}: labmaze and {title}, {count} each\n")
        for side, mazes in (("labmaze", theirs), (title, ours)):
            print(f"{side}: {_summary(mazes)}")
        print("\n| table | p-value |\n|---|---:|")
        print("\n".join(f"| {table} | {chance:.3f} |" for table, chance in found.items()))
        broken = Counter(rule for maze in ours for rule in broken_rules(maze, plan))
        print(f"\nrules broken by {title}: {dict(broken) or 'none'}")
        limit = SIGNIFICANCE / len(found) / len(arguments.plans)
        beyond = [table for table, chance in found.items() if chance < limit]
        print(f"\ntables beyond chance (p < {limit:.4f}): {', '.join(beyond) or 'none'}")
        failed |= bool(beyond or broken)
    return int(failed)


def _summary(mazes: list[Maze]) -> str:
    """Mean numbers of rooms and open cells, and the distribution of the number of rooms."""
    rooms = np.array([room.max() for _, room in mazes])
    cells = np.mean([paved.sum() for paved, _ in mazes])
    counts = ", ".join(f"{n}: {(rooms == n).mean():.1%}" for n in np.unique(rooms))
    return f"{rooms.mean():.2f} rooms ({counts}), {cells:.1f} open cells"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Compare random mazes with labmaze's.")
    parser.add_argument("--mazes", type=whole(), default=1000, help="mazes of each (default 1000)")
    parser.add_argument("--plans", nargs="+", choices=PLANS, default=list(PLANS), metavar="PLAN")
    parser.add_argument(
        "--seed", type=whole(0), default=0, help="seed of labmaze; the other uses the next seed"
    )
    parser.add_argument("--null", action="store_true", help="compare labmaze with itself")
    return parser


if __name__ == "__main__":
    run_command(main)
