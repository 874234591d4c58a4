"""The README's Python runs as it stands, and its files and ids exist."""

import re
from pathlib import Path

import jax
import pytest

import jaxenstein

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def readme() -> str:
    return (ROOT / "README.md").read_text("utf-8")


def test_python_blocks_run_in_order(readme):
    blocks = re.findall(r"^```python\n(.*?)^```$", readme, re.MULTILINE | re.DOTALL)
    assert len(blocks) >= 3
    names: dict = {}
    # Users run with JAX's own promotion rules, not with the strict ones of these tests.
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        for block in blocks:
            exec(compile(block, "README.md", "exec"), names)
    assert names["reward"].shape == (100, 256)
    assert names["env"].tilemap.tile_text().splitlines() == [
        "#########",
        "#S..r#.G#",
        "#....#..#",
        "#....R..#",
        "#########",
    ]


def test_linked_files_exist(readme):
    links = re.findall(r"\]\(([^)#]+)\)", readme)
    assert links
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_table_of_environments_is_complete(readme):
    named = set(re.findall(r"^\| `([a-z0-9-]+)` \|", readme, re.MULTILINE))
    assert named == set(jaxenstein.environment_ids())
