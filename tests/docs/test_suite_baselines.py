"""The baselines of the benchmark: their curves, their figures, and the command that adds them."""

from __future__ import annotations

import dataclasses
import itertools
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("flax")
pytest.importorskip("matplotlib")

from docs import measured, suite_baselines
from docs.other_pages import CHOSEN_ON, interquartile_means
from jaxenstein import suite
from jaxenstein.cli import main
from jaxenstein.cli.arguments import flag_of
from jaxenstein.comparison import Compared, run_returns
from jaxenstein.intervals import mean_interval
from jaxenstein.results import read_results
from jaxenstein.scores import normalised, probability_of_improvement

PAGE = "<!-- suite tasks -->\n<!-- end -->\n<!-- suite baselines -->\n<!-- end -->\n"


def test_the_curves_belong_to_the_results() -> None:
    curves = suite_baselines.stored_curves()
    shipped = suite.BASELINES / f"{suite_baselines.SIZE}-{suite.VERSION}"
    assert [*curves] == sorted(path.stem for path in shipped.glob("*"))
    for algo, tasks in curves.items():
        assert [*tasks] == [task.id for task in suite.TASKS], algo
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


def our_results() -> Compared:
    """The results of the baselines by algorithm."""
    return {name.partition(" ")[0]: mine for name, mine in suite.baselines().items()}


def the_page() -> str:
    return " ".join((suite_baselines.HERE / "suite.md").read_text("utf-8").split())


def test_the_page_says_what_was_measured() -> None:
    page, ours = the_page(), our_results()
    words = ("none", "one", "two", "three", "four", "five")

    def solved(algo: str, task: str, share: float = 0.95) -> str:
        reached = ours[algo][task].successes.mean(axis=1)
        assert ((reached < 0.05) | (reached > share)).all()
        return words[(reached > share).sum()]

    both = ("simple", "key-door")
    (rnd_solves,) = {solved("RND", task) for task in both}
    others = (" and ".join(solved(algo, task) for task in both) for algo in ("ICM", "PPO", "E3B"))
    assert (
        "RND solves `simple` and `key-door` with {} agents of five each, ICM with {}, PPO with {}, "
        "E3B with {}."
    ).format(rnd_solves, *others) in page
    for task, share, told in (
        ("dmlab-static-01", 0.95, "Only E3B learns `dmlab-static-01`, with all {}"),
        ("key-corridor-s3r3", 0.8, "Only E3B learns `key-corridor-s3r3`, with {} agents of five."),
    ):
        assert {solved(algo, task) for algo in ("ICM", "PPO", "RND")} == {"none"}
        assert told.format(solved("E3B", task, share)) in page
    away = [algo for algo, of in ours.items() if not of["doom-my-way-home-sparse"].successes.any()]
    assert away == ["E3B"]
    assert "only E3B never reaches the goal of `doom-my-way-home-sparse`." in page
    avoid = {algo: (~mine["t-maze"].returns.any(axis=1)).sum() for algo, mine in ours.items()}
    assert avoid == dict.fromkeys(ours, 5) | {"PPO": 4}
    assert "In `t-maze` all agents but one of PPO avoid both arms." in page
    # A guess earns 0.5 in minigrid-memory-s13.
    earned = {algo: mean_interval(of["minigrid-memory-s13"].returns) for algo, of in ours.items()}
    assert all(one.low < 0.5 for one in earned.values())
    assert [algo for algo, one in earned.items() if one.high < 0.5] == ["E3B"]
    ends = suite.references()["minigrid-memory-s13"]
    guess = f"{normalised(0.5, ends.random, ends.expert):.2f}"
    assert f"no algorithm beats a guess ({guess}), and E3B is worse." in page
    played = np.concatenate([of["doom-deadly-corridor"].returns for of in ours.values()])
    alike = (played == played[0]).all(axis=1).sum()
    assert f"{alike} of the {len(played)} agents play all test episodes identically." in page


# Ends of intervals that are closer than this change places with the seed of the bootstrap.
CLOSE = 0.01


def test_the_page_says_which_interquartile_means_are_apart() -> None:
    means = {algo: interquartile_means(mine) for algo, mine in our_results().items()}
    apart, touching = [], []
    for part in means["PPO"]:
        for one, other in itertools.permutations(means, 2):
            gap = means[other][part].low - means[one][part].high
            if gap > CLOSE:
                apart.append((part, one, other))
            elif gap > -CLOSE:
                touching.append((part, one, other))
    assert apart == [
        ("all", "PPO", "E3B"),
        ("exploration", "PPO", "E3B"),
        ("exploration", "PPO", "RND"),
        *(("memory", "E3B", other) for other in ("ICM", "PPO", "RND")),
        *(("generalisation", other, "E3B") for other in ("ICM", "PPO", "RND")),
        ("survival", "ICM", "E3B"),
        ("survival", "RND", "E3B"),
    ]
    assert [pair for pair in touching if pair[0] == "all"] == [("all", "PPO", "RND")]
    page = the_page()
    *first, last = CHOSEN_ON
    assert first == [task.id for task in suite.TASKS[:3]]
    for told in (
        f"We chose its settings on the first three tasks and `{last}`",
        "**Not tuned on**: on the eight tasks on which we did not choose settings, all",
        "**All tasks**: E3B scores above PPO. RND's interval only touches PPO's, and all",
        "**Exploration**: RND and E3B score above PPO.",
        "**Memory**: E3B scores below the others.",
        "**Generalisation**: E3B scores above the others.",
        "**Survival**: E3B scores above ICM and RND.",
    ):
        assert told in page


def test_the_page_says_which_runs_return_more() -> None:
    clear = clear_pairs(our_results())
    assert [*clear] == [("E3B", "ICM"), ("E3B", "PPO")]
    assert (
        f"The probability of improvement of E3B is {clear['E3B', 'PPO']:.0%} over PPO and "
        f"{clear['E3B', 'ICM']:.0%} over ICM (ties count half); the other intervals include 50%."
    ).replace("%", " %") in the_page()
    others = {
        algo: {id: results for id, results in mine.items() if id not in CHOSEN_ON}
        for algo, mine in our_results().items()
    }
    assert not clear_pairs(others)


def clear_pairs(ours: Compared) -> dict[tuple[str, str], float]:
    """The pairs of algorithms of which one returns more, with the probability."""
    returns = {algo: run_returns(mine) for algo, mine in ours.items()}
    clear = {}
    for one, other in itertools.combinations(returns, 2):
        chance = probability_of_improvement(returns[one], returns[other])
        if not chance.low - CLOSE < 0.5 < chance.high + CLOSE:
            clear[one, other] = chance.value
    return clear


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
        suite_baselines,
        "planned",
        lambda size, tasks, given, budget: planned(size, tasks, given | sizes, budget),
    )
    assert main([*train, "--out", "runs"]) == 0
    # With one task of two.
    shutil.copytree("runs", "part", ignore=lambda *_: ["simple"])
    with pytest.raises(SystemExit, match="part has no run of simple"):
        suite_baselines.add(Path("part"))
    measured.main(["baselines", "runs"])
    suite_baselines.add(Path("part"))
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
    # Half of the decisions.
    assert main([*train, "--out", "short", "--budget", "0.5"]) == 0
    with pytest.raises(SystemExit, match=r"short.t-maze was not trained by .* its config differs"):
        measured.main(["baselines", "short"])
