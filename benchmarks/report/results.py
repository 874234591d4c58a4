"""Reading what was measured: the rows of every file of results, with ratios worked out."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.suites.measure import FORMAT
from benchmarks.suites.parts import PARTS
from benchmarks.suites.worker import median_ratio
from jaxenstein.errors import SettingError

Row = Mapping[str, Any]
"""What a file says of one case or subject, its axes too, with `rates` (steps a second) and
`ratios`; without rates where there is `failed`, the reason."""
Report = Mapping[str, Any]


class Result(NamedTuple):
    """One file of results.

    Attributes:
        report: all of the file.
        rows: what was measured, also what failed.
    """

    report: Report
    rows: Sequence[Row]


def suite_rows(report: Report) -> Iterator[Row]:
    """The subjects of a part of the suite."""
    for group in report["groups"]:
        repeats = {row["name"]: row.get("steps_per_second", {}).get("repeats") for row in group}
        for row in group:
            mine, ratios = repeats[row["name"]], {}
            for heading, other in row["references"].items():
                if mine and repeats.get(other):
                    ratios[heading] = median_ratio(mine, repeats[other])
            yield _row({**row["axes"], **row}, ratios)


def _row(row: Row, ratios: Mapping[str, float]) -> Row:
    measured = {"rates": row["steps_per_second"]} if "steps_per_second" in row else {}
    return {**row, **measured, "ratios": ratios}


def _spread(report: Report) -> Iterator[Row]:
    first = report["rows"][0]["steps_per_second"]["median"]
    for row in report["rows"]:
        yield _row(row, {"x the first row": row["steps_per_second"]["median"] / first})


def device_row(row: Row, bandwidth: float) -> Row:
    """A case measured on an accelerator, on which a copy has so many bytes a second."""
    frames = {} if "failed" in row else row["frames_per_second"]
    limit = {"limit": frames["median"] * row["frame_bytes"] / bandwidth} if frames else {}
    return _row({**row, "image": f"{row['width']}x{row['height']}"}, limit)


OTHERS: Mapping[str, Callable[[Report], Iterator[Row]]] = {
    "device": lambda r: (device_row(row, r["copy_bytes_per_second"]) for row in r["rows"]),
    "spread": _spread,
    "training": lambda r: iter(r["rows"]),
}
"""Files of other commands, which a report includes where they lie beside the parts."""


def read_results(folder: Path) -> dict[str, Result]:
    """The results that a folder has, by name: the suite's parts in its order, then the others.

    Raises:
        SettingError: there is none of the suite, or a file is not what its name says.
    """
    found = {}
    for name in (*PARTS, *OTHERS):
        file = folder / f"{name}.json"
        if not file.exists():
            continue
        try:
            report = json.loads(file.read_text())
            told = (report["part"], report["format"]) if name in PARTS else (name, FORMAT)
            rows = [*OTHERS.get(name, suite_rows)(report)] if told == (name, FORMAT) else []
        except (OSError, ValueError) as error:
            raise SettingError(f"{file} cannot be read: {error}") from error
        except (KeyError, TypeError, IndexError):
            report, rows = {}, []
        if not rows:
            raise SettingError(f"{file} is no result of what writes files of this name")
        found[name] = Result(report, rows)
    if not set(found) & set(PARTS):
        raise SettingError(f"{folder} has no results: python -m benchmarks --json {folder}")
    return found
