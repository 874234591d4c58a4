"""Our agents on the small suite of the benchmark: results, training curves and figures.

The results are part of the package (`jaxenstein.suite.BASELINES`), and the curves are in
docs/suite_curves. `add` writes them for an algorithm; `draw` and the tables only read them.
"""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from docs.page_parts import HERE, each, four_digits
from jaxenstein import suite
from jaxenstein.baselines.runs.agents import evaluate
from jaxenstein.baselines.runs.curves import band, curves_of, new_figure, save_figure
from jaxenstein.baselines.runs.folder import RunFolder
from jaxenstein.cli import main as command
from jaxenstein.cli.suite import planned, trained_on
from jaxenstein.files import atomic, make_folder
from jaxenstein.results import read_results, write_results

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SIZE = "small"
CURVES = HERE / "suite_curves"
IMAGES = HERE / "images" / "results"
# The most points of a curve, and the panels in a row.
POINTS, COLUMNS = 50, 4


def add(folder: Path) -> None:
    """Test the agents of one algorithm, and write their results and curves.

    Args:
        folder: a folder of `jaxenstein train --suite`; if the algorithm has results already, with
            runs for some or all of the tasks.

    Raises:
        SystemExit: the agents do not follow the protocol, or a task is missing.
    """
    tasks = [task for task in suite.TASKS if (folder / task.id).is_dir()]
    about = [RunFolder.open(folder / task.id).experiment for task in tasks]
    if not about:
        raise SystemExit(f"{folder}: no run of a task of the benchmark")
    algo = about[0].config.algo
    usual = planned(SIZE, tasks, {"algo": algo}, 1)
    shipped = make_folder(suite.BASELINES / f"{SIZE}-{suite.VERSION}") / f"{algo}.json"
    results = {}
    if shipped.exists():
        results = {str(one.environment.id): one for one in read_results(shipped)}
    if missing := [task.id for task in suite.TASKS if task not in tasks and task.id not in results]:
        raise SystemExit(f"{folder} has no run of {', '.join(missing)}")
    curves = dict(stored_curves().get(algo, {}))
    for task, run in zip(tasks, about, strict=True):
        path = folder / task.id
        for part in ("config", "hparams", "seeds"):
            if getattr(run, part) != getattr(usual[task.id], part):
                raise SystemExit(
                    f"{path} was not trained by train --suite --algo {algo}: its {part} differs"
                )
        curves[task.id] = _curve(path)
        if curves[task.id]["decisions"][-1] != run.config.updates * run.config.steps_per_update:
            raise SystemExit(f"{path}: the training is not complete")
    for id in each([task.id for task in tasks], "testing"):
        trained = trained_on(suite.task_of(id), folder, suite.SUITES[SIZE])
        named = dataclasses.replace(trained, name=algo)
        results[id] = evaluate(named, episodes=suite.EPISODES)
    ids = [task.id for task in suite.TASKS]
    ordered = [results[id] for id in ids]
    if departures := suite.departures(ordered):
        raise SystemExit(f"{folder} departs from the protocol: {', '.join(departures)}")
    write_results(shipped, ordered)
    lines = ",\n".join(f"{json.dumps(id)}: {json.dumps(curves[id])}" for id in ids)
    with atomic(make_folder(CURVES) / f"{algo}.json") as temporary:
        temporary.write_text(f"{{\n{lines}\n}}\n", "utf-8")


def _curve(run: Path) -> dict[str, Any]:
    """The training of a task: decisions, and a list of mean returns for each seed."""
    (curve,) = curves_of(run, "return", POINTS)
    returns = [[four_digits(value) for value in values] for values in curve.values]
    return {"decisions": curve.at.astype(int).tolist(), "returns": returns}


def stored_curves() -> dict[str, dict[str, Any]]:
    """The curves that `add` has written, by algorithm and task."""
    return {path.stem: json.loads(path.read_text("utf-8")) for path in sorted(CURVES.glob("*"))}


def draw() -> None:
    """Draw the figures of docs/suite.md."""
    profiles, training = (IMAGES / f"suite-{name}.png" for name in ("profiles", "training"))
    if command(["score", "--suite", SIZE, "--baselines", "--plot", str(profiles)]):
        raise SystemExit(1)
    save_figure(training_figure(), [training])


def training_figure() -> Figure:
    """The training curves, a panel for each task: means over seeds with 95 % bands."""
    figure = new_figure(9.6, 6.4)
    panels = figure.subplots(-(-len(suite.TASKS) // COLUMNS), COLUMNS, sharex=True, sharey=True)
    for axes, task in zip(panels.flat, suite.TASKS, strict=False):
        ends = suite.references()[task.id]
        for number, (algo, curves) in enumerate(stored_curves().items()):
            at = np.array(curves[task.id]["decisions"]) / 1e6
            returns = np.array(curves[task.id]["returns"], np.float64)
            # No episode may end in a part of the training.
            there = ~np.isnan(returns).all(axis=0)
            scores = (returns[:, there] - ends.random) / (ends.expert - ends.random)
            mean, low, high = band(scores)
            axes.plot(at[there], mean, label=algo.upper(), color=f"C{number}")
            axes.fill_between(at[there], low, high, color=f"C{number}", alpha=0.2, lw=0)
        axes.set_title(task.id, fontsize="small")
        axes.set_ylim(-0.3, 1.05)
        axes.grid(alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)
    lines = panels.flat[0].get_legend_handles_labels()
    figure.legend(*lines, loc="outside upper center", ncols=len(stored_curves()), frameon=False)
    figure.supxlabel("million decisions", fontsize="medium")
    figure.supylabel("score on the training levels", fontsize="medium")
    return figure
