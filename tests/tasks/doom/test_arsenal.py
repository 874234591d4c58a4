"""Weapons by their tics, which are those of the running game, and changing between them."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxenstein.tasks.doom.arsenal import Arms, Arsenal
from jaxenstein.tasks.doom.weapons import (
    BULLETS,
    CHAINGUN,
    CHAINSAW,
    FIST,
    MOST_AMMO,
    PISTOL,
    ROCKET_LAUNCHER,
    ROCKETS,
    SHELLS,
    SHOTGUN,
    SLOTS,
    SUPER_SHOTGUN,
    Trigger,
    Weapon,
)

ARSENAL = Arsenal(SLOTS)
NONE = len(ARSENAL)
ALL = (FIST, CHAINSAW, PISTOL, SHOTGUN, SUPER_SHOTGUN, CHAINGUN, ROCKET_LAUNCHER)
NEXT, BEFORE = 1 << 6, 1 << 7
TICS = 160


def arms_with(selected: Weapon, owned: tuple[Weapon, ...] = ALL, **ammo: int) -> Arms:
    arms = ARSENAL.arms(owned, selected)
    amounts = MOST_AMMO.copy()
    for name, amount in ammo.items():
        amounts[{"bullets": BULLETS, "shells": SHELLS, "rockets": ROCKETS}[name]] = amount
    return arms.replace(ammo=jnp.asarray(amounts))


@jax.jit
def run(arms: Arms, trigger: Trigger, asked: jax.Array, attack: jax.Array) -> Any:
    """Tics of buttons int32[T], bool[T]: who is selected, what fires, and the ammunition."""

    def tic(carry: Any, held: Any) -> Any:
        arms, trigger = carry
        arms = ARSENAL.chosen(arms, held[0])
        trigger, arms, fires = ARSENAL.pulled(arms, trigger, held[1])
        return (arms, trigger), (arms.selected, fires, arms.ammo, trigger.held)

    return jax.lax.scan(tic, (arms, trigger), (asked, attack))[1]


def play(arms: Arms, asked: dict[int, int] | None = None, attack: Any = True) -> Any:
    """`TICS` tics with selecting buttons held in some of them, and ATTACK in all or some."""
    buttons = np.zeros(TICS, np.int32)
    for tic, bits in (asked or {}).items():
        buttons[tic] = bits
    held = np.broadcast_to(np.asarray(attack), TICS)
    weapon = ALL[int(arms.selected)]
    out = run(arms, ARSENAL.trigger(weapon), jnp.asarray(buttons), jnp.asarray(held))
    return jax.tree.map(np.asarray, out)


@pytest.mark.parametrize(
    ("weapon", "tics"),
    [
        (PISTOL, range(4, TICS, 14)),
        (SHOTGUN, range(3, TICS, 37)),
        (SUPER_SHOTGUN, range(3, TICS, 51)),
        (CHAINGUN, range(0, TICS, 4)),
        (ROCKET_LAUNCHER, range(8, TICS, 20)),
        (CHAINSAW, range(0, TICS, 4)),
        (FIST, range(8, TICS, 17)),
    ],
)
def test_held_trigger_fires_as_in_the_game(weapon: Weapon, tics: range) -> None:
    """From the tic in which ATTACK is pressed on; recorded with ViZDoom 1.3.2, but for blows."""
    selected, fires, ammo, _ = play(arms_with(weapon))
    assert np.flatnonzero(fires).tolist() == list(tics)
    kind = ARSENAL.ammo[ARSENAL.index_of(weapon)]
    used = MOST_AMMO[kind] - ammo[-1, kind]
    assert used == weapon.uses * len(tics)
    assert (np.delete(ammo, kind, axis=1) == np.delete(MOST_AMMO, kind)).all()
    assert (selected == ALL.index(weapon)).all()


def test_chaingun_fires_pairs_with_an_exact_first_pair() -> None:
    once = np.arange(TICS) == 5
    _, fires, _, _ = play(arms_with(CHAINGUN), attack=once)
    assert np.flatnonzero(fires).tolist() == [5, 9]
    _, fires, _, held = play(arms_with(CHAINGUN))
    assert held[fires].tolist() == [False] * 2 + [True] * (int(fires.sum()) - 2)


def test_new_weapon_appears_after_15_tics_and_fires_after_30() -> None:
    """As in the game, where ATTACK was held from the tic after the button on."""
    chaingun = {3: 1 << 3}
    selected, fires, _, _ = play(arms_with(PISTOL), chaingun, np.arange(TICS) > 3)
    assert np.flatnonzero(selected == ALL.index(CHAINGUN))[0] == 3 + 15
    assert np.flatnonzero(fires)[0] == 3 + 30
    # One that shoots is put away when it is ready again.
    selected, fires, _, _ = play(arms_with(PISTOL), chaingun, np.arange(TICS) == 0)
    assert np.flatnonzero(fires).tolist() == [4]
    assert np.flatnonzero(selected == ALL.index(CHAINGUN))[0] == PISTOL.ready + 15


def test_empty_weapon_is_replaced_by_the_best_one() -> None:
    """Two rockets were left, with shotgun and chaingun: tics of a recorded sequence."""
    owned = FIST, PISTOL, SHOTGUN, CHAINGUN, ROCKET_LAUNCHER
    selected, fires, ammo, _ = play(arms_with(ROCKET_LAUNCHER, owned, rockets=2, shells=8))
    assert np.flatnonzero(fires)[:5].tolist() == [8, 28, 70, 74, 78]
    assert np.flatnonzero(selected == ALL.index(CHAINGUN))[0] == 55
    assert ammo[-1, ROCKETS] == 0
    # Without ammunition, the player uses fists.
    selected, fires, _, _ = play(arms_with(PISTOL, (FIST, PISTOL), bullets=1))
    assert selected[-1] == ALL.index(FIST)
    assert np.flatnonzero(fires)[0] == 4


@pytest.mark.parametrize(
    ("have", "start", "button", "wanted"),
    [
        (ALL, PISTOL, 1 << 0, CHAINSAW),
        (ALL, CHAINSAW, 1 << 0, FIST),
        (ALL, PISTOL, 1 << 2, SUPER_SHOTGUN),
        (ALL, SUPER_SHOTGUN, 1 << 2, SHOTGUN),
        (ALL, PISTOL, 1 << 4, ROCKET_LAUNCHER),
        (ALL, PISTOL, 1 << 5, None),
        (ALL, PISTOL, 1 << 1, None),
        ((FIST, PISTOL), PISTOL, 1 << 3, None),
        (ALL, PISTOL, NEXT, SHOTGUN),
        (ALL, ROCKET_LAUNCHER, NEXT, FIST),
        ((FIST, PISTOL, CHAINGUN), PISTOL, NEXT, CHAINGUN),
        ((FIST, PISTOL, CHAINGUN), PISTOL, BEFORE, FIST),
        (ALL, FIST, BEFORE, ROCKET_LAUNCHER),
        ((PISTOL,), PISTOL, NEXT, None),
    ],
)
def test_buttons_select_owned_weapons(
    have: tuple[Weapon, ...], start: Weapon, button: int, wanted: Weapon | None
) -> None:
    arms = ARSENAL.chosen(arms_with(start, have), jnp.int32(button))
    assert int(arms.pending) == (NONE if wanted is None else ALL.index(wanted))
    # A button that is still held has no further effect.
    again = ARSENAL.chosen(arms, jnp.int32(button))
    assert int(again.pending) == int(arms.pending)


def test_weapons_without_ammunition_cannot_be_selected() -> None:
    arms = arms_with(PISTOL, shells=1, rockets=0)
    assert int(ARSENAL.chosen(arms, jnp.int32(1 << 4)).pending) == NONE
    # The super shotgun takes two shells.
    assert int(ARSENAL.chosen(arms, jnp.int32(1 << 2)).pending) == ALL.index(SHOTGUN)
