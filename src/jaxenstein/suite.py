"""The benchmark: a fixed list of tasks, how agents train on them, and how they are compared.

The page "Benchmark" of the documentation has the protocol.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .comparison import Compared, Reference, difference, read_reference
from .errors import SettingError, nearest, quoted
from .fields import Domain, check_value

if TYPE_CHECKING:
    from .environment import AnyEnvironment
    from .spec import Spec

VERSION = 1
"""Grows when a task, a budget or a reference return changes: only equal versions compare."""
SEEDS, EPISODES = 5, 100
"""Training seeds of an algorithm, and test episodes of each agent; actions are sampled."""
REFERENCES = Path(__file__).with_name("suite_references.json")
"""Written by `python -m docs.measured suite`."""


@dataclasses.dataclass(frozen=True)
class Task:
    """A task of the benchmark.

    Attributes:
        id: of the environment.
        version: of the environment.
        ability: what the task tests.
        reason: why the task is in the benchmark, in a sentence.
        frame_skip: steps of the world in one decision.
        small: rows and columns of an image of the small suite.
        split: whether agents train on one part of the levels and are tested on the other.
    """

    id: str
    version: int
    ability: str
    reason: str
    frame_skip: int
    small: tuple[int, int] = (16, 16)
    split: bool = False


@dataclasses.dataclass(frozen=True)
class Suite:
    """A size of the benchmark; both sizes have the same tasks.

    Attributes:
        name: "small", for a core of a processor, or "large", for an accelerator.
        total_steps: decisions of an agent's training, for each task.
        image: rows and columns of every image, or None for those of `Task.small`.
    """

    name: str
    total_steps: int
    image: tuple[int, int] | None

    def options(self, task: Task, *, test: bool = False) -> dict[str, Any]:
        """The options of a task's environment, by their names in configuration files.

        Args:
            task: one of `TASKS`.
            test: whether the agent is tested, not trained.
        """
        height, width = self.image or task.small
        options = {
            "env": task.id,
            "frame_skip": task.frame_skip,
            "height": height,
            "width": width,
        }
        if task.split:
            options["settings"] = {"split": "test" if test else "train"}
        return options

    def spec(self, task: Task, *, test: bool = False) -> Spec:
        """The spec of a task's environment; arguments as in `options`."""
        from .settings import spec_from

        return spec_from(self.options(task, test=test))


TASKS = (
    Task("simple", 0, "exploration", "A reward at the end of a ring, 53 decisions away.", 1),
    Task("key-door", 0, "exploration", "The goal is behind a door whose key is elsewhere.", 1),
    Task(
        "dmlab-static-01",
        0,
        "exploration",
        "A maze of DeepMind Lab with one distant goal, which random walks do not reach.",
        3,
    ),
    Task(
        "doom-my-way-home-sparse",
        0,
        "exploration",
        "ViZDoom's maze from a distant room, the task on which ICM was introduced.",
        4,
        (24, 32),
    ),
    Task("t-maze", 0, "memory", "A cue at the start decides which arm pays at the end.", 3),
    Task(
        "minigrid-memory-s13",
        0,
        "memory",
        "MiniGrid's Memory: compare two objects at the end with one seen at the start.",
        3,
    ),
    Task(
        "memory-maze-9x9",
        0,
        "memory",
        "Memory Maze: remember where things are, for 1,000 decisions.",
        1,
    ),
    Task(
        "key-corridor-s3r3",
        0,
        "generalisation",
        "MiniGrid's KeyCorridor on unseen layouts: find the key, the door and the goal.",
        6,
        split=True,
    ),
    Task(
        "dmlab-explore-goal-locations",
        0,
        "generalisation",
        "DeepMind Lab's mazes, unseen: find a goal, and then find it again.",
        3,
        split=True,
    ),
    Task(
        "doom-health-gathering-supreme",
        0,
        "survival",
        "ViZDoom's acid maze: find medkits and avoid poison.",
        4,
        (24, 32),
    ),
    Task(
        "doom-defend-the-center",
        2,
        "fights",
        "ViZDoom's ring of monsters: turn, aim, and save ammunition.",
        4,
        (24, 32),
    ),
    Task(
        "doom-deadly-corridor",
        1,
        "fights",
        "ViZDoom's corridor of marksmen: fight or run to the armour.",
        4,
        (24, 32),
    ),
)
"""The tasks, in the order of every table."""
SUITES: Mapping[str, Suite] = {
    "small": Suite("small", 3_000_000, None),
    "large": Suite("large", 30_000_000, (64, 64)),
}


def suite_of(name: str) -> Suite:
    """The suite of a name.

    Raises:
        SettingError: there is no suite of this name.
    """
    check_value("suite", Domain("choice", choices=tuple(SUITES)), name)
    return SUITES[name]


def make(id: str, suite: str = "small", *, test: bool = False) -> tuple[AnyEnvironment, Any]:
    """Make the environment of a task as the benchmark fixes it.

    Args:
        id: of a task, such as "t-maze".
        suite: "small" or "large".
        test: whether the agent is tested, not trained: tasks of generalisation then have levels
            that training never draws.

    Returns:
        The environment, without automatic resets, and its params.

    Raises:
        SettingError: there is no such task or suite.

    Examples:
        >>> from jaxenstein import suite
        >>> env, params = suite.make("t-maze")
        >>> env.height, env.width, env.frame_skip
        (16, 16, 3)
    """
    return suite_of(suite).spec(task_of(id), test=test).build()


def task_of(id: str) -> Task:
    """The task of an id.

    Raises:
        SettingError: no task has this id.
    """
    tasks = {task.id: task for task in TASKS}
    if id not in tasks:
        raise SettingError(
            f"the benchmark has no task {quoted(id)}{nearest(id, tasks)}; it has {', '.join(tasks)}"
        )
    return tasks[id]


def references() -> dict[str, Reference]:
    """The returns of the random player and the expert, by task."""
    return read_reference(REFERENCES)


def reference_rows() -> dict[str, dict[str, Any]]:
    """As `references`, with their standard errors, episodes, and the names of the experts."""
    return json.loads(REFERENCES.read_text("utf-8"))


def check_compared(compared: Compared, suite: str) -> Compared:
    """Check that results are those of the benchmark, and put the tasks in its order.

    Args:
        compared: as `jaxenstein.comparison.gather` returns it.
        suite: "small" or "large".

    Raises:
        SettingError: a task is missing, is not in the benchmark, or has another version, setting
            or param.
    """
    chosen = suite_of(suite)
    ordered: Compared = {}
    for policy, mine in compared.items():
        if missing := [task.id for task in TASKS if task.id not in mine]:
            raise SettingError(
                f"{policy} has no results of {', '.join(missing)}: a score of the benchmark needs "
                "all tasks; give --reference FILE to score a part of them"
            )
        for id, results in mine.items():
            spec = chosen.spec(task_of(id), test=True)
            if fault := difference(spec, results.environment):
                raise SettingError(
                    f"{policy} on {id}: {fault[0]} is {fault[2]}, and {fault[1]} in the {suite} "
                    f"suite; jaxenstein.suite.make({id!r}, {suite!r}, test=True) makes it"
                )
        ordered[policy] = {task.id: mine[task.id] for task in TASKS}
    return ordered
