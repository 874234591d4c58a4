"""Training beside RecurrentPPO on ViZDoom, of `train_compare.py`, as table and section."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.measure import FORMAT
from benchmarks.report_texts import TRAINING_DIFFERS, TRAINING_INTRODUCTION, TRAINING_MATCHES
from benchmarks.tables import markdown, number, plural
from jaxenstein.errors import SettingError

PART = "training-compare"
OURS, THEIRS = "jaxenstein", "sb3"
TITLES = {OURS: "JAXenstein", THEIRS: "RecurrentPPO, ViZDoom"}
# The number of environments above which ViZDoom is said to fail.
CLAIMED = 64
FULL_ROLLOUT = 128
MIB = 2**20
LIMITS = {
    "memory_free_bytes": "memory free",
    "shared_memory_free_bytes": "shared memory free",
    "processes": "processes allowed",
    "group_processes": "in the container",
    "files": "files allowed",
}


def read_comparison(folder: Path) -> dict[str, Any]:
    """The file of the comparison under its name, if the folder has it.

    Raises:
        SettingError: it is none of `train_compare.py`.
    """
    file = folder / f"{PART}.json"
    if not file.exists():
        return {}
    try:
        report = json.loads(file.read_text())
        fits = (report["part"], report["format"]) == (PART, FORMAT) and bool(report["rows"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SettingError(f"{file} cannot be read: {error}") from error
    if not fits:
        raise SettingError(f"{file} is no result of 'python -m benchmarks.train_compare'")
    return {PART: report}


def comparison_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Steps a second of both sides by environments; what came before, and memory, apart."""
    head = ["environments", "JAXenstein steps/s", "RecurrentPPO steps/s", "ratio"]
    head += ["compile s", "ViZDoom start s", "JAXenstein MiB", "ViZDoom MiB"]
    body = []
    for row in rows:
        ours, theirs = (row["sides"][side] for side in (OURS, THEIRS))
        rates = [_median(side) for side in (ours, theirs)]
        cells = [str(row["envs"]), *(_rate(side) for side in (ours, theirs))]
        cells.append(number(rates[0] / rates[1]) if rates[0] and rates[1] else "")
        cells += [_figure(ours, "compile_seconds"), _figure(theirs, "creation_seconds")]
        cells += [_figure(side, "memory_bytes", MIB) for side in (ours, theirs)]
        body.append(cells)
    return markdown(head, body, left=0)


def comparison_failures(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """A line for each reason for which something was not measured."""
    reasons: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        for side, found in row["sides"].items():
            if "failed" in found:
                reasons.setdefault((side, found["failed"]), []).append(str(row["envs"]))
    for (side, reason), numbers in reasons.items():
        yield f"- {TITLES[side]}, {', '.join(numbers)}: {reason}"


def comparison_sections(
    report: Mapping[str, Any], folder: str, pictures: Sequence[str]
) -> Iterator[str]:
    """The section of the page.

    Args:
        report: the file.
        folder: where it lies, for the command.
        pictures: paths of its plots.
    """
    rows, settings = report["rows"], report["settings"]
    yield "## Training beside ViZDoom"
    yield TRAINING_INTRODUCTION
    if settings["rollout"] != FULL_ROLLOUT:
        yield (
            f"**Rollouts of {settings['rollout']} steps in place of {FULL_ROLLOUT}: a trial, whose "
            "figures mean nothing.**"
        )
    yield from (f"![Training beside ViZDoom]({picture})" for picture in pictures)
    yield comparison_table(rows)
    if failures := [*comparison_failures(rows)]:
        yield "Not measured, and why:\n\n" + "\n".join(failures)
    yield claim(rows)
    yield _circumstances(report)
    yield TRAINING_MATCHES
    yield TRAINING_DIFFERS
    numbers = " ".join(str(row["envs"]) for row in rows)
    words = [f"python -m benchmarks.train_compare --envs {numbers} --json {folder}/{PART}.json"]
    words += [f"--seconds {settings['seconds']:g}", f"--limit {settings['limit']:g}"]
    words += [f"--rollout {settings['rollout']}"] * (settings["rollout"] != FULL_ROLLOUT)
    words += [f"--vector {settings['vector']}"] * (settings["vector"] != "auto")
    yield f"`{' '.join(words)}`"


def claim(rows: Sequence[Mapping[str, Any]]) -> str:
    """What became of ViZDoom above 64 environments, where it is said to fail."""
    outcomes: dict[str, list[str]] = {"trained": [], "failed": [], "was not tried": []}
    for row in rows:
        if row["envs"] > CLAIMED:
            theirs = row["sides"][THEIRS]
            untried = theirs.get("skipped") or theirs.get("missing")
            kind = "was not tried" if untried else "failed" if "failed" in theirs else "trained"
            outcomes[kind].append(str(row["envs"]))
    told = [f"{kind} with {' and '.join(ns)}" for kind, ns in outcomes.items() if ns]
    here = f"here it {'; it '.join(told)} environments" if told else "here that was not tried"
    return f"ViZDoom is said to fail above {CLAIMED} environments; {here}."


def _circumstances(report: Mapping[str, Any]) -> str:
    """The versions, threads and devices, and what the machine allowed at the first row."""
    hardware, first = report["hardware"], report["rows"][0]
    cores = plural(hardware["cores_allowed"] or hardware["cores"], "core")
    lines = [f"{cores} of {hardware['cpu']}, {hardware['platform']}."]
    for side in (OURS, THEIRS):
        found = next((r["sides"][side] for r in report["rows"] if "rates" in r["sides"][side]), {})
        if found:
            versions = ", ".join(f"{name} {v}" for name, v in found.get("versions", {}).items())
            told = [f"{TITLES[side]}: {found.get('parameters', 0):,} parameters"]
            told += [f"on {found['device']}"] if "device" in found else []
            told += [plural(found["threads"], "thread")] if "threads" in found else []
            lines.append(", ".join([*told, versions]) + ".")
    free = first["limits"][THEIRS]
    told = []
    for key, name in LIMITS.items():
        value = free.get(key)
        if value is not None:
            told.append(
                f"{name} {value / 2**30:.1f} GiB" if "bytes" in key else f"{name} {value:,}"
            )
    if told:
        lines.append(f"Before the first row: {', '.join(told)}.")
    return "\n".join(lines)


def _median(side: Mapping[str, Any]) -> float:
    return side["steps_per_second"]["median"] if "steps_per_second" in side else 0.0


def _rate(side: Mapping[str, Any]) -> str:
    if "failed" in side:
        return "not tried" if side.get("skipped") else "failed"
    return f"{_median(side):,.0f}"


def _figure(side: Mapping[str, Any], name: str, unit: int = 1) -> str:
    value = side.get(name)
    if value is None:
        return ""
    return f"{value / unit:,.0f}" if unit > 1 else number(value)
