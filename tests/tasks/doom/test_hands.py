"""The weapon in the player's hands and the strip below the view, if enabled."""

from __future__ import annotations

from importlib import resources
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein.errors import SettingError
from jaxenstein.tasks.doom.view import FLASH, Layer
from jaxenstein.tasks.doom.weapons import PISTOL, ROCKET_LAUNCHER
from jaxenstein.tasks.hud import AMMUNITION, EMPTY, LEVELS
from tests.tasks.doom.cases import first_state

pytestmark = pytest.mark.usefixtures("plain_frames")
# A view of 40 rows: the weapon has 16 of them, and 12 of the 40 columns.
HEIGHT, WIDTH, STRIP = 44, 40, 4
ROWS, FIRST, COLUMNS = 16, 14, 12


def art(name: str) -> list[str]:
    folder = resources.files("jaxenstein.engine.art")
    return folder.joinpath(f"{name}.txt").read_text("ascii").split()


def over(view: np.ndarray, layers: tuple[Layer, ...]) -> np.ndarray:
    """The view with pictures over it, pixel by pixel."""
    out = view.copy()
    for name, colours in layers:
        lines = art(name)
        for row in range(ROWS):
            for column in range(COLUMNS):
                mark = lines[int((row + 0.5) * 2)][int((column + 0.5) * 32 / COLUMNS)]
                if mark != ".":
                    out[40 - ROWS + row, FIRST + column] = colours["#o".index(mark)]
    return out


@pytest.fixture(scope="module")
def drawn() -> Any:
    """A state of Defend the Center, and what it looks like plain, with all, and in greys."""
    plain, params = jaxenstein.make("doom-defend-the-center", height=40, width=WIDTH)
    settings: dict[str, Any] = {"hud": True, "show_weapon": True, "width": WIDTH}
    full, _ = jaxenstein.make("doom-defend-the-center", height=HEIGHT, **settings)
    grey, _ = jaxenstein.make(
        "doom-defend-the-center", height=HEIGHT, observation="gray", **settings
    )
    space: Any = full.observation_space()
    assert space.shape == (HEIGHT, WIDTH, 3)
    state = first_state(plain, params)

    @jax.jit
    def draw(trigger: Any, health: jax.Array) -> Any:
        shown = state.replace(trigger=trigger, health=health)
        return tuple(env.observe(shown, params) for env in (plain, full, grey))

    return state.trigger, lambda trigger, health=100: jax.device_get(
        draw(trigger, jnp.int32(health))
    )


def test_weapon_is_drawn_pixel_by_pixel_and_flashes_after_a_shot(drawn: Any) -> None:
    trigger, draw = drawn
    for tics in range(20):
        plain, full, _ = draw(trigger.replace(tics=jnp.int32(tics), wait=jnp.int32(0)))
        # The pistol's bullet leaves in tic 4.
        view = over(plain, (FLASH,)) if 4 <= tics < 8 else plain
        np.testing.assert_array_equal(full[:-STRIP], over(view, PISTOL.picture))


def test_lowered_weapon_is_not_shown(drawn: Any) -> None:
    trigger, draw = drawn
    plain, full, _ = draw(trigger.replace(wait=jnp.int32(1)))
    np.testing.assert_array_equal(full[:-STRIP], plain)


@pytest.mark.parametrize(("health", "ammo"), [(100, 26), (55, 13), (30, 5), (1, 0)])
def test_hud_shows_health_and_ammunition(drawn: Any, health: int, ammo: int) -> None:
    trigger, draw = drawn
    _, full, _ = draw(trigger.replace(ammo=jnp.int32(ammo)), health)
    inner = full[-STRIP + 1 : -1]
    for left, share, levels in ((1, health / 100, LEVELS), (21, ammo / 26, AMMUNITION)):
        columns = inner[:, left : left + 18]
        colour = next(paint for bound, paint in levels if share <= bound)
        # Of the 18 columns those whose middle is below the share.
        count = sum((column + 0.5) / 18 < share for column in range(18))
        assert (columns[:, :count] == colour).all()
        assert (columns[:, count:] == EMPTY).all()


def test_greys_match_the_colours(drawn: Any) -> None:
    trigger, draw = drawn
    plain, full, grey = draw(trigger.replace(tics=jnp.int32(5), wait=jnp.int32(0)))
    assert grey.shape == (HEIGHT, WIDTH)
    # Of the weapon and the strip: the view below is the engine's.
    added = np.ones((HEIGHT, WIDTH), bool)
    added[:-STRIP] = (full[:-STRIP] != plain).any(axis=-1)
    assert added[:-STRIP].sum() > 40
    assert np.abs(grey - full @ np.array([0.299, 0.587, 0.114]))[added].max() <= 1


def test_every_weapon_has_a_look() -> None:
    for weapon in (PISTOL, ROCKET_LAUNCHER):
        for name, _ in weapon.picture:
            assert set("".join(art(name))) == set(".#o")


@pytest.mark.parametrize(
    ("id", "settings", "message"),
    [
        ("doom-basic", {"show_weapon": True, "observation": "depth"}, "not 'depth'"),
        ("doom-basic", {"hud": True, "observation": "labels"}, "not 'labels'"),
        ("doom-basic", {"hud": True, "height": 7}, "at least 8 pixels, not 7"),
        ("doom-take-cover", {"show_weapon": True}, "has no weapon"),
    ],
)
def test_undrawable_settings_are_refused(id: str, settings: dict, message: str) -> None:
    with pytest.raises(SettingError, match=message):
        jaxenstein.make(id, **settings)
