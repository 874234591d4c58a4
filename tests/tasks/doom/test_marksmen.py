"""Deadly Corridor, Defend the Line and Defend the Center by exact small cases."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxenstein.tasks.doom.collision import is_seen
from jaxenstein.tasks.doom.fight import fight, fly_fireballs
from jaxenstein.tasks.doom.fixed import ONE
from jaxenstein.tasks.doom.monster_attacks import attack
from jaxenstein.tasks.doom.monster_kinds import Act
from tests.tasks.doom.cases import first_state, make, place, places, player, started


@pytest.fixture(scope="module")
def corridor() -> Any:
    return started("doom-deadly-corridor")


def without_monsters(state: Any) -> Any:
    nobody = jnp.zeros_like(state.monsters.present)
    return state.replace(monsters=state.monsters.replace(present=nobody))


def test_player_does_not_move_in_the_first_seven_tics(corridor: Any) -> None:
    """The rewards of running ahead, from the game."""
    env, state, play = corridor
    reward, *_ = play(without_monsters(state), [env.index_of("forward")] * 40)
    assert (reward[:7] == 0).all()
    np.testing.assert_allclose(reward[7:11], [0.781, 1.489, 2.131, 2.712], atol=6e-4)


def test_pistol_is_raised_after_fifteen_tics(corridor: Any) -> None:
    env, state, play = corridor
    info = play(without_monsters(state), [env.index_of("attack")] * 40).info
    assert np.flatnonzero(info["shots"]).tolist() == [19, 33]
    assert info["ammo"][-1] == 50


def test_armour_pays_and_ends_the_episode_one_tic_later(corridor: Any) -> None:
    env, state, play = corridor
    near = env.at_pose(without_monsters(state), place(1250, 0), place(0, 0), jnp.uint32(0))
    near = near.replace(time=jnp.int32(20))
    reward, ends, info, _ = play(near, [env.index_of("forward")] * 40)
    first = int(np.flatnonzero(reward > 500)[0])
    # It lies at 1312, 36 units reach it: the way until then adds up.
    assert 1276 < 1250 + float(reward[: first + 1].sum()) - 1000 < 1284
    assert np.flatnonzero(ends).tolist()[:1] == [first + 1]
    assert np.flatnonzero(info["success"]).tolist()[:1] == [first]


def test_walls_hide_monsters_in_an_alcove(corridor: Any) -> None:
    """From (608, 64) the way to (x, 0) passes y = 32 in the middle, and there it opens at 448."""
    env, *_ = corridor
    marksman = place(608, 64)
    assert is_seen(marksman, place(289, 0), env.horde.opaque)
    assert not is_seen(marksman, place(287, 0), env.horde.opaque)


def test_bullets_scatter_and_damage_is_a_multiple_of_three(corridor: Any) -> None:
    env, state, _ = corridor
    horde, monsters = env.horde, state.monsters
    aims = jnp.asarray(horde.missile) + 1
    assert (horde.acts[np.asarray(aims)] == Act.SHOOT).all()
    monsters = monsters.replace(frame=aims)

    @jax.jit
    def shoot(key: jax.Array) -> jax.Array:
        bits = jax.random.bits(key, (6, 3), jnp.uint32)
        everyone = jnp.ones(6, bool)
        return attack(horde, monsters, everyone, place(0, 0), bits)[0]

    lost = np.asarray(jax.vmap(shoot)(jax.random.split(jax.random.key(0), 400)))
    assert (lost % 3 == 0).all()
    kinds = {(thing.x, thing.y): i for i, thing in enumerate(env._marksmen)}
    shotgun, rifle = kinds[160, 64], kinds[160, -64]
    assert lost[:, rifle].max() == 15
    assert 15 < lost[:, shotgun].max() <= 45
    # The others are out of sight.
    assert not np.delete(lost, [shotgun, rifle], axis=1).any()
    # A body of half-width 16 at (-160, +-64) from there covers so many degrees to each side; the
    # error is the difference of two bytes, 0.352 degrees each.
    corners = np.array([[x, y] for x in (-16, 16) for y in (-16, 16)]) - [160, 64]
    angles = np.degrees(np.arctan2(-corners[:, 1], -corners[:, 0]))
    aim = np.degrees(np.arctan2(64, 160))
    byte = np.arange(256)
    error = (byte[:, None] - byte[None]) * 360 / 2**12
    share = np.mean((error >= angles.min() - aim) & (error <= angles.max() - aim))
    assert (lost[:, rifle] > 0).mean() == pytest.approx(share, abs=4 * (share / 400) ** 0.5)


@pytest.fixture(scope="module")
def line() -> Any:
    return started("doom-defend-the-line")


def test_dead_monsters_return_stronger_and_ammunition_grows(line: Any) -> None:
    env, state, play = line
    state = state.replace(health=jnp.int32(10000))
    reward, _, info, after = play(state, [env.index_of("attack")] * 6 + [0] * 99)
    present, health = after.monsters.present, after.monsters.health
    # As in the game: the bullet leaves in tic 8, and hits the demon that has come straight on.
    assert np.flatnonzero(info["shots"]).tolist() == [8]
    assert reward[8] == 1
    assert info["ammo"][:9].tolist() == [*range(80, 88), 87]
    demon = int(np.flatnonzero(~present[8])[0])
    assert env.horde.kinds[env.horde.kind_of[demon]].name == "demon"
    assert not present[8:98, demon].any()
    assert present[98, demon]
    assert health[98, demon] == 5


def test_fireball_kills_other_kinds_and_spares_its_own(line: Any) -> None:
    env, state, _ = line
    params = env.default_params

    @jax.jit
    def tic(near: Any) -> Any:
        key = jax.random.key(0)
        _, fought = fight(env, key, near, jnp.int32(0), params)
        calm = fought.replace(throws=jnp.zeros_like(fought.throws))
        return fly_fireballs(env, env.fireballs, key, near, calm, params)

    for victim, dies in ((3, True), (1, False)):
        spot = state.monsters.position[victim]
        balls = state.fireballs.replace(
            position=state.fireballs.position.at[0].set(spot + jnp.array([30 * ONE, 0])),
            velocity=state.fireballs.velocity.at[0].set(jnp.array([-10 * ONE, 0])),
            flies=state.fireballs.flies.at[0].set(True),
        )
        after, hits = tic(state.replace(fireballs=balls))
        assert int(hits) == 0
        assert not after.fireballs.flies.any()
        assert bool(after.monsters.living[victim]) != dies
        assert int(after.kills) == int(dies)


@pytest.fixture(scope="module")
def center() -> Any:
    return started("doom-defend-the-center")


def test_kill_pays_at_once_and_monster_respawns_after_90_tics(center: Any) -> None:
    env, state, play = center
    reward, ends, info, after = play(state, [env.index_of("attack")] * 10 + [0] * 96)
    there = after.monsters.present.sum(axis=1).tolist()
    # As in the game: the pistol is drawn in tic 6 and its bullet leaves in tic 10, straight
    # ahead, where a marine stands.
    assert np.flatnonzero(reward).tolist() == [10]
    assert reward[10] == 1
    assert there[:101] == [5] * 10 + [4] * 90 + [5]
    assert info["ammo"][-1] == 25
    assert not ends[-1]


def test_death_costs_one_and_ends_the_episode(center: Any) -> None:
    _, state, play = center
    beside = places((300, 0), (59, 0), (-300, 0), (300, 300), (-300, -300))
    now = jnp.ones(5, jnp.int32)
    near = state.monsters.replace(position=beside, tics=now)
    reward, ends, info, _ = play(state.replace(health=jnp.int32(1), monsters=near), [0] * 20)
    # The demon beside steps at once and bites 16 tics later.
    assert np.flatnonzero(ends)[0] == 16
    assert (reward[16], info["health"][16], info["died"][16]) == (-1, 0, True)


# Where the monsters are when ViZDoom 1.3.2 shows the player first, in any episode.
SEEN_FIRST = {
    "doom-defend-the-center": [
        *((743.0, 0.0), (219.734, 691.883), (-588.704, 426.263)),
        *((-587.29, -424.849), (221.148, -693.297)),
    ],
    "doom-defend-the-line": [
        *((64.0, 90.0), (64.0, 200.0), (64.0, 400.0)),
        *((74.0, 150.0), (56.929, 292.929), (74.0, 450.0)),
    ],
}


@pytest.mark.parametrize("name", SEEN_FIRST)
def test_first_state_is_after_the_first_move(name: str) -> None:
    """Demons step again in the second tic, and so do marines, who had begun two tics earlier."""
    env, params = make(name)
    state = first_state(env, params, 3)
    after = player(env, params)(state, [0] * 9, seed=3).state.monsters.position
    path = np.concatenate([state.monsters.position[None], after]) / ONE
    # The game's scripts have coarser sines.
    np.testing.assert_allclose(path[0], SEEN_FIRST[name], atol=0.5)
    steps = (np.diff(path, axis=0) != 0).any(axis=2)
    for monster, speed in enumerate(env.horde.speed):
        pace = {0: [], 10: [1, 3, 5, 7], 8: [1, 5]}[int(speed)]
        assert np.flatnonzero(steps[:8, monster]).tolist() == pace
