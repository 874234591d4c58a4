"""`docs/results.json`, and its agreement with the table of `docs/results.md`."""

from __future__ import annotations

import json
import math
import re
import shlex
from collections.abc import Mapping
from typing import Any

import pytest

from jaxenstein.cli import build_parser
from tests.docs.samples import ROOT

GROUPS = json.loads((ROOT / "docs" / "results.json").read_text("utf-8"))["groups"]
SHARED = ("frame_skip", "observation", "recipe", "decisions", "machine")
RUNS = [
    {name: group[name] for name in SHARED if name in group} | run
    for group in GROUPS
    for run in group["runs"]
]
BY_SEED = ("decisions_to_90", "success_last_tenth", "goals_first", "goals_after")


def test_lists_have_one_entry_per_seed() -> None:
    found = [(run["seeds"], run[name]) for run in RUNS for name in BY_SEED if name in run]
    assert len(found) > 50
    assert [values for seeds, values in found if len(values) != seeds] == []


def test_solved_seeds_reached_90_percent() -> None:
    told = [run for run in RUNS if "decisions_to_90" in run]
    reached = [sum(at is not None for at in run["decisions_to_90"]) for run in told]
    assert [run for run, count in zip(told, reached, strict=True) if run["solved"] > count] == []


@pytest.mark.slow
def test_commands_match_their_rows() -> None:
    pytest.importorskip("flax")
    pytest.importorskip("optax")
    from jaxenstein.baselines.runs.options import resolve
    from jaxenstein.cli.opening import given_training

    parser = build_parser()
    for run in RUNS:
        program, *flags = shlex.split(run["command"])
        assert program == "jaxenstein"
        experiment = resolve(given_training(parser.parse_args(flags)))
        found = experiment.config
        assert (found.algo, len(experiment.runs)) == (run["algo"], run["seeds"]), run["command"]
        assert experiment.recipe == run["recipe"], run["command"]
        if "frame_skip" in run:
            skip = experiment.environment.settings.get("frame_skip", 1)
            assert skip == run["frame_skip"], run["command"]


def test_other_commands_parse() -> None:
    pytest.importorskip("optax")
    for command in [command for group in GROUPS for command in group.get("commands", ())]:
        program, *flags = shlex.split(command)
        if program == "jaxenstein":
            build_parser().parse_args(flags)


def test_page_rows_match_runs_in_the_file() -> None:
    page = (ROOT / "docs" / "results.md").read_text("utf-8")
    table = page.split("## What agents learn")[1].split("\n## ")[0]
    rows = re.findall(r"^\| (?:\[?`([\w-]+)`.*?)?\| (\d.*) \|$", table, re.MULTILINE)
    assert len(rows) == 15
    task = ""
    for name, cells in rows:
        task = name or task
        assert any(_is_row(run, task, cells.split(" | ")) for run in RUNS), (task, cells)


def _solved_on(run: Mapping[str, Any], core: str) -> list[str]:
    """What the table says about a core on which the same command solved fewer seeds."""
    same = (other for other in RUNS if other.get("machine") == core)
    return [f"{core}: {o['solved']})" for o in same if _command(o) == _command(run)]


def _command(run: Mapping[str, Any]) -> str:
    """The command of a run without the place of its files."""
    return run["command"].split(" --out ")[0]


def _is_row(run: Mapping[str, Any], task: str, cells: list[str]) -> bool:
    skip, seen, algo, solved, millions, minutes, core, config = cells
    name = re.findall(r"`(.*)`", config)[0]
    solved, _, elsewhere = solved.partition(" (")  # "5 (A: 2)": 5 seeds, but 2 on core A
    return (
        (run["task"], str(run.get("frame_skip")), run["algo"].upper()) == (task, skip, algo)
        and run["observation"].removesuffix(" rgb") == seen
        and (str(run["solved"]), run["machine"]) == (solved, core)
        and (not elsewhere or elsewhere in _solved_on(run, "A"))
        and math.isclose(run["decisions"], float(millions) * 1e6, rel_tol=0.02)
        and float(minutes) in (run["minutes"], round(run["minutes"]))
        and f"--config {name} " in run["command"]
    )
