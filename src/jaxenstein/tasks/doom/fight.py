"""Fights: who hurts whom in a tic of a scenario with monsters and weapons."""

from __future__ import annotations

from functools import partial
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import select, where_few
from ...params import Params, Scalar, number
from ...pytree import PyTreeNode
from ..draws import random_bits
from ..health import FULL_HEALTH
from .collision import RADIUS, is_seen, offsets, overlap, way_to
from .fixed import FEW, ONE, byte, roll
from .monster_ai import act
from .monster_attacks import attack, throws
from .monsters import Horde, Monsters
from .motion import moved
from .physics import MOST_SPEED, Reached
from .pose import DoomState
from .projectiles import Missiles, Projectiles, launch, throw, with_player
from .scenario import DoomScenario
from .weapons import Trigger, Weapon

# The damage of a rocket's blast, and its reach in map units.
_BLAST = 128

# A state with the fields of `FightState`, and fireballs or rockets if the scenario has any.
S = TypeVar("S", bound=Any)


class FightParams(Params):
    """The params that scenarios with fights share.

    Attributes:
        damage_factor: factor on all damage to the player.
    """

    damage_factor: Scalar = number(1.0, 0, 1000)


class FightState(DoomState):
    """The state of a player among monsters.

    Attributes:
        health: int32[], of the player.
        trigger: the state of the weapon in hand.
        monsters: the monsters.
        kills: int32[], monsters killed in this episode, whoever killed them.
    """

    health: jax.Array
    trigger: Trigger
    monsters: Monsters
    kills: jax.Array


class Fought(PyTreeNode):
    """The outcome of a tic of fighting.

    Attributes:
        fires: bool[], whether the player fired a shot.
        dealt: int32[], the damage of the player's bullets and blows to monsters.
        throws: bool[N], the monsters that throw a fireball.
        reached: the positions that the player reached.
    """

    fires: jax.Array
    dealt: jax.Array
    throws: jax.Array
    reached: Reached


def before_fight(
    scenario: DoomScenario[Any, Any], monsters: Monsters, weapon: Weapon | None = None
) -> dict[str, Any]:
    """The fields of `FightState` for a healthy player with a weapon, by default the first."""
    return {
        "health": jnp.int32(FULL_HEALTH),
        "trigger": scenario.arsenal.trigger(weapon),
        "monsters": monsters,
        "kills": jnp.int32(0),
    }


def fight(
    scenario: DoomScenario[S, Any], key: jax.Array, state: S, action: jax.Array, params: FightParams
) -> tuple[S, Fought]:
    """A tic: the player turns, shoots and moves; then the monsters act."""
    horde, arsenal, before = scenario.horde, scenario.arsenal, state.monsters
    bits = random_bits(key, (len(horde) + 1, 4 + max(int(horde.rays.max()), 1)))

    def bodies(places: jax.Array) -> jax.Array:
        met = overlap(places[:, None], RADIUS, before.position[None], horde.half_width[None])
        return jnp.any(met & before.living[None], axis=1)

    origin = state.fixed_position
    state, reached = moved(scenario, state, action, bodies)
    pressed = jnp.asarray(scenario.pressed(action).attack)
    state, fires = arsenal.tic(state, pressed, scenario.held(action))
    pellets = bits[-1:, 0]
    if arsenal.rays > 1:
        pellets = jax.random.bits(jax.random.fold_in(key, 1), (arsenal.rays,), jnp.uint32)
    targets = before.position, horde.half_width, before.living
    damage = arsenal.bullets(state, (fires, origin), targets, horde.opaque, pellets)
    monsters = horde.hurt(before, damage, bits[:-1, 0])
    monsters, attacks = act(horde, monsters, state.fixed_position, fires, bits[:-1, 1:3])
    blows = attack(horde, monsters, attacks, state.fixed_position, bits[:-1, 4:])
    monsters = horde.hurt(monsters, blows.dealt, bits[:-1, 3], blows.source)
    state = _with_monsters(state, monsters)
    state = suffer(scenario, state, monsters.position, blows.lost, params)
    dealt = jnp.sum(damage, dtype=jnp.int32)
    thrown = throws(horde, monsters, attacks, blows.bitten)
    return state, Fought(fires, dealt, thrown, reached)


def _with_monsters(state: S, monsters: Monsters) -> S:
    """The state with the monsters after they were hurt; some may have died."""
    killed = jnp.sum(state.monsters.living & ~monsters.living, dtype=jnp.int32)
    return state.replace(monsters=monsters, kills=state.kills + killed)


def suffer(
    scenario: DoomScenario[S, Any],
    state: S,
    origins: jax.Array,
    damage: jax.Array,
    params: FightParams,
) -> S:
    """The state after damage to the player, which also pushes it by 1/8 map unit per point.

    Blows add up to a speed of at most `MOST_SPEED` along each axis.

    Args:
        scenario: the scenario, with the player's armour if it has any.
        state: the state before the damage.
        origins: int32[N, 2], where each blow comes from.
        damage: int32[N], before the damage factor.
        params: the params of the environment.
    """
    factor = jnp.asarray(params.damage_factor, jnp.float32)
    blows, player = where_few(_lost, FEW), state.fixed_position
    lost, push = blows(jnp.any(damage > 0), damage, factor, origins, player)
    state, felt = scenario.absorbed(state, lost)
    health = jnp.maximum(state.health - felt, 0)
    velocity = jnp.clip(state.fixed_velocity + push, -MOST_SPEED * ONE, MOST_SPEED * ONE)
    return state.replace(health=health, fixed_velocity=velocity)


def _lost(
    damage: jax.Array, factor: jax.Array, origins: jax.Array, player: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """int32[N], health lost by damage int32[N] from int32[N, 2]; int32[2], the push."""
    lost = jnp.floor(damage.astype(jnp.float32) * factor)
    way = way_to(origins, player[None])
    push = jnp.sum(way * (lost[:, None] * jnp.float32(ONE / 8)), axis=0)
    return lost.astype(jnp.int32), push.astype(jnp.int32)


def fly_fireballs(
    scenario: DoomScenario[S, Any],
    missiles: Missiles,
    key: jax.Array,
    state: S,
    fought: Fought,
    params: FightParams,
) -> tuple[S, jax.Array]:
    """A tic of the fireballs, after `fight`: the state; int32[], the fireballs that hit the player.

    Fireballs also hurt monsters of other kinds than the thrower's.
    """
    horde, before = scenario.horde, state.monsters
    throws, balls = jnp.any(fought.throws), state.fireballs
    thrown = where_few(partial(_thrown, horde), FEW)
    thrown = thrown(throws, balls, fought.throws, before, state.fixed_position)
    bodies = (
        jnp.concatenate([before.position, state.fixed_position[None]]),
        np.append(horde.half_width, np.int32(RADIUS)),
        jnp.append(before.living, True),
    )
    balls, hits = missiles.fly(select(throws, thrown, balls), bodies, horde.walls)
    bits = jax.random.bits(key, (missiles.count,), jnp.uint32)
    dice, sides = (
        jnp.asarray(table).at[balls.owner].get(mode="clip")
        for table in (horde.ball_dice, horde.ball_sides)
    )
    damage = jnp.where(hits, roll(dice, sides, byte(bits, 0))[:, None], 0)
    lost = jnp.sum(damage[:, -1:], axis=1, dtype=jnp.int32)
    state = suffer(scenario, state.replace(fireballs=balls), balls.position, lost, params)
    if len(horde.kinds) > 1:
        kinds = jnp.asarray(horde.kind_of)
        others = kinds.at[balls.owner].get(mode="clip")[:, None] != kinds[None]
        burns = jnp.where(others, damage[:, :-1], 0)
        burnt = jnp.sum(burns, axis=0, dtype=jnp.int32)
        fate = jnp.broadcast_to(bits[0], (len(horde),))
        source = balls.owner.at[jnp.argmax(burns, axis=0)].get(mode="promise_in_bounds")
        state = _with_monsters(state, horde.hurt(before, burnt, fate, source))
    return state, jnp.sum(hits[:, -1], dtype=jnp.int32)


def _thrown(
    horde: Horde, balls: Projectiles, throws: jax.Array, monsters: Monsters, player: jax.Array
) -> Projectiles:
    """The fireballs with new ones from the monsters bool[N] that throw."""
    goal, _ = horde.enemies(monsters, player)
    way = way_to(monsters.position, goal)
    return throw(balls, throws, monsters.position, way, horde.ball_speed)


def fly_rockets(
    scenario: DoomScenario[S, Any],
    missiles: Missiles,
    weapon: Weapon,
    key: jax.Array,
    state: S,
    fires: jax.Array,
    params: FightParams,
) -> S:
    """The state after a tic of the player's rockets, plus a new one if the player `fires`, bool[].

    A rocket ends at a wall or at a monster, which it hurts. Then its blast hurts every body closer
    than 128 map units and not behind a wall, including the player. The damage is 128 minus the
    distance to the body's side.
    """
    horde, monsters = scenario.horde, state.monsters
    bits = jax.random.bits(key, (missiles.count + len(horde),), jnp.uint32)
    before = launch(state.rockets, weapon, fires, state.fixed_position, state.angle)
    direct = weapon.damage(byte(bits[: missiles.count], 0))
    bodies = monsters.position, horde.half_width, monsters.living
    bodies = with_player(state.fixed_position, bodies)
    places, widths, _ = bodies
    after, hits = missiles.fly(before, bodies, horde.opaque)
    ends = before.flies & ~after.flies
    # Blasts start one check before the end, in front of any wall. Few rockets end in a tic.
    sources = after.position, after.position - before.velocity // missiles.checks
    blasts = where_few(partial(_blasts, widths, horde.opaque), FEW)
    damage = jnp.where(hits, direct[:, None], 0) + blasts(jnp.any(ends), *sources, places)
    damage = jnp.where(ends[:, None], damage, 0)
    dealt = jnp.sum(damage[:, 1:], axis=0, dtype=jnp.int32)
    hurt = horde.hurt(monsters, dealt, bits[missiles.count :])
    state = _with_monsters(state.replace(rockets=after), hurt)
    return suffer(scenario, state, after.position, damage[:, 0], params)


def _blasts(
    widths: np.ndarray, walls: np.ndarray, centres: jax.Array, eyes: jax.Array, places: jax.Array
) -> jax.Array:
    """int32[M, N]: the damage of explosions at int32[M, 2] to bodies at int32[N, 2].

    They do no damage behind walls float32[L, 4], as seen from int32[M, 2].
    """
    gap = jnp.max(jnp.abs(offsets(centres[:, None], places[None])), axis=-1)
    side = jnp.maximum(gap - widths[None].astype(np.float32), 0)
    shape = (eyes.shape[0], places.shape[0], 2)
    ways = jnp.broadcast_to(eyes[:, None], shape), jnp.broadcast_to(places[None], shape)
    return jnp.where(is_seen(*ways, walls), jnp.maximum(_BLAST - side.astype(jnp.int32), 0), 0)
