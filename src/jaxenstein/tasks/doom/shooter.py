"""What ViZDoom's scenarios with a weapon have in common: shots, ammunition, kills."""

from __future__ import annotations

import abc
import dataclasses
import functools
from collections.abc import Mapping
from typing import Any, ClassVar, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from ...about import Event
from ...engine.scene import Theme
from ...engine.shade import ImageKind
from ...environment import Info, Params
from ...errors import SettingError
from ...maps.things import RGB
from ...spaces import Box
from ..health import FULL_HEALTH
from ..hud import AMMUNITION, bar, check_overlay, check_strip, strip_rows
from . import hands
from .look import Picture, doom_theme
from .scenario import DoomScenario, DoomState
from .shots import along, first_body
from .walls import START
from .weapons import PISTOL, Trigger, Weapon, drawn_weapon, pull, shot_angle

EVENTS = {
    "shots": Event("fired", "fired {} times"),
    "kills": Event("killed a monster", "killed {} monsters"),
}


class DoomShooterState(DoomState):
    """State of a player with a weapon.

    Attributes:
        health: int32[], of the player.
        trigger: what the weapon does.
    """

    health: jax.Array
    trigger: Trigger


S = TypeVar("S", bound=DoomShooterState)
P = TypeVar("P", bound=Params)


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomShooter(DoomScenario[S, P]):
    """Base of scenarios in which the player shoots at bodies.

    Attributes:
        hud: show health and ammunition as bars in a strip below the view, which then is as much
            lower; for images of colours or greys.
        show_weapon: show the weapon in the player's hands, and the flash of its shots, as the game
            does by default; likewise.
    """

    hud: bool = False
    show_weapon: bool = False

    weapon: ClassVar[Weapon] = PISTOL
    ammo: ClassVar[int] = 50
    # The most there can be; 0 for no more than at first.
    most_ammo: ClassVar[int] = 0
    # Tics until the weapon is drawn.
    draw_tics: ClassVar[int] = 0
    pictures: ClassVar[tuple[Picture, ...]]
    floor: ClassVar[RGB]
    ceiling: ClassVar[RGB]
    # The label of each of `game_things`, of which there may be more pictures than one.
    thing_labels: ClassVar[tuple[int, ...]]

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        check_strip(self.hud, self.observation, self.height)
        check_overlay("show_weapon", self.show_weapon, self.observation)
        if self.show_weapon and not self._most_ammo:
            raise SettingError(f"show_weapon=True: there is no weapon in {self.name!r}")

    @property
    @abc.abstractmethod
    def half_widths(self) -> np.ndarray:
        """int32[N]: of the bodies, in map units."""

    @property
    def starts(self) -> np.ndarray:
        """float[n, 2]: the start."""
        return np.array([(thing.x, thing.y) for thing in self.doom_map.of_kind(START)])

    @functools.cached_property
    def theme(self) -> Theme:
        """How the map looks."""
        light = self.doom_map.light
        return doom_theme(
            self.pictures, floor=self.floor, ceiling=self.ceiling, level=light, unit=self.unit
        )

    @functools.cached_property
    def game_labels(self) -> dict[str, int]:
        """The label of each thing of the game by its name."""
        return dict(zip(self.game_things, self.thing_labels, strict=True))

    def armed(self) -> dict[str, Any]:
        """The fields of the first state of a healthy player."""
        trigger = drawn_weapon(self.weapon, self.ammo, self.draw_tics)
        return {"health": jnp.int32(FULL_HEALTH), "trigger": trigger}

    def shoot(
        self, state: S, angle: jax.Array, action: jax.Array, bits: jax.Array
    ) -> tuple[S, jax.Array, jax.Array]:
        """The weapon's tic: the state, bool[] whether a bullet left, and uint32[] where it goes.

        Args:
            state: before the player moves, which it does after it has shot.
            angle: uint32[], of the player, who has turned by then.
            action: the action.
            bits: uint32[], random.
        """
        trigger, fires = pull(self.weapon, state.trigger, jnp.asarray(self.pressed(action).attack))
        towards = shot_angle(self.weapon, trigger, angle, bits)
        return state.replace(trigger=trigger), fires, towards

    def struck(
        self, origin: jax.Array, towards: jax.Array, places: jax.Array, there: jax.Array
    ) -> jax.Array:
        """bool[N]: the body that a bullet hits first.

        Args:
            origin: int32[2].
            towards: uint32[], its angle.
            places: int32[N, 2], of the bodies.
            there: bool[N], which of them can be hit.
        """
        return first_body(
            origin, along(towards), places, self.half_widths, there, self.opaque_walls
        )

    @property
    def opaque_walls(self) -> np.ndarray:
        """float32[L, 4]: walls that can stand between two places of the room: none here."""
        return np.zeros((0, 4), np.float32)

    @property
    def view_height(self) -> int:
        """Rows of the image above the strip."""
        return self.height - strip_rows(self.height) if self.hud else self.height

    def draw(self, state: S, params: P, kind: ImageKind) -> jax.Array:
        """Add the weapon and the strip."""
        image = super().draw(state, params, kind)
        if self.show_weapon:
            image = self.in_hands(image, state, kind)
        return jnp.concatenate([image, self.strip(state, kind)]) if self.hud else image

    def in_hands(self, image: jax.Array, state: S, kind: ImageKind) -> jax.Array:
        """The image with the weapon over it."""
        return hands.show(image, self.weapon, state.trigger, kind)

    def strip(self, state: S, kind: ImageKind) -> jax.Array:
        """The strip of `hud=True`: health, and at the right ammunition if there is any."""
        rows, most = strip_rows(self.height), self._most_ammo
        right = self.width // 2 if most else 0
        health = bar(state.health / FULL_HEALTH, rows, self.width - right, kind)
        if not right:
            return health
        ammo = bar(state.trigger.ammo / most, rows, right, kind, AMMUNITION)
        return jnp.concatenate([health, ammo], axis=1)

    @property
    def game_variables(self) -> tuple[str, ...]:
        """The ammunition."""
        return (self.weapon.game_ammo,)

    def with_variables(self, state: S, values: Mapping[str, int]) -> S:
        """The state with so many shots left."""
        shots = np.int32(min(max(values[self.weapon.game_ammo], 0), self._most_ammo))
        return state.replace(trigger=state.trigger.replace(ammo=shots))

    def describe(self, state: S, params: P) -> Info:
        """Add health and ammunition."""
        more = {"health": state.health, "ammo": state.trigger.ammo}
        return super().describe(state, params) | more

    def variables(self, state: S) -> dict[str, jax.Array]:
        """`health` and, where there is any, `ammo`: float32[1] each."""
        values = {"health": state.health, "ammo": state.trigger.ammo}
        return {name: values[name].astype(jnp.float32)[None] for name in self._most}

    def variable_spaces(self) -> dict[str, Box]:
        """Their spaces."""
        kind = np.dtype(np.float32)
        return {name: Box(0.0, float(most), (1,), kind) for name, most in self._most.items()}

    @property
    def _most(self) -> dict[str, int]:
        """The most that each variable can be."""
        ammo = self._most_ammo
        return {"health": FULL_HEALTH} | ({"ammo": ammo} if ammo else {})

    @property
    def _most_ammo(self) -> int:
        """The most shots that there can be."""
        return max(self.ammo, self.most_ammo)
