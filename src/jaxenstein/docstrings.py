"""What docstrings say of attributes, for help texts and pages."""

from __future__ import annotations

import inspect
import re


def attributes(cls: type) -> dict[str, str]:
    """The documented attributes of a class with their meanings, those of its bases first.

    Empty under `python -OO`, which strips docstrings.
    """
    found: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        text = inspect.cleandoc(base.__dict__.get("__doc__") or "")
        # Up to the next part of the docstring.
        listed = re.split(r"^\S", text.partition("Attributes:\n")[2], flags=re.MULTILINE)[0]
        entries = re.findall(r"^ {4}(\w+): (.*?)(?=^ {4}\w|\Z)", listed, re.MULTILINE | re.DOTALL)
        found |= {name: " ".join(meaning.split()) for name, meaning in entries}
    return found
