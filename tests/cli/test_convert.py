"""`jaxenstein convert`: its files can be read, and none is left incomplete."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from jaxenstein.cli import main
from jaxenstein.errors import SettingError
from jaxenstein.maps import TileMap, parse_ascii
from jaxenstein.maps.importers.dmlab import build_tilemap, read_maze
from jaxenstein.maps.map_files import read_map
from tests.reference import labmaps

PICTURE = "3333333\n3S...@3\n3.3.333\n3.3G.a3\n3333333\n"
PLAIN = labmaps.write_map(PICTURE)
TEXT = labmaps.write_map(PICTURE, decals={(0, 0, "west"): "cat", (2, 1, "south"): "dog"})
TILEMAP = build_tilemap(read_maze(TEXT, "custom"))


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    path = tmp_path / "lab.map"
    path.write_text(TEXT)
    return path


def test_prints_only_the_map(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["convert", str(lab)]) == 0
    out, err = capsys.readouterr()
    assert out == TILEMAP.tile_text()
    assert err.splitlines()[0] == (
        "lab: 3 x 2 cells, 7 x 5 tiles; 2 starts, 1 goal, 2 apples, 2 decals"
    )
    assert "--out" in err


def test_writes_the_map_and_its_faces(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = lab.parent / "maze.txt"
    for _ in range(2):  # the second time over its own files
        assert main(["convert", str(lab), "--out", str(out)]) == 0
        printed, err = capsys.readouterr()
        assert err == ""
        assert printed.startswith("lab: 3 x 2 cells")
        assert f"wrote {out} and {lab.parent / 'maze.faces.txt'}" in printed
        texts = read_map(out)
        assert sorted(texts) == ["faces", "name", "text"]
        assert parse_ascii(texts["text"], faces=texts["faces"]) == TILEMAP
    assert sorted(p.name for p in lab.parent.iterdir()) == ["lab.map", "maze.faces.txt", "maze.txt"]
    assert b"\r" not in out.read_bytes()


def test_without_faces_there_is_one_file(tmp_path: Path) -> None:
    lab, out = tmp_path / "lab.map", tmp_path / "maze"
    lab.write_text(PLAIN)
    assert main(["convert", str(lab), "--out", str(out)]) == 0
    assert read_map(out) == {"name": "maze", "text": PICTURE}


def test_map_without_goal_gives_a_note(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lab.write_text(labmaps.write_map(PICTURE.replace("G", "a")))
    assert main(["convert", str(lab)]) == 0
    assert "no goal" in capsys.readouterr().err


def test_each_warning_takes_one_line(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lab.write_text(labmaps.write_map("#####\n#S#G#\n#####").replace("{\n", "", 1))
    assert main(["convert", str(lab)]) == 0
    warnings = [line for line in capsys.readouterr().err.splitlines() if "warning" in line]
    assert len(warnings) == 2
    assert "lab.map, line 1: an entity starts without" in warnings[0]
    assert "line 2, column 4 of the text: no path reaches this goal" in warnings[1]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "either"),
        (["lab.map", "--minigrid", "MiniGrid-FourRooms-v0"], "either"),
        (["none.map"], "none.map: no such file"),
        (["folder"], "folder: is a directory"),
        (["binary.map"], "binary.map: it is not text"),
        (["broken.map"], "broken.map, line 3: "),
        (["lab.map", "--out", "lab.map"], "would overwrite"),
        (["lab.map", "--out", "old.txt"], "old.regions.txt exists"),
        (["plain.map", "--out", "stale.txt"], "stale.faces.txt exists"),
        (["--minigrid", "MiniGrid-FourRooms-v0", "--seed", "-1"], "--seed"),
    ],
)
def test_wrong_arguments(
    arguments: list[str],
    words: str,
    lab: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(lab.parent)
    Path("folder").mkdir()
    Path("binary.map").write_bytes(b"{\xff\xfe}")
    Path("broken.map").write_text('{\n"classname" "worldspawn"\n[')
    Path("plain.map").write_text(PLAIN)
    Path("old.regions.txt").write_text("old")
    Path("stale.faces.txt").write_text("old")
    before = {path: path.stat().st_mtime_ns for path in lab.parent.iterdir()}
    assert main(["convert", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert words in err
    assert {path: path.stat().st_mtime_ns for path in lab.parent.iterdir()} == before


def test_unwritable_targets_are_refused(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["convert", str(lab), "--out", str(lab.parent / "none" / "a.txt")]) == 1
    assert "there is no folder" in capsys.readouterr().err


@pytest.mark.parametrize("fails", [1, 2])
def test_full_disk_leaves_nothing(
    fails: int, lab: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """For either of the two files."""
    write, written = Path.write_text, []

    def fill_up(path: Path, text: str, **options: str) -> int:
        written.append(path)
        if len(written) == fails:
            write(path, text[:5])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(path, text, **options)

    monkeypatch.setattr(Path, "write_text", fill_up)
    assert main(["convert", str(lab), "--out", str(lab.parent / "maze.txt")]) == 1
    assert "no space left on device" in capsys.readouterr().err
    assert len(written) == fails
    assert list(lab.parent.iterdir()) == [lab]


class Converted:
    """Stands in for `jaxenstein.maps.importers.minigrid.MiniGridMap`."""

    tilemap = TileMap(
        "MiniGrid-Small-v0", tiles=(b"\2\2\2\2", b"\2\0\0\2", b"\2\2\2\2"), spawns=((1, 1),),
        goals=((2, 1),),
    )  # fmt: skip
    heading = 270.0


def test_minigrid(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = []

    def convert_id(id: str, seed: int) -> Converted:
        asked.append((id, seed))
        return Converted()

    monkeypatch.setattr("jaxenstein.cli.convert.convert_id", convert_id)
    out = tmp_path / "small.txt"
    assert main(["convert", "--minigrid", "Small", "--seed", "3", "--out", str(out)]) == 0
    assert asked == [("Small", 3)]
    assert read_map(out) == {"name": "small", "text": "####\n#SG#\n####\n"}
    printed = capsys.readouterr().out
    assert "MiniGrid-Small-v0: 4 x 3 tiles; 1 start, 1 goal\n" in printed
    assert "first heading: 270 degrees" in printed
    assert "--heading 270" in printed


def test_unusable_minigrid_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def convert_id(id: str, seed: int) -> Converted:
        raise SettingError("needs the package minigrid")

    monkeypatch.setattr("jaxenstein.cli.convert.convert_id", convert_id)
    assert main(["convert", "--minigrid", "Small"]) == 2
    assert capsys.readouterr().err == "jaxenstein: needs the package minigrid\n"


def test_regions_file_beside_a_map_is_read(tmp_path: Path) -> None:
    path = tmp_path / "maze.txt"
    path.write_text("###\n#S#\n###")
    own = {"name": "maze", "text": "###\n#S#\n###"}
    assert read_map(path) == own
    (tmp_path / "maze.regions.txt").write_text("regions")
    (tmp_path / "other.faces.txt").write_text("faces")
    assert read_map(path) == own | {"regions": "regions"}
