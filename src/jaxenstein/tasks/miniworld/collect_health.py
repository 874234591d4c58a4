"""MiniWorld's CollectHealth: a floor that hurts, and medkits to pick up."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import select
from ...about import About, Choose, Event, Player
from ...engine.motion import forward
from ...engine.scene import Scene, Sprites
from ...environment import Info, Params, Scalar, State
from ...maps.symbols import DEFAULT_WALL
from ...maps.things import RGB
from ...maps.tilemap import TileMap
from ...params import number
from ...players.chance import NO_OP
from ...players.walking import Movement, movement_of, towards
from ..draws import sample_unit
from ..health import FULL_HEALTH, about_health
from ..health_gathering import HealthRoom
from ..steering import ACTION_NAMES, SteeringParams, sample_heading, steer
from .rooms import CEILING

# Tiles along the room's side, medkits, and how many places are drawn for one that is apart.
ROOM, MEDKITS, _TRIES = 16, 18, 8
PICK_UP = 4
# Radii of the body and of a medkit in tiles; then those of the hand, and its distance ahead.
_BODY, _MEDKIT = 0.4, 0.25
_HAND, _AHEAD = 0.48, 0.6
# How many turns the player's heading may be off.
_SLACK = 0.75


class CollectHealthParams(SteeringParams):
    """The params of the task.

    Attributes:
        damage: health lost in each step.
        living_reward: reward of every step, including the last one.
        death_penalty: subtracted from the reward of the step in which the agent dies.
    """

    max_steps_in_episode: Scalar = number(1000, 1)
    damage: Scalar = number(2, 0)
    living_reward: Scalar = 2.0
    death_penalty: Scalar = 102.0


class CollectHealthState(State):
    """The state of the task.

    Attributes:
        health: int32[], 0 to 100.
        medkits: float32[18, 2], (x, y) of each in tiles.
    """

    health: jax.Array
    medkits: jax.Array


def collector(env: CollectHealth, params: CollectHealthParams) -> Choose:
    """Go to the reachable medkit that is close to most others.

    The player waits there, and picks it up when hardly any health is left. Other medkits are
    around it, so the next one is not too far away.
    """
    body = movement_of(env, params)
    damage = jnp.asarray(params.damage, jnp.float32)
    often = damage * body.steps

    def choose(key: jax.Array, state: CollectHealthState) -> jax.Array:
        del key
        offset = state.medkits - state.position[None]
        decisions = _decisions(body, state.heading, offset)
        health = state.health.astype(jnp.float32)
        near = (decisions < health / often - 1) & ~_behind_others(offset)
        worth = jnp.where(near, _worth(state.medkits, body, often), -1)
        best = jnp.where(jnp.any(near), jnp.argmax(worth), jnp.argmin(decisions))
        walk = towards(body, env.scene(state, params), offset[best], _SLACK)
        touched, late = in_hand(state), health <= often + damage
        still = jnp.where(touched[best], jnp.int32(NO_OP), walk)
        return jnp.where(jnp.any(touched) & late, jnp.int32(PICK_UP), still)

    return choose


def _decisions(body: Movement, heading: jax.Array, offset: jax.Array) -> jax.Array:
    """float32[n]: decisions until the hand touches medkits at offsets float32[n, 2]."""
    error = jnp.arctan2(offset[:, 1], offset[:, 0]) - heading
    error = jnp.abs(jnp.mod(error + math.pi, 2 * math.pi) - math.pi)
    left = jnp.maximum(jnp.sqrt(jnp.sum(offset**2, axis=-1)) - (_AHEAD + _HAND), 0)
    return jnp.ceil(error / body.angle) + jnp.ceil(left / (body.step * body.steps))


def _behind_others(offset: jax.Array) -> jax.Array:
    """bool[n]: which medkits at offsets float32[n, 2] have another one in the way."""
    square = jnp.sum(offset**2, axis=-1)
    along = jnp.sum(offset[:, None] * offset[None], axis=-1) / jnp.maximum(square, 1e-6)[:, None]
    past = offset[None] - along[..., None] * offset[:, None]
    width = jnp.float32(_BODY + _MEDKIT + 0.05)
    between = (along > 0) & (along < 1) & (jnp.sum(past**2, axis=-1) < width**2)
    return jnp.any(between & ~np.eye(MEDKITS, dtype=bool), axis=1)


def _worth(medkits: jax.Array, body: Movement, often: jax.Array) -> jax.Array:
    """float32[18]: from each medkit, the number of paths to a second and on to a third.

    Each part must be possible with full health after half a turn.
    """
    strides = FULL_HEALTH / often - 2 - math.pi / body.angle
    reach = strides * body.step * body.steps
    apart = jax.vmap(_distances, (0, None))(medkits, medkits)
    linked = ((apart < reach) & ~np.eye(MEDKITS, dtype=bool)).astype(jnp.float32)
    return jnp.sum(linked * (jnp.sum(linked, axis=1) - 1)[None], axis=1)


COLLECTOR = Player(
    "goes to medkits with others near them and picks them up at the last moment; sees the whole "
    "state",
    collector,
    waits="waits: healthy",
)


@dataclasses.dataclass(frozen=True, kw_only=True)
class CollectHealth(HealthRoom[CollectHealthState, CollectHealthParams]):
    """Stay alive on a floor that hurts, by picking up medkits.

    Actions: turn left, turn right, forward, backward, pick up. Every step takes 2 health. Picking
    up a medkit in front restores full health, and the medkit reappears elsewhere. Medkits block
    the way. Reward: 2 per step, and -100 for the step in which the agent dies, which terminates.
    """

    params_class: ClassVar[type[Params]] = CollectHealthParams
    action_names: ClassVar[tuple[str, ...]] = (*ACTION_NAMES[:4], "pick up")
    ceiling: ClassVar[RGB] = CEILING

    @functools.cached_property
    def tilemap(self) -> TileMap:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The room, with a wall one tile thick."""
        walls = np.full((ROOM + 2, ROOM + 2), DEFAULT_WALL, np.uint8)
        walls[1:-1, 1:-1] = 0
        return TileMap(self.name, tuple(bytes(line) for line in walls))

    def init_state(self, key: jax.Array, params: CollectHealthParams) -> CollectHealthState:
        """Place medkits apart from each other, and a start apart from them."""
        del params
        bits = jax.random.bits(key, (MEDKITS + 2, _TRIES, 2), jnp.uint32)

        def lay(medkits: jax.Array, turn: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, None]:
            index, own = turn
            return medkits.at[index].set(_place(own, medkits, _MEDKIT)), None

        # Medkits that are not placed yet are far away.
        nowhere = jnp.full((MEDKITS, 2), -ROOM, jnp.float32)
        turns = jnp.arange(MEDKITS, dtype=jnp.int32), bits[:MEDKITS]
        medkits, _ = jax.lax.scan(lay, nowhere, turns)
        return CollectHealthState(
            position=_place(bits[-2], medkits, _BODY),
            heading=sample_heading(bits[-1, 0, 0], None),
            health=jnp.int32(FULL_HEALTH),
            medkits=medkits,
        )

    def transition(
        self,
        key: jax.Array,
        state: CollectHealthState,
        action: jax.Array,
        params: CollectHealthParams,
    ) -> tuple[CollectHealthState, jax.Array, jax.Array, Info]:
        """Move, pick up, take damage."""
        closed = jnp.zeros(0, bool)
        before = state.position
        position, heading = steer(self.level, closed, before, state.heading, action, params)
        near = _distances(position, state.medkits)
        blocked = (near < _BODY + _MEDKIT) & (near < _distances(before, state.medkits))
        position = jnp.where(jnp.any(blocked), before, position)
        state = state.replace(position=position, heading=heading)
        taken = _first(in_hand(state)) & (action == PICK_UP)
        # A medkit that is taken does not block its own new place.
        others = jnp.where(taken[:, None], jnp.float32(-ROOM), state.medkits)
        others = jnp.concatenate([others, position[None]])
        place = _place(jax.random.bits(key, (_TRIES, 2), jnp.uint32), others, _MEDKIT)
        picked = jnp.any(taken)
        health = state.health - jnp.asarray(params.damage, jnp.int32)
        health = select(picked, jnp.int32(FULL_HEALTH), jnp.maximum(health, 0))
        dead = health <= 0
        state = state.replace(
            health=health, medkits=jnp.where(taken[:, None], place[None], state.medkits)
        )
        reward = params.living_reward - jnp.where(dead, params.death_penalty, 0)
        return state, reward, dead, {"took_medkit": picked, "died": dead}

    def about(self) -> About:
        """A description of the task."""
        about = about_health({"took_medkit": Event("took a medkit")}, COLLECTOR, "step")
        return dataclasses.replace(about, players={"collector": COLLECTOR}, expert="collector")

    def scene(self, state: CollectHealthState, params: CollectHealthParams) -> Scene:
        """The room and its medkits."""
        del params
        return Scene(
            level=self.level,
            closed=jnp.zeros(0, bool),
            position=state.position,
            heading=state.heading,
            sprites=Sprites(
                position=state.medkits,
                picture=jnp.zeros(MEDKITS, jnp.int32),
                visible=jnp.ones(MEDKITS, bool),
            ),
            theme=self.theme,
        )


def in_hand(state: CollectHealthState) -> jax.Array:
    """bool[18]: which medkits the hand touches."""
    hand = state.position + forward(state.heading) * jnp.float32(_AHEAD)
    return _distances(hand, state.medkits) < _HAND + _MEDKIT


def _first(which: jax.Array) -> jax.Array:
    """bool[n]: the first true entry of bool[n]."""
    return which & (jnp.cumsum(which, dtype=jnp.int32) == 1)


def _distances(place: jax.Array, medkits: jax.Array) -> jax.Array:
    return jnp.sqrt(jnp.sum((medkits - place[None]) ** 2, axis=-1))


def _place(bits: jax.Array, others: jax.Array, radius: float) -> jax.Array:
    """float32[2]: the first candidate that is apart from other medkits, from uint32[n, 2]."""
    side = jnp.float32(ROOM - 2 * radius)
    places = 1 + jnp.float32(radius) + sample_unit(bits) * side
    distances = jax.vmap(_distances, (0, None))(places, others)
    return places[jnp.argmax(jnp.all(distances >= radius + _MEDKIT, axis=1))]
