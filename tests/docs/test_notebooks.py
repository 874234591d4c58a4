"""The notebooks: all cells run in order, unchanged except for sizes."""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any

import jax
import pytest

from jaxenstein import registry
from tests.docs.samples import ROOT

NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
# Shorten parts that take minutes.
SHORTENED = {
    "NUM_ENVS, STEPS = 256, 200": "NUM_ENVS, STEPS = 4, 5",
    "NUM_ENVS, STEPS = 256, 100": "NUM_ENVS, STEPS = 4, 5",
    **dict.fromkeys(
        ('"total_steps": 1_500_000}', '"total_steps": 2_000_000}'),
        '"total_steps": 32, "num_envs": 4, "rollout": 8, "minibatches": 1, "network": "tiny",'
        ' "epochs": 1} | {"horizon": 12}',
    ),
}
DISPLAY_METHODS = ("_repr_html_", "_repr_png_")


def cells(path: Path, kind: str) -> list[str]:
    found = json.loads(path.read_text("utf-8"))["cells"]
    return ["".join(cell["source"]) for cell in found if cell["cell_type"] == kind]


def run(code: str, names: dict[str, Any]) -> None:
    """Run a cell as a notebook does, which shows the value of an expression at its end."""
    for given, small in SHORTENED.items():
        code = code.replace(given, small)
    *body, last = ast.parse(code).body
    if not isinstance(last, ast.Expr):
        body.append(last)
    exec(compile(ast.Module(body, []), "cell", "exec"), names)
    if isinstance(last, ast.Expr):
        value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
        assert all(len(getattr(value, show)()) for show in DISPLAY_METHODS if hasattr(value, show))
        assert repr(value)


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(
            path, marks=[pytest.mark.slow] * (path.stem in ("doom", "train")), id=path.stem
        )
        for path in NOTEBOOKS
    ],
)
@pytest.mark.usefixtures("plain_frames")
def test_cells_run_in_order(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if "jaxenstein.baselines" in path.read_text("utf-8"):
        for name in ("flax", "optax", "matplotlib"):
            pytest.importorskip(name)
        monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(registry, "ENTRIES", dict(registry.ENTRIES))
    names: dict[str, Any] = {"__name__": "__main__"}
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        for code in cells(path, "code"):
            run(code, names)
    assert "episode" in names


def test_notebooks_have_no_outputs() -> None:
    nbformat = pytest.importorskip("nbformat")
    assert [path.stem for path in NOTEBOOKS] == ["doom", "start", "task", "train"]
    for path in NOTEBOOKS:
        book = json.loads(path.read_text("utf-8"))
        assert (book["nbformat"], book["metadata"]["kernelspec"]["name"]) == (4, "python3")
        assert len({cell["id"] for cell in book["cells"]}) == len(book["cells"])
        code = [cell for cell in book["cells"] if cell["cell_type"] == "code"]
        assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)
        nbformat.validate(book)


def test_notebook_links_lead_to_files() -> None:
    for path in NOTEBOOKS:
        text = "\n".join(cells(path, "markdown"))
        targets = [part.partition(")")[0] for part in text.split("](")[1:]]
        assert targets
        assert [target for target in targets if not (path.parent / target).exists()] == []
