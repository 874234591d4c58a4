"""Environments with custom images: each pixel matches its label."""

from typing import Any

import jax
import numpy as np
import pytest

import jaxenstein
from jaxenstein import SettingError
from jaxenstein.engine.shade import Light, brightness
from jaxenstein.engine.textures import shade_of
from jaxenstein.maps.symbols import CEILING, FLOOR, WALL_LABELS
from jaxenstein.tasks import dressing
from jaxenstein.tasks.dressing import depth_of_shades, smoothed

# Walls are red, the floor is green and the ceiling blue, in noise; nothing else is of one channel.
SIDE = 16
CHANNELS = {"wall": 0, "floor": 1, "ceiling": 2}


def images() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    found = {}
    for name, channel in CHANNELS.items():
        found[name] = np.zeros((SIDE, SIDE, 3), np.uint8)
        found[name][..., channel] = rng.integers(40, 256, (SIDE, SIDE))
    return found


def test_too_many_texels_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dressing, "MOST_TEXELS", 100)
    env, params = jaxenstein.make("key-door", height=8, width=8, textures=images())
    with pytest.raises(SettingError, match=r"textures have .* texels together, more than 100: "):
        env.reset(jax.random.key(0), params)


@pytest.mark.parametrize(
    ("id", "settings"),
    [
        # A generated level with doors and things.
        pytest.param("key-corridor", {}, id="generated"),
        pytest.param("doom-basic", {"hud": True}, id="doom", marks=pytest.mark.variant),
        pytest.param("health-gathering", {"hud": True}, id="many", marks=pytest.mark.variant),
    ],
)
def test_pixels_match_the_labels(id: str, settings: dict[str, bool]) -> None:
    env: Any
    env, params = jaxenstein.make(id, height=24, width=32, textures=images(), **settings)
    lanes, steps = 4, 6

    @jax.jit
    @jax.vmap
    def play(key: jax.Array):
        def step(state, key):
            state = env.step(key, state, 2 * (key[0] & 1), params)[1]
            return state, (env.draw(state, params, "rgb"), env.draw(state, params, "labels"))

        state = env.reset(key, params)[1]
        return jax.lax.scan(step, state, jax.random.split(key, steps))[1]

    rgb, labels = play(jax.random.split(jax.random.PRNGKey(0), lanes))
    rgb, labels = (np.asarray(kind)[:, :, : env.view_height] for kind in (rgb, labels))
    assert labels.shape == (lanes, steps, env.view_height, 32)
    shown = (rgb > 0).astype(int) @ [1, 2, 4]
    groups = {"wall": np.isin(labels, WALL_LABELS), "floor": labels == FLOOR}
    groups["ceiling"] = labels == CEILING
    others = ~np.any(list(groups.values()), axis=0)
    for name, here in groups.items():
        assert here.sum() > 100
        assert (shown[here] == 1 << CHANNELS[name]).all(), name
        assert len(np.unique(rgb[here], axis=0)) > 20
    assert not np.isin(shown[others], (1, 2, 4)).all()
    assert others.any()


def test_smoothing_averages_surrounding_texels() -> None:
    """For a repeating picture; over an odd number of texels, or over all."""
    picture = np.random.default_rng(1).integers(0, 256, (8, 16, 3), dtype=np.uint8)
    around = [
        np.roll(picture.astype(np.float64), (row, column), (0, 1))
        for row in (-1, 0, 1)
        for column in range(-2, 3)
    ]
    np.testing.assert_allclose(smoothed(picture, 5.4, 2.6), np.mean(around, axis=0))
    np.testing.assert_array_equal(smoothed(picture, 1.9, 0), picture)
    whole = np.broadcast_to(picture.mean(axis=(0, 1)), picture.shape)
    np.testing.assert_allclose(smoothed(picture, 17, np.inf), whole)


def test_shades_depend_on_depth() -> None:
    """A plane at the depth of a shade has that shade; an unused shade is infinitely far."""
    depths = depth_of_shades(Light())
    reached = np.isfinite(depths)
    np.testing.assert_array_equal(shade_of(brightness(depths[reached])), np.flatnonzero(reached))
    assert (np.diff(depths[reached]) > 0).all()
    # The least light is 0.22, so the darkest of 32 shades is the 25th.
    assert reached.sum() == 26
