"""ViZDoom's Health Gathering and Health Gathering Supreme, tic by tic: survive on acid."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import where_few
from ...about import About, Choose, Event, Player
from ...environment import Info
from ...maps import things
from ...params import Params, Scalar, number
from ...players.chance import NO_OP
from ...players.walking import flood
from ..health import FULL_HEALTH, about_health
from .collision import LATTICE, Geometry
from .fixed import ONE
from .maps import MAP_SPOT, START
from .motion import moved
from .parts import Health, Part
from .physics import FORWARD, TURN_LEFT, TURN_RIGHT
from .pickups import Pickup, Pickups
from .players import NEIGHBOURS, free_nodes, nearest_node, walker
from .pose import ANY_ANGLE, DoomState
from .scenario import DoomScenario
from .view import ACID, CEILING, MEDKIT_BOX, Picture, Room

_MEDKIT, _BOTTLE = things.MEDKIT.label, Picture("bottle", 15.3, (72, 112, 80), (110, 140, 66))
_SMALL = (
    Pickup(
        "Medikit",
        _MEDKIT,
        MEDKIT_BOX,
        25,
        at_first=17,
        period=30,
        capacity=88,
        spared_when_full=True,
    ),
)
_SUPREME = (
    Pickup("CustomMedikit", _MEDKIT, MEDKIT_BOX, 20, at_first=31, period=25, capacity=116),
    Pickup(
        "Poison",
        things.POISON.label,
        _BOTTLE,
        -30,
        at_first=3,
        period=50,
        capacity=46,
        name="poison",
    ),
)
# The number of points checked along a straight path; the extra distance for medkits behind walls
# or poison, and the distance at which poison is too close, in map units.
_STEPS, _BLOCKED, _POISONED, _CLEARANCE = 48, 1e4, 1e3, 60
# The distance at which a player waits for a medkit to be needed; how many nodes it looks ahead on
# a path around walls.
_ARRIVED, _AHEAD = 20, 2


class DoomHealthParams(Params):
    """The params of the task.

    Attributes:
        damage: health that the floor takes each time; the first time before the first observation.
        damage_period: tics from one damage to the next.
        living_reward: reward of every tic, including the last one.
        death_penalty: subtracted from the reward of the tic in which the player dies.
        health_reward: reward of a point of health from a medkit; poison takes it. 0 in the game.
    """

    max_steps_in_episode: Scalar = 2100
    discount: Scalar = 0.99
    damage: Scalar = number(8, 0, 99)
    damage_period: Scalar = number(32, 1)
    living_reward: Scalar = 1.0
    death_penalty: Scalar = 100.0
    health_reward: Scalar = 0.0


class DoomHealthState(DoomState):
    """The state of the task with N places for things (see `Pickups`).

    Attributes:
        health: int32[], 0 to 100.
        places: int32[N, 2], map units in 16.16, of things kind by kind.
        present: bool[N], which things are present.
        number: int32[N], the order in which things appeared; the game takes the newest first. If
            all places of a kind are taken, a new thing replaces the oldest.
    """

    health: jax.Array
    places: jax.Array
    present: jax.Array
    number: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomHealthGathering(DoomScenario[DoomHealthState, DoomHealthParams]):
    """Stay alive on a floor that hurts, by walking over medkits, with Doom's own motion.

    The floor takes 8 health every 32 tics. Medkits, and in the second scenario poison, appear
    somewhere at fixed intervals, and the player takes them by walking into them. Reward: 1 per
    tic, and -100 for dying, which terminates the episode.

    Attributes:
        supreme: whether it is Health Gathering Supreme: in a large room with walls, and with
            poison that looks like a bottle.
    """

    # Things are at most as high as the eye, so a third one in a column is hardly visible.
    sprite_layers: int = 2
    supreme: bool = False

    params_class: ClassVar[type[Params]] = DoomHealthParams
    takes_game_look: ClassVar[bool] = True
    button_names: ClassVar[tuple[str, ...]] = (TURN_LEFT, TURN_RIGHT, FORWARD)

    @property
    def room(self) -> Room:
        """An empty room, or one with walls."""
        name = "health-gathering-supreme" if self.supreme else "health-gathering"
        return Room(name, floor=ACID, ceiling=CEILING)

    @property
    def starts(self) -> np.ndarray:
        """float[n, 2]: the map spots, or the only start of a map without spots."""
        return self.doom_map.places(MAP_SPOT, START)

    @property
    def angles(self) -> tuple[int, int]:
        """The range of the first heading, in 65536ths of a turn."""
        return ANY_ANGLE if self.doom_map.of_kind(MAP_SPOT) else (0, 0)

    @functools.cached_property
    def pickups(self) -> Pickups:
        """The things on the floor."""
        kinds = _SUPREME if self.supreme else _SMALL
        return Pickups(kinds, self.room.map_name, self.geometry)

    @functools.cached_property
    def parts(self) -> tuple[Part, ...]:
        """Health, and the things on the floor."""
        return Health(FULL_HEALTH), self.pickups

    def init_state(self, key: jax.Array, params: DoomHealthParams) -> DoomHealthState:
        """Sample start and heading, and place the first things."""
        pose_key, thing_key = jax.random.split(key)
        pose = self.start_pose(jax.random.bits(pose_key, (2,), jnp.uint32), self.angles)
        health = FULL_HEALTH - jnp.asarray(params.damage)
        return DoomHealthState(**pose, health=health, **self.pickups.first(thing_key))

    def transition(
        self, key: jax.Array, state: DoomHealthState, action: jax.Array, params: DoomHealthParams
    ) -> tuple[DoomHealthState, jax.Array, jax.Array, Info]:
        """Take damage, move, take things; then new ones appear."""
        time = state.time + 1
        hurt = time % jnp.maximum(params.damage_period, 1) == 0
        health = jnp.maximum(state.health - jnp.where(hurt, params.damage, 0), 0)
        state, reached = moved(self, state, action)
        state, counts = self.pickups.take(state, health, reached)
        state = self.pickups.appear(state, key, time)
        dead = state.health <= 0
        reward = params.living_reward - jnp.where(dead, params.death_penalty, 0)
        reward += params.health_reward * (state.health - health).astype(jnp.float32)
        return state, reward, dead, counts | {"died": dead}

    def about(self) -> About:
        """A description of the task."""
        kinds = self.pickups.kinds
        taken = {f"took_{kind.name}": Event(kind.one, kind.several) for kind in kinds}
        about = about_health(taken, GREEDY_MEDKITS, "tic")
        paid = {**about.rewards, "health_reward": "{:+g} per point of health taken"}
        return dataclasses.replace(about, rewards=paid)


def greedy_medkits(env: DoomHealthGathering, params: Any) -> Choose:
    """Go to the nearest medkit on a straight path, avoiding poison if possible.

    If there is none, it takes the path around the walls to the nearest medkit.
    """
    del params
    count = env.pickups.kinds[0].capacity
    walk = walker(env)
    around = where_few(functools.partial(_way_around, env.geometry))

    def choose(key: jax.Array, state: DoomHealthState) -> jax.Array:
        del key
        medkits, there = state.places[:count], state.present[:count]
        offset = (medkits - state.fixed_position[None]).astype(jnp.float32) * (1 / ONE)
        distance = jnp.sqrt(jnp.sum(offset**2, axis=-1))
        free = there & _walkable(env.geometry, state.fixed_position, medkits)
        safe = ~_passes(offset, state.fixed_position, state.places[count:], state.present[count:])
        cost = jnp.where(there, distance, jnp.inf) + jnp.where(free, 0, _BLOCKED)
        nearest = jnp.argmin(cost + jnp.where(safe, 0, _POISONED))
        lost = there[nearest] & ~free[nearest]
        target = around(lost, state.fixed_position, medkits, there)
        target = jnp.where(lost, target, medkits[nearest])
        # A medkit that is not needed is left alone, and a body must move to take it.
        arrived = jnp.all(jnp.abs(target - state.fixed_position) < _ARRIVED * ONE)
        waits = arrived & (state.health >= FULL_HEALTH) | ~jnp.any(there)
        return jnp.where(waits, NO_OP, walk(state, target))

    return choose


GREEDY_MEDKITS = Player(
    "goes to the nearest medkit and waits until it is needed; sees the whole state",
    greedy_medkits,
    waits="waits: healthy",
)


def _walkable(geometry: Geometry, position: jax.Array, places: jax.Array) -> jax.Array:
    """bool[N]: whether a body can walk straight from a position to int32[N, 2]."""
    part = np.linspace(0, 1, _STEPS + 1, dtype=np.float32)[1:-1]
    way = (places - position[None]).astype(jnp.float32)[:, None] * part[None, :, None]
    steps = position[None, None] + way.astype(jnp.int32)
    return ~jnp.any(jax.vmap(jax.vmap(geometry.blocked))(steps), axis=1)


def _passes(
    offset: jax.Array, position: jax.Array, poison: jax.Array, there: jax.Array
) -> jax.Array:
    """bool[N]: whether the straight path along float32[N, 2] map units passes close to poison."""
    if poison.shape[0] == 0:
        return jnp.zeros(offset.shape[0], bool)
    place = (poison - position[None]).astype(jnp.float32) * (1 / ONE)
    length = jnp.maximum(jnp.sum(offset**2, axis=-1), 1)
    along = jnp.sum(place[None] * offset[:, None], axis=-1) / length[:, None]
    beside = place[None] - offset[:, None] * jnp.clip(along, 0, 1)[..., None]
    return jnp.any((jnp.sum(beside**2, axis=-1) < _CLEARANCE**2) & there[None], axis=1)


def _way_around(
    geometry: Geometry, position: jax.Array, medkits: jax.Array, there: jax.Array
) -> jax.Array:
    """int32[2]: the next point on the path to the nearest medkit, on the lattice of 32 units."""
    shape = tuple(size // 2 for size in geometry.cells.shape)
    node = jax.vmap(functools.partial(nearest_node, geometry))(medkits) // 2
    node = jnp.minimum(node, np.array(shape, np.int32)[None] - 1)
    target = jnp.zeros(shape, bool).at[node[:, 0], node[:, 1]].max(there)
    free = free_nodes(geometry)[: 2 * shape[0] : 2, : 2 * shape[1] : 2]
    field = flood(jnp.asarray(np.pad(free, 1)), jnp.pad(target, 1))
    here = jnp.minimum(nearest_node(geometry, position) // 2, np.array(shape, np.int32) - 1)
    for _ in range(_AHEAD):
        beside = here[None] + np.array(NEIGHBOURS, np.int32)
        best = jnp.argmin(field[beside[:, 0] + 1, beside[:, 1] + 1])
        nearer = field[beside[best][0] + 1, beside[best][1] + 1] < field[here[0] + 1, here[1] + 1]
        here = jnp.where(nearer, beside[best], here)
    return jnp.asarray(geometry.origin) + here * (2 * LATTICE * ONE)
