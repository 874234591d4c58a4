"""What the scripts that play ViZDoom share."""

from __future__ import annotations

import sys

from jaxenstein.errors import JAXensteinError


def single_buttons(count: int, *, idle: bool) -> list[list[int]]:
    """The actions that press at most one of `count` buttons; the first presses none if `idle`."""
    pressed = [[int(i == j) for j in range(count)] for i in range(count)]
    return [[0] * count, *pressed] if idle else pressed


def complaint(error: JAXensteinError) -> int:
    """Tell what went wrong on the error stream; the exit code."""
    print(f"fidelity: {error}", file=sys.stderr)
    return 2
