"""The benchmark: a fixed list of tasks, and how agents are trained and compared on them.

The "Benchmark" page of the documentation has the protocol.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from .comparison import Compared, Reference, difference, gather, read_reference, run_scores
from .environment import AnyEnvironment, Autoreset
from .errors import SettingError, nearest, quoted
from .fields import Domain, check_value
from .results import Results
from .scores import Estimate, aggregates
from .settings import spec_from
from .spec import Spec

VERSION = 1
"""Increases when a task, a budget or a reference return changes; compare only equal versions."""
SEEDS, EPISODES = 5, 100
"""Training seeds per algorithm, and test episodes per agent; actions are sampled."""
REFERENCES = Path(__file__).with_name("suite_references.json")
"""Written by `python -m docs.measured suite`."""
BASELINES = Path(__file__).with_name("suite_baselines")
"""Results of our agents, such as small-1/ppo.json for version 1 of the small suite.

Written by `python -m docs.measured baselines RUN`, in the format of `jaxenstein.results`.
"""


@dataclasses.dataclass(frozen=True)
class Task:
    """A task of the benchmark.

    Attributes:
        id: the id of the environment.
        version: the version of the environment.
        ability: the ability that the task tests.
        reason: why the task is in the benchmark, in one sentence.
        frame_skip: world steps per decision.
        small: rows and columns of an image in the small suite.
        split: whether agents train on one set of levels and are tested on another.
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
        name: "small", for one CPU core, or "large", for an accelerator.
        total_steps: decisions per training run on each task.
        image: rows and columns of all images, or None to use `Task.small`.
    """

    name: str
    total_steps: int
    image: tuple[int, int] | None

    def options(self, task: Task, *, test: bool = False) -> dict[str, Any]:
        """The options of a task's environment, by their names in config files.

        Args:
            task: one of `TASKS`.
            test: True for testing an agent, False for training it.
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
        """The spec of a task's environment; the arguments are those of `options`."""
        return spec_from(self.options(task, test=test))


TASKS = (
    Task("simple", 0, "exploration", "A reward at the end of a ring, about 50 decisions away.", 1),
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
        2,
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
    """Look up a suite by name.

    Raises:
        SettingError: the suite does not exist.
    """
    check_value("suite", Domain("choice", choices=tuple(SUITES)), name)
    return SUITES[name]


def make(
    id: str,
    suite: str = "small",
    *,
    test: bool = False,
    autoreset: Autoreset | None = "same-step",
    final_observation: bool = False,
) -> tuple[AnyEnvironment, Any]:
    """Make the environment of a benchmark task.

    Args:
        id: the id of a task, such as "t-maze".
        suite: "small" or "large".
        test: True for testing an agent, False for training it. Tasks that test generalisation
            then use levels that never occur in training.
        autoreset: as in `jaxenstein.make`.
        final_observation: likewise.

    Returns:
        The environment and its params. The environment's `name` is `id`.

    Raises:
        SettingError: the task or suite does not exist, or a setting is wrong.

    Examples:
        >>> from jaxenstein import suite
        >>> env, params = suite.make("t-maze")
        >>> env.height, env.width, env.frame_skip
        (16, 16, 3)
    """
    env, params = suite_of(suite).spec(task_of(id), test=test).build()
    return dataclasses.replace(
        env, autoreset=autoreset, final_observation=final_observation
    ), params


def task_of(id: str) -> Task:
    """Look up a task by its id.

    Raises:
        SettingError: the task does not exist.
    """
    tasks = {task.id: task for task in TASKS}
    if id not in tasks:
        raise SettingError(
            f"the benchmark has no task {quoted(id)}{nearest(id, tasks)}; its tasks are "
            f"{', '.join(tasks)}"
        )
    return tasks[id]


def references() -> dict[str, Reference]:
    """The returns of the random player and the expert, by task."""
    return read_reference(REFERENCES)


def reference_rows() -> dict[str, dict[str, Any]]:
    """As `references`, with standard errors, numbers of episodes, and versions of the tasks."""
    return json.loads(REFERENCES.read_text("utf-8"))


def check_compared(compared: Compared, suite: str) -> Compared:
    """Check that results follow the benchmark, and sort the tasks in its order.

    Args:
        compared: as returned by `jaxenstein.comparison.gather`.
        suite: "small" or "large".

    Raises:
        SettingError: a task does not belong to the benchmark, was played in ViZDoom, or has
            another version, setting or param.
    """
    chosen = suite_of(suite)
    ordered: Compared = {}
    for policy, mine in compared.items():
        for id, results in mine.items():
            if results.in_game:
                raise SettingError(
                    f"{policy} on {id}: these episodes were played in ViZDoom; a benchmark score "
                    "needs episodes in this package's environment"
                )
            spec = chosen.spec(task_of(id), test=True)
            if fault := difference(spec, results.environment):
                raise SettingError(
                    f"{policy} on {id}: {fault[0]} is {fault[2]}, but must be {fault[1]} in the "
                    f"{suite} suite; use jaxenstein.suite.make({id!r}, {suite!r}, test=True)"
                )
        ordered[policy] = {task.id: mine[task.id] for task in TASKS if task.id in mine}
    return ordered


def baselines(suite: str = "small") -> Compared:
    """The results of our agents, which are part of the package.

    Args:
        suite: "small" or "large".

    Returns:
        Results by policy, such as "PPO (baseline)", and then by task.

    Raises:
        SettingError: the suite does not exist or has no baselines, or a file is damaged.
    """
    suite_of(suite)
    files = sorted((BASELINES / f"{suite}-{VERSION}").glob("*.json"))
    if not files:
        raise SettingError(
            f"version {VERSION} of the {suite} suite has no baselines; there are baselines for "
            f"{', '.join(sorted(path.name for path in BASELINES.glob('*-*'))) or 'no suite'}"
        )
    named = [(f"{path.stem.upper()} (baseline)", path) for path in files]
    try:
        return check_compared(gather(named), suite)
    except SettingError as error:
        raise SettingError(f"the baselines of this package are damaged: {error}") from error


def abilities(mine: Mapping[str, Results], *, seed: int = 0) -> dict[str, Estimate]:
    """The interquartile mean of a policy's scores in the tasks of each ability.

    Args:
        mine: the results of the policy by task, as in `baselines`.
        seed: the seed of the bootstrap, as in `jaxenstein.scores.aggregates`.

    Returns:
        By ability, in the order of `TASKS`, except abilities with a missing task.
    """
    parts: dict[str, list[str]] = {}
    for task in TASKS:
        parts.setdefault(task.ability, []).append(task.id)
    ends, found = references(), {}
    for ability, ids in parts.items():
        if {*ids} <= {*mine}:
            scores = run_scores({id: mine[id] for id in ids}, ends)
            found[ability] = aggregates(scores, seed=seed)["interquartile_mean"]
    return found


def departures(results: Iterable[Results]) -> list[str]:
    """How the results of a policy depart from the protocol, in words; empty if they do not."""
    rows = list(results)
    runs, episodes = (min(row.returns.shape[axis] for row in rows) for axis in (0, 1))
    counts = (runs, SEEDS, "training seeds"), (episodes, EPISODES, "test episodes")
    found = [f"{have} of {wanted} {name}" for have, wanted, name in counts if have < wanted]
    if any(row.actions == "greedy" for row in rows):
        found.append("greedy actions instead of sampled ones")
    return found
