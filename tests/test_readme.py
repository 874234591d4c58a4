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


def blocks(text: str) -> list[str]:
    return re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def run(block: str, names: dict) -> None:
    # Users run with JAX's own promotion rules, not with the strict ones of these tests.
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        exec(compile(block, "README.md", "exec"), names)


def test_python_blocks_run_in_order(readme):
    names: dict = {}
    own = blocks(readme.split("## In your training loop")[0])
    assert len(own) >= 3
    for block in own:
        run(block, names)
    assert names["reward"].shape == (100, 256)
    assert names["env"].tilemap.tile_text().splitlines() == [
        "#########",
        "#S..r#.G#",
        "#....#..#",
        "#....R..#",
        "#########",
    ]


LATER = blocks((ROOT / "README.md").read_text("utf-8").split("## In your training loop")[1])
# Its learning takes minutes, and its package excludes current versions of JAX.
NOT_RUN = ("brax",)


def imported(block: str) -> set[str]:
    """The packages that a block imports, besides this one."""
    found = re.findall(r"^(?:import|from) (\w+)", block, re.MULTILINE)
    return {name for name in found if name != "jaxenstein"}


@pytest.mark.parametrize("block", LATER, ids=lambda block: "-".join(sorted(imported(block))))
@pytest.mark.filterwarnings("default")  # partners and what they import warn of their own
def test_later_blocks_run_by_themselves(block, tmp_path, monkeypatch):
    for name in sorted(imported(block)):
        if name in NOT_RUN:
            pytest.skip(f"{name} is run by tests/adapters/partners.py")
        pytest.importorskip(name)
    monkeypatch.chdir(tmp_path)
    run(block, {})


def test_linked_files_exist(readme):
    links = re.findall(r"\]\(([^)#]+)\)", readme)
    assert links
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_table_of_environments_is_complete(readme):
    named = set(re.findall(r"^\| `([a-z0-9-]+)` \|", readme, re.MULTILINE))
    assert named == set(jaxenstein.environment_ids())
