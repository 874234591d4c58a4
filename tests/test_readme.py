"""The README and the pages are short, samples work, and the page of choices is complete."""

import re

import pytest

import jaxenstein
from tests.docs.samples import PAGES, ROOT, samples


@pytest.fixture(scope="module")
def readme() -> str:
    return (ROOT / "README.md").read_text("utf-8")


def test_readme_is_short(readme):
    assert len(readme.splitlines()) <= 120


def test_readme_starts_with_a_picture_and_two_commands(readme):
    first = readme.partition("\n## ")[0]
    picture, block = first.index("!["), first.index("```\n")
    assert picture < block
    commands = first[block:].split("```")[1].strip().splitlines()
    assert len(commands) == 2


def test_sample_does_what_its_comment_says():
    names: dict = {}
    for sample in samples(ROOT / "README.md"):
        sample.run(names)
    assert (names["obs"].shape, str(names["obs"].dtype)) == ((256, 64, 64, 3), "uint8")
    assert names["reward"].shape == (256,)


def test_table_of_families_is_complete():
    """Each id starts with an id in the first cell of a row, or is a -respawn variant."""
    page = (ROOT / "docs" / "choose.md").read_text("utf-8")
    cells = re.findall(r"^\| (`[^|]*)\|.*\|$", page.partition("## All families")[2], re.MULTILINE)
    listed = [name for cell in cells for name in re.findall(r"`([a-z0-9-]+)`", cell)]
    for name in jaxenstein.environment_ids():
        first = re.sub(r"-\d\d(-respawn)?$", "-01", name)
        assert any(first.startswith(row) for row in listed if not row.startswith("-")), name


def test_pages_are_short():
    pages = [page for page in PAGES if page.parent in (ROOT, ROOT / "docs")]
    assert sum(page.stat().st_size for page in (*pages, ROOT / "CONTRIBUTING.md")) <= 110_000
