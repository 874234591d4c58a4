"""What the scripts that draw and measure for the site share."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence

from jaxenstein.catalogue import MAIN_IDS
from jaxenstein.progress import Progress


def parser_of(module: str, text: str | None) -> argparse.ArgumentParser:
    """A parser that takes ids, by default all but variants of others."""
    parser = argparse.ArgumentParser(prog=f"python -m {module}", description=text)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument(
        "ids", nargs="*", metavar="ID", help="environments (default: all but variants)"
    )
    return parser


def each(ids: Sequence[str], doing: str) -> Iterator[str]:
    """The ids one after another, or all but variants, with a progress bar."""
    names = ids or MAIN_IDS
    with Progress(len(names), doing, unit="environments") as progress:
        for i, name in enumerate(names, 1):
            progress.label = name
            progress.show()
            yield name
            progress.update(i)
