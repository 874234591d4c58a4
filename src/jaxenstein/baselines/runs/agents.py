"""Loads, exports and evaluates trained agents."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import jax
import numpy as np

from ...errors import SettingError, quoted
from ...evaluation import episodes_done
from ...fields import Domain, check_seed, check_value, check_whole, is_whole
from ...files import check_apart, check_writable
from ...params import split_ranges
from ...results import GAME, Results
from ...seeds import key_of
from ..divergence import METRIC
from .folder import RunFolder, run_names
from .metrics import METRICS, read_metrics, rows_by_run
from .policies import TrainedPolicy
from .programs import check_program, write_program
from .trained import SUFFIX, Trained, Weights, load_trained, score_of, write_trained

Notify = Callable[[float], object]
WAYS = {"greedy": True, "sampled": False}
"""The kinds of actions, and whether they are the most likely ones."""


def load_policy(path: str | Path, run: int | None = None, *, greedy: bool = False) -> TrainedPolicy:
    """Load an agent from the newest checkpoint of a run directory, or from a file.

    Args:
        path: a run directory, a file from `export_policy`, or `pretrained/NAME` for an agent of
            this package; `jaxenstein list --pretrained` names them.
        run: number of the run, from 0, in the order of grid points and seeds; None: the best run.
        greedy: take the most likely action instead of sampling one.

    Raises:
        SettingError: there is no such run or agent, or it cannot be read.

    Warns:
        DivergenceWarning: the run diverged; the agent has its last finite parameters.
    """
    trained = load_trained(path)
    chosen = chosen_run(trained, run)
    trained.warn(chosen)
    return TrainedPolicy(trained, chosen, greedy)


def export_policy(
    path: str | Path,
    out: str | Path,
    run: int | None = None,
    *,
    weights: Weights = "float16",
    episodes: int = 100,
    seed: int = 0,
    program: str | Path | None = None,
    greedy: bool = False,
    notify: Notify = lambda done: None,
) -> dict[str, Results]:
    """Write one agent of a run directory into a file, with its score.

    Args:
        path: as in `load_policy`.
        out: the file to write, which must end in `.npz`.
        run: as in `load_policy`.
        weights: precision of the weights; the score is that of the rounded weights.
        episodes: number of episodes for the score, with greedy and with sampled actions each.
        seed: seed of the evaluation.
        program: a second file, which must end in `.jaxexport`, for the agent as a program that does
            not need this package; `write_program` documents how to call it. None: no program.
        greedy: the program takes the most likely action instead of sampling one.
        notify: called with the number of episodes played so far, of `2 * episodes`.

    Returns:
        The results of the episodes, by `"greedy"` and `"sampled"`.

    Raises:
        SettingError: as in `load_policy`, or an argument is out of range, or a file name has the
            wrong suffix, or a parameter is not finite in `weights`, or the program needs
            flatbuffers and it is not installed.
        OutputError: a file cannot be written.

    Warns:
        DivergenceWarning: as in `load_policy`.
    """
    check_value("weights", Domain("choice", choices=get_args(Weights)), weights)
    check_whole("episodes", episodes, 1)
    check_seed(seed)
    out = Path(out)
    if out.suffix != SUFFIX:
        raise SettingError(f"{out} should end in {SUFFIX}")
    check_apart([out, None if program is None else Path(program)], [path])
    check_writable(out)
    if program is not None:
        check_program(program)
    trained = load_trained(path)
    chosen = chosen_run(trained, run)
    trained.warn(chosen)
    agent = rounded(trained, chosen, weights)
    results = write_with_score(out, agent, weights, episodes=episodes, seed=seed, notify=notify)
    if program is not None:
        write_program(program, TrainedPolicy(agent, 0, greedy))
    return results


def rounded(trained: Trained, run: int, weights: Weights) -> Trained:
    """One of the runs with rounded weights; a `SettingError` if they are not finite."""
    agent = trained.one(run)
    params = jax.tree.map(lambda leaf: leaf.astype(weights).astype(np.float32), agent.params)
    agent = dataclasses.replace(agent, params=params)
    if not agent.finite(0):
        name = run_names(trained.experiment)[run]
        hint = "; weights='float32' can hold them" if trained.finite(run) else ""
        raise SettingError(
            f"{trained.name}: the parameters of {name} are not finite in {weights}{hint}"
        )
    return agent


def write_with_score(out: Path, agent: Trained, weights: Weights, **how: Any) -> dict[str, Results]:
    """Evaluate an agent as `evaluate_both` does, and write it into a file with its score."""
    results = evaluate_both(agent, **how)
    score = {name: score_of(result) for name, result in results.items()}
    write_trained(out, agent, weights, score)
    return results


def chosen_run(trained: Trained, run: int | None) -> int:
    """The given run, or the best one for None; a `SettingError` if there is no such run."""
    if run is None:
        return best_run(trained.folder) if trained.folder else 0
    many = len(trained.experiment.runs)
    if not is_whole(run) or not 0 <= run < many:
        raise SettingError(f"{trained.name} has runs 0 to {many - 1}, not {quoted(run)}")
    return run


def best_run(folder: RunFolder) -> int:
    """The run with the highest mean return over the last tenth of its updates so far.

    Ties go to runs that have not diverged, then to the run with the shortest episodes. Updates
    after a divergence do not count. Without metrics, it is the first run.
    """
    if not os.path.exists(folder.path / METRICS):
        return 0
    by_run = rows_by_run(read_metrics(folder.path), len(folder.experiment.runs))
    last = max(1, len(by_run[0]) // 10)
    diverged = np.array([any(row.get(METRIC) for row in rows) for rows in by_run])
    by_run = [[row for row in rows if not row.get(METRIC)][-last:] for rows in by_run]
    episodes, returns, lengths = (
        np.array([sum(row.get(name) or 0 for row in rows) for rows in by_run])
        for name in ("episodes", "return_sum", "length_sum")
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        returns, lengths = returns / episodes, lengths / episodes
    return int(np.lexsort((lengths, diverged, -np.nan_to_num(returns, nan=-np.inf)))[0])


def evaluate_both(
    trained: Trained, *, episodes: int = 100, seed: int = 0, notify: Notify = lambda done: None
) -> dict[str, Results]:
    """Evaluate with greedy and then with sampled actions; see `evaluate`."""
    half = episodes * len(trained.experiment.runs)
    return {
        name: evaluate(
            trained,
            episodes=episodes,
            seed=seed,
            greedy=greedy,
            notify=lambda done, before=half * number: notify(before + done),
        )
        for number, (name, greedy) in enumerate(WAYS.items())
    }


def evaluate(
    trained: Trained,
    *,
    episodes: int = 100,
    seed: int = 0,
    greedy: bool = False,
    notify: Notify = lambda done: None,
) -> Results:
    """Play whole episodes with the agents of all runs, with the same random numbers.

    Args:
        trained: the networks.
        episodes: number of episodes for each run.
        seed: seed of the random numbers.
        greedy: take the most likely action instead of sampling one.
        notify: called with the number of episodes played so far, over all runs; an unfinished
            episode counts as a fraction, its length over the time limit.
    """
    learner = trained.experiment.learner
    longest = np.asarray(learner.env.most_steps(split_ranges(learner.env_params)[0]))
    played = learner.many.evaluate(
        trained.params,
        key_of(seed),
        episodes,
        greedy,
        lambda running, length: notify(episodes_done(running, length, longest)),
    )
    played = jax.device_get(played)
    arrays = played.episode_return, played.episode_length, played.success
    return _results(trained, trained.name, greedy, seed, *arrays)


def evaluate_in_game(
    trained: Trained,
    *,
    episodes: int = 100,
    seed: int = 0,
    greedy: bool = False,
    notify: Callable[[int], object] = lambda done: None,
) -> Results:
    """Like `evaluate`, but play the scenario of the environment in ViZDoom, by the game's rules.

    Raises:
        SettingError: ViZDoom does not have the scenario.
    """
    from ...adapters.vizdoom import play_game
    from ...adapters.vizdoom_buffers import load_vizdoom

    trained = by_game_rules(trained)
    policies = [TrainedPolicy(trained, run, greedy) for run in range(len(trained.experiment.runs))]
    games = [
        play_game(
            policy.env,
            policy.params,
            policy,
            episodes=episodes,
            seed=seed,
            notify=lambda done, before=number * episodes: notify(before + done),
        )
        for number, policy in enumerate(policies)
    ]
    arrays = (
        np.stack([getattr(game, name) for game in games])
        for name in ("returns", "lengths", "successes")
    )
    results = _results(trained, f"{trained.name} in ViZDoom", greedy, seed, *arrays)
    version = str(getattr(load_vizdoom(), "__version__", "unknown"))
    return dataclasses.replace(results, made_with={**results.made_with, GAME: version})


def by_game_rules(trained: Trained) -> Trained:
    """The same networks with the rewards and rules of the game, and their own time limit."""
    spec = trained.experiment.environment
    kept = {name: value for name, value in spec.params.items() if name == "max_steps_in_episode"}
    about = dataclasses.replace(
        trained.experiment, environment=dataclasses.replace(spec, params=kept)
    )
    return dataclasses.replace(trained, experiment=about)


def _results(trained: Trained, name: str, greedy: bool, seed: int, *arrays: np.ndarray) -> Results:
    returns, lengths, successes = arrays
    return Results(
        environment=trained.experiment.environment,
        policy=name,
        actions="greedy" if greedy else "sampled",
        seed=seed,
        names=tuple(run_names(trained.experiment)),
        returns=returns,
        lengths=lengths,
        successes=successes,
    )
