"""The flag `--suite`: train and test on the tasks of the benchmark."""

from __future__ import annotations

import argparse
import dataclasses
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import suite
from ..comparison import difference, score_interval
from ..errors import SettingError
from ..evaluation import evaluate, evaluate_player
from ..files import name_of
from ..intervals import mean_interval
from ..players import player_of
from ..progress import Progress
from ..results import Results
from ..settings import MAP_TEXTS, environment_options
from .arguments import UsageError, flag_of
from .listing import between, format_table
from .opening import baselines, print_warning, printing_warnings
from .own_policy import is_own, load_own

if TYPE_CHECKING:
    from ..baselines.runs.experiment import Experiment
    from ..baselines.runs.trained import Trained


def tasks_of(name: str | None, ids: Sequence[str] | None) -> tuple[suite.Task, ...]:
    """The tasks that --tasks names, or else all, in the order of the benchmark.

    Args:
        name: the value of --suite.
        ids: the value of --tasks.

    Raises:
        UsageError: there is --tasks, but no --suite.
        SettingError: a task does not exist.
    """
    if ids is None:
        return suite.TASKS
    if name is None:
        raise UsageError("jaxenstein: --tasks needs --suite; use --env for a single environment")
    wanted = [suite.task_of(id) for id in ids]
    return tuple(task for task in suite.TASKS if task in wanted)


def planned(
    name: str, tasks: Sequence[suite.Task], given: dict[str, Any], budget: float
) -> dict[str, Experiment]:
    """The trainings of a suite, by task.

    Args:
        name: the name of the suite.
        tasks: its tasks to train on.
        given: the options from the config file and the flags.
        budget: factor on the number of decisions of each agent.

    Raises:
        UsageError: `given` has an option that the suite fixes.
        JAXensteinError: an option has a wrong value.
    """
    chosen = suite.suite_of(name)
    fixed = {*environment_options(), *MAP_TEXTS, "total_steps", "grid"} & {*given}
    if fixed:
        flags = ", ".join(map(flag_of, sorted(fixed)))
        raise UsageError(
            f"jaxenstein train: --suite does not accept {flags}, as a flag or in a config"
            + ("; --budget X multiplies the decisions" * ("total_steps" in fixed))
        )
    resolve = baselines("options").resolve
    common = {
        "recipe": "long",
        "seeds": suite.SEEDS,
        **given,
        "total_steps": round(chosen.total_steps * budget),
    }
    try:
        return {task.id: resolve({**common, **chosen.options(task)}) for task in tasks}
    except SettingError as error:
        if str(error).startswith("total_steps"):
            raise SettingError(f"--budget {budget:g}: {error}") from error
        raise


def evaluated(
    options: argparse.Namespace, tasks: Sequence[suite.Task]
) -> Iterator[tuple[suite.Task, Results]]:
    """Test an agent on one task after the other.

    Args:
        options: the arguments of `evaluate`: `suite`, `folder` or `policy`, `episodes` and `seed`.
        tasks: the tasks.

    Raises:
        SettingError: a run is missing or was trained in another environment, or the policy does
            not suit a task.
    """
    chosen = suite.suite_of(options.suite)
    own = options.policy is not None
    play = _policy(options, tasks) if own else _runs(options.folder, chosen, tasks)
    for task in tasks:
        with Progress(options.episodes, task.id, unit="episodes", compiles=True) as progress:

            def notify(part: float, progress: Progress = progress) -> None:
                progress.update(part * options.episodes)

            yield task, play(task, options.episodes, options.seed, notify)


Play = Callable[[suite.Task, int, int, Callable[[float], object]], Results]


def _policy(options: argparse.Namespace, tasks: Sequence[suite.Task]) -> Play:
    """Test the user's own policy, or a scripted player, after a check of it on all tasks."""
    made = {task.id: suite.make(task.id, options.suite, test=True) for task in tasks}
    own = {}
    for id, (env, params) in made.items():
        if is_own(options.policy):
            own[id] = load_own(options.policy, env, params, options.name)
        else:
            player_of(env, options.policy)

    def play(task: suite.Task, episodes: int, seed: int, notify: Any) -> Results:
        env, params = made[task.id]

        def part(done: float) -> None:
            notify(done / episodes)

        if not own:
            results = evaluate_player(env, params, options.policy, episodes, seed)
            notify(1.0)
            return results
        mine = own[task.id]
        told = mine.policy, mine.carry, episodes, seed, mine.name
        return evaluate(env, params, *told, notify=part)

    return play


def trained_on(task: suite.Task, folder: Path, chosen: suite.Suite) -> Trained:
    """The agents of one task in a folder of `jaxenstein train --suite`, on its test levels.

    Raises:
        SettingError: the run is missing, or was trained in another environment.
    """
    path = folder / task.id
    with printing_warnings():
        trained = baselines("agents").load_trained(path)
        for run in range(len(trained.experiment.runs)):
            trained.warn(run)
    about = trained.experiment
    if about.grid:
        varied = ", ".join(name for name, _ in about.grid)
        raise SettingError(
            f"{path} has a grid of {varied}: the agents of the benchmark differ only in their seed"
        )
    if fault := difference(chosen.spec(task), about.environment):
        raise SettingError(
            f"{path}: {fault[0]} is {fault[2]}, but {fault[1]} in the {chosen.name} suite"
        )
    tested = dataclasses.replace(about, environment=chosen.spec(task, test=True))
    return dataclasses.replace(trained, experiment=tested, name=name_of(folder))


def _runs(folder: Path, chosen: suite.Suite, tasks: Sequence[suite.Task]) -> Play:
    """Test the agents of `jaxenstein train --suite`."""
    agents, config = baselines("agents"), baselines("folder").CONFIG
    if missing := [task.id for task in tasks if not os.path.exists(folder / task.id / config)]:
        if not any(os.path.exists(folder / task.id / config) for task in suite.TASKS):
            raise SettingError(f"{folder} is not a folder of 'jaxenstein train --suite'")
        raise SettingError(
            f"{folder} has no run of {', '.join(missing)}: repeat the command 'jaxenstein train "
            "--suite' with --resume, or name other tasks with --tasks"
        )
    found = {task.id: trained_on(task, folder, chosen) for task in tasks}
    budgets = {
        id: trained.update
        - trained.experiment.config.replace(total_steps=chosen.total_steps).updates
        for id, trained in found.items()
    }
    for amount, ids in (
        ("fewer", [id for id, excess in budgets.items() if excess < 0]),
        ("more", [id for id, excess in budgets.items() if excess > 0]),
    ):
        if ids:
            print_warning(
                f"agents in {folder} were trained for {amount} than the benchmark's "
                f"{chosen.total_steps:,} decisions: {', '.join(ids)}"
            )

    def play(task: suite.Task, episodes: int, seed: int, notify: Any) -> Results:
        trained = found[task.id]
        total = episodes * len(trained.experiment.runs)
        return agents.evaluate(
            trained, episodes=episodes, seed=seed, notify=lambda done: notify(done / total)
        )

    return play


def table(results: list[tuple[suite.Task, Results]]) -> str:
    """A table of the means of all tasks with their intervals."""
    reference = suite.references()
    rows = [("TASK", "RETURN", "95 %", "SUCCESS", "STEPS", "RANDOM", "EXPERT", "SCORE", "95 %")]
    for task, result in results:
        earned, ends = mean_interval(result.returns), reference[task.id]
        score = score_interval(earned, ends)
        rows.append(
            (
                task.id,
                f"{earned.mean:.4g}",
                between(earned, ".4g"),
                f"{result.successes.mean():.1%}",
                f"{result.lengths.mean():.4g}",
                f"{ends.random:.4g}",
                f"{ends.expert:.4g}",
                f"{score.mean:z.3f}",
                between(score, ".3f"),
            )
        )
    return format_table(rows, right=range(1, len(rows[0])))
