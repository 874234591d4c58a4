"""Your own shooters: a text map with monsters, a weapon, and a goal.

The rules are those of the `doom-*` environments, with Doom's motion, monsters, shots and fireballs,
on a map whose tiles are 64 map units wide. A step is a tic, 1/35 of a second.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Mapping
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ..about import About, Event
from ..engine.level import Level, compile_level
from ..engine.scene import Theme
from ..engine.shade import Light
from ..environment import Info
from ..errors import MapError, SettingError, quoted
from ..maps.symbols import LABEL_COLOURS
from ..maps.things import MEDKIT, THING_OF
from ..maps.tilemap import TileMap
from ..params import Params, Scalar, number
from .appearance import CEILING, FLOOR
from .doom.arsenal import Arsenal
from .doom.collision import RADIUS, Geometry, build_geometry, overlap, segments
from .doom.fight import FightParams, FightState, before_fight, fight, fly_fireballs, fly_rockets
from .doom.fixed import ONE
from .doom.maps import DoomMap, TileGrid
from .doom.monster_kinds import (
    CHAINGUN_GUY,
    CHAINSAW_MARINE,
    DEMON,
    IMP,
    SHOTGUN_GUY,
    ZOMBIE,
    Act,
    MonsterKind,
    standing,
)
from .doom.monsters import Horde
from .doom.parts import Health, Part
from .doom.physics import ALL_MOVES
from .doom.players import HUNT, tiles_of
from .doom.projectiles import HITS, Missiles, Projectiles, fireballs, rockets
from .doom.respawn import asleep
from .doom.scenario import DoomScenario
from .doom.text_map import (
    TILE,
    Goals,
    Supplies,
    centres_of,
    doom_map_of,
    grid_of,
    read_text,
    things_of,
)
from .doom.view import Room
from .doom.weapons import PISTOL, ROCKET_LAUNCHER, SHOOTING, Slot, Weapon
from .health import FULL_HEALTH
from .steering import heading_range

__all__ = [
    "KINDS",
    "PISTOL",
    "ROCKET_LAUNCHER",
    "MonsterKind",
    "Shooter",
    "ShooterParams",
    "ShooterState",
    "Weapon",
    "reached_aim",
    "reward_of",
    "standing",
    "tiles_of",
    "toward_aim",
]

KINDS: Mapping[str, MonsterKind] = {
    "z": ZOMBIE,
    "s": SHOTGUN_GUY,
    "c": CHAINGUN_GUY,
    "i": IMP,
    "d": DEMON,
    "m": CHAINSAW_MARINE,
}
"""The kind of monster for each symbol of a map."""
MOST_MONSTERS, MOST_TILES = 64, 64
"""The most monsters on a map, and the most columns or rows."""
# Half-width of pickups and goals; the most fireballs in flight, per imp and in total.
_THING, _BALLS, _MOST_BALLS = 20, 4, 24
# The health and the shots below which the player `hunt` fetches more.
_HURT, _SHORT = 60, 8


class ShooterParams(FightParams):
    """The params of a shooter.

    Attributes:
        kill_reward: reward of each monster that dies, whoever killed it.
        win_reward: reward of the tic in which the aim is reached.
        death_penalty: subtracted from the reward of the tic in which the player dies.
        living_reward: reward of every tic.
        monster_health: factor on the health of each kind of monster.
        medkit: health gained by a medkit, up to 100.
        clip: shots in a box of ammunition, up to the largest number of shots.
    """

    max_steps_in_episode: Scalar = 2100
    discount: Scalar = 0.99
    kill_reward: Scalar = 1.0
    win_reward: Scalar = 10.0
    death_penalty: Scalar = 1.0
    living_reward: Scalar = 0.0
    monster_health: Scalar = number(1.0, 0)
    medkit: Scalar = number(25, 0)
    clip: Scalar = number(10, 0)


class ShooterState(FightState):
    """The state of a shooter on a map with M medkits and boxes of ammunition.

    Attributes:
        fireballs: fireballs in flight.
        rockets: the player's rockets, if the weapon fires any.
        supplies: bool[M], which medkits and boxes are left.
    """

    fireballs: Projectiles
    rockets: Projectiles
    supplies: jax.Array


def reached_aim(env: Shooter, state: ShooterState) -> jax.Array:
    """bool[]: whether the player is at a goal; on a map without goals, whether all are dead."""
    if env.tilemap.goals:
        return jnp.any(env.touches(state, env.goal_part.places))
    return ~jnp.any(state.monsters.living)


def reward_of(
    before: ShooterState, after: ShooterState, won: jax.Array, params: ShooterParams
) -> jax.Array:
    """float32[]: the reward of a tic; `won` is bool[], and at death `after.health` is 0."""
    kills = (after.kills - before.kills).astype(jnp.float32)
    reward = params.living_reward + params.kill_reward * kills
    reward = reward + jnp.where(won, params.win_reward, 0)
    return reward - jnp.where(after.health <= 0, params.death_penalty, 0)


def toward_aim(env: Shooter, state: ShooterState) -> jax.Array:
    """bool[rows, columns]: the tiles of the goals; on a map without goals, of the monsters."""
    if env.tilemap.goals:
        goals = env.goal_part.places
        return tiles_of(env, goals, np.ones(len(goals), bool))
    return tiles_of(env, state.monsters.position, state.monsters.living)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Shooter(DoomScenario[ShooterState, ShooterParams]):
    """Reach the goal of a map with monsters; on a map without a goal, kill them all.

    Monsters look in random directions at first, and stay where they are until they see the player
    in front of them or hear a shot. The player takes medkits and ammunition by walking over them,
    if they are needed. Rockets hurt everyone around where they burst, including the player.

    Attributes:
        text: the map, as for `from_ascii`, with the symbols of `KINDS`, `+` for medkits and `=`
            for ammunition, and without doors, keys and apples.
        heading: the first heading in degrees, 0 east, growing clockwise: None for any, a number,
            or (lowest, highest).
        weapon: the player's weapon.
        ammo: shots at the start.
        most_ammo: the largest number of shots.
        monsters: kinds that replace some of those in `KINDS`, by symbol.
        fast: whether monsters react at once and attack without pausing, as in the game's highest
            skill.
        aim: the meaning of success, in words that follow "the agent"; "" uses the map's aim.
        won: a function of (environment, state) that returns as bool[] whether the aim is reached,
            which ends the episode.
        reward: a function of (state before, state after, won, params) that returns the reward of a
            tic, float32[].
        destination: a function of (environment, state) that returns the tiles, as bool[rows,
            columns], to which the player `hunt` walks when it sees no monster.

    Raises:
        MapError: the map is invalid (the message names line and column), has no monster, more than
            `MOST_MONSTERS`, or more than `MOST_TILES` columns or rows.
        SettingError: a setting is out of range, or a key of `monsters` is not in `KINDS`.
    """

    text: str = dataclasses.field(repr=False)
    heading: float | tuple[float, float] | None = None
    weapon: Weapon = PISTOL
    ammo: int = number(50, 0, 1_000_000)
    most_ammo: int = number(100, 0, 1_000_000)
    monsters: Mapping[str, MonsterKind] | tuple[tuple[str, MonsterKind], ...] = ()
    fast: bool = False
    aim: str = ""
    won: Callable[[Shooter, ShooterState], jax.Array] = reached_aim
    reward: Callable[[ShooterState, ShooterState, jax.Array, ShooterParams], jax.Array] = reward_of
    destination: Callable[[Shooter, ShooterState], jax.Array] = toward_aim

    params_class: ClassVar[type[Params]] = ShooterParams
    success_event: ClassVar[str] = "won"
    unit: ClassVar[int] = TILE
    takes_patterns: ClassVar[bool] = True
    button_names: ClassVar[tuple[str, ...]] = ALL_MOVES

    def __post_init__(self) -> None:
        """Check the settings and the map."""
        if isinstance(self.monsters, Mapping):
            object.__setattr__(self, "monsters", tuple(self.monsters.items()))
        super().__post_init__()
        heading_range(self.heading)
        if strange := sorted({symbol for symbol, _ in self._changes} - set(KINDS)):
            known = ", ".join(map(repr, KINDS))
            raise SettingError(
                f"monsters has a kind for {quoted(strange[0])}, which is not one of the symbols "
                f"{known}"
            )
        columns, rows = self.tilemap.columns, self.tilemap.rows
        if max(columns, rows) > MOST_TILES:
            raise MapError(
                f"a map of {columns} columns and {rows} rows is too large for a shooter: the limit "
                f"is {MOST_TILES} of each"
            )
        count = len(things_of(self.tilemap, "monster")[0])
        if not 1 <= count <= MOST_MONSTERS:
            raise MapError(
                f"a shooter must have 1 to {MOST_MONSTERS} monsters ({' '.join(KINDS)}), but this "
                f"map has {count}"
            )

    @property
    def _changes(self) -> tuple[tuple[str, MonsterKind], ...]:
        return tuple(self.monsters.items() if isinstance(self.monsters, Mapping) else self.monsters)

    # The map.

    @property
    def room(self) -> Room:
        """The colours of other text maps."""
        return Room("", floor=FLOOR[0], ceiling=CEILING)

    @property
    def scenario(self) -> str | None:
        """None, because ViZDoom does not have this scenario."""
        return None

    @functools.cached_property
    def tilemap(self) -> TileMap:
        """The map as tiles."""
        return dataclasses.replace(read_text(self.text), name=self.name)

    @functools.cached_property
    def doom_map(self) -> DoomMap:
        """The map in map units."""
        return doom_map_of(self.tilemap)

    @functools.cached_property
    def tiles(self) -> TileGrid:
        """The grid of tiles in map units."""
        return grid_of(self.tilemap)

    @functools.cached_property
    def geometry(self) -> Geometry:
        """The walls that bodies collide with."""
        return build_geometry(self.doom_map.walls)

    @functools.cached_property
    def level(self) -> Level:
        """The map for the renderer."""
        return compile_level(self.tilemap.walls, self.tilemap.door_tiles)

    @functools.cached_property
    def theme(self) -> Theme:
        """The look of the map, as for other text maps."""
        return super().theme.replace(
            wall_colours=np.array(LABEL_COLOURS, np.float32),
            floor=np.array(FLOOR, np.float32),
            light=Light(),
        )

    @property
    def starts(self) -> np.ndarray:
        """float[n, 2]: the starts of episodes, in map units."""
        return centres_of(self.tilemap, self.tilemap.spawns) / ONE

    def touches(self, state: ShooterState, places: np.ndarray) -> jax.Array:
        """bool[N]: whether the player is less than 36 units from int32[N, 2] in x and y."""
        own, other = np.array(RADIUS, np.int32), np.array(_THING, np.int32)
        return overlap(state.fixed_position[None], own, jnp.asarray(places), other)

    # The parts.

    @functools.cached_property
    def horde(self) -> Horde:
        """The monsters, row by row of the map, which fight each other too."""
        kinds = {**KINDS, **dict(self._changes)}
        labels, _ = things_of(self.tilemap, "monster")
        found = [kinds[THING_OF[label].symbols] for label in labels]
        walls = segments(self.doom_map.walls)
        return Horde(found, walls=walls, opaque=walls, fast=self.fast, infighting=True)

    @functools.cached_property
    def arsenal(self) -> Arsenal:
        """The weapon."""
        return Arsenal([Slot(self.weapon)], shots=self.ammo, most=self.most_ammo)

    @functools.cached_property
    def fireballs(self) -> Missiles:
        """The fireballs of monsters."""
        acts = [[frame.act for frame in (*kind.melee, *kind.missile)] for kind in self.horde.kinds]
        throwers = sum(Act.THROW in acts[number] for number in self.horde.kind_of)
        return fireballs(min(_BALLS * throwers, _MOST_BALLS))

    @functools.cached_property
    def rockets(self) -> Missiles:
        """The player's rockets; none if the weapon fires bullets."""
        return rockets(3 if self.weapon.speed else 0)

    @functools.cached_property
    def supplies(self) -> Supplies:
        """Medkits and boxes of ammunition."""
        labels, places = things_of(self.tilemap, "supply")
        return Supplies(places, np.array(labels, int) == MEDKIT.label)

    @functools.cached_property
    def goal_part(self) -> Goals:
        """The goals."""
        return Goals(centres_of(self.tilemap, self.tilemap.goals))

    @functools.cached_property
    def parts(self) -> tuple[Part, ...]:
        """Health, weapon, monsters, fireballs, supplies, goals, rockets."""
        player, shots = (Health(FULL_HEALTH), self.arsenal), (self.horde, self.fireballs)
        return *player, *shots, self.supplies, self.goal_part, self.rockets

    # The rules.

    def init_state(self, key: jax.Array, params: ShooterParams) -> ShooterState:
        """Sample start, heading, and where each monster looks."""
        count = len(self.horde)
        bits = jax.random.bits(key, (2 + 2 * count,), jnp.uint32)
        low, high = heading_range(self.heading)
        # Headings in 65536ths of a circle, counter-clockwise.
        angles = round(-high / (2 * math.pi) * ONE), round(-low / (2 * math.pi) * ONE)
        facing, looks = bits[2 : 2 + count] & np.uint32(7 << 29), bits[2 + count :]
        health = self.horde.healthy(params.monster_health)
        _, places = things_of(self.tilemap, "monster")
        return ShooterState(
            **self.start_pose(bits[:2], angles),
            **before_fight(self, asleep(self.horde, places, facing, health, looks)),
            fireballs=self.fireballs.none(),
            rockets=self.rockets.none(),
            supplies=jnp.ones(len(self.supplies.places), bool),
        )

    def transition(
        self, key: jax.Array, state: ShooterState, action: jax.Array, params: ShooterParams
    ) -> tuple[ShooterState, jax.Array, jax.Array, Info]:
        """Fight, take supplies, and check whether the aim is reached."""
        fight_key, ball_key, rocket_key = jax.random.split(key, 3)
        before, hits = state, jnp.int32(0)
        state, fought = fight(self, fight_key, state, action, params)
        if self.weapon.speed:
            state = fly_rockets(
                self, self.rockets, self.weapon, rocket_key, state, fought.fires, params
            )
        if self.fireballs.count:
            state, hits = fly_fireballs(self, self.fireballs, ball_key, state, fought, params)
        dead = state.health <= 0
        state, took = self._take(state, ~dead, params)
        won = self.won(self, state) & ~dead
        events = {"shots": fought.fires.astype(jnp.int32), "kills": state.kills - before.kills}
        events |= {"hits": hits, **took, "won": won, "died": dead}
        return state, self.reward(before, state, won, params), dead | won, events

    def _take(
        self, state: ShooterState, able: jax.Array, params: ShooterParams
    ) -> tuple[ShooterState, dict[str, jax.Array]]:
        """Take what the player needs, if able to; returns the state and the amounts."""
        medkits, most = self.supplies.medkits, self.arsenal.most
        reach = state.supplies & self.touches(state, self.supplies.places) & able
        trigger = state.trigger
        healing = reach & medkits & (state.health < FULL_HEALTH)
        loading = reach & ~medkits & (trigger.ammo < most)
        healed, loaded = (jnp.sum(taken, dtype=jnp.int32) for taken in (healing, loading))
        ammo = jnp.minimum(trigger.ammo + loaded * params.clip, most)
        state = state.replace(
            health=jnp.minimum(state.health + healed * params.medkit, FULL_HEALTH),
            trigger=trigger.replace(ammo=ammo),
            supplies=state.supplies & ~healing & ~loading,
        )
        return state, {"took_medkit": healed, "took_ammunition": loaded}

    def next_tiles(self, state: ShooterState) -> jax.Array:
        """bool[rows, columns]: where the player `hunt` walks when it sees no monster."""
        return self.destination(self, state)

    def to_fetch(self, state: ShooterState) -> tuple[jax.Array, jax.Array]:
        """int32[M, 2], the positions of supplies; bool[M], which of them `hunt` should fetch."""
        medkits = self.supplies.medkits
        wanted = jnp.where(medkits, state.health < _HURT, state.trigger.ammo < _SHORT)
        return jnp.asarray(self.supplies.places), state.supplies & wanted

    def about(self) -> About:
        """A description of the task."""
        usual = "reached the goal" if self.tilemap.goals else "killed all monsters"
        aim = self.aim or usual
        return About(
            aim=aim,
            ends="when the aim is reached, and when the player dies",
            rewards={
                "kill_reward": "{:+g} per monster that dies",
                "win_reward": "{:+g} for reaching the aim",
                "death_penalty": "-{:g} at death",
                "living_reward": "{:+g} per tic",
            },
            events={
                **SHOOTING,
                **(HITS if self.fireballs.count else {}),
                "took_medkit": Event("took a medkit", "took {} medkits"),
                "took_ammunition": Event("took ammunition", "took {} boxes of ammunition"),
                "won": Event(aim),
                "died": Event("died"),
            },
            variables={"health": "0 to 100", "ammo": "shots left", "killed": "monsters killed"},
            captions=("health", "ammo", "killed"),
            players={"hunt": HUNT},
            expert="hunt",
        )
