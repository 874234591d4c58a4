"""The tutorial's commands run one after the other, on its map; training and episodes are short."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from jaxenstein.cli import main
from tests.docs.samples import ROOT, commands

PAGE = ROOT / "docs" / "tutorial.md"
SHORT = ["--horizon", "12"]
SHORTER = {
    "rollout": [*SHORT, "--envs", "4", "--steps", "4"],
    "train": [
        *SHORT, "--total-steps", "32", "--num-envs", "4", "--rollout", "8", "--minibatches", "1",
        "--epochs", "1", "--network", "tiny",
    ],
    "evaluate": ["--episodes", "2"],
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.usefixtures("plain_frames")
def test_tutorial_commands_produce_an_animation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("flax", "optax", "matplotlib"):
        pytest.importorskip(name)
    monkeypatch.chdir(tmp_path)
    drawing, _ = re.findall(r"^```text\n(.*?)^```$", PAGE.read_text("utf-8"), re.M | re.S)
    Path("maze.txt").write_text(drawing, "utf-8")
    run = [arguments for program, *arguments in commands(PAGE) if program == "jaxenstein"]
    assert [name for name, *_ in run] == ["rollout", "train", "evaluate", "plot", "record"]
    for name, *arguments in run:
        assert main([name, *arguments, *SHORTER.get(name, [])]) == 0, capsys.readouterr().err
    for name in ("agent.gif", "other.gif", "curve.png"):
        assert Path(name).stat().st_size > 1000
