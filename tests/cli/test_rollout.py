"""`jaxenstein rollout`: results and pictures."""

from __future__ import annotations

import re
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from PIL import Image

import jaxenstein
from jaxenstein.cli import main, rollout

pytestmark = pytest.mark.usefixtures("plain_frames")

MAP = "######\n#S..G#\n######\n"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The folder and the printed text of one small rollout with pictures."""
    folder = tmp_path_factory.mktemp("rollout")
    (folder / "tiny.txt").write_text(MAP)
    arguments = ["--envs=5", "--steps=30", "--horizon=10", "--height=8", "--width=12"]
    with pytest.MonkeyPatch.context() as patch:
        printed: list[str] = []
        patch.setattr("builtins.print", lambda *text, **_: printed.append(" ".join(text)))
        code = main(
            ["rollout", "--map-file", str(folder / "tiny.txt"), *arguments, "--out", str(folder)]
        )
    assert code == 0
    return folder, "\n".join(printed)


def test_figures(made: tuple[Path, str]) -> None:
    _, text = made
    assert "150 steps" in text
    assert re.search(r"steps/s", text)
    # Thirty steps of at most ten an episode in five environments.
    assert int(re.search(r"episodes +(\d+) ended", text).group(1)) >= 15  # type: ignore[union-attr]
    assert re.search(r"success +\d+\.\d%", text)


def test_animation_shows_all_environments_over_time(made: tuple[Path, str]) -> None:
    folder, _ = made
    with Image.open(folder / "tiny.gif") as gif:
        assert getattr(gif, "n_frames", 1) > 10
        assert gif.width > gif.height >= rollout.GIF_HEIGHT
        first = np.asarray(gif.convert("RGB"))
        gif.seek(10)
        assert (first != np.asarray(gif.convert("RGB"))).any()


def test_contact_sheet_has_a_row_per_environment(made: tuple[Path, str]) -> None:
    folder, _ = made
    scale = -(-rollout.SHEET_HEIGHT // 8)
    with Image.open(folder / "tiny.png") as sheet:
        assert sheet.size == (8 * (12 * scale + 2) + 2, 5 * (8 * scale + 2) + 2)
    assert sorted(path.name for path in folder.iterdir()) == ["tiny.gif", "tiny.png", "tiny.txt"]


def test_counts_match_the_environment() -> None:
    """Compare the counts with the same environments stepped one by one."""
    env, params = jaxenstein.from_ascii(MAP, height=4, width=4)
    params = params.replace(max_steps_in_episode=7, goal_radius=1.2, living_reward=-0.25)
    # Of 21 steps: the third episodes of 7 steps do not count.
    advance, carry = rollout.compile_rollout(env, params, envs=3, seed=5, watched=2, latest=13)
    state, key = carry["state"], carry["key"]
    copied = jax.tree.map(jnp.copy, carry)
    frames, tally = rollout.play(advance, copied, 21, 3, True)
    assert len(frames) == 22
    assert frames[0].shape == (2, 4, 4, 3)
    ended, counted, reached, returns, began = 0, 0, 0, 0.0, np.zeros(3, int)
    step = jax.jit(jax.vmap(env.step, in_axes=(0, 0, 0, None)))
    for time in range(1, 22):
        key, policy_key, step_key = jax.random.split(key, 3)
        actions = jax.random.randint(policy_key, (3,), 0, env.num_actions, np.int32)
        keys = jax.random.split(step_key, 3)
        _, state, _, terminated, truncated, info = step(keys, state, actions, params)
        over = np.asarray(terminated | truncated)
        counts = over & (began <= 13)
        began = np.where(over, time, began)
        ended += over.sum()
        counted += counts.sum()
        reached += (np.asarray(terminated) & counts).sum()
        returns += np.asarray(info["episode_return"])[counts].sum()
    assert (tally.ended, tally.episodes, tally.successes, tally.goals) == (
        ended, counted, reached, reached
    )  # fmt: skip
    assert 0 < tally.episodes < tally.ended
    assert tally.returns == pytest.approx(returns, rel=1e-5)
