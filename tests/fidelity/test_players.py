"""Wrong arguments are told before anything is measured."""

from __future__ import annotations

import pytest

from fidelity import players
from jaxenstein.errors import JAXensteinError


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("--ids nosuch", "unknown environment 'nosuch'"),
        ("--ids simple --param foo=1", "has no 'foo'"),
        ("--ids simple --param discount=2", "discount must be"),
    ],
)
def test_wrong_arguments(words: str, told: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(JAXensteinError, match=told):
        players.main(words.split())
    assert not capsys.readouterr().out
