"""The README is short, and its table of environments is true; tests/docs runs its samples."""

import re

import pytest

import jaxenstein
from jaxenstein.cli.listing import extent
from tests.docs.samples import ROOT, samples


@pytest.fixture(scope="module")
def readme() -> str:
    return (ROOT / "README.md").read_text("utf-8")


def test_it_is_short(readme):
    assert len(readme.splitlines()) < 250


def test_it_leads_with_a_picture_and_two_commands(readme):
    first = readme.partition("\n## ")[0]
    picture, block = first.index("!["), first.index("```\n")
    assert picture < block
    commands = first[block:].split("```")[1].strip().splitlines()
    assert len(commands) == 2


def test_the_samples_do_what_the_text_says(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    for sample in samples(ROOT / "README.md"):
        sample.run(names)
    assert names["reward"].shape == (100, 256)
    assert (tmp_path / "walk.gif").stat().st_size > 10_000
    assert names["env"].tilemap.tile_text().splitlines() == [
        "#########",
        "#S..r#.G#",
        "#....#..#",
        "#....R..#",
        "#########",
    ]


def test_table_of_environments_is_complete_and_true(readme):
    rows = re.findall(r"^\| `([a-z0-9-]+)` \|(.*)\|$", readme, re.MULTILINE)
    assert [name for name, _ in rows] == list(jaxenstein.environment_ids())
    for name, cells in rows:
        *_, horizon, discount = cells.split("|")
        env, params = jaxenstein.make(name)
        assert int(horizon) == int(params.max_steps_in_episode)
        assert float(discount) == pytest.approx(float(params.discount))
        assert extent(env)
