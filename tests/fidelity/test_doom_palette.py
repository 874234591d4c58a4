"""A WAD file with another palette."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fidelity import doom_palette
from jaxenstein.errors import SettingError, WadError
from jaxenstein.tasks.doom.wad import Wad
from tests.reference.wads import write_wad


def test_channels_change_places_and_nothing_else(tmp_path: Path) -> None:
    colours = np.random.default_rng(0).integers(0, 256, (14, 256, 3), np.uint8)
    lumps = [("FIRST", b"abc"), ("PLAYPAL", colours.tobytes()), ("LAST", b"defgh")]
    old, new = tmp_path / "old.wad", tmp_path / "new.wad"
    old.write_bytes(write_wad(lumps, b"IWAD"))
    assert doom_palette.main([str(new), "--wad", str(old), "--channels", "gbr"]) == 0
    wanted = np.stack([colours[..., 1], colours[..., 2], colours[..., 0]], axis=-1)
    lumps[1] = ("PLAYPAL", wanted.tobytes())
    assert new.read_bytes() == write_wad(lumps, b"IWAD")
    np.testing.assert_array_equal(Wad(new).palette(), wanted[0])


def test_the_file_that_is_read_is_kept(tmp_path: Path) -> None:
    old, same = tmp_path / "old.wad", tmp_path / "other" / ".." / "old.wad"
    same.parent.parent.mkdir()
    old.write_bytes(data := write_wad([("PLAYPAL", bytes(range(256)) * 3)], b"IWAD"))
    with pytest.raises(SettingError, match="would overwrite"):
        doom_palette.main([str(same), "--wad", str(old)])
    assert old.read_bytes() == data


def test_files_without_a_palette_are_refused(tmp_path: Path) -> None:
    old, new = tmp_path / "old.wad", tmp_path / "new.wad"
    old.write_bytes(write_wad([("FIRST", b"abc")]))
    with pytest.raises(WadError, match="has no lump 'PLAYPAL'"):
        doom_palette.main([str(new), "--wad", str(old)])
    assert not new.exists()
