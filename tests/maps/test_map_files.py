"""The sample maps."""

from __future__ import annotations

from pathlib import Path

import pytest

import jaxenstein
from jaxenstein.cli import main
from jaxenstein.maps.map_files import SAMPLES, sample_map


@pytest.mark.parametrize("name", SAMPLES)
def test_each_sample_is_solvable_and_listed(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A goal that cannot be reached would be a warning, which is an error here."""
    env, params = jaxenstein.from_ascii(jaxenstein.sample_map(name))
    assert int(params.max_steps_in_episode) == 1000
    assert env.tilemap.tile_text().splitlines() == sample_map(name).splitlines()
    assert main(["list", "--samples"]) == 0
    assert f"samples/{name}: {SAMPLES[name]}\n{sample_map(name)}\n" in capsys.readouterr().out


def test_each_sample_has_a_name() -> None:
    folder = Path(jaxenstein.__file__).parent / "maps" / "samples"
    assert {path.stem for path in folder.glob("*.txt")} == set(SAMPLES)


def test_sample_names_work_as_file_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    env, _ = jaxenstein.from_file("samples/rooms")
    assert env.name == "rooms"
    assert len(env.tilemap.spawns) == sample_map("rooms").count("S")
    with pytest.raises(jaxenstein.MapError, match=r"'room', did you mean 'rooms'\?"):
        jaxenstein.from_file("samples/room")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "samples").mkdir()
    (tmp_path / "samples" / "rooms").write_text("####\n#SG#\n####")
    assert len(jaxenstein.from_file("samples/rooms")[0].tilemap.spawns) == 1
    with pytest.raises(jaxenstein.MapError, match="no such file"):
        jaxenstein.from_file("data/samples/rooms")


def test_regions_and_faces_of_one_map_are_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "maze.txt").write_text("####\n#SG#\n####")
    for kind in ("regions", "faces"):
        (tmp_path / f"maze.{kind}.txt").write_text("")
    with pytest.raises(
        jaxenstein.MapError, match=r"maze\.regions\.txt and .*maze\.faces\.txt exist"
    ):
        jaxenstein.from_file(tmp_path / "maze.txt")
