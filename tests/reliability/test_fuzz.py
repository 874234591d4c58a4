"""Spoilt input gives a result or one of the project's errors, and defects are seen as such."""

from __future__ import annotations

import random
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import jaxenstein
from jaxenstein.errors import JAXensteinError, SettingError
from reliability import fuzz
from reliability.cases import ACCEPTED, DEFECT, REFUSED, Case, Outcome, attempt, skeleton
from reliability.mutate import spoil_bytes, spoil_tree
from reliability.targets import TARGETS, open_target

# Cases of each target, so that all take seconds.
CASES = {"ascii": 150, "dmlab": 200, "trajectory": 25, "settings": 25, "config": 25, "run": 15}


SLOW = ("run",)


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow) if n in SLOW else n for n in CASES]
)
def test_a_few_spoilt_inputs(name: str) -> None:
    if name in ("config", "run"):
        pytest.importorskip("flax")
        pytest.importorskip("orbax.checkpoint")
        pytest.importorskip("matplotlib")
    tally = fuzz.fuzz(open_target(name), random.Random(1), cases=CASES[name])
    assert tally.kinds.total() == CASES[name]
    assert not [outcome.details for _, outcome in tally.defects.values()]
    assert tally.kinds[REFUSED] > CASES[name] // 5


@pytest.mark.slow
def test_some_spoilt_arguments() -> None:
    pytest.importorskip("flax")
    pytest.importorskip("orbax.checkpoint")
    tally = fuzz.fuzz(open_target("arguments"), random.Random(2), cases=60)
    assert not [outcome.details for _, outcome in tally.defects.values()]


class Saying:
    """A target that does what a test wants."""

    name, named, quiet = "saying", False, True

    def __init__(self, does: Callable[[], Any], *, named: bool = False) -> None:
        self._does = does
        self.named = named

    def seeds(self) -> list[Case]:
        return [Case({"a.txt": b"x"})]

    def spoil(self, case: Case, rng: random.Random) -> Case:
        return Case({name: spoil_bytes(data, rng) for name, data in case.files.items()})

    def run(self, case: Case, folder: Path) -> None:
        del case, folder
        self._does()


def judged(does: Callable[[], Any], **settings: Any) -> Outcome:
    with fuzz.scratch() as folder:
        return attempt(Saying(does, **settings), Case({"a.txt": b"x"}), folder, 0.2)


def fail(error: BaseException) -> Callable[[], Any]:
    def run() -> None:
        raise error

    return run


def test_what_is_accepted_and_refused() -> None:
    assert judged(lambda: None).kind == ACCEPTED
    outcome = judged(fail(SettingError("height must be 3, not 'x'")))
    assert outcome.kind == REFUSED
    assert outcome.words == "height must be N, not '..'"


@pytest.mark.parametrize(
    ("does", "words"),
    [
        (fail(KeyError("x")), "KeyError in test_fuzz.py, run"),
        (fail(RecursionError("deep")), "RecursionError"),
        (fail(MemoryError()), "MemoryError"),
        (fail(SettingError("bad")), "an error that says nothing"),
        (lambda: warnings.warn("overflow", RuntimeWarning, stacklevel=1), "RuntimeWarning"),
        (lambda: time.sleep(5), "took longer than 0.2 s"),
        (lambda: Path("b.part").write_text(""), "left files behind: b.part is new"),
        (lambda: Path("a.txt").write_text("y"), "left files behind: a.txt changed"),
        (lambda: Path("a.txt").unlink(), "left files behind: a.txt is gone"),
    ],
)
def test_what_is_a_defect(does: Callable[[], Any], words: str) -> None:
    outcome = judged(does)
    assert outcome.kind == DEFECT
    assert words in outcome.words


def test_an_error_must_name_the_file() -> None:
    error = SettingError("there is something wrong")
    assert judged(fail(error), named=True).kind == DEFECT
    assert judged(fail(SettingError("a.txt: something is wrong")), named=True).kind == REFUSED


def test_a_defect_is_kept_and_found_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = Saying(fail(ZeroDivisionError("x")))
    case = Case({"a/b.txt": b"\xff"}, ("--out", "\udcff"))
    outcome = Outcome(DEFECT, "ZeroDivisionError", "x")
    place = fuzz.keep(tmp_path, "saying", case, outcome)
    assert (place / "files" / "a" / "b.txt").read_bytes() == b"\xff"
    seen: list[Case] = []
    monkeypatch.setattr(broken, "run", lambda case, folder: seen.append(case))
    monkeypatch.setattr(fuzz, "open_target", lambda name: {"saying": broken}[name])
    assert fuzz.main(["--again", str(place)]) == 0
    assert seen == [case]
    assert capsys.readouterr().out.startswith(ACCEPTED)


def test_a_seed_must_be_valid() -> None:
    with pytest.raises(ValueError, match="a seed is not valid"):
        fuzz.fuzz(Saying(fail(SettingError("not this one"))), random.Random(0), cases=3)


def test_equal_seeds_try_the_same() -> None:
    def messages() -> list[str]:
        target = open_target("ascii")
        return list(fuzz.fuzz(target, random.Random(5), cases=40).reasons)

    assert messages() == messages()


def test_trees_are_spoilt_in_copies() -> None:
    tree = {"a": [1, {"b": None}], "c": "x"}
    rng = random.Random(0)
    spoilt = [spoil_tree(tree, rng) for _ in range(200)]
    assert tree == {"a": [1, {"b": None}], "c": "x"}
    assert sum(other != tree for other in spoilt) > 150


def test_skeletons_of_equal_reasons_are_equal() -> None:
    one = skeleton("/a/b.txt: line 3, column 14: unknown symbol 'é'")
    assert one == skeleton("c/d.txt: line 1, column 2: unknown symbol 'x'")


def test_unknown_targets_are_refused() -> None:
    with pytest.raises(SystemExit) as stopped:
        fuzz.main(["--target", "nothing"])
    assert stopped.value.code == 2
    assert set(CASES) | {"arguments"} == set(TARGETS)


@pytest.mark.parametrize("value", [None, 3, b"#SG#", ["#SG#"], {"a": 1}, object()])
def test_what_is_no_text_is_no_map(value: Any) -> None:
    with pytest.raises(JAXensteinError):
        jaxenstein.from_ascii(value)
