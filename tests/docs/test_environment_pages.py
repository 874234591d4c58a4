"""The generated pages have a section for each environment with correct facts."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import pytest

pytest.importorskip("flax")

import jaxenstein
from docs import environment_pages, measured, other_pages, page_parts
from docs.page_parts import FAMILIES
from jaxenstein.baselines.runs import options
from jaxenstein.baselines.runs.configs import find_config
from jaxenstein.catalogue import ENTRIES, MAIN_IDS
from jaxenstein.fields import attributes
from tests.docs.samples import anchors

DOCS = Path(__file__).parents[2] / "docs"
IDS = MAIN_IDS


@pytest.fixture(scope="module")
def pages(tmp_path_factory) -> dict[str, str]:
    folder = tmp_path_factory.mktemp("site") / "environments"
    return {path.stem: path.read_text("utf-8") for path in environment_pages.write_pages(folder)}


def test_each_id_has_one_section_and_one_card(pages) -> None:
    sections = [name for text in pages.values() for name in re.findall(r"^## `(.+)`$", text, re.M)]
    assert sorted(sections) == sorted(IDS)
    cards = re.findall(r'<span class="name">(.+?)</span>', pages["index"])
    assert cards == list(IDS)
    for family in FAMILIES:
        for name in family.ids:
            assert f'href="{family.name}.html#{name}"' in pages["index"]


def test_pictures_and_animations_exist(pages) -> None:
    for stem, text in pages.items():
        shown = re.findall(r"^```\{image\} \.\./(\S+)$", text, re.MULTILINE)
        moving = re.findall(r'(?:src|srcset)="\.\./(\S+?)"', text)
        agents = text.count("\nA trained agent") + text.count("\nAn agent that sees pixels")
        shows = len(IDS) if stem == "index" else text.count("\n## `") + agents
        assert len(moving) == 2 * shows
        for path in [*shown, *moving]:
            assert (DOCS / path).is_file(), path
    films = {path.name for path in DOCS.glob("_static/episodes/doom-*-both.webp")}
    told = set(re.findall(r"doom-\S+-both\.webp", "".join(pages.values())))
    assert films == told


def test_numbers_match_the_tasks() -> None:
    facts = {name: dict(environment_pages.facts(name)) for name in IDS}
    assert facts["simple"]["reward"] == "+1 at the goal"
    assert facts["simple"]["map"] == "9x5"
    assert facts["my-way-home"]["reward"] == "+1 at the goal, -0.0001 per step"
    assert facts["health-gathering"]["reward"] == "+1 per step, -100 at death"
    assert facts["dmlab-static-01"]["reward"] == "+10 at the goal"
    assert facts["dmlab-random-goal-02-respawn"]["reward"] == "+10 at the goal, +1 per apple"
    assert facts["key-corridor"]["levels"] == "at least 10,000"
    assert "levels" not in facts["simple"]
    assert facts["key-corridor"]["other name"] == "`key-corridor-s4r3`"
    assert "only at the time limit" in facts["dmlab-static-03-respawn"]["ends"]
    for name in IDS:
        _, params = jaxenstein.make(name)
        assert facts[name]["horizon"] == f"{int(params.max_steps_in_episode)} steps"


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.name)
def test_every_param_and_info_entry_is_explained(family, pages) -> None:
    _, params = jaxenstein.make(family.ids[0])
    fields = [field.name for field in dataclasses.fields(params)]
    assert set(fields) == set(attributes(type(params)))
    info = pages[family.name].partition("## Info")[2].partition("## ")[0]
    rows = re.findall(r"^\| `(\w+)` \| (\S+) \| (.+) \|$", info, re.MULTILINE)
    assert len(rows) >= 5
    assert len(rows) == info.count("\n| `")


def test_stored_returns_match_current_versions() -> None:
    rows = page_parts.stored_returns()["players"]
    found = [(row["id"], row["player"]) for row in rows]
    assert found == [(name, player) for name in IDS for player in measured.players_of(name)]
    assert [row["version"] for row in rows] == [ENTRIES[row["id"]].version for row in rows]
    assert {row["episodes"] for row in rows} == {measured.PLAYED}
    for row in rows:
        assert row["least"] <= row["mean"] <= row["most"]


def test_links_outside_the_site_lead_to_including_pages() -> None:
    text = "[how](../CONTRIBUTING.md#x), [programs](../examples/README.md), [me](concepts.md)"
    assert page_parts.turned(text) == "[how](contributing.md#x), programs, [me](concepts.md)"
    for target, page in page_parts.SHOWN.items():
        assert f"{{include}} {target}" in (DOCS / page).read_text("utf-8")


def test_links_between_the_pages_lead_to_headings(pages) -> None:
    found = {
        (name, anchor)
        for text in pages.values()
        for name, anchor in re.findall(r"\]\(([\w-]+)\.md#([^)]+)\)", text)
    }
    assert ("doom-defend-the-center", "variants") in found
    assert {(name, anchor) for name, anchor in found if anchor not in anchors(pages[name])} == set()


def test_scoreboard_names_configs_of_its_agents(pages) -> None:
    rows = page_parts.stored_agents()
    best, trained = pages["scoreboard"].split("## Agents")
    for row in rows:
        config = options.read_file(find_config(row["config"]))
        assert (config["env"], config["seeds"]) == (row["id"], row["seeds"])
        assert config.get("frame_skip", 1) == row["frame_skip"]
        assert row["version"] == ENTRIES[row["id"]].version
        assert f"`{row['config']}`" in trained
    last = re.findall(r"^\| \[`(.+?)`\].*\| *(.*?) *\|$", best, re.M)
    shown = {name: cell for name, cell in last if cell}
    assert set(shown) == {row["id"] for row in rows}.intersection(MAIN_IDS)
    # Nobody succeeds in the task of the first, whose agents get their returns instead.
    assert "%" not in shown["doom-defend-the-center"]
    assert "%" in shown["doom-basic"]


def test_command_line_page_has_every_command(monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    text = other_pages.commands_page()
    told = re.findall(r"^## `jaxenstein (.+)`$", text, re.M)
    assert {"list", "play", "record", "train", "evaluate"} <= set(told)
    assert text.count("\nusage: jaxenstein ") == len(told)
    # As wide as on a page, independent of the terminal.
    assert max(map(len, text.splitlines())) > 80


def test_command_line_page_has_the_recipes() -> None:
    tuned, long = other_pages.recipes().split("The defaults of the recipe `long`")
    told, changed = (
        {
            name: values.split(" | ")
            for name, values in re.findall(r"^\| `(.+?)` \| (.+) \|$", text, re.M)
        }
        for text in (tuned, long)
    )
    assert told["--contrast"] == ["0", "10", "0", "10", "10"]
    assert told["--anneal"] == ["yes", "no", "no", "no", "no"]
    assert "--num-envs" not in told
    assert changed["--contrast"] == ["10", "0", "0", "10"]
    assert "--epochs" not in changed
    assert changed["tiny"] == ["64", "64", "64", "4x4x32"]
