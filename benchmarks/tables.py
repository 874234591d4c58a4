"""Tables in Markdown."""

from __future__ import annotations

from collections.abc import Sequence


def markdown(head: Sequence[str], body: Sequence[Sequence[str]], left: int = 1) -> str:
    """A table whose first `left` columns are aligned to the left, the others to the right."""
    rules = ["---" if column < left else "---:" for column in range(len(head))]
    rows = (head, rules, *body)
    # A bar inside a cell would end it.
    return "\n".join(f"| {' | '.join(cell.replace('|', '/') for cell in row)} |" for row in rows)


def number(value: float) -> str:
    """A figure with three digits that count, in full from 100 on."""
    if value >= 99.5:
        return f"{value:,.0f}"
    if value >= 9.95:
        return f"{value:.1f}"
    return f"{value:.2f}" if value >= 0.0995 else f"{value:.2g}"


def plural(count: int, thing: str) -> str:
    """A number and what is counted: 1 core, 2 cores."""
    return f"{count} {thing}{'' if count == 1 else 's'}"
