"""What a scenario adds to the view: the strip of `hud=True`, and the weapon of `show_weapon=True`.

Parts draw the weapon themselves (`Part.show`).
"""

from __future__ import annotations

from collections.abc import Mapping

import jax
import jax.numpy as jnp

from ...engine.shade import ImageKind
from ...environment import Info
from ...errors import SettingError
from ..health import FULL_HEALTH
from ..hud import AMMUNITION, bar, check_overlay, check_strip


def check_overlays(
    name: str,
    limits: Mapping[str, int],
    *,
    hud: bool,
    show_weapon: bool,
    observation: str,
    height: int,
) -> None:
    """Raise if a scenario has nothing to show in an overlay, or no place for it.

    Args:
        name: the name of the scenario.
        limits: its variables, each with its highest value.
        hud: the setting.
        show_weapon: the setting.
        observation: the kind of observation.
        height: image rows.

    Raises:
        SettingError: `hud` or `show_weapon` is True and does not fit.
    """
    check_strip(hud, observation, height)
    check_overlay("show_weapon", show_weapon, observation)
    if hud and not limits:
        raise SettingError(f"hud=True: {name!r} has neither health nor a weapon")
    if show_weapon and not limits.get("ammo"):
        raise SettingError(f"show_weapon=True: {name!r} has no weapon")


def strip(told: Info, most_ammo: int, rows: int, width: int, kind: ImageKind) -> jax.Array:
    """The strip of `hud=True`: health and, on the right, ammunition if there is any.

    Args:
        told: the entries of the parts for a state.
        most_ammo: the highest number of shots; 0 without a weapon.
        rows: rows of the strip.
        width: columns of the strip.
        kind: `"rgb"` for uint8[rows, width, 3], `"gray"` for uint8[rows, width].
    """
    right = width // 2 if most_ammo else 0
    health = bar(told["health"] / FULL_HEALTH, rows, width - right, kind)
    if not right:
        return health
    ammo = bar(told["ammo"] / most_ammo, rows, right, kind, AMMUNITION)
    return jnp.concatenate([health, ammo], axis=1)
