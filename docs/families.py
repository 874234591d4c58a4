"""Which environments share a page of the site, and what its first paragraphs say."""

from __future__ import annotations

from typing import NamedTuple

from jaxenstein.catalogue import ENTRIES


class Family(NamedTuple):
    """Environments that are sizes or variants of one task.

    Attributes:
        name: of the page.
        title: its heading.
        original: the word by which a heading of docs/fidelity.md names the task.
        text: what they are, in Markdown.
    """

    name: str
    title: str
    original: str
    text: str

    @property
    def ids(self) -> tuple[str, ...]:
        """The environments, in the order of the catalogue."""
        return tuple(name for name, entry in ENTRIES.items() if entry.family == self.name)


FAMILIES = (
    Family(
        "simple",
        "simple, a ring corridor",
        "simple",
        """
The first thing to try: a ring corridor around a block. The agent starts in the north-western
corner and faces east, the goal lies in the opposite corner, and both ways are equally long. A
learner that cannot do this has a bug.
""",
    ),
    Family(
        "key-door",
        "key-door, first the key",
        "key-door",
        """
A corridor from west to east with a red key, a red locked door and the goal behind the door. The
agent picks the key up by walking over it and opens the door with the action *interact* where it
is right in front. Only the goal pays, so the order of things has to be found out by exploring.
""",
    ),
    Family(
        "my-way-home",
        "my-way-home and its variants",
        "my-way-home",
        """
The maze of ViZDoom's scenario *My Way Home*: eight rooms of different colours, brick corridors
between them, and an armour as the goal, which is drawn as a star here. The dense variant starts at
one of 17 spots with any heading; the sparse ones start far from the goal, which is what work on
exploration uses. Each step costs a little, so a faster way pays more.
""",
    ),
    Family(
        "health-gathering",
        "health-gathering, an acid floor",
        "health-gathering",
        """
ViZDoom's *Health Gathering*: the floor of a square room hurts, and medkits, which appear at random
places, give health back. The reward is for staying alive. The picture does not show the health;
`info["health"]` does, and `observation="dict"` or `hud=True` let the agent see it.
""",
    ),
    Family(
        "key-corridor",
        "key-corridor in six sizes",
        "key-corridor",
        """
MiniGrid's *KeyCorridor* seen from inside. A hall runs from north to south with rooms on both
sides. The goal is in a locked room in the east, the key of the door's colour in a room in the
west, and the doors between the rooms have to be opened on the way. Rooms, doors, colours and
starts are drawn anew at each reset by the rules of the original, in the compiled program;
`layout_seed=N` freezes one layout. The ids are sizes: `sSrR` has rooms of S tiles in R rows.
""",
    ),
    Family(
        "dmlab-static",
        "dmlab-static, a goal that stays",
        "dmlab",
        """
DeepMind Lab's navigation mazes `nav_maze_static_01` to `03`, converted from their map files. The
walls have colours by side, and pictures that occur once are colours of their own: landmarks. The
goal is always at the same place, and an episode begins at any of the map's starts.

The plain ids end at the goal. Those with `-respawn` have the rules of the original's level
script: the goal pays and moves the agent to a new start, apples lie on the way, and only time ends
the episode, so the return says how often the way was found.
""",
    ),
    Family(
        "dmlab-random-goal",
        "dmlab-random-goal, a goal to find again",
        "dmlab",
        """
DeepMind Lab's navigation mazes `nav_maze_random_goal_01` to `03`. The goal is in another cell in
every episode, and the start at least five cells from it on foot: knowing the maze helps, knowing
the way does not.

The plain ids end at the goal. With `-respawn` the goal pays, stays where it is for the episode, and
moves the agent to a new start, so a memory of where it was is worth much.
""",
    ),
)
