"""Results from files, grouped by policy and task, or refused if they cannot be compared."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from jaxenstein import SettingError
from jaxenstein.comparison import Reference, gather, read_reference, run_returns, run_scores
from jaxenstein.results import Results
from jaxenstein.spec import Spec
from tests.results_of import results_of, write_all

ONE, TWO = [[0.0, 1.0], [1.0, 1.0]], [[0.5, 0.0], [0.0, 0.0]]


def gathered(folder: Path, *results: Results, actions: str | None = None) -> dict[str, Any]:
    paths = write_all(folder, {f"{n}.json": one for n, one in enumerate(results)})
    return gather([(None, path) for path in paths], actions)


def test_policies_are_identified_by_name_and_actions(tmp_path: Path) -> None:
    found = gathered(
        tmp_path,
        results_of("simple", ONE, "a", "greedy"),
        results_of("simple", TWO, "a", "sampled"),
        results_of("simple", TWO, "b", None),
    )
    assert list(found) == ["a, greedy", "a, sampled", "b"]
    np.testing.assert_array_equal(found["a, greedy"]["simple"].returns, ONE)
    paths = sorted(tmp_path.glob("*.json"))
    sampled = gather([(None, path) for path in paths], "sampled")
    assert list(sampled) == ["a", "b"]
    np.testing.assert_array_equal(sampled["a"]["simple"].returns, TWO)
    with pytest.raises(SettingError, match="no results with greedy actions"):
        gather([(None, paths[1])], "greedy")


def test_labels_group_files(tmp_path: Path) -> None:
    paths = write_all(
        tmp_path,
        {
            "a.json": results_of("simple", ONE, "simple-rnd"),
            "b.json": results_of("t-maze", TWO, "t-maze-rnd"),
            "c.json": results_of("simple", TWO, "simple-rnd", first=2),
        },
    )
    found = gather([("rnd", path) for path in paths])
    assert list(found) == ["rnd"]
    assert list(found["rnd"]) == ["simple", "t-maze"]
    together = found["rnd"]["simple"]
    assert together.names == ("seed-0", "seed-1", "seed-2", "seed-3")
    np.testing.assert_array_equal(together.returns, [*ONE, *TWO])
    np.testing.assert_array_equal(together.successes, np.array([*ONE, *TWO]) > 0.5)
    assert [runs.tolist() for runs in run_returns(found["rnd"])] == [
        [0.5, 1.0, 0.25, 0.0],
        [0.25, 0.0],
    ]


def test_explicit_defaults_are_no_difference(tmp_path: Path) -> None:
    plain = results_of("simple", ONE, "a")
    named = results_of("simple", TWO, "b", settings={"frame_skip": 1, "observation": "rgb"})
    named_too = results_of("simple", TWO, "c", params={"goal_reward": 1.0})
    assert list(gathered(tmp_path, plain, named, named_too)) == ["a", "b", "c"]


@pytest.mark.parametrize(
    ("others", "words"),
    [
        ({"version": 1}, "simple: the version is 0 in .*0.json and 1 in .*1.json; one task"),
        (
            {"settings": {"frame_skip": 3}},
            "simple: the setting 'frame_skip' is the default in .*0.json and 3 in",
        ),
        ({"params": {"goal_reward": 2.0}}, "the param 'goal_reward' is the default in .* and 2.0"),
        # Neither can be built: they are compared as they are written.
        ({"settings": {"frame_skip": "many"}}, "'frame_skip' is the default in .* and 'many' in"),
        ({"settings": {"no_such": 1}}, "'no_such' is the default in"),
        # The first setting is the default, so the second makes the difference.
        (
            {"settings": {"field_of_view": 60.0, "look": "random"}},
            "the setting 'look' is the default in .* and 'random' in",
        ),
        (
            {"params": {"goal_reward": 1.0, "living_reward": 0.5}},
            "'living_reward' is the default",
        ),
        ({"policy": "a"}, "a on simple: the run 'seed-0' is both in .*0.json and in .*1.json"),
        ({"policy": "a", "first": 2, "seed": 5}, "a on simple: seed 0 in .* and 5 in .*1.json"),
        ({"task": "t-maze"}, "a has no results for t-maze, but b does: .* the same tasks"),
    ],
)
def test_incomparable_results_are_refused(
    others: dict[str, Any], words: str, tmp_path: Path
) -> None:
    two = results_of(**{"task": "simple", "returns": TWO, "policy": "b", **others})
    with pytest.raises(SettingError, match=words):
        gathered(tmp_path, results_of("simple", ONE, "a"), two)


def test_one_label_for_several_policies_of_a_file_is_refused(tmp_path: Path) -> None:
    both = [results_of("simple", ONE, "a"), results_of("simple", TWO, "b")]
    (path,) = write_all(tmp_path, {"both.json": both})
    with pytest.raises(SettingError, match=r"'seed-0' is twice in .*both\.json; .* before"):
        gather([("mine", path)])


def test_maps_that_differ_late_are_told_apart(tmp_path: Path) -> None:
    wall = "#" * 60
    one, two = (f"{wall}\n#S{'.' * 55}{end}G#\n{wall}\n" for end in (".", "#"))
    results = [
        dataclasses.replace(results_of("", ONE, policy), environment=Spec(None, 0, settings, {}))
        for policy, text in (("a", one), ("b", two))
        for settings in [{"text": text, "name": "hall"}]
    ]
    with pytest.raises(SettingError, match=r"hall: line 2 of the setting 'text' is '#S\.\."):
        gathered(tmp_path, *results)


def test_episodes_in_the_game_are_another_policy(tmp_path: Path) -> None:
    here = results_of("simple", ONE, "a")
    there = dataclasses.replace(here, policy="a in ViZDoom", made_with={"vizdoom": "1.3"})
    (path,) = write_all(tmp_path, {"both.json": [here, there]})
    assert list(gather([(None, path)])) == ["a", "a in ViZDoom"]
    assert list(gather([("b", path)])) == ["b", "b in ViZDoom"]
    own = results_of("simple", TWO, "a", None)
    assert list(gathered(tmp_path, here, own)) == ["a, sampled", "a, own actions"]


def test_runs_need_the_same_episodes(tmp_path: Path) -> None:
    longer = results_of("simple", [[0.0, 1.0, 1.0]], "a", first=5)
    with pytest.raises(SettingError, match=r"a on simple: episodes 2 in .*0\.json and 3 in"):
        gathered(tmp_path, results_of("simple", ONE, "a"), longer)


def test_custom_maps_are_identified_by_name(tmp_path: Path) -> None:
    settings = {"text": "#####\n#S.G#\n#####\n", "name": "hall"}
    mine = results_of("", ONE, settings=settings)
    mine = Results(**{**vars(mine), "environment": type(mine.environment)(None, 0, settings, {})})
    assert list(gathered(tmp_path, mine)["mine"]) == ["hall"]


def test_scores_lie_between_the_references(tmp_path: Path) -> None:
    found = gathered(tmp_path, results_of("simple", ONE), results_of("t-maze", TWO))
    reference = {"simple": Reference(0.5, 1.0), "t-maze": Reference(-0.75, 0.25)}
    scores = run_scores(found["mine"], reference)
    assert [runs.tolist() for runs in scores] == [[0.0, 1.0], [1.0, 0.75]]
    with pytest.raises(SettingError, match="no reference for 't-maze', did you mean 't-mase'"):
        run_scores(found["mine"], {"simple": Reference(0, 1), "t-mase": Reference(0, 1)})


def test_reference_files(tmp_path: Path) -> None:
    path = tmp_path / "reference.json"
    path.write_text('{"simple": {"random": 0, "expert": 1.5, "episodes": 100}}')
    assert read_reference(path) == {"simple": Reference(0.0, 1.5)}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "reference.json: cannot be read: no such file"),
        ("{", "reference.json: not a file of reference returns, or only a part of it: "),
        ("[" * 100_000, "reference.json: not a file of reference returns: "),
        ('{"simple": {"random": 0, "expert": NaN}}', "it has a number that is NaN"),
        ("[]", "reference.json must hold "),
        ('{"simple": 1}', "'simple' must be an object with 'random' and 'expert'"),
        ('{"simple": {"random": 0}}', "'simple' must be an object with 'random' and 'expert'"),
        *(
            (json.dumps({"simple": {"random": 0, "expert": wrong}}), f"'simple': {words}")
            for wrong, words in (
                (0, "the expert's return must be above the random player's, but is 0 against 0"),
                *(
                    (wrong, "the expert's return must be a finite number, not ")
                    for wrong in (10**400, "1", None, True, [1, 2])
                ),
            )
        ),
    ],
)
def test_wrong_reference_files_are_refused(content: str | None, words: str, tmp_path: Path) -> None:
    path = tmp_path / "reference.json"
    if content is not None:
        path.write_text(content)
    with pytest.raises(SettingError, match=words):
        read_reference(path)
