"""`jaxenstein score`: tables, files, plots, and refused input."""

from __future__ import annotations

import dataclasses
import io
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from jaxenstein import suite
from jaxenstein.cli import main
from jaxenstein.files import make_folder
from jaxenstein.results import write_results
from tests.reference import statistics
from tests.results_of import results_of, suite_results, write_all

REFERENCE = {"simple": {"random": 0.0, "expert": 1.0}, "t-maze": {"random": -1.0, "expert": 1.0}}
RND = {"simple": [[1.0, 0.5], [1.0, 1.0], [0.0, 0.5]], "t-maze": [[1.0, 0.0], [0.0, -1.0]]}
PPO = {"simple": [[0.5, 0.5], [0.0, 0.0], [0.0, 0.5]], "t-maze": [[1.0, 1.0], [1.0, 0.0]]}


@pytest.fixture
def words(tmp_path: Path) -> list[str]:
    """The arguments for two policies with two tasks each."""
    given = ["score"]
    for policy, tasks in ("rnd", RND), ("ppo", PPO):
        files = {
            f"{task}-{policy}.json": [
                results_of(task, returns, f"{task}-{policy}", "sampled"),
                results_of(task, np.zeros_like(returns).tolist(), f"{task}-{policy}", "greedy"),
            ]
            for task, returns in tasks.items()
        }
        given += ["--label", policy, *map(str, write_all(tmp_path, files))]
    (tmp_path / "reference.json").write_text(json.dumps(REFERENCE))
    return [*given, "--actions", "sampled"]


def scores_of(tasks: dict[str, list[list[float]]]) -> list[list[float]]:
    scores = []
    for task, runs in tasks.items():
        random, expert = REFERENCE[task]["random"], REFERENCE[task]["expert"]
        scores.append([(sum(run) / len(run) - random) / (expert - random) for run in runs])
    return scores


def test_score_from_returns_only(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == 0
    table, chance = capsys.readouterr().out.split("\n\n")
    heading, *rows = (re.split(r" {2,}", line) for line in table.splitlines())
    assert heading == ["TASK", "POLICY", "RUNS", "EPISODES", "RETURN", "95 %", "SUCCESS"]
    assert [row[:5] + row[6:] for row in rows] == [
        ["simple", "rnd", "3", "2", "0.6667", "50.0%"],
        ["", "ppo", "3", "2", "0.25", "0.0%"],
        ["t-maze", "rnd", "2", "2", "0", "25.0%"],
        ["", "ppo", "2", "2", "0.75", "75.0%"],
    ]
    right = statistics.probability_of_improvement(scores_of(RND), scores_of(PPO))
    assert (
        f"probability that rnd scores higher than ppo, ties counted half: {right:.3f}, 95 % "
        in chance
    )


def test_single_runs_have_no_interval(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Resampling one run would give an interval without width."""
    files = {f"{name}.json": results_of("simple", [[1.0, 0.5]], name) for name in ("a", "b")}
    assert main(["score", *map(str, write_all(tmp_path, files))]) == 0
    assert capsys.readouterr().out.endswith("higher than b, ties counted half: 0.500\n")


def test_aggregates_and_files(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "scores.json"
    words += ["--reference", str(tmp_path / "reference.json"), "--json", str(out)]
    assert main(words) == 0
    shown = capsys.readouterr().out
    assert shown.endswith(f"wrote {out}\n")
    report = json.loads(out.read_text())
    table = shown.split("\n\n")[1].splitlines()
    names = [name for name in re.split(r" {2,}", table[0]) if name != "95 %"]
    assert names == ["POLICY", "IQM", "MEAN", "MEDIAN", "GAP"]
    for line, policy, tasks in zip(table[1:], ("rnd", "ppo"), (RND, PPO), strict=True):
        told = report["policies"][policy]
        scores = scores_of(tasks)
        assert [told["tasks"][task]["scores"] for task in tasks] == scores
        assert told["tasks"]["simple"]["return"]["mean"] == pytest.approx(np.mean(tasks["simple"]))
        for name in ("interquartile_mean", "mean", "median", "optimality_gap"):
            found = told["aggregates"][name]
            assert found["value"] == pytest.approx(getattr(statistics, name)(scores), abs=1e-12)
            assert found["low"] <= found["value"] <= found["high"]
            interval = f"{found['low']:.3f} to {found['high']:.3f}"
            assert f"{found['value']:.3f}  {interval}" in re.sub(" {2,}", "  ", line)
        profile = told["profile"]
        right = [statistics.fraction_above(scores, tau) for tau in profile["taus"]]
        assert profile["fractions"] == pytest.approx(right, abs=1e-12)
    right = statistics.probability_of_improvement(scores_of(RND), scores_of(PPO))
    assert report["probability_of_improvement"]["ppo"]["value"] == pytest.approx(right)


def test_single_run_gets_a_note(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (path,) = write_all(tmp_path, {"a.json": results_of("simple", [[0.0, 1.0, 1.0]])})
    assert main(["score", str(path)]) == 0
    table, note = capsys.readouterr().out.splitlines()[1:]
    assert " mine " in table
    assert note.startswith("mine has a single run of simple: its intervals do not include")


def test_baselines_stand_beside_the_own_agent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("jaxenstein.intervals.RESAMPLES", 20)
    monkeypatch.setattr("jaxenstein.cli.score.POINTS", 5)
    monkeypatch.setattr(suite, "BASELINES", tmp_path)
    rng, folder = np.random.default_rng(0), make_folder(tmp_path / "small-1")
    earned = {task.id: rng.normal(size=(5, 100)).tolist() for task in suite.TASKS}
    ours = suite_results(returns=earned)
    write_all(folder, {"ppo.json": ours, "rnd.json": ours})
    (mine,) = write_all(tmp_path, {"mine.json": suite_results()})
    out = tmp_path / "scores.json"
    assert main(["score", str(mine), "--suite", "--baselines", "--json", str(out)]) == 0
    report, shown = json.loads(out.read_text()), capsys.readouterr().out
    assert shown.startswith("small suite, version 1\n")
    assert (report["suite"], report["suite_version"]) == ("small", 1)
    assert report["resamples"] == {"returns": 20, "scores": 10_000}
    assert report["policies"]["mine"]["tasks"]["simple"]["actions"] == "sampled"
    assert [*report["policies"]] == ["mine", "PPO (baseline)", "RND (baseline)"]
    for name, chance in report["probability_of_improvement"].items():
        told = f"\nprobability that mine scores higher than {name}, ties counted half: "
        assert f"{told}{chance['value']:.3f}" in shown
    assert [*report["probability_of_improvement"]] == ["PPO (baseline)", "RND (baseline)"]
    assert "mine departs from the protocol: 1 of 5 training seeds" in shown
    assert re.search(r"\nmine +\S+ +- +\S+ +- +\S+ +- +\S+ +-\n", shown)
    assert "PPO (baseline) departs" not in shown
    told = report["policies"]["PPO (baseline)"]["tasks"]
    for task, ends in suite.references().items():
        scores = (np.mean(earned[task], axis=1) - ends.random) / (ends.expert - ends.random)
        assert told[task]["scores"] == pytest.approx(scores)
        found, scale = told[task]["score"], ends.expert - ends.random
        for end, earned_end in told[task]["return"].items():
            assert found[end] == pytest.approx((earned_end - ends.random) / scale)
        score = f"{found['mean']:z.3f} +{found['low']:z.3f} to {found['high']:z.3f}"
        assert re.search(rf"PPO \(baseline\) +5 +100 .* {score}\n", shown)
    abilities = report["policies"]["PPO (baseline)"]["abilities"]
    for ability, found in abilities.items():
        part = [told[one.id]["scores"] for one in suite.TASKS if one.ability == ability]
        assert found["value"] == pytest.approx(statistics.interquartile_mean(part))
        assert found["low"] < found["value"] < found["high"]
        cell = f"{found['value']:z.3f} ({found['low']:z.3f} to {found['high']:z.3f})"
        assert re.search(rf"\n{ability} .* {re.escape(cell)}", shown)
    assert [*abilities] == [*dict.fromkeys(task.ability for task in suite.TASKS)]
    assert re.search(r"\nmemory +-?\d\.\d+ +-?\d\.\d+ \(", shown), "a single run has no interval"

    write_results(mine, suite_results()[2:4])
    assert main(["score", str(mine), "--suite", "--baselines", "--json", str(out)]) == 0
    assert "2 of 12 tasks: a score of the benchmark needs all of them\n" in capsys.readouterr().out
    part = json.loads(out.read_text())["policies"]
    assert part["mine"]["abilities"] == {}
    assert [*part] == [*report["policies"]]
    some = [task.id for task in suite.TASKS[2:4]]
    assert {name: [*mine["tasks"]] for name, mine in part.items()} == dict.fromkeys(part, some)
    assert all(part["RND (baseline)"]["tasks"][id] == told[id] for id in some)


def test_baselines_of_another_size_are_not_mixed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(suite, "BASELINES", tmp_path)
    write_all(make_folder(tmp_path / "small-1"), {"ppo.json": suite_results()})
    in_game = [dataclasses.replace(one, made_with={"vizdoom": "1.3"}) for one in suite_results()]
    small, large, game = write_all(
        tmp_path, {"s.json": suite_results(), "l.json": suite_results("large"), "g.json": in_game}
    )
    for words, told in (
        ([str(small), "--baselines"], "--baselines needs --suite"),
        ([str(small), "--baselines", "--suite", "--actions", "greedy"], "leave out --actions gree"),
        ([str(game), "--suite"], ": these episodes were played in ViZDoom; a benchmark"),
        ([str(large), "--baselines", "--suite"], "'height' is 64, but must be 16 in the small"),
        ([str(large), "--baselines", "--suite", "large"], "the large suite has no baselines"),
        (
            ["--label", "PPO (baseline)", str(small), "--baselines", "--suite"],
            "PPO (baseline) is a baseline; use another --label",
        ),
    ):
        assert main(["score", *words]) == 2, words
        assert told in capsys.readouterr().err


def test_plot(words: list[str], tmp_path: Path) -> None:
    for name in ("flax", "matplotlib"):
        pytest.importorskip(name)
    out = tmp_path / "scores.png"
    words += ["--reference", str(tmp_path / "reference.json"), "--plot", str(out)]
    assert main(words) == 0
    with Image.open(out) as picture:
        assert picture.width > 1000
        colours = np.asarray(picture.convert("RGB")).reshape(-1, 3)
    # Both policies have a colour of their own, in bars and lines.
    for colour in ((31, 119, 180), (255, 127, 14)):
        assert (colours == colour).all(axis=1).sum() > 100


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ([], "jaxenstein score: give files from 'jaxenstein evaluate --json'"),
        (["--label", "rnd"], "jaxenstein score: --label rnd: give files after the name"),
        (["none.json"], "cannot"),
        (["reference.json"], "reference.json"),
        (
            ["a.json", "--plot", "a.png"],
            "normalised scores: give --suite or --reference",
        ),
        (["a.json", "--reference", "none.json"], "none.json: cannot be read: no such file"),
        (["a.json", "--reference", "reference.json"], "there is no reference for 'key-door'"),
        (["a.json", "--seed", "-1"], "argument --seed: must be a whole number from 0"),
    ],
)
def test_wrong_arguments_get_one_line_and_code_2(
    more: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    write_all(tmp_path, {"a.json": results_of("key-door", [[0.0], [1.0]])})
    (tmp_path / "reference.json").write_text(json.dumps(REFERENCE))
    assert main(["score", *more]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert message in err


def test_no_file_is_read_and_written(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    file = Path(words[3])
    before = file.read_bytes()
    assert main([*words, "--json", str(file.parent / "." / file.name)]) == 2
    assert "would overwrite" in capsys.readouterr().err
    assert main(["evaluate", "--policy", "idle", "--json", "a.gif", "--gif", "./a.gif"]) == 2
    assert "a.gif would overwrite a.gif" in capsys.readouterr().err
    assert file.read_bytes() == before


def test_a_file_is_written_even_if_the_table_cannot_be_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    files = write_all(tmp_path, {"r.json": [results_of("simple", RND["simple"], "ü", "sampled")]})
    out = tmp_path / "scores.json"
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(io.BytesIO(), encoding="ascii"))
    assert main(["score", *map(str, files), "--json", str(out)]) == 1
    assert "cannot print '\\xfc' as ascii" in capsys.readouterr().err
    assert list(json.loads(out.read_text())["policies"]) == ["ü"]
