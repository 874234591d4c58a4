"""The example of a custom map runs and does what its text says."""

import numpy as np
import pytest
from PIL import Image

from examples import custom_map


@pytest.mark.usefixtures("plain_frames")
def test_custom_map(tmp_path, capsys):
    assert custom_map.main(["--out", str(tmp_path / "pictures")]) == 1.0
    assert "return 1" in capsys.readouterr().out
    with Image.open(tmp_path / "pictures" / "map.png") as picture:
        assert picture.size == (10 * 36, 5 * 36)
    with Image.open(tmp_path / "pictures" / "walk.gif") as walk:
        frames = walk.n_frames  # pyright: ignore[reportAttributeAccessIssue]
        first = np.asarray(walk.convert("RGB"))
        walk.seek(frames - 1)
        assert (np.asarray(walk.convert("RGB")) != first).any()
    assert frames > 40
