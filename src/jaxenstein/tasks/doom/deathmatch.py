"""ViZDoom's Deathmatch for one player, tic by tic: monsters without end, and things to take."""

from __future__ import annotations

import dataclasses
import functools
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ...about import About, Event
from ...environment import Info
from ...maps.things import RGB
from ...params import Params, Scalar, number
from ..draws import draw_index, random_bits
from .arena import DoomArenaParams
from .armed_arena import (
    NEXT_WEAPON,
    PREVIOUS_WEAPON,
    SELECT,
    TAKING,
    DoomArmedArena,
    DoomArmedState,
)
from .arsenal import BULLETS, FIST, SHELLS, first_arms
from .blasts import MOST
from .buttons import (
    ATTACK,
    BACKWARD,
    FORWARD,
    MOVE_LEFT,
    MOVE_RIGHT,
    TURN_LEFT,
    TURN_RIGHT,
)
from .creatures import placed
from .fixed import ONE
from .hordes import come, words
from .hunting import HUNT
from .items import ITEMS, Item
from .kinds import (
    CHAINGUN_GUY,
    CHAINSAW_MARINE,
    DEMON,
    HELL_KNIGHT,
    SHOTGUN_GUY,
    ZOMBIE,
    Kind,
    Roster,
)
from .look import CEILING, CLAY
from .pickup import REACH
from .projectiles import no_projectiles
from .scenario import near
from .shooter import EVENTS
from .shots import segments
from .weapons import PISTOL, ROCKET_LAUNCHER, Weapon

# Of each kind: the reward of its death, its chance to come in 65536ths, and how many there can be.
_HORDE: tuple[tuple[Kind, int, int, int], ...] = (
    (ZOMBIE, 1, 2621, 7),
    (SHOTGUN_GUY, 3, 2621, 7),
    (CHAINSAW_MARINE, 3, 1310, 4),
    (CHAINGUN_GUY, 4, 1310, 4),
    (DEMON, 3, 655, 3),
    (HELL_KNIGHT, 10, 655, 3),
)
_CAST = tuple(kind for kind, _, _, count in _HORDE for _ in range(count))
_REWARDS = np.array([pay for _, pay, _, count in _HORDE for _ in range(count)], np.float32)
_CHANCES = np.array([chance for _, _, chance, _ in _HORDE], np.float32)
# The health, and how much of each ammunition, below which the player `hunt` fetches more.
_HURT, _SHORT = 60, (30, 8, 0)
# Everybody appears within these bounds of x and y.
_SQUARE = (32, 992)


class DoomMatchParams(DoomArenaParams):
    """The numbers of the task.

    Attributes:
        kill_reward: what the rewards of the kinds of monsters are multiplied by.
        death_penalty: taken off the reward of the tic in which the player dies.
        first: tics until the first monsters may come.
        period: tics from then on until others may.
        crowd: what the chances of monsters to come are multiplied by.
        monster_health: what the health of each kind is multiplied by.
    """

    max_steps_in_episode: Scalar = 4200
    discount: Scalar = 0.99
    kill_reward: Scalar = 1.0
    death_penalty: Scalar = 0.0
    first: Scalar = number(105, 0)
    period: Scalar = number(10, 1)
    crowd: Scalar = number(1.0, 0)
    monster_health: Scalar = number(1.0, 0)


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomDeathmatch(DoomArmedArena[DoomArmedState, DoomMatchParams]):
    """Kill as many monsters as possible: they keep coming, of six kinds, and also fight each other.

    Weapons, ammunition, armour and medkits lie in the rooms around the arena. Reward: 1 to 10 for
    each monster that dies, whoever killed it, by its kind. Death terminates.
    """

    # A second thing behind the first hardly shows, but for the crowds of things in the rooms.
    sprite_layers: int = 4

    params_class: ClassVar[type[Params]] = DoomMatchParams
    map_name: ClassVar[str] = "deathmatch"
    button_names: ClassVar[tuple[str, ...]] = (
        ATTACK,
        "speed",
        "strafe",
        MOVE_RIGHT,
        MOVE_LEFT,
        BACKWARD,
        FORWARD,
        TURN_RIGHT,
        TURN_LEFT,
        *SELECT,
        NEXT_WEAPON,
        PREVIOUS_WEAPON,
    )
    cast: ClassVar[tuple[Kind, ...]] = _CAST
    weapon: ClassVar[Weapon] = PISTOL
    floor: ClassVar[RGB] = CLAY
    ceiling: ClassVar[RGB] = CEILING
    ammo: ClassVar[int] = 50
    most_ammo: ClassVar[int] = 200
    most_balls: ClassVar[int] = 8
    draw_tics: ClassVar[int] = 13

    @functools.cached_property
    def roster(self) -> Roster:
        """The monsters, who turn on each other."""
        return Roster(self.cast, feuds=True)

    @functools.cached_property
    def items(self) -> tuple[Item, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """What there is to take, one by one."""
        return tuple(ITEMS[thing.kind] for thing in self.doom_map.things)

    @functools.cached_property
    def supplies(self) -> np.ndarray:  # pyright: ignore[reportIncompatibleMethodOverride]
        """int32[M, 2]: where it lies, map units in 16.16."""
        places = np.array([(thing.x, thing.y) for thing in self.doom_map.things])
        return (places * ONE).astype(np.int32)

    @functools.cached_property
    def opaque_walls(self) -> np.ndarray:  # pyright: ignore[reportIncompatibleMethodOverride]
        """float32[L, 4]: all walls."""
        return segments(self.doom_map.walls)

    @property
    def starts(self) -> np.ndarray:
        """float[1, 2]: the middle; episodes start anywhere in the arena."""
        return np.array([(512.0, 512.0)])

    def init_state(self, key: jax.Array, params: DoomMatchParams) -> DoomArmedState:
        """Draw place and heading; nobody else is there."""
        del params
        bits = jax.random.bits(key, (3,), jnp.uint32)
        low, high = _SQUARE
        place = low * ONE + draw_index(bits[:2], (high - low) * ONE + 1)
        count = len(self.roster)
        nowhere = jnp.zeros((count, 2), jnp.int32)
        nobody = jnp.zeros(count, bool)
        creatures = placed(
            self.roster, nowhere, jnp.zeros(count, jnp.uint32), nobody, jnp.zeros(count, jnp.int32)
        )
        return DoomArmedState(
            **self.placed(place, bits[2]),
            **self.armed(),
            creatures=creatures,
            kills=jnp.int32(0),
            balls=no_projectiles(self.most_balls),
            rockets=no_projectiles(MOST),
            arms=first_arms(self.arsenal, (FIST, PISTOL), PISTOL, self.ammo),
            armour=jnp.int32(0),
            share=jnp.int32(0),
            left=jnp.ones(len(self.items), bool),
        )

    def transition(
        self, key: jax.Array, state: DoomArmedState, action: jax.Array, params: DoomMatchParams
    ) -> tuple[DoomArmedState, jax.Array, jax.Array, Info]:
        """Fight; take what is there; the dead are taken away; now and then others come."""
        fight_key, ball_key, rocket_key, horde_key = jax.random.split(key, 4)
        living, before = state.creatures.living, state.kills
        state, fought = self.fight(fight_key, state, action, params)
        launches = fought.fires & (state.arms.selected == self.arsenal.index_of(ROCKET_LAUNCHER))
        state = self.fly_rockets(rocket_key, state, launches, params)
        state, hits = self.burn(ball_key, state, fought, params)
        killed = living & ~state.creatures.living
        dead = state.health <= 0
        reach = near(fought.tried, self.supply_places(state), REACH // ONE) & state.left & ~dead
        state, took = self.take(state, reach)
        creatures = state.creatures.replace(present=state.creatures.living)
        state = state.replace(creatures=creatures)
        state = self._joined(horde_key, state, params)
        reward = jnp.sum(jnp.where(killed, _REWARDS, 0)) * params.kill_reward
        reward = reward - jnp.where(dead, params.death_penalty, 0)
        events = {"shots": fought.fires.astype(jnp.int32), "kills": state.kills - before}
        events |= {"hits": jnp.sum(hits, dtype=jnp.int32), **took, "died": dead}
        return state, reward, dead, events

    def _joined(
        self, key: jax.Array, state: DoomArmedState, params: DoomMatchParams
    ) -> DoomArmedState:
        """The state with the monsters who come in this tic."""
        since = state.time + 1 - jnp.asarray(params.first, jnp.int32)
        period = jnp.maximum(jnp.asarray(params.period, jnp.int32), 1)
        due = (since >= 0) & (since % period == 0)
        chances = jnp.where(due, _CHANCES * params.crowd, 0)
        healthy = self.roster.health.astype(np.float32) * params.monster_health
        health = jnp.maximum(jnp.round(healthy), 1).astype(jnp.int32)
        bits = random_bits(key, words(self.roster))
        creatures, _ = come(
            self.roster, state.creatures, state.fixed_position, chances, _SQUARE, health, bits
        )
        return state.replace(creatures=creatures)

    # For the player `hunt`.

    def wanted(self, state: DoomArmedState) -> jax.Array:
        """bool[M]: what is worth a walk: health, bullets, shells and their weapons."""
        goods, arms = self.goods, state.arms
        usual = np.isin(goods.ammunition, (BULLETS, SHELLS))
        heals = jnp.asarray(goods.health > 1) & (state.health < _HURT)
        short = (arms.ammo < np.array(_SHORT, np.int32))[np.maximum(goods.ammunition, 0)]
        missing = ~arms.owned[np.maximum(goods.weapon, 0)] & (goods.weapon >= 0)
        return heals | (usual & (missing | short))

    def errand(self, state: DoomArmedState) -> jax.Array:
        """bool[rows, columns]: the middle of the arena."""
        del state
        middle = np.array([[512 * ONE, 512 * ONE]], np.int32)
        return self.tiles_of(middle, np.ones(1, bool))

    def about(self) -> About:
        """What the task says of itself."""
        return About(
            aim="reached the time limit alive",
            ends="where the player dies",
            rewards={
                "kill_reward": "{:+g} for each zombie that dies, and 3 to 10 times that for others",
                "death_penalty": "-{:g} at death",
            },
            events={
                **EVENTS,
                "hits": Event("was hit by a fireball", "was hit by {} fireballs"),
                **TAKING,
                "died": Event("died"),
            },
            variables={
                "killed": "monsters killed",
                "health": "0 to 200",
                "armour": "0 to 200",
                "weapon": "1 to 5, the number of the button that selects it",
                "ammo": "shots left in it",
            },
            captions=("health", "ammo", "killed"),
            players={"hunt": HUNT},
            expert="hunt",
        )
