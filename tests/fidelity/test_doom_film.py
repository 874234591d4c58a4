"""A film of two episodes side by side, and how it is made to fit."""

from __future__ import annotations

import io
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("flax")
pytest.importorskip("gymnasium")

from fidelity import doom_film
from jaxenstein.errors import SettingError

SIZE = 12, 16


def film(count: int, brightness: int) -> np.ndarray:
    return np.full((count, *SIZE, 3), brightness, np.uint8)


def test_shorter_film_repeats_its_last_frame() -> None:
    left = np.concatenate([film(1, 10), film(1, 20)])
    both = doom_film.side_by_side(left, film(4, 90))
    assert both.shape == (4, 12, 2 * 16 + doom_film.GAP, 3)
    assert both[:, 0, 0, 0].tolist() == [10, 20, 20, 20]
    assert both[:, 0, -1, 0].tolist() == [90] * 4


@pytest.mark.parametrize("suffix", doom_film.SUFFIXES)
def test_films_leave_out_steps_until_they_fit(suffix: str) -> None:
    frames = np.random.default_rng(0).integers(0, 256, (20, *SIZE, 3), np.uint8)
    whole = doom_film.encoded(frames, suffix, 0.1, 10**6)
    less = doom_film.encoded(frames, suffix, 0.1, len(whole) // 3)
    assert len(less) <= len(whole) // 3
    lengths = []
    for data in (whole, less):
        image: Any = Image.open(io.BytesIO(data))
        lengths.append(image.n_frames)
        image.seek(0)
        image.load()
        lengths.append(image.info["duration"])
    assert lengths[:2] == [20, 100]
    assert lengths[2] < 10
    # The film takes as long as before.
    assert (lengths[2] - 1) * lengths[3] == pytest.approx(1900, abs=lengths[3])
    with pytest.raises(SettingError, match="does not fit into 99 bytes"):
        doom_film.encoded(frames, suffix, 0.1, 99)


def test_command_writes_the_film(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    parts = [SimpleNamespace(frames=film(n, n), summary=lambda n=n: f"{n} steps") for n in (2, 3)]
    policy = SimpleNamespace(env=SimpleNamespace(frame_skip=4))
    monkeypatch.setattr(doom_film, "load_policy", lambda agent, run, *, greedy: policy)
    monkeypatch.setattr(doom_film, "play_both", lambda agent, seed: parts)
    assert doom_film.main(["runs/a", str(tmp_path / "a.webp")]) == 0
    assert capsys.readouterr().out.startswith("2 steps; 3 steps, wrote ")
    assert (tmp_path / "a.webp").read_bytes()[8:12] == b"WEBP"
