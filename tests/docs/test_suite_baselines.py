"""The baselines of the benchmark: their curves, their figures, and the command that adds them."""

from __future__ import annotations

import dataclasses
import itertools
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("flax")
pytest.importorskip("matplotlib")

from docs import measured, other_pages, suite_baselines
from jaxenstein import suite
from jaxenstein.cli import main
from jaxenstein.cli.arguments import flag_of
from jaxenstein.comparison import run_returns, run_scores
from jaxenstein.intervals import mean_interval
from jaxenstein.results import read_results, write_results
from jaxenstein.scores import Estimate, aggregates, normalised, probability_of_improvement

PAGE = "<!-- suite tasks -->\n<!-- end -->\n<!-- suite baselines -->\n<!-- end -->\n"


def test_the_curves_belong_to_the_results() -> None:
    curves, partial = suite_baselines.stored_curves(), suite_baselines.partial_results()
    shipped = suite.BASELINES / f"{suite_baselines.SIZE}-{suite.VERSION}"
    assert [*curves] == sorted([*(path.stem for path in shipped.glob("*")), *partial])
    assert not {*partial} & {path.stem for path in shipped.glob("*")}
    for results in partial.values():
        assert suite.departures(results.values()) == []
    for algo, tasks in curves.items():
        expected = partial.get(algo, [task.id for task in suite.TASKS])
        assert [*tasks] == [*expected], algo
        for curve in tasks.values():
            assert np.shape(curve["returns"]) == (suite.SEEDS, len(curve["decisions"])), algo
            assert curve["decisions"][-1] == pytest.approx(3_000_000, rel=0.01)


def test_all_curves_are_seen_in_one_colour_per_algorithm() -> None:
    panels = suite_baselines.training_figure().axes
    for axes in panels:
        low, high = axes.get_ylim()
        scores = np.concatenate([np.asarray(line.get_ydata()) for line in axes.lines])
        assert ((low < scores) & (scores < high)).all()
    colours = {(line.get_label(), line.get_color()) for axes in panels for line in axes.lines}
    assert len(colours) == len(suite_baselines.stored_curves())


def test_the_page_says_what_was_measured() -> None:
    page = " ".join((suite_baselines.HERE / "suite.md").read_text("utf-8").split())
    shipped = suite.baselines()
    ours = {name.partition(" ")[0].lower(): mine for name, mine in shipped.items()}
    ours |= suite_baselines.partial_results()
    words = ("none", "one", "two", "three", "four", "five")

    def solved(algo: str, task: str, share: float = 0.95) -> str:
        reached = ours[algo][task].successes.mean(axis=1)
        assert ((reached < 0.05) | (reached > share)).all()
        return words[(reached > share).sum()]

    both = ("simple", "key-door")
    (rnd_solves,) = {solved("rnd", task) for task in both}
    others = (" and ".join(solved(algo, task) for task in both) for algo in ("icm", "ppo", "e3b"))
    assert (
        "RND solves `simple` and `key-door` with {} agents of five each, ICM with {}, PPO with {}, "
        "E3B with {}."
    ).format(rnd_solves, *others) in page
    for task, share, told in (
        ("dmlab-static-01", 0.95, "Only E3B learns `dmlab-static-01`, with all {}."),
        ("key-corridor-s3r3", 0.8, "only E3B learns `key-corridor-s3r3`, with {} agents of five."),
    ):
        assert {solved(algo, task) for algo in ("icm", "ppo", "rnd")} == {"none"}
        assert told.format(solved("e3b", task, share)) in page
    avoid = {algo: (~mine["t-maze"].returns.any(axis=1)).sum() for algo, mine in ours.items()}
    assert avoid == dict.fromkeys(ours, 5) | {"ppo": 4}
    assert "in `t-maze` four agents of PPO and all others avoid both arms." in page
    # A guess earns 0.5 in minigrid-memory-s13.
    ends = suite.references()["minigrid-memory-s13"]
    for mine in ours.values():
        assert mean_interval(mine["minigrid-memory-s13"].returns).low < 0.5
    assert f"no algorithm beats a guess ({normalised(0.5, ends.random, ends.expert):.2f})." in page
    first = ours["ppo"]["doom-deadly-corridor"].returns[0]
    assert all((mine["doom-deadly-corridor"].returns == first).all() for mine in shipped.values())
    assert "in `doom-deadly-corridor` all agents act alike" in page
    for pair in itertools.combinations(shipped.values(), 2):
        chance = probability_of_improvement(*map(run_returns, pair))
        assert chance.low < 0.5 < chance.high
    assert "about half of the pairs of runs favour each, with ties counted half." in page


def test_only_one_pair_of_intervals_is_apart() -> None:
    found: dict[str, dict[str, Estimate]] = {}
    for name, mine in suite.baselines().items():
        scores = dict(zip(mine, run_scores(mine, suite.references()), strict=True))
        for ability in ("all", *{task.ability for task in suite.TASKS}):
            part = [
                runs
                for task, runs in scores.items()
                if ability in ("all", suite.task_of(task).ability)
            ]
            found.setdefault(ability, {})[name] = aggregates(part)["interquartile_mean"]
    apart = [
        (ability, one, other)
        for ability, means in found.items()
        for one, other in itertools.permutations(means, 2)
        if means[one].high < means[other].low
    ]
    assert apart == [("exploration", "PPO (baseline)", "RND (baseline)")]


@pytest.mark.slow
@pytest.mark.usefixtures("plain_frames")
def test_an_algorithm_is_added_from_its_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only this test runs the whole command."""
    small = dataclasses.replace(suite.SUITES["small"], total_steps=256)
    monkeypatch.setattr(suite, "TASKS", tuple(map(suite.task_of, ("t-maze", "simple"))))
    monkeypatch.setattr(suite, "SUITES", {"small": small})
    monkeypatch.setattr(suite, "SEEDS", 2)
    monkeypatch.setattr(suite, "EPISODES", 100)
    monkeypatch.chdir(tmp_path)
    for module, name in (
        (suite, "BASELINES"),
        (suite_baselines, "CURVES"),
        (suite_baselines, "PARTIAL"),
        (suite_baselines, "IMAGES"),
    ):
        monkeypatch.setattr(module, name, tmp_path / name.lower())
        (tmp_path / name.lower()).mkdir()
    page = tmp_path / "suite.md"
    page.write_text(PAGE)
    monkeypatch.setattr(measured, "SUITE", page)
    sizes = {"num_envs": 4, "rollout": 32, "minibatches": 2, "features": 8, "hidden": 8, "head": 8}
    flags = [f"{flag_of(name)}={value}" for name, value in sizes.items()]
    train = ["train", "--suite", "--algo", "e3b", *flags]
    planned = suite_baselines.planned
    monkeypatch.setattr(
        suite_baselines, "planned", lambda size, given, budget: planned(size, given | sizes, budget)
    )
    assert main([*train, "--out", "runs"]) == 0
    # With one task of two.
    shutil.copytree("runs", "part", ignore=lambda *_: ["simple"])
    suite_baselines.add(Path("part"))
    assert [*suite_baselines.partial_results()["e3b"]] == ["t-maze"]
    measured.main(["baselines", "runs"])
    assert not suite_baselines.partial_results()
    results = read_results("baselines/small-1/e3b.json")
    assert [one.returns.shape for one in results] == [(2, 100)] * 2
    for one in results:
        ends = suite.references()[str(one.environment.id)]
        score = float(normalised(one.returns.mean(), ends.random, ends.expert))
        assert f"| `{one.environment.id}` | {round(score, 2) + 0.0:.2f} (" in page.read_text()
    curves = json.loads(Path("curves/e3b.json").read_text())
    assert curves["simple"]["decisions"] == [128, 256]
    assert {path.name for path in Path("images").iterdir()} == {
        "suite-profiles.png",
        "suite-training.png",
    }
    write_results("partial/icm.json", results[:1])
    told = other_pages.suite_baselines()
    assert re.search(r"\| `t-maze` (\|[^|]+){2}\|\n\| `simple` \|[^|]+\|  \|\n", told)
    assert re.search(r"\| all \|[^|]+\|  \|\n", told)
    # Half of the decisions.
    assert main([*train, "--out", "short", "--budget", "0.5"]) == 0
    with pytest.raises(SystemExit, match=r"short.t-maze was not trained by .* its config differs"):
        measured.main(["baselines", "short"])
