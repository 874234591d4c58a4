"""Which environments share a page of the site; what it says first is in families.toml."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import NamedTuple

from jaxenstein.catalogue import ENTRIES, MAIN_IDS


class Family(NamedTuple):
    """Environments that are sizes or variants of one task.

    Attributes:
        name: of the page.
        title: its heading.
        original: the word by which a heading of docs/fidelity.md names the task.
        text: what they are, in Markdown.
    """

    name: str
    title: str
    original: str
    text: str

    @property
    def ids(self) -> tuple[str, ...]:
        """The environments but variants of others, in the order of the catalogue."""
        return tuple(name for name in MAIN_IDS if ENTRIES[name].family == self.name)

    @property
    def variants(self) -> tuple[str, ...]:
        """The variants among them."""
        every = (name for name, entry in ENTRIES.items() if entry.family == self.name)
        return tuple(name for name in every if ENTRIES[name].variant_of)


_LISTED = tomllib.loads(Path(__file__).with_name("families.toml").read_text("utf-8"))
FAMILIES = tuple(Family(name=name, **said) for name, said in _LISTED.items())
