"""Figures of scripted players on pages match the measurements."""

from __future__ import annotations

import json

import pytest

pytest.importorskip("flax")

from docs.other_pages import _measure
from docs.page_parts import stored_agents, stored_rows
from jaxenstein.baselines.runs.configs import find_config
from jaxenstein.baselines.runs.options import read_file, resolve
from tests.docs.samples import ROOT

MEAN = "{mean:.1f} +- {error:.1f}"
# From docs/returns.json: a page, an environment, and the text on the page about a player.
REPEATED = (
    ("originals/health-gathering", "health-gathering", "random", f"| {MEAN} |"),
    ("originals/health-gathering", "health-gathering", "greedy_medkits", "{mean:.0f} ({episodes} "),
    ("originals/my-way-home", "my-way-home", "shortest_path", "{mean:.4f} +- {error:.4f}"),
    ("originals/key-corridor", "key-corridor-s3r1", "random", "{percent:.1f} % of {episodes} "),
    ("originals/dmlab-explore", "dmlab-explore-goal-locations", "shortest_path", f"256 | {MEAN}"),
    ("originals/doom-deathmatch", "doom-deathmatch", "random", f"| {{episodes}} | {MEAN} |"),
    ("originals/doom-deathmatch", "doom-deathmatch", "hunt", f"| {{episodes}} | {MEAN} |"),
    ("results", "dmlab-static-01-respawn", "shortest_path", "frame skip 1 | {mean:.1f} |"),
)


@pytest.mark.parametrize(("page", "name", "player", "text"), REPEATED)
def test_pages_match_stored_measurements(page: str, name: str, player: str, text: str) -> None:
    (row,) = (row for row in stored_rows(name) if row["player"] == player)
    said = text.format(percent=100 * row["success"], **row)
    assert said in (ROOT / "docs" / f"{page}.md").read_text("utf-8")


# From docs/results.json: an environment, and the text in docs/results.md about a random player.
RANDOM = {"dmlab-static-01-respawn": "| random | {mean:.1f} |"}


def test_results_state_random_player_scores() -> None:
    page = " ".join((ROOT / "docs" / "results.md").read_text("utf-8").split())
    rows = json.loads((ROOT / "docs" / "results.json").read_text("utf-8"))["random_players"]
    assert {row["task"] for row in rows} >= set(RANDOM)
    for row in rows:
        if row["task"] in RANDOM:
            assert RANDOM[row["task"]].format(**row) in page
        numbers = f"--set frame_skip={row['frame_skip']} --episodes {row['episodes']}"
        assert (
            row["command"] == f"jaxenstein evaluate --policy random --env {row['task']} {numbers}"
        )


def test_scoreboard_returns_use_task_units() -> None:
    shown = [row for row in stored_agents() if _measure(row) == "return"]
    assert shown
    for row in shown:
        spec = resolve(read_file(find_config(row["config"]))).environment
        rewards = spec.build()[0].about().rewards
        assert not set(rewards) & set(spec.params), row["config"]
