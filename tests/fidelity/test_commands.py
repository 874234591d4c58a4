"""How commands end."""

from __future__ import annotations

import pytest

from fidelity.commands import run_command
from jaxenstein.errors import SettingError


def test_our_errors_end_a_command_with_a_line() -> None:
    def fail() -> int:
        raise SettingError("wrong:\n  id")

    with pytest.raises(SystemExit, match=r"^wrong: id$"):
        run_command(fail)
    with pytest.raises(SystemExit) as ended:
        run_command(lambda: 3)
    assert ended.value.code == 3
