"""Files of results, which the same command goes on with."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from jaxenstein.files import OutputError, atomic


def write(file: Path, report: Mapping[str, Any]) -> None:
    """Write a file of results, whole or not at all."""
    with atomic(file) as path:
        path.write_text(json.dumps(report, indent=1))


def earlier(file: Path, now: Mapping[str, Any]) -> dict[str, Any] | None:
    """What a file has, if it was measured as it would be now; None if it is not there.

    Args:
        file: of results.
        now: entries that must be the same, such as `settings` and `hardware`.

    Raises:
        OutputError: it is of something else, of another machine or of other settings.
    """
    if not file.exists():
        return None
    other = "choose another place, or remove it"
    try:
        report = json.loads(file.read_text())
        leaves = [*_leaves(now, report)]
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise OutputError(file, f"it is there and no result of this command; {other}") from error
    changed = [f"{name} {before}, not {value}" for name, before, value in leaves if before != value]
    if changed:
        raise OutputError(file, f"it was measured with {'; '.join(changed)}; {other}")
    return report


def _leaves(now: Mapping[str, Any], report: Mapping[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    for name, value in now.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, report[name])
        else:
            yield name, report.get(name), value
