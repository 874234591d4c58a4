"""ViZDoom's Rocket Basic, tic by tic, and what scenarios with a rocket launcher share."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ...maps.things import CACODEMON as CACODEMON_THING
from ...maps.things import ROCKET
from .basic import DoomBasicParams, DoomBasicState, DoomSimplerBasic
from .geometry import RADIUS
from .kinds import CACODEMON
from .look import CACODEMONS, ROCKETS, Picture
from .projectiles import Projectiles, fly, no_projectiles, throw
from .shots import along
from .weapons import ROCKET_LAUNCHER, Weapon

# Rockets fly for as long as the next one takes to come; more than three are never seen.
_ROCKETS, _BURST = 3, 18


class Rockets:
    """What scenarios with rockets say alike: those of `state.rockets` kill what they hit."""

    weapon: ClassVar[Weapon] = ROCKET_LAUNCHER
    pictures: ClassVar[tuple[Picture, ...]] = (*CACODEMONS, *ROCKETS)
    thing_labels: ClassVar[tuple[int, ...]] = (CACODEMON_THING.label, ROCKET.label)


def flown(
    rockets: Projectiles,
    shot: tuple[jax.Array, jax.Array, jax.Array],
    target: tuple[jax.Array, jax.Array],
    walls: np.ndarray,
    half_width: int,
) -> tuple[Projectiles, jax.Array]:
    """A tic of the player's rockets, and bool[] whether one hits.

    Args:
        rockets: before it.
        shot: int32[2] from where, bool[] whether, and uint32[] at which angle one is fired.
        target: int32[2] where the monster is, and bool[] whether it can be hit.
        walls: float32[L, 4].
        half_width: of a rocket, in map units; one without any is stopped by no wall, as in the
            game, and looks for the monster once a tic.
    """
    origin, fires, angle = shot
    place, there = target
    rockets = throw(rockets, fires[None], origin[None], along(angle)[None], ROCKET_LAUNCHER.speed)
    bodies = (
        jnp.stack([origin, place]),
        np.array([RADIUS, CACODEMON.half_width], np.int32),
        jnp.stack([jnp.bool_(False), there]),
    )
    looks = 3 if half_width else 1
    rockets, hits = fly(rockets, half_width, bodies, walls, _BURST, looks)
    return rockets, jnp.any(hits[:, 1])


def shown(
    monster: tuple[jax.Array, jax.Array], rockets: Projectiles
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """What is drawn of rockets and a monster: int32[2] where, and bool[] whether it lives."""
    place, living = monster
    ends = np.int32(len(CACODEMONS))
    looks = jnp.where(rockets.flies, ends, ends + 1)
    return (
        jnp.concatenate([place[None], rockets.position]),
        jnp.concatenate([(~living)[None].astype(jnp.int32), looks]),
        jnp.concatenate([jnp.ones(1, bool), rockets.flies | (rockets.bursts > 0)]),
    )


class DoomRocketState(DoomBasicState):
    """State of Rocket Basic.

    Attributes:
        rockets: in flight.
    """

    rockets: Projectiles


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomRocketBasic(Rockets, DoomSimplerBasic):
    """Simpler Basic with a rocket launcher: what is shot at is reached a second later.

    Rewards and ends are those of Basic. The rockets have no width: they must meet the monster
    itself. The launcher takes up ATTACK when it has been drawn and ATTACK been released.
    """

    game_things: ClassVar[tuple[str, ...]] = ("Cacodemon", "CustomRocket")
    draw_tics: ClassVar[int] = 3

    @property
    def scenario(self) -> str:
        """Its name in ViZDoom; the room is that of Simpler Basic."""
        return "rocket_basic"

    def init_state(self, key: jax.Array, params: DoomBasicParams) -> DoomRocketState:
        """Draw where the monster stands."""
        state = super().init_state(key, params)
        fields = {field.name: getattr(state, field.name) for field in dataclasses.fields(state)}
        return DoomRocketState(**fields, rockets=no_projectiles(_ROCKETS))

    def hit(
        self, state: Any, origin: jax.Array, fires: jax.Array, towards: jax.Array
    ) -> tuple[Any, jax.Array]:
        """The state after a tic of the rockets, and bool[] whether the monster is hit now."""
        target = state.target, ~state.killed
        walls = np.zeros((0, 4), np.float32)
        rockets, hits = flown(state.rockets, (origin, fires, towards), target, walls, 0)
        return state.replace(rockets=rockets), hits

    def things(self, state: Any) -> tuple[jax.Array, jax.Array, jax.Array]:
        """The monster and the rockets."""
        return shown((state.target, ~state.killed), state.rockets)
