"""The progress line."""

from __future__ import annotations

import io
import re

import pytest

from jaxenstein import progress
from jaxenstein.progress import Progress, si


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def test_line_shows_fraction_rate_and_time_left(clock: list[float]) -> None:
    bar = Progress(2000, "rollout", stream=io.StringIO())
    clock[0] += 4
    bar.update(500)
    assert bar.line() == "rollout [######------------------]  25%  125 steps/s  12 s left"


def test_compiling_is_shown_but_not_counted(clock: list[float]) -> None:
    bar = Progress(100, "work", compiles=True, stream=io.StringIO())
    with bar:
        assert "compiling" in bar.stream.getvalue()  # type: ignore[attr-defined]
        clock[0] += 50
        assert "compiling" in bar.line()
        bar.update(0)
    assert "compiling" not in bar.line()
    clock[0] += 1
    bar.update(20)
    assert "20 steps/s  4.0 s left" in bar.line()


def test_line_can_be_printed_above(clock: list[float]) -> None:
    stream = Terminal()
    bar = Progress(10, "work", stream=stream)
    bar.show()
    bar.say("careful")
    assert re.search(r"\r\x1b\[Kcareful\n\rwork \[", stream.getvalue())


def test_line_is_redrawn_in_place_on_a_terminal(clock: list[float]) -> None:
    stream = Terminal()
    with Progress(10, "work", stream=stream) as bar:
        for i in range(1, 11):
            clock[0] += 0.03
            bar.update(i)
    text = stream.getvalue()
    assert text.endswith("\n")
    assert text.count("\n") == 1
    # Redrawn every tenth of a second, not at every one of the ten updates.
    assert 3 <= text.count("\r") <= 5
    assert "100%" in text.rsplit("\r", 1)[1]


def test_log_gets_few_lines_including_the_last(clock: list[float]) -> None:
    stream = io.StringIO()
    with Progress(100, "work", stream=stream) as bar:
        for i in range(1, 101):
            clock[0] += 0.25
            bar.update(i)
    lines = stream.getvalue().splitlines()
    assert [re.search(r"\d+%", line).group() for line in lines] == ["40%", "80%", "100%"]  # type: ignore[union-attr]
    assert "\r" not in stream.getvalue()


@pytest.mark.parametrize(
    ("number", "text"),
    [(0, "0"), (7.25, "7.25"), (999, "999"), (999.9, "1.00k"), (99960, "100k"), (217_400, "217k"),
     (1_234_567, "1.23M"), (4e9, "4.00G")],
)  # fmt: skip
def test_numbers_have_three_digits(number: float, text: str) -> None:
    assert si(number) == text
