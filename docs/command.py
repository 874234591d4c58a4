"""What the scripts that draw and measure for the site share."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence

from jaxenstein import environment_ids
from jaxenstein.progress import Progress


def parser_of(module: str, text: str | None) -> argparse.ArgumentParser:
    """A parser that takes ids, all of them by default."""
    parser = argparse.ArgumentParser(prog=f"python -m {module}", description=text)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("ids", nargs="*", metavar="ID", help="environments (default: all)")
    return parser


def each(ids: Sequence[str], doing: str) -> Iterator[str]:
    """The ids one after another, or all, with a progress bar."""
    names = ids or environment_ids()
    with Progress(len(names), doing, unit="environments") as progress:
        for i, name in enumerate(names, 1):
            progress.label = name
            progress.show()
            yield name
            progress.update(i)
