"""Monsters by exact small cases: how they wake, walk, strike, die, and get in each other's way."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein.tasks.doom.fixed import ONE, to_fixed
from jaxenstein.tasks.doom.monster_ai import act, approximate
from jaxenstein.tasks.doom.monster_attacks import attack
from jaxenstein.tasks.doom.monster_kinds import CHAINSAW_MARINE, DEMON, IMP, Act, standing
from jaxenstein.tasks.doom.monsters import Horde, Monsters

NO_WALLS = np.zeros((0, 4), np.float32)
SIZE: dict[str, Any] = {"height": 4, "width": 6, "autoreset": None}
PAIR = Horde([DEMON, CHAINSAW_MARINE], walls=NO_WALLS)
EAST, WEST = np.uint32(0), np.uint32(1 << 31)


def places(*spots: tuple[float, float]) -> jax.Array:
    return jnp.array([[to_fixed(x), to_fixed(y)] for x, y in spots], jnp.int32)


def some(facing: np.uint32, *spots: tuple[float, float]) -> Monsters:
    count = len(spots)
    everywhere = jnp.full(count, facing)
    return PAIR.placed(places(*spots), everywhere, jnp.ones(count, bool), jnp.array([150, 100]))


@jax.jit
def watched(monsters: Monsters, player: jax.Array, noise: jax.Array, key: jax.Array) -> Any:
    """Forty tics: positions, acts of the frames, who strikes."""

    def tic(monsters: Monsters, inputs: tuple[jax.Array, jax.Array]) -> Any:
        heard, key = inputs
        bits = jax.random.bits(key, (2, 2), jnp.uint32)
        after, strikes = act(PAIR, monsters, player, heard, bits)
        acts = jnp.asarray(PAIR.acts)[after.frame]
        return after, (after.position, acts, strikes)

    noises = jnp.arange(40) == noise
    return jax.lax.scan(tic, monsters, (noises, jax.random.split(key, 40)))[1]


def watch(facing: np.uint32, *spots: tuple[float, float], noise: int = -1) -> Any:
    start = some(facing, *spots)
    out = watched(start, places((0, 0))[0], jnp.int32(noise), jax.random.key(0))
    return jax.tree.map(np.asarray, out)


def test_who_faces_the_player_steps_in_the_tics_of_the_game() -> None:
    """A demon looks after 10 tics and steps 10 units every 2; a marine after 8, 8 units every 4."""
    position, acts, _ = watch(WEST, (700, 0), (0, 700))
    # The demon's first leg: a turn around is not considered, and it has begun by facing east.
    moved = (np.diff(position, axis=0) != 0).any(axis=2)
    assert np.flatnonzero(moved[:, 0]).tolist() == list(range(8, 39, 2))
    steps = np.abs(np.diff(position[:, 0], axis=0)).max(axis=1)
    assert set(steps[steps > 0] // ONE) <= {7, 10}
    # The marine looks west, and the player is south of it: that is within a half circle.
    assert np.flatnonzero(moved[:, 1]).tolist() == list(range(6, 39, 4))
    assert acts[5].tolist() == [Act.WATCH, Act.WATCH]


def test_who_looks_away_waits_for_a_shot() -> None:
    position, acts, _ = watch(EAST, (700, 0), (800, 0), noise=25)
    assert (acts[:26] == Act.WATCH).all()
    assert (position[:26] == position[0]).all()
    assert acts[31].tolist() == [Act.CHASE, Act.CHASE]


def test_a_demon_bites_after_sixteen_tics_and_a_marine_saws_on() -> None:
    _, _, strikes = watch(WEST, (0, 59), (-59, 0))
    # Noticed at 9 and 7, in reach at once; the bite at 9 + 16, the saw at 7 + 4 and every 4.
    assert np.flatnonzero(strikes[:, 0]).tolist()[:1] == [25]
    assert np.flatnonzero(strikes[:, 1]).tolist() == list(range(11, 40, 4))


def test_nobody_overlaps_in_a_crowd() -> None:
    kinds = [DEMON, CHAINSAW_MARINE] * 4
    horde, count = Horde(kinds, walls=NO_WALLS), len(kinds)
    draw = np.random.default_rng(0)
    angle = np.arange(count) * (2 * np.pi / count)
    spots = places(*np.stack([np.cos(angle), np.sin(angle)], 1).tolist()) * 200
    monsters = horde.placed(
        spots, jnp.zeros(count, jnp.uint32), jnp.ones(count, bool), jnp.full(count, 9)
    ).replace(alarmed=jnp.ones(count, bool))
    player = places((0, 0))[0]

    @jax.jit
    def run(monsters: Monsters, key: jax.Array) -> jax.Array:
        def tic(monsters: Monsters, key: jax.Array) -> tuple[Monsters, jax.Array]:
            bits = jax.random.bits(key, (count, 2), jnp.uint32)
            noise = jnp.bool_(False)
            after, _ = act(horde, monsters, player, noise, bits)
            return after, after.position

        return jax.lax.scan(tic, monsters, jax.random.split(key, 200))[1]

    path = np.asarray(run(monsters, jax.random.key(int(draw.integers(99))))).astype(np.int64)
    gap = np.abs(path[:, :, None] - path[:, None]).max(axis=-1)
    reach = (horde.half_width[:, None] + horde.half_width) * ONE
    assert ((gap >= reach) | np.eye(count, dtype=bool)).all()
    assert (np.abs(path).max(axis=-1) >= (horde.half_width + 16) * ONE).all()
    # They have come: in the end all but those behind others are near.
    assert np.median(np.abs(path[-1]).max(axis=-1)) < 120 * ONE


def test_distance_is_the_games() -> None:
    assert approximate(jnp.array([[30, -40], [0, 7]], jnp.int32)).tolist() == [55, 7]


@pytest.mark.parametrize(("distance", "hurts"), [(59.9, True), (60, False)])
def test_a_bite_reaches_sixty_units(distance: float, hurts: bool) -> None:
    monsters = some(WEST, (distance, 0), (500, 500))
    monsters = monsters.replace(frame=jnp.asarray(PAIR.melee) + jnp.array([2, 1]))
    bits = jnp.full((2, 1), 3 << 16, jnp.uint32)
    both = jnp.ones(2, bool)
    lost, friendly, *_ = attack(PAIR, monsters, both, places((0, 0))[0], bits)
    # A die of ten from byte 3 shows 4; a demon's bite is four times that.
    assert lost.tolist() == [16 if hurts else 0, 0]
    assert friendly.tolist() == [0, 0]


def test_a_saw_hits_who_stands_between() -> None:
    monsters = some(WEST, (30, 0), (59, 0))
    monsters = monsters.replace(frame=jnp.asarray(PAIR.melee) + jnp.array([0, 1]))
    bits = jnp.full((2, 1), 9 << 16, jnp.uint32)
    strikes = jnp.array([False, True])
    lost, friendly, *_ = attack(PAIR, monsters, strikes, places((0, 0))[0], bits)
    assert lost.tolist() == [0, 0]
    assert friendly.tolist() == [20, 0]


def test_damage_kills_flinches_and_wakes() -> None:
    monsters = some(EAST, (100, 0), (200, 0))
    calm = jnp.full(2, 255 << 24, jnp.uint32)
    after = PAIR.hurt(monsters, jnp.array([149, 100]), calm)
    assert after.health.tolist() == [1, 0]
    assert after.living.tolist() == [True, False]
    assert np.asarray(PAIR.acts)[np.asarray(after.frame)].tolist()[0] == Act.CHASE
    assert int(after.frame[1]) == PAIR.die[1]
    hurts = PAIR.hurt(monsters, jnp.array([149, 0]), jnp.zeros(2, jnp.uint32))
    assert hurts.frame.tolist() == [PAIR.pain[0], PAIR.stand[1]]


def test_a_kill_pays_in_its_tic_and_another_comes_after_ninety() -> None:
    env, params = jaxenstein.make("doom-defend-the-center", **SIZE)
    step = jax.jit(lambda key, state, action: env.advance(key, state, action, params))
    state = env.reset(jax.random.key(0), params)[1]
    shoot, rewards, there = env.index_of("attack"), [], []
    terminated, info = True, {}
    for tic in range(106):
        action = shoot if tic < 10 else 0
        state, reward, terminated, info = step(jax.random.key(tic), state, action)
        rewards.append(float(reward))
        there.append(int(state.monsters.present.sum()))
    # As in the game: the pistol is drawn in tic 6 and its bullet leaves in tic 10, straight
    # ahead, where a marine stands.
    assert np.flatnonzero(rewards).tolist() == [10]
    assert rewards[10] == 1
    assert there[:10] == [5] * 10
    assert there[10:100] == [4] * 90
    assert there[100] == 5
    assert int(info["ammo"]) == 25
    assert not terminated


def test_death_costs_one_in_its_tic_and_ends() -> None:
    env, params = jaxenstein.make("doom-defend-the-center", **SIZE)
    step = jax.jit(lambda key, state, action: env.advance(key, state, action, params))
    state = env.reset(jax.random.key(0), params)[1].replace(health=jnp.int32(1))
    beside = places((300, 0), (59, 0), (-300, 0), (300, 300), (-300, -300))
    now = jnp.ones(5, jnp.int32)
    state = state.replace(monsters=state.monsters.replace(position=beside, tics=now))
    tic, terminated, reward, info = -1, False, 0.0, {}
    while not terminated and tic < 30:
        tic += 1
        state, reward, terminated, info = step(jax.random.key(tic), state, 0)
    # The demon beside steps at once and bites 16 tics later.
    assert tic == 16
    assert (float(reward), int(info["health"]), bool(info["died"])) == (-1, 0, True)


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
def test_the_first_step_has_been_taken(name: str) -> None:
    """Demons step again in the second tic, and so do marines, who had begun two tics earlier."""
    env: Any
    env, params = jaxenstein.make(name, **SIZE)

    @jax.jit
    def play(key: jax.Array) -> jax.Array:
        def step(state: Any, key: jax.Array) -> Any:
            return env.advance(key, state, jnp.int32(0), params)[0], state.monsters.position

        return jax.lax.scan(step, env.init_state(key, params), jax.random.split(key, 10))[1]

    path = np.asarray(play(jax.random.key(3))) / ONE
    # The game's scripts have coarser sines.
    np.testing.assert_allclose(path[0], SEEN_FIRST[name], atol=0.5)
    steps = (np.diff(path, axis=0) != 0).any(axis=2)
    for monster, speed in enumerate(env.horde.speed):
        pace = {0: [], 10: [1, 3, 5, 7], 8: [1, 5]}[int(speed)]
        assert np.flatnonzero(steps[:8, monster]).tolist() == pace


def test_who_flinches_shoots_back() -> None:
    """Even one that would wait, or leave it for now as far away as this, but not within a leg."""
    horde = Horde([standing(IMP)] * 2, walls=NO_WALLS)
    start = horde.placed(
        places((1000, 0), (1000, 200)),
        jnp.full(2, WEST),
        jnp.ones(2, bool),
        jnp.array([60, 60]),
    )
    walking = jnp.asarray(horde.walk)
    start = start.replace(frame=walking, tics=jnp.ones(2, jnp.int32), steps_left=jnp.array([0, 4]))
    # The lowest byte of the first number decides who dares: none does with zero.
    bits = jnp.zeros((2, 2), jnp.uint32)

    def after(monsters: Monsters) -> Monsters:
        quiet, player = jnp.bool_(False), places((0, 0))[0]
        return act(horde, monsters, player, quiet, bits)[0]

    aims = after(start).frame == jnp.asarray(horde.missile)
    assert aims.tolist() == [False, False]
    hit = horde.hurt(start, jnp.array([5, 5]), jnp.zeros(2, jnp.uint32))
    assert hit.just_hit is not None
    assert hit.just_hit.tolist() == [True, True]
    unmoved = horde.hurt(start, jnp.array([5, 5]), jnp.full(2, 0xFFFFFFFF, jnp.uint32))
    assert unmoved.just_hit is not None
    assert unmoved.just_hit.tolist() == [False, False]
    again = after(hit.replace(frame=walking, tics=jnp.ones(2, jnp.int32), reaction=start.reaction))
    assert (again.frame == jnp.asarray(horde.missile)).tolist() == [True, False]
    assert again.just_hit is not None
    assert again.just_hit.tolist() == [False, True]
