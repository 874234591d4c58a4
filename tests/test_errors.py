"""Messages stay short, and errors can be pickled."""

from __future__ import annotations

import pickle
import warnings
from pathlib import Path

import pytest

import jaxenstein
from jaxenstein import errors
from jaxenstein.cli import main
from jaxenstein.files import OutputError

LONG = "x" * 100_000


@pytest.mark.parametrize(
    "message",
    [LONG, f"a b, {LONG} c", "word " * 20_000, f"{LONG} " * 3],
    ids=["word", "word within", "words", "long words"],
)
def test_long_messages_lose_their_middle(message: str) -> None:
    told = str(jaxenstein.SettingError(message))
    assert len(told) <= errors.LONGEST_MESSAGE
    assert max(map(len, told.split())) <= errors.LONGEST_WORD
    assert "..." in told
    assert (told[:4], told[-4:]) == (message[:4], message[-4:])
    assert str(jaxenstein.SettingError(message[:300])) == message[:300]


@pytest.mark.parametrize("value", [LONG, [LONG] * 10**5, {LONG: [LONG]}, 10**400, b"x" * 10**6])
def test_quoted_values_are_short(value: object) -> None:
    assert len(errors.quoted(value)) <= errors.LONGEST_QUOTE
    assert errors.quoted("it's") == repr("it's")


def test_commands_shorten_arguments(capsys: pytest.CaptureFixture[str]) -> None:
    for code, command in (
        (2, ["record", LONG, "--out", "a.gif"]),
        (2, ["record", "simple", "--policy", LONG, "--out", "a.gif"]),
        (1, ["record", "simple", "--out", f"{LONG}.gif"]),
        (2, ["record", "simple", f"--{LONG}"]),
        (2, ["bench", "--map-file", LONG]),
        (2, [LONG]),
    ):
        assert main(command) == code
        told = capsys.readouterr().err
        assert 0 < len(told) < 1600
        assert told.count("\n") == 1


def test_commands_print_warnings_as_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def warn(options: object) -> None:
        del options
        warnings.warn(f"\x1b[2J {LONG}", stacklevel=1)

    monkeypatch.setattr("jaxenstein.cli.listing.run", warn)
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        assert main(["list"]) == 0
    told = capsys.readouterr().err
    assert told.startswith("jaxenstein: warning: \\x1b[2J xxx")
    assert told.count("\n") == 1
    assert len(told) < 600


@pytest.mark.parametrize(
    "error",
    [
        errors.MapError("odd", line=1, column=2, source="map"),
        OutputError(Path("a"), "the disk is full"),
        jaxenstein.SettingError("odd"),
    ],
)
def test_errors_can_be_pickled(error: Exception) -> None:
    other = pickle.loads(pickle.dumps(error))
    assert (type(other), str(other), vars(other)) == (type(error), str(error), vars(error))
