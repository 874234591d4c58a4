"""Fuzzed input gives a result or one of the project's errors, and defects are detected."""

from __future__ import annotations

import time
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from jaxenstein.errors import SettingError
from reliability.fuzz import attempt, fuzz, main, skeleton
from reliability.spoil import Case, Target
from reliability.targets import TARGETS

# Cases of each target, so that all take seconds; the others take longer.
CASES = {"ascii": 150, "dmlab": 200, "trajectory": 25, "results": 100, "settings": 25, "config": 25}
CASES |= {"wad": 400}
SLOW = {"run": 15}


@pytest.mark.parametrize(
    "name", [*CASES, *(pytest.param(name, marks=pytest.mark.slow) for name in SLOW)]
)
def test_few_corrupted_inputs(name: str) -> None:
    if name in ("config", *SLOW):
        pytest.importorskip("flax")
        pytest.importorskip("matplotlib")
    cases, made, reasons = {**CASES, **SLOW}[name], TARGETS[name](), Counter[str]()
    for seed in range(1, 9):
        reasons += fuzz(made, cases, seed=seed)
        # A few cases may all be refused by chance, but not many, or later code would not be tested.
        if reasons[""]:
            break
    assert reasons[""]
    assert reasons.total() > cases // 2
    assert len(reasons) > 2


def target(does: Callable[[], Any], **settings: Any) -> Target:
    """A target with a given behaviour."""
    return Target([Case({"a.txt": b"x"})], lambda case: does(), **settings)


def fail(error: BaseException) -> Callable[[], Any]:
    def run() -> None:
        raise error

    return run


def judged(does: Callable[[], Any], **settings: Any) -> str:
    return attempt(target(does, **settings), Case({"a.txt": b"x"}), 0.2)


def test_accepted_and_refused_inputs() -> None:
    assert judged(lambda: None) == ""
    refusal = judged(fail(SettingError("height must be 3, not 'x'")))
    assert skeleton(refusal) == "height must be N, not '..'"
    with pytest.raises(AssertionError, match="does not name a file"):
        judged(fail(SettingError("there is something wrong")), named=True)
    assert judged(fail(SettingError("a.txt: something is wrong")), named=True)


@pytest.mark.parametrize(
    ("does", "kind", "words"),
    [
        (fail(KeyError("x")), KeyError, "x"),
        (fail(RecursionError("deep")), RecursionError, "deep"),
        (fail(SettingError("bad")), AssertionError, "an error without a message"),
        (lambda: warnings.warn("overflow", RuntimeWarning, 1), RuntimeWarning, "overflow"),
        (lambda: time.sleep(5), AssertionError, "took longer than 0.2 s"),
        (lambda: Path("b.part").write_text(""), AssertionError, "left files behind: .'b.part'"),
        (lambda: Path("a.txt").write_text("y"), AssertionError, "left files behind: .'a.txt'"),
        (lambda: Path("a.txt").unlink(), AssertionError, "left files behind: .'a.txt'"),
    ],
)
def test_defects_are_recognised(does: Callable[[], Any], kind: type[Exception], words: str) -> None:
    with pytest.raises(kind, match=words):
        judged(does)


def test_smallest_defect_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def read(case: Case) -> None:
        if len(case.files.get("a.txt", b"")) > 3:
            raise ZeroDivisionError

    broken = Target([Case({"a.txt": b"xyz"})], read)
    monkeypatch.setitem(TARGETS, "ascii", lambda: broken)
    # Hypothesis calls what it raises again by the test's own arguments.
    arguments = ["--target", "ascii", "--minutes", "1", "--out", str(tmp_path), "--seed", "1"]
    assert main(arguments) == 1
    assert "ascii: defect: ZeroDivisionError()" in capsys.readouterr().out
    assert 4 <= len((tmp_path / "ascii" / "a.txt").read_bytes()) <= 6


def test_every_target_is_tested(capsys: pytest.CaptureFixture[str]) -> None:
    assert {*CASES, *SLOW} == set(TARGETS)
    with pytest.raises(SystemExit):
        main(["--target", "nothing"])
