"""The ids of the mazes that come in sizes; importing this imports no task.

The module of a family has a function `build` that takes an id.
"""

from __future__ import annotations

FAMILIES: dict[str, tuple[str, dict[str, str]]] = {
    "dmlab-explore": (
        "explore",
        {
            "dmlab-explore-goal-locations": "DeepMind Lab: a goal to find again in a new maze",
            "dmlab-explore-goal-locations-large": "the same in a larger maze",
            "dmlab-explore-object-locations": "DeepMind Lab: apples to find again in a new maze",
            "dmlab-explore-object-locations-large": "the same in a larger maze",
            "dmlab-explore-object-rewards": "DeepMind Lab: which objects pay in this episode",
        },
    ),
    "memory-maze": (
        "memory_maze",
        {
            "memory-maze-9x9": "Memory Maze: fetch 3 things as asked, for 1000 steps",
            "memory-maze-11x11": "Memory Maze: fetch 4 things as asked, for 2000 steps",
            "memory-maze-13x13": "Memory Maze: fetch 5 things as asked, for 3000 steps",
            "memory-maze-15x15": "Memory Maze: fetch 6 things as asked, for 4000 steps",
        },
    ),
}
"""The module of each family, and the summaries of its ids; all are variants of the first one."""
