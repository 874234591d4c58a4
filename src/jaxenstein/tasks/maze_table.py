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
            "dmlab-explore-obstructed-goals": "DeepMind Lab: a goal behind doors, some closed",
            "dmlab-explore-obstructed-goals-large": "the same in a larger maze",
            "dmlab-explore-object-locations": "DeepMind Lab: apples to find again in a new maze",
            "dmlab-explore-object-locations-large": "the same in a larger maze",
            "dmlab-explore-object-rewards": "DeepMind Lab: which objects pay in this episode",
            "dmlab-explore-object-rewards-many": "the same with eight objects a round",
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
    "miniworld": (
        "miniworld.table",
        {
            "miniworld-hallway": "MiniWorld: a red box at the end of a hall",
            "miniworld-one-room": "MiniWorld: a red box anywhere in a room",
            "miniworld-one-room-s6": "the same in a small room",
            "miniworld-one-room-s6-fast": "the same with long steps",
            "miniworld-four-rooms": "MiniWorld: a red box in one of four rooms",
            "miniworld-t-maze": "MiniWorld: a red box at one end of a T",
            "miniworld-t-maze-left": "the same, always at the left end",
            "miniworld-t-maze-right": "the same, always at the right end",
            "miniworld-wall-gap": "MiniWorld: a red box behind a gap in a wall",
            "miniworld-sidewalk": "MiniWorld: a red box along a street that ends the episode",
            "miniworld-maze": "MiniWorld: a red box in a maze of 8 by 8 cells, new each time",
            "miniworld-maze-s2": "the same in 2 by 2 cells",
            "miniworld-maze-s3": "the same in 3 by 3 cells",
            "miniworld-maze-s3-fast": "the same with long steps",
        },
    ),
    "miniworld-objects": (
        "miniworld.table",
        {
            "miniworld-collect-health": "MiniWorld: pick up medkits to stay alive",
            "miniworld-pickup-objects": "MiniWorld: pick up five things",
            "miniworld-put-next": "MiniWorld: put the red box down beside the yellow one",
            "miniworld-sign": "MiniWorld: a sign out of sight tells which thing to go to",
        },
    ),
}
"""The module of each family, and the summaries of its ids; all are variants of the first one."""
