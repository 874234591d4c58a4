"""Parts of the pages of environments: tables, and content from other files."""

from __future__ import annotations

import functools
import json
import math
import re
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

import jaxenstein
from jaxenstein.catalogue import ENTRIES, MAIN_IDS
from jaxenstein.players import players_of
from jaxenstein.progress import Progress

HERE = Path(__file__).parent
RETURNS, AGENTS = HERE / "returns.json", HERE / "agents.json"
# The end of the names of pretrained agents that see pixels of Doom's scenarios, after the id.
PIXELS = "-pixels"

OF_ALL = {
    "position": "(x, y) in tiles: x along a row of the map, y down the rows",
    "heading": "radians, 0 along +x, growing clockwise on the map",
    "cell": "(column, row) of the tile",
    "episode_return": "undiscounted sum of the rewards since the reset",
    "episode_length": "world steps since the reset",
}
"""The entries of `info` that every task has."""

SHOWN = {
    "../CHANGELOG.md": "changelog.md",
    "../CONTRIBUTING.md": "contributing.md",
}
"""Files outside docs, and the pages that show them."""


class Family(NamedTuple):
    """Environments that are sizes or variants of one task.

    Attributes:
        name: name of the page.
        title: heading of the page.
        original: stem of the file in docs/originals that compares the task with its original.
        text: introduction in Markdown.
    """

    name: str
    title: str
    original: str
    text: str

    @property
    def ids(self) -> tuple[str, ...]:
        """The environments without variants, in the order of the catalogue."""
        return tuple(name for name in MAIN_IDS if ENTRIES[name].family == self.name)

    @property
    def variants(self) -> tuple[str, ...]:
        """The variants of the family."""
        every = (name for name, entry in ENTRIES.items() if entry.family == self.name)
        return tuple(name for name in every if ENTRIES[name].variant_of)


_LISTED = tomllib.loads((HERE / "families.toml").read_text("utf-8"))
FAMILIES = tuple(Family(name=name, **said) for name, said in _LISTED.items())
"""The families, each with its page; families.toml has the introductions."""


def four_digits(value: float) -> float | None:
    """Four digits of a number for a file; None for NaN."""
    return None if math.isnan(value) else float(f"{value:.4g}")


def each(ids: Sequence[str], doing: str) -> Iterator[str]:
    """Iterate over ids, or all environments without variants, with a progress bar."""
    names = ids or MAIN_IDS
    with Progress(len(names), doing, unit="environments") as progress:
        for i, name in enumerate(names, 1):
            progress.label = name
            progress.show()
            yield name
            progress.update(i)


def table(head: Sequence[str], rows: Iterable[Sequence[str]], right: Sequence[int] = ()) -> str:
    """A Markdown table.

    Args:
        head: the headings.
        rows: the cells of each row.
        right: columns that are aligned to the right.
    """
    rule = ["---:" if i in right else "---" for i in range(len(head))]
    lines = [head, rule, *([cell.replace("|", r"\|") for cell in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def link_to(name: str) -> str:
    """A link to the section of an environment, or to the table that lists it as a variant."""
    entry = ENTRIES[name]
    return f"[`{name}`]({entry.family}.md#{'variants' if entry.variant_of else name})"


def turned(text: str) -> str:
    """Point links to Markdown outside docs at the page that shows it, or remove the link."""

    def turn(match: re.Match[str]) -> str:
        words, target, anchor = match.groups(default="")
        return f"[{words}]({SHOWN[target]}{anchor})" if target in SHOWN else words

    return re.sub(r"\[([^\]]+)\]\((\.\./[^)#]+\.md)(#[^)]*)?\)", turn, text)


def info_table(env: Any, params: Any) -> str:
    """The entries of `info` with their types, from a trace of a step that draws no frame."""
    key, params = jax.random.key(0), env.check_params(params)
    state = jax.eval_shape(env.init_state, key, params)
    info = jax.eval_shape(env.advance, key, state, jnp.int32(0), params)[3]
    meanings = meanings_of(env)
    rows = [
        (f"`{name}`", f"{leaf.dtype}{list(leaf.shape)}", meanings[name])
        for name, leaf in info.items()
    ]
    return table(("`info`", "type", "meaning"), rows)


def meanings_of(env: Any) -> dict[str, str]:
    """The meaning of each entry of `info`."""
    about = env.about()
    events = {
        name: f"how often the agent {event.one} in this step"
        if event.several
        else f"the agent {event.one} in this step"
        for name, event in about.events.items()
    }
    return {**OF_ALL, "success": f"the agent {about.aim} in this step", **events, **about.variables}


@functools.cache
def stored_returns() -> dict[str, Any]:
    """The results of `docs.measured returns`."""
    return json.loads(RETURNS.read_text("utf-8"))


def stored_rows(name: str) -> list[dict[str, Any]]:
    """The measured rows of an environment: the random player first, then the expert."""
    return [row for row in stored_returns()["players"] if row["id"] == name]


@functools.cache
def stored_agents() -> list[dict[str, Any]]:
    """The results of `docs.measured agent`, in the order of the catalogue."""
    rows = json.loads(AGENTS.read_text("utf-8"))
    return sorted(rows, key=lambda row: list(ENTRIES).index(row["id"]))


def returns(name: str) -> str:
    """The returns of the scripted players as a table."""
    stored = stored_rows(name)
    if not stored:
        return f"No returns measured yet: run `python -m docs.measured returns {name}`."
    players = players_of(jaxenstein.make(name)[0])
    rows = [
        (
            players[row["player"]].summary,
            f"{row['mean']:.4g} +- {row['error']:.2g}",
            f"{row['least']:.4g} to {row['most']:.4g}",
            f"{row['length']:.0f}",
            f"{100 * row['success']:.1f} %",
        )
        for row in stored
    ]
    head = ("player", "mean return", "range", "steps", "success")
    rows_of = f"{stored[0]['episodes']} episodes of version {stored[0]['version']}"
    measured = f"{rows_of}, at frame skip 1 and with the default params"
    listed = table(head, rows, right=(1, 2, 3, 4))
    return f"Returns over {measured}, with standard errors:\n\n{listed}"


def fidelity(family: Family) -> str:
    """The family's file in docs/originals; its links are relative to a folder below docs, too."""
    text = (HERE / "originals" / f"{family.original}.md").read_text("utf-8")
    return f"{text}\n[Fidelity](../fidelity.md) compares all environments.\n"


def history(family: Family) -> str:
    """The current versions, and the changes that name one of the ids."""
    versions = sorted({ENTRIES[name].version for name in family.ids})
    rows = [
        (release, " ".join(entry.split()))
        for release, body in _parts((HERE.parent / "CHANGELOG.md").read_text("utf-8"))
        for entry in re.split(r"^(?:- |### .*)", body, flags=re.MULTILINE)
        if any(_names(entry, name) for name in (*family.ids, *family.variants))
    ]
    return (
        "## Versions\n\nResults are comparable only between equal versions of an environment. The "
        f"current version{' is' if len(versions) == 1 else 's are'} "
        f"{', '.join(map(str, versions))}.\n\n{table(('release', 'change'), rows)}\n"
    )


def _parts(text: str) -> list[tuple[str, str]]:
    """The sections of a Markdown file, from its second-level headings: (title, body)."""
    parts = re.split(r"^## +(.+)$", text, flags=re.MULTILINE)
    return [(title, body.strip()) for title, body in zip(parts[1::2], parts[2::2], strict=True)]


def _names(text: str, name: str) -> bool:
    """Whether a text has an id in backticks, or a pattern with `*` that matches it."""
    words = re.findall(r"`([a-z0-9*-]+)`", text)
    return any(re.fullmatch(re.escape(word).replace(r"\*", ".*"), name) for word in words)
