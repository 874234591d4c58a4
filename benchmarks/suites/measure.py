"""Measuring groups of subjects in turn, each in a process of its own; what fails is noted."""

from __future__ import annotations

import dataclasses
import datetime
import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.suites.peers import Found, find
from benchmarks.suites.worker import SubjectError, Worker, run_rounds, tell
from jaxenstein.machine import describe_machine
from jaxenstein.speed.measuring import ONE_THREAD, summarise

FORMAT = 1


@dataclasses.dataclass(frozen=True)
class Subject:
    """One thing to measure: a row of a table.

    Attributes:
        name: what `benchmarks/subjects` builds; unique within its group.
        title: for people.
        axes: what distinguishes it, for tables and plots, such as `{"batch": 64}`.
        references: names of subjects of its group to divide by, with a heading for each ratio.
        peer: of `benchmarks.suites.peers`, whose interpreter runs it; "" for this one.
        python: an interpreter to run instead of this one; "" for none.
        pinned: whether it may use one core only.
        flags: XLA's; None for a subject that does without this project.
    """

    name: str
    title: str
    axes: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    references: Mapping[str, str] = dataclasses.field(default_factory=dict)
    peer: str = ""
    python: str = ""
    pinned: bool = True
    flags: str | None = ONE_THREAD


Groups = Sequence[Sequence[Subject]]


@dataclasses.dataclass(frozen=True)
class Settings:
    """How to measure.

    Attributes:
        core: the core that pinned subjects share; None where the system cannot pin.
        rounds: rounds that count, after one that does not.
        seconds: length of a chunk.
        quick: whether the sizes are tiny ones, only to see the suite work.
        only: how the names of the subjects begin; None for all of them.
    """

    core: int | None
    rounds: int
    seconds: float
    quick: bool = False
    only: list[str] | None = None


def measure(
    groups: Groups, settings: Settings, where: Callable[[str], Found] = find
) -> dict[str, Any]:
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
        "groups": [measure_group(group, settings, where) for group in groups],
    }


def measure_group(
    subjects: Sequence[Subject], settings: Settings, where: Callable[[str], Found] = find
) -> list[dict[str, Any]]:
    """Measure subjects in turn; one that cannot be started, or ends, stops no other.

    Returns:
        For each subject its name, title, axes and references, and either `failed`, the reason,
        or `versions`, `notes`, `ready_seconds`, `steps_per_second`, `disturbed` and
        `memory_bytes` at its peak.
    """
    failed: dict[str, str] = {}
    workers: dict[str, Worker] = {}
    try:
        for subject in subjects:
            tell(f"starting {subject.name} ...")
            found = where(subject.peer) if subject.peer else Found(subject.python)
            core = settings.core if subject.pinned else None
            try:
                if found.problem:
                    raise SubjectError(found.problem)
                workers[subject.name] = Worker(subject.name, found.python, core, subject.flags)
            except SubjectError as error:
                failed[subject.name] = str(error)
        rates = run_rounds(workers, settings.rounds, settings.seconds, failed)
        held = {name: workers[name].memory() for name in rates}
    finally:
        for worker in workers.values():
            worker.close()
    return [_result(subject, workers, rates, held, failed) for subject in subjects]


def _result(
    subject: Subject,
    workers: Mapping[str, Worker],
    rates: Mapping[str, list[float]],
    held: Mapping[str, int | None],
    failed: Mapping[str, str],
) -> dict[str, Any]:
    kept = ("name", "title", "axes", "references", "pinned")
    found = {name: value for name, value in vars(subject).items() if name in kept}
    if subject.name in failed:
        return found | {"failed": failed[subject.name]}
    worker = workers[subject.name]
    return found | {
        **worker.description,
        "steps_per_second": summarise(np.array(rates[subject.name])),
        "disturbed": worker.disturbed,
        "memory_bytes": held[subject.name],
    }
