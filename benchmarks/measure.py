"""Measuring groups of subjects in turn, each in a process of its own; what fails is noted."""

from __future__ import annotations

import dataclasses
import datetime
import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.interleave import SubjectError, Worker, run_rounds, tell
from jaxenstein.speed.measuring import ONE_THREAD, describe_machine, summarise

FORMAT = 1


@dataclasses.dataclass(frozen=True)
class Subject:
    """One thing to measure.

    Attributes:
        name: what `subjects.py` builds; unique within its group.
        title: for people.
        axes: what distinguishes it, for tables and plots, such as `{"batch": 64}`.
        references: names of subjects of its group to divide by, with a heading for each ratio.
        python: the interpreter to run; "" for this one.
        jax: whether it needs this project.
        pinned: whether it may use one core only.
        flags: XLA's, for a subject that needs this project.
        problem: why it cannot be started at all, else "".
    """

    name: str
    title: str
    axes: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    references: Mapping[str, str] = dataclasses.field(default_factory=dict)
    python: str = ""
    jax: bool = True
    pinned: bool = True
    flags: str = ONE_THREAD
    problem: str = ""


@dataclasses.dataclass(frozen=True)
class Settings:
    """How to measure.

    Attributes:
        core: the core that pinned subjects share; None where the system cannot pin.
        rounds: rounds that count, after one that does not.
        seconds: length of a chunk.
        quick: whether the sizes are tiny ones, only to see the suite work.
    """

    core: int | None
    rounds: int
    seconds: float
    quick: bool = False


def measure(groups: Sequence[Sequence[Subject]], settings: Settings) -> dict[str, Any]:
    """Measure groups one after another.

    Returns:
        What goes into a part's file but for its name: `format`, `began` (UTC), `versions`,
        `hardware`, `settings`, `load` (what else ran at the start) and `groups`, lists with a
        dictionary for each subject.
    """
    began = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    return {
        "format": FORMAT,
        "began": began,
        **describe_machine(),
        "settings": dataclasses.asdict(settings),
        "load": load,
        "groups": [measure_group(group, settings) for group in groups],
    }


def measure_group(subjects: Sequence[Subject], settings: Settings) -> list[dict[str, Any]]:
    """Measure subjects in turn; one that cannot be started, or ends, stops no other.

    Returns:
        For each subject its name, title, axes and references, and either `failed`, the reason,
        or `versions`, `notes`, `ready_seconds`, `steps_per_second` and `disturbed`.
    """
    failed = {subject.name: subject.problem for subject in subjects if subject.problem}
    workers: dict[str, Worker] = {}
    try:
        for subject in subjects:
            if subject.problem:
                continue
            tell(f"starting {subject.name} ...")
            core = settings.core if subject.pinned else None
            try:
                workers[subject.name] = Worker(
                    subject.name, subject.python, core, subject.jax, subject.flags
                )
            except SubjectError as error:
                failed[subject.name] = error.reason
        rates = run_rounds(workers, settings.rounds, settings.seconds, failed)
    finally:
        for worker in workers.values():
            worker.close()
    return [_result(subject, workers, rates, failed) for subject in subjects]


def _result(
    subject: Subject,
    workers: Mapping[str, Worker],
    rates: Mapping[str, list[float]],
    failed: Mapping[str, str],
) -> dict[str, Any]:
    found = {
        "name": subject.name,
        "title": subject.title,
        "axes": dict(subject.axes),
        "references": dict(subject.references),
        "pinned": subject.pinned,
    }
    if subject.name in failed:
        return found | {"failed": failed[subject.name]}
    worker = workers[subject.name]
    return found | {
        **worker.description,
        "steps_per_second": summarise(np.array(rates[subject.name])),
        "disturbed": worker.disturbed,
    }
