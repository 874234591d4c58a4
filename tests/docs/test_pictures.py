"""The pictures of the site show what the engine does, and the command that draws them works."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("flax")

import jaxenstein
from docs import measured, pictures
from jaxenstein.catalogue import MAIN_IDS
from jaxenstein.view.episode import compose_side_by_side
from tests.reference.frames import plain_frame

ENGINE = Path(__file__).parents[2] / "docs" / "images" / "engine"


def test_engine_finds_the_same_walls_as_geometry(tmp_path: Path, monkeypatch) -> None:
    """The pictures are drawn with cheap frames; a slow test uses the engine."""
    pytest.importorskip("matplotlib")
    from docs import engine_pictures

    view = engine_pictures.View(width=12, height=8)
    for column in range(12):
        first = [next(place for place, solid in line if solid) for line in view.crossings(column)]
        nearest = min(first, key=lambda place: place[2])
        assert nearest[2] == pytest.approx(view.hits.depth[column], abs=1e-4)
        assert view.hits.horizontal[column] == (first[1][2] < first[0][2])
    names = {
        f"{name}-{page}.png" for name in engine_pictures.PICTURES for page in ("light", "dark")
    }
    assert {path.name for path in ENGINE.iterdir()} == names
    monkeypatch.setattr(engine_pictures, "render", plain_frame)
    engine_pictures.draw_all(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == names


@pytest.mark.slow
def test_each_picture_is_drawn(tmp_path: Path, monkeypatch) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(pictures, "IMAGES", tmp_path / "images")
    monkeypatch.setattr(pictures, "EPISODES", tmp_path / "episodes")
    for what in ("episodes", "sheets", "looks"):
        pictures.main([what, "t-maze"])
    pictures.main(["engine"])
    found = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*.*")}
    engine = {f"images/engine/{path.name}" for path in ENGINE.iterdir()}
    assert found == engine | {
        "episodes/t-maze.webp", "episodes/t-maze-still.webp", "images/looks/t-maze.png",
        "images/environments/t-maze-map.png", "images/environments/t-maze.png",
    }  # fmt: skip
    for name in ("looks", "environments"):
        committed = ENGINE.parent / name / "t-maze.png"
        with (
            Image.open(committed) as old,
            Image.open(tmp_path / "images" / name / "t-maze.png") as new,
        ):
            assert (np.asarray(old) != np.asarray(new)).mean() < 0.02


def test_measured_ids_replace_only_their_rows(tmp_path: Path, monkeypatch) -> None:
    stored = json.loads(measured.RETURNS.read_text("utf-8"))
    file = tmp_path / "returns.json"
    file.write_text(json.dumps(stored))
    monkeypatch.setattr(measured, "RETURNS", file)
    measured.main(["returns", "simple", "--episodes", "8"])
    told, before = json.loads(file.read_text())["players"], stored["players"]
    assert [(row["id"], row["player"]) for row in told] == [
        (row["id"], row["player"]) for row in before
    ]
    again, row = (
        next(r for r in rows if r["player"] == "shortest_path") for rows in (told, before)
    )
    assert [again[key] for key in ("mean", "success", "length")] == [1, 1, 64]
    assert [row[key] for key in ("mean", "success", "length")] == [1, 1, 64]


def test_agents_with_another_config_get_no_row() -> None:
    with pytest.raises(SystemExit, match=r"was not trained with .*: its environment differs"):
        measured.row_of("simple-skip6", Path("pretrained/key-door"), 1)


@pytest.mark.parametrize("name", MAIN_IDS)
def test_animations_move_and_have_room_for_the_expert_caption(name) -> None:
    with Image.open(pictures.EPISODES / f"{name}.webp") as animation:
        assert getattr(animation, "n_frames", 1) > 10
    about = jaxenstein.make(name)[0].about()
    if waits := about.expert and about.players[about.expert].waits:
        view, beside = np.zeros((*pictures.VIEW, 3), np.uint8), pictures.BESIDE
        page = Image.new("RGB", (beside, beside))
        facts = ["step 480", "return 480", "health 100"]
        without, told = (
            compose_side_by_side(view, page, [*facts, event], scale=1) for event in ("", waits)
        )
        assert (without != told).any()


@pytest.mark.parametrize("name", pictures.FILMED)
def test_films_of_agents_begin_at_the_same_place(name) -> None:
    """Coarse pictures hide the compression; monsters differ a little."""
    with Image.open(pictures.EPISODES / f"{name}-both.webp") as film:
        assert film.size == (324, 120)
        assert getattr(film, "n_frames", 1) >= pictures.ENOUGH
        first = film.convert("RGB")
    here, there = (
        np.asarray(first.crop((left, 0, left + 160, 120)).resize((20, 15), Image.Resampling.BOX))
        for left in (0, 164)
    )
    here, there = here.astype(float), there.astype(float)
    assert np.abs(here - there).mean() < 0.4 * np.abs(here - here.mean(axis=(0, 1))).mean()
