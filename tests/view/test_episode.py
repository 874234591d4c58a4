"""An episode in a notebook and in files."""

from __future__ import annotations

import base64
import html.parser
import io
import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from jaxenstein import SettingError
from jaxenstein.maps.ascii import parse_ascii
from jaxenstein.view.episode import NOTEBOOK_FRAMES, Episode, Pictures

FIELD = parse_ascii("#####\n#S.G#\n#####")


def walk(steps: int, side: int = 16) -> Episode:
    """A walk to and fro on an empty map."""
    count = steps + 1
    frames = np.zeros((count, side, side, 3), np.uint8)
    for i, frame in enumerate(frames):
        frame[:, i % side] = (250, 200, i % 256)
    xs = 1.5 + 2 * np.abs(np.sin(np.arange(count) / 7))
    return Episode(
        frames=frames,
        positions=np.stack([xs, np.full(count, 1.5)], axis=-1).astype(np.float32),
        headings=np.zeros(count, np.float32),
        rewards=np.full(steps, 0.5, np.float32),
        closed=np.zeros((count, 0), bool),
        sprites=np.zeros((count, 0, 2), np.float32),
        labels=np.zeros((count, 0), np.int32),
        visible=np.zeros((count, 0), bool),
        events=("",) * steps,
        tilemap=FIELD,
        name="<b>field</b>",
        ending="truncated",
    )


class Page(html.parser.HTMLParser):
    """The image and the text that a notebook shows."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.text = ""
        self.picture = b""
        self.alt = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        if tag == "img":
            given = dict(attrs)
            self.alt = given["alt"] or ""
            kind, _, data = (given["src"] or "").partition(",")
            assert kind == "data:image/gif;base64"
            self.picture = base64.b64decode(data, validate=True)

    def handle_data(self, data: str) -> None:
        self.text += data


@pytest.mark.parametrize("steps", [1, 20, 148, 149, 150, 700, 3000])
def test_notebooks_get_an_animation(steps: int) -> None:
    episode = walk(steps)
    page = Page(episode._repr_html_())
    every = 1 if steps < NOTEBOOK_FRAMES else -(-steps // (NOTEBOOK_FRAMES - 1))
    wanted = len({*range(0, steps, every), steps})
    assert wanted <= NOTEBOOK_FRAMES
    with Image.open(io.BytesIO(page.picture)) as gif:
        assert getattr(gif, "n_frames", 1) == wanted
        assert max(gif.size) < 600
        # The first and the last observation are there, with square pixels.
        scale = 192 // 16
        for number, frame in ((0, episode.frames[0]), (wanted - 1, episode.frames[-1])):
            gif.seek(number)
            image = np.asarray(gif.convert("RGB")).astype(int)
            top = (image.shape[0] - 30 - 192) // 2
            part = image[top : top + 192, 6:198][scale // 2 :: scale, scale // 2 :: scale]
            assert np.abs(part - frame).max() < 40
    assert page.tags == ["figure", "img", "figcaption"]
    assert page.text.startswith(f"<b>field</b>: {steps} steps, return {steps / 2:.4g}, truncated")
    assert ("steps shown" in page.text) == (every > 1)
    assert page.alt == page.text
    assert repr(episode) == f"<Episode {episode.summary()}>"


def test_notebook_stays_small() -> None:
    noisy = walk(2000, 64)
    noisy.frames[:] = np.random.default_rng(0).integers(0, 256, noisy.frames.shape)
    # Noise in all pixels is the worst that there can be.
    assert len(noisy._repr_html_()) < 8_000_000


def test_frames_are_equal_in_any_order() -> None:
    episode = walk(30)
    drawn: list[int] = []
    pictures = Pictures(episode, every=4, notify=drawn.append)
    in_order = list(pictures)
    assert len(pictures) == len(in_order) == 9
    assert drawn == list(range(1, 10))
    for i in (8, 3, 0, -1):
        np.testing.assert_array_equal(pictures[i], in_order[i])
    with pytest.raises(IndexError):
        pictures[9]
    with pytest.raises(SettingError, match="every must be"):
        Pictures(episode, every=0)


def test_file_format_follows_the_suffix(tmp_path: Path) -> None:
    episode = walk(5)
    episode.save(tmp_path / "a.gif", fps=10, every=2)
    episode.save(str(tmp_path / "a.PNG"))
    with Image.open(tmp_path / "a.gif") as gif:
        assert getattr(gif, "n_frames", 1) == 4
        assert gif.info["duration"] == 100
    with Image.open(tmp_path / "a.PNG") as png:
        assert png.format == "PNG"
    for path, words in (
        ("a.json", "no trajectory"),
        ("a.avi", r"\.gif, \.mp4, \.png or"),
        ("a", "end in"),
    ):
        with pytest.raises(SettingError, match=words):
            episode.save(tmp_path / path)
    assert sorted(os.listdir(tmp_path)) == ["a.PNG", "a.gif"]
