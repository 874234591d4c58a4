"""Arguments and ends of the commands in `benchmarks/`, `docs/`, `experiments/` and `fidelity/`."""

from __future__ import annotations

from collections.abc import Callable
from typing import NoReturn

from jaxenstein.cli.arguments import reader
from jaxenstein.errors import JAXensteinError, one_line
from jaxenstein.fields import Domain

positive = reader(Domain("number", above=0))
"""An argument type: a finite number above 0."""


def run_command(main: Callable[[], int | None]) -> NoReturn:
    """Run a command; one of our errors ends it with a line and exit status 1."""
    try:
        raise SystemExit(main())
    except JAXensteinError as error:
        raise SystemExit(one_line(str(error))) from None
