"""`jaxenstein record --save` and `jaxenstein replay`."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

import jaxenstein
from jaxenstein.cli import main
from jaxenstein.episodes.session import Session
from jaxenstein.episodes.trajectory_file import load_trajectory

MAP = "########\n#S.rR.G#\n########\n"
SIZE = ["--height", "8", "--width", "8"]
ACTIONS = ["--actions", "forward*5, turn left*3, 4"]


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A trajectory of a custom map, written by the command."""
    folder = tmp_path_factory.mktemp("saved")
    (folder / "maze.txt").write_text(MAP)
    given = ["--map-file", str(folder / "maze.txt"), *SIZE, *ACTIONS, "--seed", "7"]
    outputs = ["--out", str(folder / "a.gif"), "--save", str(folder / "a.json")]
    assert main(["record", *given, *outputs]) == 0
    return folder / "a.json"


def edited(saved: Path, path: Path, **changes: Any) -> Path:
    """A copy of the file with changed entries."""
    path.write_text(json.dumps(json.loads(saved.read_text()) | changes))
    return path


def test_record_saves_the_episode(saved: Path) -> None:
    trajectory = load_trajectory(saved)
    assert trajectory.actions == (2, 2, 2, 2, 2, 0, 0, 0, 4)
    assert trajectory.seed == 7
    assert trajectory.environment.id is None
    assert trajectory.environment.settings["height"] == 8


def test_replay_is_identical(
    saved: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    outputs = ["--out", str(tmp_path / "b.gif"), "--sheet", str(tmp_path / "b.png")]
    assert main(["replay", str(saved), *outputs]) == 0
    out, _ = capsys.readouterr()
    assert "9 steps" in out
    assert "the same bit for bit" in out
    # The animation is also the same as the recorded one.
    assert (tmp_path / "b.gif").read_bytes() == saved.with_suffix(".gif").read_bytes()
    with Image.open(tmp_path / "b.png") as sheet:
        assert sheet.format == "PNG"


def test_replay_reports_differences(
    saved: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = json.loads(saved.read_text())
    made_by = {**table["made_by"], "jaxenstein": "0.0.7"}
    path = edited(saved, tmp_path / "a.json", actions=[[2, 4], [3, 5]], made_by=made_by)
    assert main(["replay", str(path)]) == 1
    out, _ = capsys.readouterr()
    assert "NOT the same" in out
    assert "states differ from step 5 on" in out
    assert "observations differ from step 5 on" in out
    assert "made by  jaxenstein 0.0.7" in out
    assert f"running  jaxenstein {jaxenstein.__version__}" in out


def test_wrong_files_get_one_line_and_code_2(
    saved: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = edited(saved, tmp_path / "a.json", actions=[[2, 3], [9, 6]])
    for file, words in ((path, "action 3"), (saved.with_suffix(".gif"), "not a trajectory")):
        assert main(["replay", str(file)]) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert err.count("\n") == 1
        assert err.startswith(f"jaxenstein: {file}: ")
        assert words in err


def test_interrupted_recordings_leave_nothing(
    saved: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    step = Session.step

    def interrupt(session: Session, action: int) -> Any:
        if len(session.actions) == 3:
            raise KeyboardInterrupt
        return step(session, action)

    monkeypatch.setattr(Session, "step", interrupt)
    given = ["--map-file", str(saved.with_name("maze.txt")), *SIZE, *ACTIONS]
    outputs = ["--out", str(tmp_path / "a.gif"), "--save", str(tmp_path / "a.json")]
    assert main(["record", *given, *outputs]) == 130
    assert capsys.readouterr().err.splitlines()[-1] == "interrupted"
    assert os.listdir(tmp_path) == []


def test_record_writes_videos(saved: Path, tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg")
    given = ["--map-file", str(saved.with_name("maze.txt")), *SIZE, *ACTIONS]
    assert main(["record", *given, "--out", str(tmp_path / "a.MP4"), "--no-map"]) == 0
    assert (tmp_path / "a.MP4").read_bytes()[4:8] == b"ftyp"
    assert os.listdir(tmp_path) == ["a.MP4"]
