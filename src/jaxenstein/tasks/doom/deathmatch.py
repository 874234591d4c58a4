"""ViZDoom's Deathmatch for one player, tic by tic: endless monsters, and things to pick up."""

from __future__ import annotations

import dataclasses
import functools
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ...about import About, Event
from ...environment import Info
from ...params import Params, Scalar, number
from ..draws import random_bits, sample_index
from .arsenal import SELECT, SWITCHING, Arms, Arsenal
from .collision import REACH, segments
from .deathmatch_look import SCENERY, Fog, Fogs, Scenery
from .fight import FightParams, FightState, before_fight, fight, fly_fireballs, fly_rockets
from .fixed import ONE
from .items import ITEMS, MOST_ARMOUR, MOST_HEALTH, TAKING, Armour, Items
from .monster_kinds import (
    CHAINGUN_GUY,
    CHAINSAW_MARINE,
    DEMON,
    HELL_KNIGHT,
    SHOTGUN_GUY,
    ZOMBIE,
    MonsterKind,
)
from .monsters import Horde
from .parts import Health, Part
from .physics import (
    ATTACK,
    BACKWARD,
    FORWARD,
    MOVE_LEFT,
    MOVE_RIGHT,
    TURN_LEFT,
    TURN_RIGHT,
    touches,
)
from .players import HUNT, tiles_of
from .projectiles import HITS, Missiles, Projectiles, fireballs, rockets
from .respawn import invaded, words
from .scenario import DoomScenario
from .view import CEILING, CLAY, Room
from .weapons import BULLETS, FIST, PISTOL, ROCKET_LAUNCHER, SHELLS, SHOOTING, SLOTS

# For each kind: the reward of its death, its chance to appear in 65536ths, and the most of it.
_HORDE: tuple[tuple[MonsterKind, int, int, int], ...] = (
    (ZOMBIE, 1, 2621, 7),
    (SHOTGUN_GUY, 3, 2621, 7),
    (CHAINSAW_MARINE, 3, 1310, 4),
    (CHAINGUN_GUY, 4, 1310, 4),
    (DEMON, 3, 655, 3),
    (HELL_KNIGHT, 10, 655, 3),
)
_REWARDS = np.array([pay for _, pay, _, count in _HORDE for _ in range(count)], np.float32)
_CHANCES = np.array([chance for _, _, chance, _ in _HORDE], np.float32)
# The health, and the amount of each ammunition, below which the player `hunt` fetches more.
_HURT, _SHORT = 60, (30, 8, 0)
# Player and monsters appear within these bounds of x and y.
_SQUARE = (32, 992)
# The most kills that a variable can show.
_MOST_KILLS = 10_000


class DoomMatchParams(FightParams):
    """The params of the task.

    Attributes:
        kill_reward: factor on the rewards of the kinds of monsters.
        damage_reward: reward of a point of damage that the player's bullets and blows do to
            monsters. 0 in the game.
        item_reward: reward of a thing that the player picks up. 0 in the game.
        death_penalty: subtracted from the reward of the tic in which the player dies.
        first: tics until the first monsters may appear.
        period: tics after which more may appear.
        crowd: factor on the chances of monsters to appear.
        monster_health: factor on the health of each kind.
    """

    max_steps_in_episode: Scalar = 4200
    discount: Scalar = 0.99
    kill_reward: Scalar = 1.0
    damage_reward: Scalar = 0.0
    item_reward: Scalar = 0.0
    death_penalty: Scalar = 0.0
    first: Scalar = number(105, 0)
    period: Scalar = number(10, 1)
    crowd: Scalar = number(1.0, 0)
    monster_health: Scalar = number(1.0, 0)


class DoomMatchState(FightState):
    """The state of the task with M things to pick up.

    Attributes:
        fireballs: fireballs in flight.
        rockets: rockets in flight.
        arms: weapons and ammunition.
        armour: int32[], the damage that it can still absorb, 0 to 200.
        armour_share: int32[], the fraction of damage that it absorbs, in 65536ths.
        items: bool[M], which things are present.
        fogs: with `look="game"`, the fog in which monsters appear; else None.
    """

    fireballs: Projectiles
    rockets: Projectiles
    arms: Arms
    armour: jax.Array
    armour_share: jax.Array
    items: jax.Array
    fogs: Fogs | None = None


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomDeathmatch(DoomScenario[DoomMatchState, DoomMatchParams]):
    """Kill as many monsters as possible: six kinds keep appearing, which also fight each other.

    Weapons, ammunition, armour and medkits are in the rooms around the arena. Reward: 1 to 10 for
    each monster that dies, by its kind, whoever killed it. Death terminates the episode.
    """

    params_class: ClassVar[type[Params]] = DoomMatchParams
    takes_game_look: ClassVar[bool] = True
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
        *SWITCHING,
    )

    @property
    def room(self) -> Room:
        """An arena with rooms around it."""
        return Room("deathmatch", floor=CLAY, ceiling=CEILING)

    @functools.cached_property
    def horde(self) -> Horde:
        """The monsters, which fight each other too."""
        kinds = [kind for kind, _, _, count in _HORDE for _ in range(count)]
        walls = segments(self.doom_map.walls)
        pictured = self.look == "game"
        return Horde(kinds, walls=walls, opaque=walls, infighting=True, pictured=pictured)

    @functools.cached_property
    def arsenal(self) -> Arsenal:
        """The weapons."""
        first_button = self.button_names.index(SELECT[0])
        return Arsenal(SLOTS, shots=50, most=200, raise_tics=13, first_button=first_button)

    @functools.cached_property
    def items(self) -> Items:
        """The things to pick up."""
        lying = [thing for thing in self.doom_map.things if thing.kind not in SCENERY]
        found = [ITEMS[thing.kind] for thing in lying]
        places = np.array([(thing.x, thing.y) for thing in lying])
        return Items(found, (places * ONE).astype(np.int32), self.arsenal)

    @functools.cached_property
    def armour(self) -> Armour:
        """The player's armour."""
        return Armour()

    @functools.cached_property
    def fireballs(self) -> Missiles:
        """The fireballs of hell knights."""
        return fireballs(8, pictured=self.look == "game", knights=True)

    @functools.cached_property
    def rockets(self) -> Missiles:
        """The player's rockets."""
        return rockets(pictured=self.look == "game")

    @functools.cached_property
    def fog(self) -> Fog:
        """The fog in which monsters appear."""
        return Fog(4)

    @functools.cached_property
    def parts(self) -> tuple[Part, ...]:
        """Health, armour, weapons, monsters, fireballs, things to pick up, rockets.

        With `look="game"` also fog and scenery.
        """
        player = Health(MOST_HEALTH), self.armour, self.arsenal
        more = (self.fog, Scenery(self.doom_map.things)) if self.look == "game" else ()
        return *player, self.horde, self.fireballs, self.items, self.rockets, *more

    @functools.cached_property
    def limits(self) -> dict[str, int]:
        """The variables of the game's wrapper, each with its highest value."""
        return {
            "killed": _MOST_KILLS,
            "health": MOST_HEALTH,
            "armour": MOST_ARMOUR,
            "weapon": len(SELECT),
            "ammo": self.arsenal.most,
        }

    def absorbed(self, state: DoomMatchState, lost: jax.Array) -> tuple[DoomMatchState, jax.Array]:
        """Take damage, part of which the armour absorbs."""
        return self.armour.absorbed(state, lost)

    @property
    def starts(self) -> np.ndarray:
        """float[1, 2]: the middle; episodes start anywhere in the arena."""
        return np.array([(512.0, 512.0)])

    def init_state(self, key: jax.Array, params: DoomMatchParams) -> DoomMatchState:
        """Sample position and heading; there are no monsters yet."""
        del params
        bits = jax.random.bits(key, (3,), jnp.uint32)
        low, high = _SQUARE
        place = low * ONE + sample_index(bits[:2], (high - low) * ONE + 1)
        count = len(self.horde)
        nowhere, none = jnp.zeros((count, 2), jnp.int32), jnp.zeros(count, jnp.int32)
        absent = jnp.zeros(count, bool)
        return DoomMatchState(
            **self.pose(place, bits[2]),
            **before_fight(
                self, self.horde.placed(nowhere, none.astype(jnp.uint32), absent, none), PISTOL
            ),
            fireballs=self.fireballs.none(),
            rockets=self.rockets.none(),
            arms=self.arsenal.arms((FIST, PISTOL), PISTOL),
            armour=jnp.int32(0),
            armour_share=jnp.int32(0),
            items=jnp.ones(len(self.items.places), bool),
            fogs=self.fog.none() if self.look == "game" else None,
        )

    def transition(
        self, key: jax.Array, state: DoomMatchState, action: jax.Array, params: DoomMatchParams
    ) -> tuple[DoomMatchState, jax.Array, jax.Array, Info]:
        """Fight, pick up things, remove dead monsters, and sometimes add new ones."""
        fight_key, ball_key, rocket_key, horde_key = jax.random.split(key, 4)
        living, before = state.monsters.living, state.kills
        state, fought = fight(self, fight_key, state, action, params)
        launcher = self.arsenal.index_of(ROCKET_LAUNCHER)
        launches = fought.fires & (state.arms.selected == launcher)
        state = fly_rockets(
            self, self.rockets, ROCKET_LAUNCHER, rocket_key, state, launches, params
        )
        state, hits = fly_fireballs(self, self.fireballs, ball_key, state, fought, params)
        killed = living & ~state.monsters.living
        dead = state.health <= 0
        reach = touches(fought.reached, jnp.asarray(self.items.places), REACH)
        state, took = self.items.taken(state, reach & state.items & ~dead)
        monsters = state.monsters.replace(present=state.monsters.living)
        state = self._joined(horde_key, state.replace(monsters=monsters), params)
        reward = jnp.sum(jnp.where(killed, _REWARDS, 0)) * params.kill_reward
        reward = reward + params.damage_reward * jnp.float32(fought.dealt)
        reward = reward + params.item_reward * jnp.float32(sum(took.values()))
        reward = reward - jnp.where(dead, params.death_penalty, 0)
        events = {"shots": fought.fires.astype(jnp.int32), "kills": state.kills - before}
        return state, reward, dead, events | {"hits": hits, **took, "died": dead}

    def _joined(
        self, key: jax.Array, state: DoomMatchState, params: DoomMatchParams
    ) -> DoomMatchState:
        """Add the monsters that appear in this tic."""
        since = state.time + 1 - jnp.asarray(params.first, jnp.int32)
        period = jnp.maximum(jnp.asarray(params.period, jnp.int32), 1)
        due = (since >= 0) & (since % period == 0)
        chances = jnp.where(due, _CHANCES * params.crowd, 0)
        health = self.horde.healthy(params.monster_health)
        bits = random_bits(key, words(self.horde))
        monsters, comes = invaded(
            self.horde, state.monsters, state.fixed_position, chances, _SQUARE, health, bits
        )
        fogs = state.fogs
        if fogs is not None:
            fogs = self.fog.added(fogs, comes, monsters.position)
        return state.replace(monsters=monsters, fogs=fogs)

    # For the player `hunt`.

    def to_fetch(self, state: DoomMatchState) -> tuple[jax.Array, jax.Array]:
        """The things worth fetching: health, bullets, shells and their weapons."""
        items, arms = self.items, state.arms
        usual = np.isin(items.ammo, (BULLETS, SHELLS))
        heals = jnp.asarray(items.health > 1) & (state.health < _HURT)
        short = (arms.ammo < np.array(_SHORT, np.int32))[np.maximum(items.ammo, 0)]
        missing = ~arms.owned[np.maximum(items.weapon, 0)] & (items.weapon >= 0)
        wanted = heals | (usual & (missing | short))
        return jnp.asarray(items.places), state.items & wanted

    def next_tiles(self, state: DoomMatchState) -> jax.Array:
        """bool[rows, columns]: the middle of the arena."""
        del state
        middle = np.array([[512 * ONE, 512 * ONE]], np.int32)
        return tiles_of(self, middle, np.ones(1, bool))

    def about(self) -> About:
        """A description of the task."""
        return About(
            aim="reached the time limit alive",
            ends="when the player dies",
            rewards={
                "kill_reward": "{:+g} per zombie that dies, and 3 to 10 times that for others",
                "damage_reward": "{:+g} per point of damage to a monster",
                "item_reward": "{:+g} per thing picked up",
                "death_penalty": "-{:g} at death",
            },
            events={
                **SHOOTING,
                **HITS,
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
