"""Tables and plots as data: which columns the table of each file of results has."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from benchmarks.report.plots import Bars, Lines, pixels
from benchmarks.report.results import Result, Row
from benchmarks.suites.parts import ADAPTERS


class Column(NamedTuple):
    """A column of a table.

    Attributes:
        heading: its first line.
        show: the cell of a row; a row that lacks what it takes has an empty one.
        left: whether it is aligned to the left.
    """

    heading: str
    show: Callable[[Row], str]
    left: bool = False


class Table(NamedTuple):
    """How the rows of a file of results are shown.

    Attributes:
        columns: of the table.
        plots: by the names that templates call them by.
        rows: which rows are shown.
    """

    columns: Sequence[Column]
    plots: Mapping[str, Bars | Lines] = {}
    rows: Callable[[Sequence[Row]], Sequence[Row]] = lambda rows: rows


def markdown(columns: Sequence[Column], rows: Sequence[Row]) -> str:
    """A table in Markdown."""
    rule = ["---" if column.left else "---:" for column in columns]
    head = [column.heading for column in columns]
    body = [[_cell(column, row) for column in columns] for row in rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in (head, rule, *body))


def _cell(column: Column, row: Row) -> str:
    try:
        # A bar inside a cell would end it.
        return column.show(row).replace("|", "/")
    except (KeyError, TypeError):
        return ""


def number(value: float) -> str:
    """A figure with three digits that count, in full from 100 on."""
    if value >= 99.5:
        return f"{value:,.0f}"
    if value >= 9.95:
        return f"{value:.1f}"
    return f"{value:.2f}" if value >= 0.0995 else f"{value:.2g}"


def whole(value: float) -> str:
    """A figure without decimals."""
    return f"{value:,.0f}"


def column(
    heading: str, *path: str, form: Callable[[Any], str] = str, unit: float = 0, left: bool = False
) -> Column:
    """A column of what lies in the rows under these keys (the heading), one inside the other."""

    def show(row: Any) -> str:
        for key in path or (heading,):
            row = row[key]
        return form(row / unit if unit else row)

    return Column(heading, show, left)


def ratio(heading: str) -> Column:
    """How many times as fast as another subject."""
    return column(heading, "ratios", heading, form=number)


def _quartiles(rates: Mapping[str, float]) -> str:
    return f"{rates['lower_quartile']:,.0f} - {rates['upper_quartile']:,.0f}"


def _steps(row: Row) -> str:
    return "not measured" if "failed" in row else whole(row["rates"]["median"])


def _with_axes(rows: Sequence[Row]) -> Sequence[Row]:
    """Without the subject that each group was measured beside, which has nothing of its own."""
    return [row for row in rows if row["axes"]]


def _adapters(rows: Sequence[Row]) -> Sequence[Row]:
    """The adapters, each with the native figure of its kind, partner and number."""
    scans = tuple(each.kind for each in ADAPTERS if each.scan)
    rates = {(row["partner"], row["name"]): row.get("rates") for row in rows}
    found = []
    for row in rows:
        kind, _, batch = row["name"].rpartition("-")
        native, heading = "adapter-loop", "of the loop"
        if kind in scans:
            native, heading = "scan", "of the scan"
        if kind not in ("scan", "adapter-loop"):
            ratios = {"of the native": row["ratios"].get(heading)}
            beside = rates.get((row["partner"], f"{native}-{batch}"))
            found.append({**row, "ratios": ratios, "native": beside})
    return found


STEPS = Column("steps/s", _steps)
RATES = (
    STEPS,
    column("quartiles", "rates", form=_quartiles),
    Column("us a step", lambda row: number(1e6 / row["rates"]["median"])),
)
TITLE, ID = column("", "title", left=True), column("id", left=True)
BATCH, HOME = column("environments", "batch"), ratio("of my-way-home")
BESIDE = Table((TITLE, *RATES, ratio("x resized"), ratio("x raw")))
MIB = 2**20

TABLES: Mapping[str, Table] = {
    "peers": BESIDE,
    "compare": BESIDE,
    "frame-skip": Table((*BESIDE.columns, ratio("x no frames"))),
    "scenarios": Table((ID, *BESIDE.columns)),
    "cores": Table((TITLE, *RATES, ratio("x one core")), {"cores": Bars("title")}),
    "environments": Table((ID, *RATES, HOME), {"environments": Bars("id")}, _with_axes),
    "batches": Table(
        (ID, BATCH, *RATES), {"batches": Lines("batch", "environments side by side")}
    ),
    "resolutions": Table(
        (ID, column("size"), BATCH, *RATES, HOME),
        {"resolutions": Lines("size", "image", pixels, logarithmic=True)}, _with_axes,
    ),
    "observations": Table((ID, column("observation", left=True), *RATES, HOME), {}, _with_axes),
    "maps-and-sprites": Table(
        (column("tiles a side", "map"), column("sprites"), *RATES, HOME),
        {"maps": Lines("map", "tiles a side"), "sprites": Lines("sprites", "sprites")}, _with_axes,
    ),
    "limits": Table((TITLE, *RATES, HOME)),
    "stages": Table((ID, column("stage", left=True), *RATES, ratio("of the step"))),
    "adapters": Table(
        (
            TITLE, BATCH, *RATES, column("native steps/s", "native", "median", form=whole),
            ratio("of the native"),
        ),
        rows=_adapters,
    ),
    "resets": Table((TITLE, *RATES, ratio("of a step"))),
    "starts": Table(
        (
            TITLE, Column("s", lambda row: number(1 / row["rates"]["median"])),
            Column("x import jax", lambda row: number(1 / row["ratios"]["of import jax"])),
        )
    ),
    "updates": Table(
        (TITLE, *RATES[:2], ratio("of large products"),
         column("MiB", "memory_bytes", form=whole, unit=MIB)),
    ),
    "training-compare": Table(
        (
            ID, column("environments", "envs"), *RATES[:2], ratio("x RecurrentPPO"),
            column("ready after s", "ready_seconds", form=number),
            column("MiB", "memory_bytes", form=whole, unit=MIB),
        ),
        {"training": Lines("envs", "environments")},
    ),
    "training": Table(
        (
            column("algorithm", "algo", left=True), column("dtype", left=True),
            column("environments", "num_envs"), column("steps/s", "steps_per_second", form=whole),
            column("first call s", "first_call_seconds", form=whole),
        )
    ),
    "spread": Table(
        (
            column("devices"), column("environments", "batch", form=whole), STEPS,
            ratio("x the first row"),
        )
    ),
    "device": Table(
        (
            ID, column("image"), column("batch", form=whole), STEPS,
            column("frames/s", "frames_per_second", "median", form=whole),
            column("of the limit", "ratios", "limit", form="{:.1%}".format),
            column("compile s", "compile_seconds", form="{:.1f}".format),
            column("MiB", "program_bytes", form=whole, unit=MIB),
            column("kernels", "kernels_a_step", "count", form=whole),
        )
    ),
}  # fmt: skip


def table_of(file: str, result: Result) -> str:
    """The table of a file of results."""
    table = TABLES.get(file, BESIDE)
    return markdown(table.columns, table.rows(result.rows))
