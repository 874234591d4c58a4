"""The README is short and names all environments; its samples do what it says."""

import re

import pytest

import jaxenstein
from tests.docs.samples import ROOT, samples


@pytest.fixture(scope="module")
def readme() -> str:
    return (ROOT / "README.md").read_text("utf-8")


def test_it_is_short(readme):
    assert len(readme.splitlines()) < 200


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


def test_table_of_environments_is_complete(readme):
    """Each id begins as the first id of a row, or is a -respawn variant."""
    rows = re.findall(r"^\| `([a-z0-9.-]+)`.*\|.*\|$", readme, re.MULTILINE)
    for name in jaxenstein.environment_ids():
        first = re.sub(r"-\d\d(-respawn)?$", "-01", name)
        assert any(first.startswith(row) for row in rows), name
