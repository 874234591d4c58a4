"""Reading what the suite measured, for tables and plots."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.interleave import median_ratio
from benchmarks.measure import FORMAT
from benchmarks.parts import PARTS
from jaxenstein.errors import SettingError

# Files of other commands, which a report includes where they lie beside the parts.
OTHERS = ("device", "spread", "training")


@dataclass(frozen=True)
class Row:
    """One subject of a part.

    Attributes:
        name: of the subject.
        title: for people.
        axes: what distinguishes it.
        failed: why it was not measured, else "".
        rates: steps a second: `median`, `lower_quartile`, `upper_quartile`, `repeats`.
        ratios: medians over the rounds, by their headings.
        versions: of what ran.
        notes: what the subject said of itself.
        disturbed: chunks during which others used the core.
    """

    name: str
    title: str
    axes: Mapping[str, Any]
    failed: str
    rates: Mapping[str, Any]
    ratios: Mapping[str, float]
    versions: Mapping[str, str]
    notes: Mapping[str, str]
    disturbed: int

    @property
    def median(self) -> float:
        """Median steps a second."""
        return self.rates["median"]


@dataclass(frozen=True)
class Part:
    """One part's file."""

    name: str
    report: Mapping[str, Any]
    rows: Sequence[Row]

    @property
    def measured(self) -> list[Row]:
        """The rows that did not fail."""
        return [row for row in self.rows if not row.failed]

    def versions(self) -> dict[str, list[str]]:
        """All versions of each package that took part."""
        found: dict[str, set[str]] = {}
        for row in self.rows:
            for package, version in row.versions.items():
                found.setdefault(package, set()).add(version)
        return {package: sorted(versions) for package, versions in found.items()}


def read_parts(folder: Path) -> dict[str, Part]:
    """The parts that a folder has, in the suite's order.

    Raises:
        SettingError: there is none, or a file is none of this suite's.
    """
    parts = {}
    for name in PARTS:
        file = folder / f"{name}.json"
        if file.exists():
            report = _read(file)
            if report.get("format") != FORMAT or report.get("part") != name:
                raise SettingError(f"{file} is no result of 'python -m benchmarks {name}'")
            parts[name] = Part(name, report, [*_rows(report["groups"])])
    if not parts:
        raise SettingError(f"{folder} has no results: python -m benchmarks --json {folder}")
    return parts


def read_others(folder: Path) -> dict[str, Any]:
    """What the other commands wrote into the folder, by name."""
    files = {name: folder / f"{name}.json" for name in OTHERS}
    return {name: _read(file) for name, file in files.items() if file.exists()}


def _read(file: Path) -> Any:
    try:
        return json.loads(file.read_text())
    except (OSError, ValueError) as error:
        raise SettingError(f"{file} cannot be read: {error}") from error


def _rows(groups: Sequence[Sequence[Mapping[str, Any]]]) -> Iterator[Row]:
    for group in groups:
        rates = {row["name"]: row.get("steps_per_second") for row in group}
        for row in group:
            ratios = {}
            for heading, other in row["references"].items():
                mine, others = rates[row["name"]], rates.get(other)
                if mine and others:
                    ratios[heading] = median_ratio(mine["repeats"], others["repeats"])
            yield Row(
                name=row["name"],
                title=row["title"],
                axes=row["axes"],
                failed=row.get("failed", ""),
                rates=row.get("steps_per_second", {}),
                ratios=ratios,
                versions=row.get("versions", {}),
                notes=row.get("notes", {}),
                disturbed=len(row.get("disturbed", ())),
            )
