"""What `look="game"` adds to some scenarios: several weapons, fog, and what monsters drop."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein.tasks.doom.deathmatch_look import Fog
from jaxenstein.tasks.doom.drops import Drops
from jaxenstein.tasks.doom.fixed import ONE
from jaxenstein.tasks.doom.game_things import Views
from jaxenstein.tasks.doom.game_weapon import WEAPON_LOOKS, held, pictures_of
from jaxenstein.tasks.doom.monster_kinds import CHAINGUN_GUY, SHOTGUN_GUY, ZOMBIE
from jaxenstein.tasks.doom.monsters import Horde
from jaxenstein.tasks.doom.weapons import SLOTS, Trigger
from tests.tasks.doom.cases import NO_WALLS

LOOKS = tuple(WEAPON_LOOKS[slot.weapon.name] for slot in SLOTS)
NAMES = [slot.weapon.name for slot in SLOTS]


def shown(name: str, tics: int, wait: int = 0, time: int = 99) -> Any:
    """The pictures in tics of a weapon: letters of gun and flash, the light, and the row."""
    trigger = Trigger(jnp.int32(tics), jnp.bool_(False), jnp.int32(9), jnp.int32(wait))
    selected = jnp.int32(NAMES.index(name))
    over, glare = held(LOOKS, trigger, jnp.float32(0), jnp.int32(time), selected)
    (flash, gun), seen = over.picture.tolist(), over.shown.tolist()
    known = ["".join(one) for one in pictures_of(LOOKS)]
    assert seen[1]
    return known[gun], known[flash] if seen[0] else "", int(glare), float(over.place[0, 1])


@pytest.mark.parametrize(
    ("name", "guns", "flashes"),
    [
        ("fist", "PUNG BBBBCCCCDDDDDCCCCBBBBB", ""),
        ("shotgun", "SHTG AAAAAAAAAABBBBBCCCCCDDDDCCCCCBBBBBAAAAAAAAAA", "...AAAABBB"),
        ("chaingun", "CHGG AAAABBBB", "AAAABBBB"),
        ("rocket launcher", "MISG BBBBBBBBBBBBBBBBBBBB", "AAABBBBCCCCDDDD"),
    ],
)
def test_weapons_fire_as_in_the_games_tables(name: str, guns: str, flashes: str) -> None:
    sprite, letters = guns.split()
    weapon = SLOTS[NAMES.index(name)].weapon
    assert len(letters) == weapon.ready
    for tic, letter in enumerate(letters):
        gun, flash, glare, _ = shown(name, tic)
        expected = flashes[tic : tic + 1].strip(".")
        assert (gun, flash[4:]) == (sprite + letter, expected)
        assert (glare > 0) == bool(expected)


def test_weapons_are_lowered_and_raised_as_in_the_game() -> None:
    """Rows recorded in the game, from the tic after the button on."""
    down = [shown("pistol", 99, wait)[3] for wait in range(29, 14, -1)]
    np.testing.assert_allclose(down, 38.375 + 6 * np.arange(15))
    up = [shown("fist", 99, wait) for wait in range(14, 0, -1)]
    np.testing.assert_allclose([row[3] for row in up], 122 - 6 * np.arange(14))
    assert shown("fist", 99)[3] == pytest.approx(32.375)
    # The chainsaw shakes, but not while it is raised.
    assert {shown("chainsaw", 99, time=time)[0] for time in range(90, 99)} == {"SAWGC", "SAWGD"}
    assert {shown("chainsaw", 99, 9, time)[0] for time in range(90, 99)} == {"SAWGC"}


def test_fog_lasts_71_tics_where_monsters_appear() -> None:
    fog = Fog(2)
    places = jnp.arange(6, dtype=jnp.int32).reshape(3, 2)
    comes = jnp.array([False, True, False])
    fogs, seen = fog.added(fog.none(), comes, places), []

    class State:
        fogs: Any

    for _ in range(80):
        State.fogs = fogs
        one = fog.shown(State, jnp.int32(0))
        letters = [fog.looks[look].letter for look in one.looks.tolist()]
        seen.append("".join(np.array(letters)[np.asarray(one.visible)]))
        assert one.places[0].tolist() == [2, 3]
        fogs = fog.added(fogs, comes & False, places)
    assert seen[:71] == list("A" * 5 + "".join(6 * letter for letter in "BABCDEFGHIJ"))
    assert seen[71:] == [""] * 9


def thrown(speed: float, up: float) -> float:
    """How far a thing gets, tic by tic: it falls from a height of 28, then slides to a halt."""
    place, height = 0.0, 28.0
    while height > 0:
        place, height, up = place + speed, height + up, up - 1
    while abs(speed) >= 1 / 16:
        speed *= 29 / 32
        place += speed
    return place


def test_what_monsters_drop_lies_near_them_and_out_of_reach() -> None:
    horde = Horde([SHOTGUN_GUY, ZOMBIE, CHAINGUN_GUY], walls=NO_WALLS, pictured=True)
    drops = Drops(horde, (44, 12))
    bits = jax.random.bits(jax.random.key(0), (4000, 3, 2), jnp.uint32)
    way = np.asarray(jax.vmap(drops.sample)(bits)) / ONE
    first, second = np.asarray(bits[:200, 0, 0]), np.asarray(bits[:200, 0, 1])
    speeds = ((first & 255).astype(float) - (first >> 8 & 255)) / 256
    slides = [thrown(*one) for one in zip(speeds, 5 + (second & 255) / 64, strict=True)]
    assert np.abs(way[:200, 0, 0] - slides).mean() < 0.5
    assert np.abs(way[..., 0]).max() <= 44
    assert np.abs(way[..., 1]).max() == 12

    class State:
        monsters: Any
        drops = jnp.zeros((3, 2), jnp.int32)

    here = jnp.zeros((3, 2), jnp.int32)
    alive = horde.placed(here, jnp.zeros(3, jnp.uint32), jnp.ones(3, bool), jnp.ones(3, jnp.int32))
    for frames, there in (-1, False), (0, False), (1, False), (2, True), (4, True):
        State.monsters = alive.replace(frame=jnp.asarray(horde.die) + frames)
        one = drops.shown(State, jnp.int32(0))
        assert one.visible.tolist() == [there] * 3
    assert [drops.looks[look].sprite for look in one.looks.tolist()] == ["SHOT", "CLIP", "MGUN"]


def test_things_of_the_games_look_alone_have_no_shape_in_labels_and_depth() -> None:
    env: Any = jaxenstein.make("doom-basic")[0]
    theme = env.theme
    views = Views(np.arange(2), np.zeros(2, bool), np.array([0, 1, 1]), [])
    art = np.asarray(views.themed(theme, np.array([0, -1])).sprite_art)
    np.testing.assert_array_equal(art[0], theme.sprite_art[0])
    assert art[0].any()
    assert not art[1:].any()
