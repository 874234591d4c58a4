"""The rows of results with their ratios, and the columns of each table."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from benchmarks.measure import median_ratio

Row = Mapping[str, Any]
"""A subject in a file of results, with its axes, `rates` (steps per second) and `ratios`. A subject
that failed has the reason in `failed`, and no rates."""


class Column(NamedTuple):
    """A column of a table.

    Attributes:
        heading: the heading.
        show: returns the cell of a row; if a key is missing, the cell is empty.
        left: whether to align the column to the left.
    """

    heading: str
    show: Callable[[Row], str]
    left: bool = False


def rows_of(report: Mapping[str, Any]) -> list[Row]:
    """The subjects of a part of the suite."""
    rows = []
    for group in report["groups"]:
        rates = {row["name"]: row.get("steps_per_second") for row in group}
        for row in group:
            mine, ratios = rates[row["name"]], {}
            for heading, other in row["references"].items():
                if mine and rates.get(other):
                    ratios[heading] = median_ratio(mine["repeats"], rates[other]["repeats"])
            measured = {"rates": mine} if mine else {}
            rows.append({**row["axes"], **row, **measured, "ratios": ratios})
    return rows


def markdown(columns: Sequence[Column], rows: Sequence[Row]) -> str:
    """A table in Markdown."""
    rule = ["---" if column.left else "---:" for column in columns]
    head = [column.heading for column in columns]
    body = [[_cell(column, row) for column in columns] for row in rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in (head, rule, *body))


def _cell(column: Column, row: Row) -> str:
    try:
        # A bar would end the cell.
        return column.show(row).replace("|", "/")
    except (KeyError, TypeError):
        return ""


def number(value: float) -> str:
    """Format a number with three significant digits, or as an integer from 100."""
    if value >= 99.5:
        return f"{value:,.0f}"
    if value >= 9.95:
        return f"{value:.1f}"
    return f"{value:.2f}" if value >= 0.0995 else f"{value:.2g}"


def column(
    heading: str, *path: str, form: Callable[[Any], str] = str, unit: float = 0, left: bool = False
) -> Column:
    """A column of the values at a path of keys in the rows; the default path is the heading."""

    def show(row: Any) -> str:
        for key in path or (heading,):
            row = row[key]
        return form(row / unit if unit else row)

    return Column(heading, show, left)


def ratio(heading: str) -> Column:
    """A column with the ratio to another subject."""
    return column(heading, "ratios", heading, form=number)


def _quartiles(rates: Mapping[str, float]) -> str:
    return f"{rates['lower_quartile']:,.0f} - {rates['upper_quartile']:,.0f}"


def _seconds(row: Row) -> str:
    return (
        f"{number(1 / max(row['rates']['repeats']))} - {number(1 / min(row['rates']['repeats']))}"
    )


def _steps(row: Row) -> str:
    return "not measured" if "failed" in row else WHOLE(row["rates"]["median"])


def shown(part: str, rows: Sequence[Row]) -> Sequence[Row]:
    """The rows of the table and the plots of a part."""
    if part in ("environments", "resolutions", "observations"):
        # Without the reference subject of each group, which has no axes.
        return [row for row in rows if row["axes"]]
    return rows


WHOLE = "{:,.0f}".format
STEPS = Column("steps/s", _steps)
RATES = (
    STEPS,
    column("quartiles", "rates", form=_quartiles),
    Column("us a step", lambda row: number(1e6 / row["rates"]["median"])),
)
TITLE, ID = column("", "title", left=True), column("id", left=True)
VERSION = column("JAX", "versions", "jax")
BATCH, HOME = column("environments", "batch"), ratio("of my-way-home")
BESIDE = (TITLE, *RATES, ratio("x resized"), ratio("x raw"))

COLUMNS: Mapping[str, Sequence[Column]] = {
    "peers": BESIDE,
    "scenarios": (ID, *BESIDE, VERSION),
    "pictures": (ID, column("size"), *BESIDE),
    "cores": (TITLE, *RATES, ratio("x one core")),
    "environments": (ID, *RATES, HOME),
    "batches": (ID, BATCH, *RATES),
    "resolutions": (ID, column("size"), BATCH, *RATES, HOME),
    "observations": (ID, column("observation", left=True), *RATES, HOME),
    "adapters": (TITLE, BATCH, *RATES, ratio("of the loop")),
    "single": (
        column("size"), column("frame skip"), column("cores", left=True), TITLE, VERSION, *RATES,
        ratio("x Gymnasium"), ratio("x raw"),
    ),
    "starts": (
        ID, TITLE, VERSION, Column("seconds", lambda row: number(1 / row["rates"]["median"])),
        Column("range", _seconds),
    ),
    "training-compare": (
        ID, column("environments", "envs"), *RATES[:2], ratio("x RecurrentPPO"),
        column("ready after s", "ready_seconds", form=number),
    ),
    "convolutions": (
        column("network", left=True), column("size"), TITLE, *RATES[:2], ratio("x flax")
    ),
}  # fmt: skip


def table_of(part: str, rows: Sequence[Row]) -> str:
    """The table of a part."""
    return markdown(COLUMNS[part], shown(part, rows))
