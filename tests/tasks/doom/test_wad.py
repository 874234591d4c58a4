"""WAD files written here, spoilt ones, and the game's own where ViZDoom is installed."""

from __future__ import annotations

import struct
import sys
from pathlib import Path

import numpy as np
import pytest

from jaxenstein.adapters.vizdoom_buffers import MissingViZDoomError
from jaxenstein.errors import WadError
from jaxenstein.tasks.doom.wad import LARGEST, Wad, find_iwad
from tests.reference.wads import (
    COLORMAP,
    FLAT,
    MONSTER,
    PALETTE,
    PATCH,
    POST,
    TURNED,
    WALL,
    small_lumps,
    write_picture,
    write_textures,
    write_wad,
)


def opened(path: Path, **lumps: bytes | None) -> Wad:
    """The small WAD with some lumps in the place of its own, or without them."""
    parts = [(name, lumps.get(name, data)) for name, data in small_lumps()]
    parts += [(name, data) for name, data in lumps.items() if name not in dict(parts)]
    path = path / "some.wad"
    path.write_bytes(write_wad((name, data) for name, data in parts if data is not None))
    return Wad(path)


def same(found: np.ndarray, expected: np.ndarray) -> None:
    assert found.dtype == expected.dtype
    np.testing.assert_array_equal(found, expected)


def test_tables_and_flats(tmp_path: Path) -> None:
    wad = opened(tmp_path)
    same(wad.palette(), PALETTE)
    same(wad.colormap(), COLORMAP)
    same(wad.flat("floor"), FLAT)
    same(wad.texture("Floor"), FLAT.astype(np.int16))
    assert wad.names("F") == ("FLOOR",)
    assert wad.names() == ("PLAYPAL", "COLORMAP", "TEXTURE1", "PNAMES")
    assert wad.lump("colormap") == COLORMAP.tobytes()


def test_textures_are_overlaid_patches(tmp_path: Path) -> None:
    wad = opened(tmp_path)
    for name, ((height, width), parts) in WALL.items():
        expected = np.full((height, width), -1, np.int16)
        for column, row, patch in parts:
            for (y, x), pixel in np.ndenumerate((PATCH, POST)[patch]):
                inside = 0 <= row + y < height and 0 <= column + x < width
                if inside and pixel >= 0:
                    expected[row + y, column + x] = pixel
        same(wad.texture(name.lower()), expected)


def test_sprites_have_views_and_mirror_images(tmp_path: Path) -> None:
    wad = opened(tmp_path)
    vest = wad.sprite("vest", "a")
    assert len(vest) == 8
    for view in vest:
        same(view.pixels, TURNED)
        assert (view.left, view.top, view.mirrored) == (2, 4, False)
    trooper = wad.sprite("TROO", "A")
    assert [view.mirrored for view in trooper] == [False] * 5 + [True] * 3
    for side, mirror in ((1, 7), (2, 6), (3, 5)):
        same(trooper[mirror].pixels, trooper[side].pixels[:, ::-1])
        width = trooper[side].pixels.shape[1]
        assert trooper[mirror].left == width - 1 - trooper[side].left
        assert trooper[mirror].top == trooper[side].top
    same(trooper[0].pixels, MONSTER)
    same(trooper[5].pixels, TURNED[:, ::-1])


def test_posts_of_tall_pictures_continue_below_the_last_one(tmp_path: Path) -> None:
    column = bytes([250, 2, 0, 7, 8, 0]) + bytes([50, 1, 0, 9, 0]) + b"\xff"
    tall = struct.pack("<4hI", 1, 400, 0, 0, 12) + column
    pixels = opened(tmp_path, PATCH=tall).patch("PATCH").pixels
    assert {int(row): int(pixels[row, 0]) for row in np.flatnonzero(pixels[:, 0] >= 0)} == {
        250: 7,
        251: 8,
        300: 9,
    }


def test_last_of_equal_names_counts(tmp_path: Path) -> None:
    path = tmp_path / "two.wad"
    first, last = (write_picture(pixels) for pixels in (PATCH, POST))
    path.write_bytes(write_wad([("A", first), ("A", last), ("P_START", b""), ("P_END", b"")]))
    same(Wad(path).patch("A").pixels, POST)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "not a WAD file"),
        (b"PK\3\4 and more bytes", "not a WAD file"),
        (struct.pack("<4sII", b"IWAD", 2, 12), "cut off: its directory ends after the file's 12"),
        (struct.pack("<4sII", b"IWAD", 2**32 - 1, 2**32 - 1), "cut off"),
        (
            struct.pack("<4sII", b"IWAD", 1, 12) + struct.pack("<II8s", 20, 9, b"AWAY"),
            "lump 'AWAY' lies outside of the file's 28 bytes",
        ),
        (write_wad(small_lumps())[:-1], "cut off"),
        (b"IWAD", "cut off"),
    ],
)
def test_files_that_are_not_wads(tmp_path: Path, data: bytes, message: str) -> None:
    path = tmp_path / "some.wad"
    path.write_bytes(data)
    with pytest.raises(WadError, match=rf"some\.wad: .*{message}"):
        Wad(path)


def test_missing_files(tmp_path: Path) -> None:
    for path in (tmp_path / "none.wad", tmp_path / ("x" * 5000), Path("\0")):
        with pytest.raises(WadError, match="there is no such file"):
            Wad(path)
    with pytest.raises(WadError, match="it is a folder"):
        Wad(tmp_path)


BAD = struct.pack("<4hI", 1, 4, 0, 0, 12)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (None, "has no patch 'PATCH'"),
        (b"", "picture 'PATCH' is cut off"),
        (BAD, "picture 'PATCH' is cut off"),
        (BAD + bytes([0, 9, 0, 1]), "picture 'PATCH' is cut off"),
        (BAD + bytes([2, 3, 0, 1, 2, 3, 0, 255]), "column 0 of picture 'PATCH' leaves its 4 rows"),
        (BAD + bytes([0, 0, 0, 0]) * 9, "column 0 of picture 'PATCH' has more runs than rows"),
        (struct.pack("<4hI", 1, 4, 0, 0, 2**31), "picture 'PATCH' is cut off"),
        (struct.pack("<4h", 9999, 4, 0, 0), rf"is 9999 by 4 pixels, not 1 to {LARGEST}"),
        (struct.pack("<4h", 3, -4, 0, 0), "is 3 by -4 pixels"),
    ],
)
def test_damaged_pictures(tmp_path: Path, data: bytes | None, message: str) -> None:
    wad = opened(tmp_path, PATCH=data)
    with pytest.raises(WadError, match=rf"some\.wad: .*{message}"):
        wad.texture("WALL")
    same(wad.texture("POLE"), POST)


@pytest.mark.parametrize(
    ("lump", "data", "message"),
    [
        ("TEXTURE1", None, "has no texture 'WALL'"),
        ("TEXTURE1", b"\1\0\0\0\7\0\0\0", "TEXTURE1 is cut off"),
        ("TEXTURE1", struct.pack("<I", 2**32 - 1), "TEXTURE1 is cut off"),
        ("TEXTURE1", write_textures({"WALL": ((8, 8), [(0, 0, 0)])})[:-1], "'WALL' is cut off"),
        ("TEXTURE1", write_textures({"WALL": ((8, 8), [(0, 0, 2)])}), "has patch 2 of 2"),
        ("TEXTURE1", write_textures({"WALL": ((0, 8), [])}), "is 8 by 0 pixels"),
        ("TEXTURE1", write_textures({"WALL": ((8, 8), [(0, 0, 0)] * 257)}), "has 257 patches"),
        ("PNAMES", None, "has no lump 'PNAMES'"),
        ("PNAMES", struct.pack("<I", 2**32 - 1), "PNAMES is cut off"),
    ],
)
def test_damaged_textures(tmp_path: Path, lump: str, data: bytes | None, message: str) -> None:
    wad = opened(tmp_path, **{lump: data})
    with pytest.raises(WadError, match=message):
        wad.texture("WALL")


def test_error_names_missing_lump(tmp_path: Path) -> None:
    wad = opened(tmp_path, COLORMAP=None, PLAYPAL=bytes(700), FLOOR=bytes(4095))
    for call, message in (
        (wad.palette, "lump PLAYPAL is cut off: it has only 700 bytes"),
        (wad.colormap, "has no lump 'COLORMAP'"),
        (lambda: wad.flat("FLOOR"), "flat 'FLOOR' has 4095 bytes, not 4096"),
        (lambda: wad.flat("FLOR"), "has no flat 'FLOR', did you mean 'FLOOR'"),
        (lambda: wad.texture("WALLS"), "has no texture 'WALLS', did you mean 'WALL'"),
        (lambda: wad.sprite("TROO", "C"), "has no sprite 'TROOC', did you mean 'TROO"),
        (lambda: wad.sprite("TROO", "B"), "sprite 'TROOB' lacks its view 2"),
        (lambda: wad.lump("VESTA0"), "has no lump 'VESTA0'"),
    ):
        with pytest.raises(WadError, match=message):
            call()


def test_installed_iwad_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    assert find_iwad("my.wad") == Path("my.wad")
    monkeypatch.setitem(sys.modules, "vizdoom", None)
    with pytest.raises(MissingViZDoomError, match=r"jaxenstein\[vizdoom\]"):
        find_iwad()


def test_every_picture_of_the_game_can_be_read() -> None:
    """Freedoom's file, as ViZDoom brings it; its own tables name what is in it."""
    pytest.importorskip("vizdoom")
    wad = Wad(find_iwad())
    assert wad.palette()[0].tolist() == [0, 0, 0]
    assert (wad.colormap()[0] == np.arange(256)).mean() > 0.95
    assert wad.texture("BIGDOOR2").shape == (128, 128)
    assert (wad.texture("CEIL4_2") == wad.flat("CEIL4_2")).all()
    assert len(wad.textures()) > 900
    for name in wad.textures():
        assert wad.texture(name).shape[0] in range(8, 257)
    for name, frame in {(lump[:4], lump[4]) for lump in wad.names("S")}:
        assert len(wad.sprite(name, frame)) == 8
    assert {len({view.pixels.tobytes() for view in wad.sprite("ARM1", "A")})} == {1}
