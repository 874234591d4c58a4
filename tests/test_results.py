"""The file of results: round trips, and errors for wrong content."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import jaxenstein
from jaxenstein import Results, SettingError, read_results, write_results
from jaxenstein.spec import Spec, spec_of


def results(**changes: Any) -> Results:
    given: dict[str, Any] = {
        "environment": spec_of(*jaxenstein.make("simple", height=12, width=16)),
        "policy": "mine",
        "actions": "greedy",
        "seed": 3,
        "names": ("seed-0", "seed-1"),
        "returns": np.array([[0.1, -2.5, 1], [0, 1e-9, 3]], np.float32),
        "lengths": np.array([[1, 2, 3], [4, 5, 600]]),
        "successes": np.array([[True, False, True], [False, True, True]]),
    }
    return Results(**{**given, **changes})


def test_file_has_the_format_and_round_trips(tmp_path: Path) -> None:
    several = [results(), results(actions=None, policy="another", names=("a", "b"))]
    write_results(tmp_path / "r.json", several)
    plain = json.loads((tmp_path / "r.json").read_text())
    assert (plain["format"], plain["version"]) == ("jaxenstein-results", 1)
    first = plain["results"][0]
    environment = first["environment"]
    assert (environment["id"], environment["params"]) == ("simple", {})
    assert (environment["settings"]["height"], environment["settings"]["width"]) == (12, 16)
    assert [first[name] for name in ("policy", "actions", "episodes", "seed")] == [
        "mine", "greedy", 3, 3
    ]  # fmt: skip
    assert first["runs"]["seed-1"] == {
        "return": [0.0, float(np.float32(1e-9)), 3.0],
        "length": [4, 5, 600],
        "success": [False, True, True],
    }
    assert first["made_with"]["jaxenstein"] == jaxenstein.__version__
    for before, after in zip(several, read_results(tmp_path / "r.json"), strict=True):
        assert after.environment == before.environment
        for name in ("policy", "actions", "seed", "names", "made_with"):
            assert getattr(after, name) == getattr(before, name)
        for name in ("returns", "lengths", "successes"):
            one, other = getattr(before, name), getattr(after, name)
            assert one.dtype == other.dtype
            np.testing.assert_array_equal(one, other)


def test_map_in_a_file_is_rebuilt(tmp_path: Path) -> None:
    world = jaxenstein.from_ascii("####\n#SG#\n####", heading=0, height=8, width=8)
    results(environment=spec_of(*world)).save(tmp_path / "r.json")
    (read,) = read_results(tmp_path / "r.json")
    assert read.environment.build()[0] == spec_of(*world).build()[0]


def test_best_run_has_highest_return_then_shortest_episodes() -> None:
    returns, names = np.ones((3, 2)), ("a", "b", "c")
    lengths = np.array([[9, 9], [3, 4], [5, 5]])
    given: dict[str, Any] = {"names": names, "lengths": lengths, "successes": lengths > 0}
    assert results(returns=returns, **given).best == 1
    returns[2] = 2
    assert results(returns=returns, **given).best == 2


def test_summary_shows_means() -> None:
    told = results(successes=np.ones((2, 3), bool)).summary()
    assert told.startswith("mine in simple: return 0.2667 (")
    assert told.endswith("success 100.0% (100.0% to 100.0%), 6 episodes")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"returns": np.zeros((2, 2))}, r"lengths must have the shape \(2, 2\), not \(2, 3\)"),
        (
            {"returns": np.zeros(3)},
            r"returns must have the shape \[runs, episodes\] with 2 runs, not \(3,\)",
        ),
        ({"returns": np.full((2, 3), np.nan)}, r"episode 0 \(from 0\) of 'seed-0' is nan"),
        ({"lengths": np.zeros((2, 3), int)}, "lengths must be at least 1, not 0"),
        (
            {"lengths": np.full((2, 3), 1.5)},
            r"lengths must be an array \[runs, episodes\] of whole",
        ),
        ({"lengths": np.full((2, 3), 2**31)}, "lengths must be an array"),
        ({"successes": np.full((2, 3), 2)}, "successes must be an array"),
        ({"returns": [[1.0], [1.0, 2.0]]}, "returns must be an array .* of numbers"),
        ({"returns": np.full((2, 3), "1")}, "returns must be an array .* of numbers"),
        ({"names": ("a", "a")}, "names of runs must differ"),
        ({"actions": "best"}, "must be 'greedy', 'sampled' or None, not 'best'"),
        ({"seed": -1}, "seed must be a whole number"),
        ({"policy": "a\nb"}, "policy must be one line of text"),
        ({"environment": "simple"}, "environment must be a Spec, not 'simple'"),
        ({"names": None}, "names must be a tuple of texts, not None"),
        ({"names": "ab"}, "names must be a tuple of texts, not 'ab'"),
        ({"made_with": {"n": 1}}, "'made_with.n' must be one line of text, not 1"),
        ({"made_with": None}, "made_with must map names to texts, not None"),
    ],
)
def test_wrong_parts_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(SettingError, match=message):
        results(**changes)


def test_numbers_of_numpy_can_be_saved(tmp_path: Path) -> None:
    given: Any = np.int64(3)
    results(seed=given).save(tmp_path / "r.json")
    (found,) = read_results(tmp_path / "r.json")
    assert (found.seed, found.in_game) == (3, False)


@pytest.mark.parametrize("wrong", [[], None, "r"])
def test_only_lists_of_results_are_written(wrong: Any, tmp_path: Path) -> None:
    with pytest.raises(SettingError, match="results must be a list of at least one Results, not"):
        write_results(tmp_path / "r.json", wrong)
    assert list(tmp_path.iterdir()) == []


def test_setting_that_json_cannot_hold_is_refused(tmp_path: Path) -> None:
    odd = results(environment=Spec("my:Task", 0, {"way": max}, {}))
    with pytest.raises(SettingError, match="a setting of my:Task cannot be written as JSON"):
        odd.save(tmp_path / "r.json")
    assert list(tmp_path.iterdir()) == []


def change(*places: Any, value: Any) -> Callable[[Any], None]:
    def run(plain: Any) -> None:
        for place in places[:-1]:
            plain = plain[place]
        if value is ...:
            del plain[places[-1]]
        else:
            plain[places[-1]] = value

    return run


FIRST = ("results", 0)
RUN = (*FIRST, "runs", "seed-1")


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (change("format", value="x"), "'format' is not 'jaxenstein-results'"),
        (change("version", value=2), "its format is version 2, but this version .* up to 1"),
        (change("version", value=True), "version must be a whole number"),
        (change("more", value=1), "unknown entry 'more'"),
        (change("results", value=[]), "'results' must be a list with an entry"),
        (change(*FIRST, value=3), r"results\[0\]: the entry must be an object"),
        (change(*FIRST, "seed", value=...), r"results\[0\]: the entry 'seed' is missing"),
        (change(*FIRST, "episodes", value=4), r"'runs.seed-0.return' must be a list of 4 values"),
        (change(*FIRST, "runs", value={}), r"returns must have the shape \[runs, episodes\]"),
        (change(*FIRST, "made_with", "jax", value=3), "'made_with.jax' must be one line of text"),
        (change(*FIRST, "environment", "version", value=-1), "'environment.version' must be"),
        (change(*FIRST, "environment", "params", value={"a": "b"}), "'environment.params.a' must"),
        (change(*FIRST, "environment", "params", value={"a": [1, 2, 3]}), "two ends of a range"),
        (change(*FIRST, "environment", value=None), "'environment' must be an object of id"),
        (change(*FIRST, "environment", "id", value=5), "'environment.id' must be one line of text"),
        (change(*RUN, "return", 1, value="1"), r"return': episode 1 \(from 0\) must be int or flo"),
        (change(*RUN, "return", 1, value=True), "must be int or float, not True"),
        (change(*RUN, "return", 1, value=10**400), r"results\[0\]: "),
        (change(*RUN, "return", 1, value=float("nan")), "a number that is NaN"),
        (change(*RUN, "return", 1, value=float("inf")), "a number that is Infinity"),
        (change(*RUN, "length", 1, value=2**40), r"results\[0\]: "),
        (change(*RUN, "length", 1, value=2.5), "must be int, not 2.5"),
        (change(*RUN, "success", 1, value=1), "must be bool, not 1"),
        (change(*RUN, "success", value=...), "the entry 'runs.seed-1.success' is missing"),
    ],
)
def test_damaged_files_are_refused(
    tmp_path: Path, spoil: Callable[[Any], None], message: str
) -> None:
    file = tmp_path / "r.json"
    results().save(file)
    plain = json.loads(file.read_text())
    spoil(plain)
    file.write_text(json.dumps(plain))
    with pytest.raises(SettingError, match=message) as caught:
        read_results(file)
    assert str(caught.value).startswith(f"{file}: ")


def test_runs_of_one_name_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "r.json"
    results().save(file)
    file.write_text(file.read_text().replace('"seed-1"', '"seed-0"'))
    with pytest.raises(SettingError, match=r"r\.json: two entries have the name 'seed-0'"):
        read_results(file)


def test_files_without_results_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "r.json"
    with pytest.raises(SettingError, match="cannot be read: no such file"):
        read_results(file)
    for text, message in (
        ("{", "not a results file, or only a part of it: line 1, column 2"),
        ("[]", "'format' is not"),
        ("[" * 200_000, "not a results file"),
        ('{"format": "jaxenstein-results", "x": 1e999}', "version must be a whole number"),
    ):
        file.write_text(text)
        with pytest.raises(SettingError, match=message):
            read_results(file)
    file.write_bytes(b"\xff\xfe")
    with pytest.raises(SettingError, match="not a results file"):
        read_results(file)
    monkeypatch.setattr("jaxenstein.results.LONGEST_TEXT", 100)
    with pytest.raises(SettingError, match="would have more than"):
        results().save(file)
