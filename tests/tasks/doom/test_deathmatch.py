"""Deathmatch by exact small cases: arrivals, pellets, drops and rewards."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxenstein.tasks.doom.collision import crosses
from jaxenstein.tasks.doom.fight import suffer
from jaxenstein.tasks.doom.fixed import ONE
from jaxenstein.tasks.doom.items import ITEMS, THIRD
from jaxenstein.tasks.doom.monster_kinds import DEMON, HELL_KNIGHT, SHOTGUN_GUY, ZOMBIE
from jaxenstein.tasks.doom.monsters import Horde
from jaxenstein.tasks.doom.parts import Game
from jaxenstein.tasks.doom.physics import MOST_SPEED
from jaxenstein.tasks.doom.respawn import invaded, words
from jaxenstein.tasks.doom.weapons import (
    CHAINGUN,
    CHAINSAW,
    FIST,
    PISTOL,
    SHOTGUN,
    SUPER_SHOTGUN,
    Weapon,
)
from tests.tasks.doom.cases import NO_WALLS, first_state, make, place

MIDDLE = (512, 512)


@pytest.fixture(scope="module")
def match() -> Any:
    """The environment, its first state in the middle, facing east, and its transition."""
    env, params = make("doom-deathmatch")
    assert env.arsenal.index_of(PISTOL) == 2
    state = first_state(env, params)
    state = state.replace(**env.pose(place(*MIDDLE), jnp.uint32(0)), time=jnp.int32(0))
    transition = jax.jit(env.transition)

    def step(key: jax.Array, state: Any, action: jax.Array, params: Any = params) -> Any:
        return transition(key, state, action, params)

    return env, state, step


def with_monster(env: Any, state: Any, kind: Any, x: float, y: float, health: int) -> Any:
    """The state with one monster, which stands and looks away."""
    slot = env.horde.place_of(kind)
    monsters = state.monsters
    return state.replace(
        monsters=monsters.replace(
            position=monsters.position.at[slot].set(place(x, y)),
            present=monsters.present.at[slot].set(True),
            health=monsters.health.at[slot].set(health),
            tics=monsters.tics.at[slot].set(1000),
        )
    )


def with_weapon(env: Any, state: Any, weapon: Weapon, tics: int) -> Any:
    """The state with a weapon whose ATTACK was pressed `tics` tics ago."""
    arms = state.arms.replace(
        selected=jnp.int32(env.arsenal.index_of(weapon)), ammo=jnp.array([50, 50, 50])
    )
    trigger = state.trigger.replace(tics=jnp.int32(tics), wait=jnp.int32(0))
    return state.replace(arms=arms, trigger=trigger)


def test_initial_state(match: Any) -> None:
    env, state, _ = match
    assert env.action_names[0] == "nothing"
    # ViZDoom's wrapper numbers the buttons from the last to the first.
    assert (env.action_names[1], env.action_names[17]) == ("previous weapon", "attack")
    assert not state.monsters.present.any()
    assert (int(state.items.sum()), len(env.items.places)) == (178, 178)
    assert {name: float(value[0]) for name, value in env.variables(state).items()} == {
        "killed": 0,
        "health": 100,
        "armour": 0,
        "weapon": 2,
        "ammo": 50,
    }


def test_monsters_spawn_with_their_probabilities_where_there_is_room(match: Any) -> None:
    """Six hundred draws of a small horde, beside the player and one existing monster."""
    horde = Horde([ZOMBIE, ZOMBIE, DEMON], walls=NO_WALLS)
    old = jax.tree.map(lambda leaf: leaf[: len(horde)], match[1].monsters)
    old = old.replace(
        position=old.position.at[0].set(jnp.array([500 * ONE, 500 * ONE])),
        present=jnp.array([True, False, False]),
        health=jnp.array([20, 0, 0]),
        infighting=None,
    )
    player = jnp.array([540 * ONE, 500 * ONE], jnp.int32)
    health = jnp.array([20, 20, 150])
    draws = 600

    @jax.jit
    @jax.vmap
    def coming(bits: jax.Array) -> Any:
        return invaded(horde, old, player, [32768.0, 6553.6], (400, 640), health, bits)

    bits = jax.random.bits(jax.random.key(1), (draws, *words(horde)), jnp.uint32)
    after, comes = jax.device_get(coming(bits))
    assert not comes[:, 0].any()
    for slot, chance in ((1, 0.5), (2, 0.1)):
        assert abs(comes[:, slot].mean() - chance) < 4 * (chance * (1 - chance) / draws) ** 0.5
    places = after.position / ONE
    for slot, width in ((1, 20), (2, 30)):
        new = places[comes[:, slot], slot]
        assert ((new >= 400) & (new <= 640)).all()
        assert (new.min() < 450) & (new.max() > 590)
        assert (np.abs(new - (500, 500)).max(axis=1) >= 20 + width).all()
        assert (np.abs(new - (540, 500)).max(axis=1) >= 16 + width).all()
    both = comes[:, 1] & comes[:, 2]
    gap = np.abs(places[both, 1] - places[both, 2]).max(axis=1)
    assert both.sum() > 10
    assert (gap >= 50).all()
    assert (after.health[comes[:, 2], 2] == 150).all()


def test_nothing_spawns_in_a_wall(match: Any) -> None:
    env, _, _ = match
    corners = jnp.array([[x * ONE, y * ONE] for x in (32, 992) for y in (32, 992)], jnp.int32)
    widest = np.array(30, np.float32)
    assert not crosses(corners, widest, env.horde.walls).any()


def test_pellets_scatter_and_fists_have_a_reach(match: Any) -> None:
    """Against sums over pellets one by one."""
    env, state, _ = match
    state = with_monster(env, state, HELL_KNIGHT, 512 + 300, 512, 500)
    slot = env.horde.place_of(HELL_KNIGHT)

    @jax.jit
    @jax.vmap
    def volley(key: jax.Array, weapon: jax.Array, tics: jax.Array) -> jax.Array:
        armed = state.replace(
            arms=state.arms.replace(selected=weapon), trigger=state.trigger.replace(held=tics > 0)
        )
        bits = jax.random.bits(key, (env.arsenal.rays,), jnp.uint32)
        shot = jnp.bool_(True), state.fixed_position
        monsters = state.monsters
        targets = monsters.position, env.horde.half_width, monsters.living
        return env.arsenal.bullets(armed, shot, targets, env.horde.opaque, bits)

    def damage(weapon: Weapon, held: bool = False, count: int = 400) -> np.ndarray:
        keys = jax.random.split(jax.random.key(2), count)
        number = jnp.full(count, env.arsenal.index_of(weapon), jnp.int32)
        found = np.asarray(volley(keys, number, jnp.full(count, int(held))))
        assert not np.delete(found, slot, axis=1).any()
        return found[:, slot]

    # A hit is 5, 10 or 15, with the chances of a byte's rest by three.
    assert set(damage(PISTOL)) == set(damage(CHAINGUN)) == {5, 10, 15}
    # 24 map units at 276 off the near side: 4.97 degrees; of 22.4 at most, the difference of two
    # bytes (in steps of 5.6 / 255 degrees for a pistol, and of twice that for the super shotgun).
    steps = np.arange(-255, 256)
    chances = (256 - np.abs(steps)) / 256**2
    for weapon, shift in ((SHOTGUN, 18), (SUPER_SHOTGUN, 19)):
        angles = steps * 2.0**shift / 2**32 * 2 * np.pi
        hits = (np.abs(np.tan(angles)) * 276 <= 24).astype(float) @ chances
        found = damage(weapon)
        expected = weapon.rays * hits * (5 * 86 + 10 * 85 + 15 * 85) / 256
        assert abs(found.mean() - expected) < 4 * found.std() / 20
        assert found.max() <= 15 * weapon.rays
        assert (found % 5 == 0).all()
    held = damage(PISTOL, held=True)
    angles = steps * 2.0**18 / 2**32 * 2 * np.pi
    hits = (np.abs(np.tan(angles)) * 276 <= 24).astype(float) @ chances
    assert abs((held > 0).mean() - hits) < 4 * (max(hits * (1 - hits), 0.002) / 400) ** 0.5
    assert not damage(CHAINSAW).any()


def test_kill_reward_depends_on_kind_and_the_dead_disappear(match: Any) -> None:
    env, state, step = match
    attack = jnp.int32(env.index_of("attack"))
    ready = with_weapon(env, state, PISTOL, PISTOL.shot - 1)
    for kind, pay in ((ZOMBIE, 1), (SHOTGUN_GUY, 3), (HELL_KNIGHT, 10)):
        alive = with_monster(env, ready, kind, 512 + 60, 512, 1)
        after, reward, dead, events = step(jax.random.key(3), alive, attack)
        assert (float(reward), bool(dead), int(events["kills"])) == (pay, False, 1)
        assert not after.monsters.present.any()
    # A hurt monster gives no reward; it does not matter who shot a monster before it died.
    alive = with_monster(env, ready, DEMON, 512 + 60, 512, 150)
    after, reward, _, events = step(jax.random.key(3), alive, attack)
    assert (float(reward), int(events["kills"])) == (0, 0)
    assert int(after.monsters.living.sum()) == 1
    params = env.check_params().replace(damage_reward=0.5)
    after, reward, _, _ = step(jax.random.key(3), alive, attack, params)
    lost = alive.monsters.health.sum() - after.monsters.health.sum()
    assert float(reward) == 0.5 * int(lost) > 0


def test_things_are_picked_up_by_walking_into_them(match: Any) -> None:
    env, state, step = match
    things = [thing for thing in env.doom_map.things if thing.kind in ITEMS]
    number = next(i for i, thing in enumerate(things) if thing.kind == 82)
    forward = jnp.int32(env.index_of("forward"))

    def state_at(distance: float) -> Any:
        at = place(things[number].x - distance, things[number].y)
        alone = jnp.zeros_like(state.items).at[number].set(True)
        return state.replace(**env.pose(at, jnp.uint32(0)), items=alone)

    # A first tic of walking is 0.78 map units; the boxes are 16 and 20 wide to each side.
    after, _, _, events = step(jax.random.key(4), state_at(37), forward)
    assert after.items[number]
    assert int(events["took_weapon"]) == 0
    after, _, _, events = step(jax.random.key(4), state_at(36.5), forward)
    assert int(events["took_weapon"]) == 1
    assert not after.items[number]
    params = env.check_params().replace(item_reward=0.5)
    assert float(step(jax.random.key(4), state_at(36.5), forward, params)[1]) == 0.5
    assert after.arms.ammo.tolist() == [50, 8, 0]
    assert int(after.arms.pending) == env.arsenal.index_of(SUPER_SHOTGUN)
    hurt = state_at(36.5).replace(health=jnp.int32(0))
    _, _, dead, events = step(jax.random.key(4), hurt, forward)
    assert dead
    assert int(events["took_weapon"]) == 0


def test_ammunition_counts_in_the_tic_of_its_pickup(match: Any) -> None:
    env, state, step = match
    things = [thing for thing in env.doom_map.things if thing.kind in ITEMS]
    number = next(i for i, thing in enumerate(things) if thing.kind == 2048)
    alone = jnp.zeros_like(state.items).at[number].set(True)
    at = place(things[number].x - 36.5, things[number].y)
    before = state.replace(**env.pose(at, jnp.uint32(0)), items=alone)
    after = step(jax.random.key(4), before, jnp.int32(env.index_of("forward")))[0]
    assert int(env.describe(before, env.default_params)["ammo"]) == 50
    assert int(env.describe(after, env.default_params)["ammo"]) == 100


def test_armour_and_health_share_damage(match: Any) -> None:
    env, state, _ = match
    params = env.check_params()
    dressed = state.replace(armour=jnp.int32(100), armour_share=jnp.int32(THIRD))
    origin = state.fixed_position[None] + jnp.array([[ONE * 100, 0]])
    after = suffer(env, dressed, origin, jnp.array([30]), params)
    assert (int(after.health), int(after.armour)) == (80, 90)
    # The push is that of the whole blow: an eighth of a map unit a point, away from it.
    assert after.fixed_velocity.tolist() == [-30 * ONE // 8, 0]
    after = suffer(env, dressed, origin, jnp.array([8 * MOST_SPEED + 8]), params)
    assert after.fixed_velocity.tolist() == [-MOST_SPEED * ONE, 0]


def test_monsters_spawn_every_tenth_tic_from_105(match: Any) -> None:
    env, state, _ = match
    params = env.check_params().replace(crowd=1e6)

    @jax.jit
    def joined(state: Any) -> Any:
        return env._joined(jax.random.key(5), state, params).monsters.present

    for time, comes in ((0, 0), (103, 0), (104, 6), (105, 0), (113, 0), (114, 6)):
        present = joined(state.replace(time=jnp.int32(time)))
        assert int(present.sum()) == comes


def test_state_is_read_from_the_game(match: Any) -> None:
    """Two weapons at the first button, one at the second; a ball, a rocket and one that bursts."""
    env, state, _ = match
    values = dict.fromkeys((*env.game_variables, "HEALTH"), 0)
    values |= {"KILLCOUNT": 3, "ARMOR": 70, "SELECTED_WEAPON": 1, "AMMO2": 30, "AMMO5": 4}

    def told_by(names: tuple[str, ...] = (), rows: Any = (), **more: int) -> Any:
        objects = np.array(rows, np.int64).reshape(-1, 5)
        return env.from_game(state, Game(names, objects, values | more))

    told = told_by(WEAPON1=2, WEAPON2=1)
    owned = [env.arsenal.slots[i].weapon for i in np.flatnonzero(told.arms.owned)]
    assert owned == [FIST, CHAINSAW, PISTOL]
    assert (int(told.armour), int(told.kills), told.arms.ammo.tolist()) == (70, 3, [30, 0, 4])
    assert int(told.arms.selected) == env.arsenal.index_of(CHAINSAW)
    assert int(told_by(SELECTED_WEAPON=5, WEAPON5=1).trigger.ammo) == 4
    x, y = env.items.places[5]
    item = [ITEMS[t.kind] for t in env.doom_map.things if t.kind in ITEMS][5]
    names = item.game_name, "Demon", "BaronBall", "Rocket", "Rocket", "Clip"
    spots = [(x, y), (ONE, 2), (ONE, 3), (ONE, 4), (ONE, 5), (x, y)]
    speed = [0, 0, 15, 20, 0, 0]
    rows = [(*spots[i], i, 0, speed[i] * ONE) for i in range(len(names))]
    told = told_by(names, rows, HEALTH=80)
    assert int(told.health) == 80
    assert np.flatnonzero(told.items).tolist() == [5]
    assert np.flatnonzero(told.monsters.living).tolist() == [env.horde.place_of(DEMON)]
    flying = [(p.position[p.flies].tolist()) for p in (told.fireballs, told.rockets)]
    assert flying == [[[ONE, 3]], [[ONE, 4]]]
    labels = {env.game_labels[name] for name in ("CellPack", "ClipBox", "ShellBox")}
    assert len(labels) == 1
