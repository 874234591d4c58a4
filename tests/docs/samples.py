"""The checkable parts of a Markdown page: its Python, its commands, its links."""

from __future__ import annotations

import re
import shlex
import sys
from pathlib import Path
from typing import Any, NamedTuple

import jax

ROOT = Path(__file__).parents[2]
GENERATED = ROOT / "docs" / "commands.md"
PAGES = [ROOT / "README.md", *sorted({*(ROOT / "docs").glob("*.md")} - {GENERATED})]
for folder in ("benchmarks", "originals"):
    PAGES += sorted((ROOT / "docs" / folder).glob("*.md"))
# Modules that every sample can import; others are partners that may be missing.
ALWAYS_INSTALLED = {*sys.stdlib_module_names, "PIL", "custom_task"}
ALWAYS_INSTALLED |= {"examples", "jax", "jaxenstein", "numpy"}


class Sample(NamedTuple):
    """A Python block of a page.

    Attributes:
        page: the file.
        line: of its first line, from 1.
        code: the block.
    """

    page: Path
    line: int
    code: str

    @property
    def partners(self) -> list[str]:
        """The imported packages that may be missing."""
        found = re.findall(r"^(?:import|from) (\w+)", self.code, re.MULTILINE)
        # ViZDoom's ids read its pictures.
        found += ["vizdoom"] if "jaxenstein/Vizdoom" in self.code else []
        return sorted({name for name in found if name not in ALWAYS_INSTALLED})

    def run(self, names: dict[str, Any]) -> None:
        """Execute it; errors name the line of the page."""
        code = compile("\n" * (self.line - 1) + self.code, str(self.page), "exec")
        # Users run with JAX's own promotion rules, not with the strict ones of these tests.
        with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
            exec(code, names)


def samples(page: Path) -> list[Sample]:
    """The Python blocks of a page; of a change, the programs before it and after it."""
    text = page.read_text("utf-8")
    found = []
    for match in re.finditer(r"^```(python|diff)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
        codes = [match[2]]
        if match[1] == "diff":
            # The lines of the other side stay as empty ones.
            codes = [re.sub(f"^[{side}].*", "", match[2], flags=re.MULTILINE) for side in "+-"]
            codes = [re.sub("^[ +-]", "", code, flags=re.MULTILINE) for code in codes]
        line = text.count("\n", 0, match.start(2)) + 1
        found += [Sample(page, line, code) for code in codes]
    return found


def commands(page: Path) -> list[list[str]]:
    """The lines of the blocks without a language, as words; comments are left out."""
    text = page.read_text("utf-8")
    blocks = re.findall(r"^```(\w*)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    lines = [line for language, block in blocks if not language for line in block.splitlines()]
    known = re.compile(r"(\.venv/bin/)?(jaxenstein|make|python|pip) ")
    return [shlex.split(line, comments=True) for line in lines if known.match(line)]


def prose(page: Path) -> str:
    """A page without its Python blocks."""
    return re.sub(r"^```python\n.*?^```$", "", page.read_text("utf-8"), flags=re.M | re.S)


def anchors(text: str) -> set[str]:
    """The anchors of the headings of a page without Python, as the site and GitHub make them."""
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    plain = [re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).lower() for heading in headings]
    return {re.sub(r"[^\w -]", "", heading).strip().replace(" ", "-") for heading in plain}


def links(page: Path) -> list[str]:
    """The files of this repository that a page links to or shows, without anchors."""
    text = prose(page)
    targets = re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", text)
    targets += re.findall(r"^```\{(?:image|include|literalinclude)\} (\S+)$", text, re.MULTILINE)
    return [target for target in targets if not re.match(r"[a-z]+:", target)]
