"""ViZDoom's Health Gathering and Health Gathering Supreme, tic by tic: live on a floor of acid."""

from __future__ import annotations

import dataclasses
import functools
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import where_few
from ...about import About, Event
from ...engine.scene import Theme
from ...environment import Info
from ...params import Params, Scalar, number
from ..draws import random_bits
from ..health import FULL_HEALTH, HealthTask, about_health
from .buttons import FORWARD, TURN_LEFT, TURN_RIGHT
from .look import ACID, BOTTLE, CEILING, MEDKIT_BOX, doom_theme
from .pickup import Pickup, take_one, take_some, touched
from .places import load_places
from .players import GREEDY_MEDKITS
from .scenario import ANY_ANGLE, DoomScenario, DoomState
from .walls import MAP_SPOT, START


class DoomHealthParams(Params):
    """The numbers of the task.

    Attributes:
        damage: health lost to the floor at a time, the first before the first observation.
        damage_period: tics from one damage to the next.
        living_reward: reward of every tic, the last one included.
        death_penalty: taken off the reward of the tic that dies.
    """

    max_steps_in_episode: Scalar = 2100
    discount: Scalar = 0.99
    damage: Scalar = number(8, 0)
    damage_period: Scalar = number(32, 1)
    living_reward: Scalar = 1.0
    death_penalty: Scalar = 100.0


class DoomHealthState(DoomState):
    """State of the task; N is the capacity of all kinds of things together.

    Attributes:
        health: int32[], 0 to 100.
        places: int32[N, 2], map units in 16.16, of things kind by kind.
        present: bool[N], which of them are there.
        number: int32[N], which of all things so far each is; the game takes the newest first.
    """

    health: jax.Array
    places: jax.Array
    present: jax.Array
    number: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomHealthGathering(
    HealthTask[DoomHealthState, DoomHealthParams], DoomScenario[DoomHealthState, DoomHealthParams]
):
    """Stay alive on a floor that hurts, by walking over medkits. Doom's own motion.

    The floor takes 8 health every 32 tics. Medkits, and in the second scenario poison, appear
    somewhere at fixed intervals and are taken by walking into them. Reward: 1 a tic, and -100
    more for dying, which terminates.
    """

    # Things are as high as the eye or lower: a third one in a column hardly shows.
    sprite_layers: int = 2

    params_class: ClassVar[type[Params]] = DoomHealthParams
    map_name: ClassVar[str] = "health-gathering"
    button_names: ClassVar[tuple[str, ...]] = (TURN_LEFT, TURN_RIGHT, FORWARD)
    kinds: ClassVar[tuple[Pickup, ...]] = (
        Pickup(MEDKIT_BOX, health=25, at_first=17, period=30, capacity=88, spared_when_full=True),
    )
    game_things: ClassVar[tuple[str, ...]] = ("Medikit",)

    @property
    def starts(self) -> np.ndarray:
        """float[n, 2]: the map spots, or the one start of a map without."""
        spots = self.doom_map.of_kind(MAP_SPOT) or self.doom_map.of_kind(START)
        return np.array([(spot.x, spot.y) for spot in spots])

    @property
    def angles(self) -> tuple[int, int]:
        """The first heading, lowest and highest, in 65536ths of a circle."""
        return ANY_ANGLE if self.doom_map.of_kind(MAP_SPOT) else (0, 0)

    @functools.cached_property
    def looks(self) -> np.ndarray:
        """int32[N]: the kind of each place for a thing."""
        return np.repeat(np.arange(len(self.kinds)), [k.capacity for k in self.kinds]).astype(
            np.int32
        )

    @functools.cached_property
    def theme(self) -> Theme:
        """How the room looks."""
        pictures = tuple(kind.picture for kind in self.kinds)
        light = self.doom_map.light
        return doom_theme(pictures, floor=ACID, ceiling=CEILING, level=light, unit=self.unit)

    def init_state(self, key: jax.Array, params: DoomHealthParams) -> DoomHealthState:
        """Draw start and heading, and place the first things."""
        pose_key, thing_key = jax.random.split(key)
        pose = self.drawn(jax.random.bits(pose_key, (2,), jnp.uint32), self.angles)
        at_first = [kind.at_first for kind in self.kinds]
        drawn = random_bits(thing_key, (sum(at_first), 3))
        new = load_places(self.map_name).draw(drawn)
        parts, number, seen = [], [], 0
        for kind in self.kinds:
            rest = jnp.zeros((kind.capacity - kind.at_first, 2), jnp.int32)
            parts += [new[seen : seen + kind.at_first], rest]
            number += [*range(seen, seen + kind.at_first), *[0] * rest.shape[0]]
            seen += kind.at_first
        present = [np.arange(kind.capacity) < kind.at_first for kind in self.kinds]
        return DoomHealthState(
            **pose,
            health=FULL_HEALTH - jnp.asarray(params.damage),
            places=jnp.concatenate(parts),
            present=jnp.asarray(np.concatenate(present)),
            number=jnp.asarray(np.array(number, np.int32)),
        )

    def transition(
        self, key: jax.Array, state: DoomHealthState, action: jax.Array, params: DoomHealthParams
    ) -> tuple[DoomHealthState, jax.Array, jax.Array, Info]:
        """Suffer, move, take things, then new ones appear."""
        time = state.time + 1
        hurt = time % jnp.maximum(params.damage_period, 1) == 0
        health = jnp.maximum(state.health - jnp.where(hurt, params.damage, 0), 0)
        state, tried = self.moved(state, action)
        reach = touched(tried, state.places, state.present) & (health > 0)
        kinds = jnp.asarray(self.looks)
        after, taken = take_one(self.kinds, kinds, health, reach)
        several = jnp.sum(reach, dtype=jnp.int32) > 1
        take = where_few(functools.partial(take_some, self.geometry, self.kinds, self.looks))
        after_all, taken_all = take(
            several, tried.target, state.places, state.number, health, reach
        )
        health = jnp.where(several, after_all, after)
        taken = jnp.where(several, taken_all, taken)
        dead = health <= 0
        state = state.replace(health=health, present=state.present & ~taken)
        state = self._appear(state, key, time)
        reward = params.living_reward - jnp.where(dead, params.death_penalty, 0)
        counts = {
            f"took_{kind.name}": jnp.sum(taken & (self.looks == i), dtype=jnp.int32)
            for i, kind in enumerate(self.kinds)
        }
        return state, reward, dead, counts | {"died": dead}

    def _appear(self, state: DoomHealthState, key: jax.Array, time: jax.Array) -> DoomHealthState:
        """Things more, of each kind whose time it is."""
        bits = random_bits(key, (len(self.kinds), 3))
        new = load_places(self.map_name).draw(bits)
        here, first = jnp.zeros(len(self.looks), bool), 0
        slots = np.arange(len(self.looks), dtype=np.int32)
        for kind in self.kinds:
            due = time % kind.period == 0
            slot = first + (kind.at_first + time // kind.period - 1) % kind.capacity
            here = here | ((slots == slot) & due)
            first += kind.capacity
        place = new.at[self.looks].get(mode="promise_in_bounds")
        return state.replace(
            places=jnp.where(here[:, None], place, state.places),
            present=state.present | here,
            # Of two at the same time the game's script makes the first kind first.
            number=jnp.where(here, (time + 1) * len(self.kinds) + self.looks, state.number),
        )

    def about(self) -> About:
        """What the task says of itself."""
        taken = {f"took_{kind.name}": Event(kind.one, kind.several) for kind in self.kinds}
        return about_health(taken, GREEDY_MEDKITS, "tic")

    def with_things(
        self, state: DoomHealthState, health: int, things: np.ndarray
    ) -> DoomHealthState:
        """The state with the health and the things of the game."""
        places, present = np.zeros((len(self.looks), 2), np.int32), np.zeros(len(self.looks), bool)
        number, first = np.zeros(len(self.looks), np.int32), 0
        for look, kind in enumerate(self.kinds):
            rows = things[things[:, 0] == look][: kind.capacity]
            here = slice(first, first + len(rows))
            places[here], present[here], number[here] = rows[:, 1:3], True, rows[:, 3]
            first += kind.capacity
        return state.replace(health=np.int32(health), places=places, present=present, number=number)

    def things(self, state: DoomHealthState) -> tuple[jax.Array, jax.Array, jax.Array]:
        """What lies there."""
        return state.places, jnp.asarray(self.looks), state.present


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomHealthGatheringSupreme(DoomHealthGathering):
    """Health Gathering in a large room with walls, and with poison that looks like a bottle."""

    map_name: ClassVar[str] = "health-gathering-supreme"
    kinds: ClassVar[tuple[Pickup, ...]] = (
        Pickup(MEDKIT_BOX, health=20, at_first=31, period=25, capacity=116),
        Pickup(BOTTLE, health=-30, at_first=3, period=50, capacity=46, name="poison"),
    )
    game_things: ClassVar[tuple[str, ...]] = ("CustomMedikit", "Poison")
