"""What the scripts that play ViZDoom share."""

from __future__ import annotations

import sys

from jaxenstein.errors import JAXensteinError


def complaint(error: JAXensteinError) -> int:
    """Tell what went wrong on the error stream; the exit code."""
    print(f"fidelity: {error}", file=sys.stderr)
    return 2
