"""The random rollout and the custom map run and do what they say."""

import jax
import numpy as np
import pytest
from PIL import Image

from examples import custom_map, random_rollout
from jaxenstein.files import OutputError


@pytest.fixture(autouse=True)
def promotion_as_users_have_it():
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        yield


def test_random_rollout(capsys):
    rate, mean = random_rollout.main(["--envs", "4", "--steps", "310", "--size", "8"])
    assert rate > 0
    assert 0 <= mean <= 1
    out = capsys.readouterr().out
    assert "simple, 4 environments" in out
    # 300 steps an episode, less where chance reaches the goal.
    assert int(out.split("\n")[-2].split()[0]) >= 4


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


def test_custom_map_where_nothing_can_be_written(tmp_path):
    taken = tmp_path / "taken"
    taken.write_text("")
    with pytest.raises(OutputError, match="taken"):
        custom_map.main(["--out", str(taken)])
