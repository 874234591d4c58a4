"""Maps of visits: what is counted, and that it goes on where it stopped."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from PIL import Image

pytest.importorskip("flax")

from experiments import visits
from jaxenstein import from_ascii
from jaxenstein.baselines.learner import PolicyCarry
from jaxenstein.maps.ascii import parse_ascii

CONFIG = (
    'map = """\n#####\n#S..#\n###G#\n#####\n"""\nheading = 0\nheight = 8\nwidth = 8\nhorizon = 8\n'
    'recipe = "tuned"\nnum_envs = 8\nrollout = 8\nseeds = 2\ntotal_steps = 256\n'
)


def size_of(path: Path) -> tuple[int, int]:
    with Image.open(path) as picture:
        return picture.size


def test_visits_are_counted_at_each_stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "config.toml").write_text(CONFIG)
    command = [str(tmp_path / "config.toml"), "--algo", "ppo", "--stages", "3"]
    visits.main([*command, "--out", str(tmp_path / "runs")])
    file = tmp_path / "runs" / "ppo" / "visits.json"
    kept = json.loads(file.read_text())
    assert list(kept) == ["0", "2", "4"]
    for counts in map(np.array, kept.values()):
        # Two seeds, each for as many steps as an episode can have; nobody stands in a wall.
        assert counts.sum() == 2 * visits.EPISODES * 8
        free = np.zeros((4, 5), bool)
        free[1, 1:4] = free[2, 3] = True
        assert not counts[~free].any()
        assert counts[1, 1] > 0
    rows = (tmp_path / "runs" / "ppo" / "metrics.jsonl").read_text()
    assert len(rows.splitlines()) == 4 * 2
    size = size_of(tmp_path / "runs" / "visits.png")
    # Again: nothing is trained or counted anew; what is missing is.
    monkeypatch.setattr(visits, "visits", lambda folder: np.zeros((4, 5), int))
    file.write_text(json.dumps({name: kept[name] for name in ("0", "2")}))
    visits.main([*command, "--out", str(tmp_path / "runs")])
    again = json.loads(file.read_text())
    assert again["2"] == kept["2"]
    assert not np.any(again["4"])
    assert (tmp_path / "runs" / "ppo" / "metrics.jsonl").read_text() == rows
    assert size_of(tmp_path / "runs" / "visits.png") == size


def test_who_reaches_the_goal_begins_anew() -> None:
    env, params = from_ascii("#####\n#S.G#\n#####", heading=0.0, height=8, width=8, autoreset=None)
    params = params.replace(max_steps_in_episode=jnp.int32(40))
    forward = jnp.full(visits.EPISODES, env.action_names.index("forward"), jnp.int32)
    carry = PolicyCarry(jnp.zeros(1), jnp.int32(-1), jnp.bool_(True))
    learner: Any = SimpleNamespace(
        env=env,
        env_params=params,
        initial_carry=lambda: carry,
        act=lambda *given: (forward, given[2]),
    )
    cells = np.asarray(visits.play(learner, jnp.zeros(1)))[0]
    expected: list[int] = []
    step = jax.jit(lambda state: env.step(jax.random.key(0), state, forward[0], params))
    while len(expected) < 40:
        state, over = env.reset(jax.random.key(0), params)[1], False
        while not over and len(expected) < 40:
            _, state, _, terminated, truncated, info = step(state)
            over = bool(terminated | truncated)
            expected.append(int(info["cell"][0]))
    np.testing.assert_array_equal(
        np.bincount(cells[:, 0], minlength=5), visits.EPISODES * np.bincount(expected, minlength=5)
    )


def test_tiles_are_brighter_by_powers_of_ten() -> None:
    tilemap = parse_ascii("#####\n#S G#\n#####")
    counts = np.zeros((3, 5), int)
    nobody = np.asarray(visits.draw(tilemap, [[counts]]), float)
    counts[1, 1:4] = 900, 90, 10
    seen = np.asarray(visits.draw(tilemap, [[counts, counts]]), float)
    high, wide = nobody.shape[:2]
    assert seen.shape == (high, 2 * wide + visits.GAP, 3)
    np.testing.assert_array_equal(seen[:, :wide], seen[:, wide + visits.GAP :])
    middle = [(high // 2, wide * column // 10) for column in (3, 5, 7)]
    mixed = [
        np.abs(seen[at] - nobody[at]).sum() / np.abs(visits.COLOUR - nobody[at]).sum()
        for at in middle
    ]
    np.testing.assert_allclose(mixed, [1, np.log10(0.09 / 1e-5) / 4, 0.75], atol=0.02)
