"""Monsters by exact small cases: how they wake, walk, strike, die, and get in each other's way."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxenstein.tasks.doom.fixed import ONE
from jaxenstein.tasks.doom.monster_ai import act, approximate
from jaxenstein.tasks.doom.monster_attacks import attack
from jaxenstein.tasks.doom.monster_kinds import CHAINSAW_MARINE, DEMON, IMP, Act, standing
from jaxenstein.tasks.doom.monsters import Horde, Monsters
from tests.tasks.doom.cases import NO_WALLS, place, places, walked

PAIR = Horde([DEMON, CHAINSAW_MARINE], walls=NO_WALLS)
EAST, WEST = np.uint32(0), np.uint32(1 << 31)


def some(facing: np.uint32, *spots: tuple[float, float]) -> Monsters:
    count = len(spots)
    everywhere = jnp.full(count, facing)
    return PAIR.placed(places(*spots), everywhere, jnp.ones(count, bool), jnp.array([150, 100]))


def watch(facing: np.uint32, *spots: tuple[float, float], noise: int = -1) -> Any:
    """Forty tics: positions, acts of the frames, who strikes."""
    given = place(0, 0), jnp.arange(40) == noise, jax.random.key(0)
    after, strikes = jax.device_get(walked(PAIR, some(facing, *spots), *given))
    return after.position, np.asarray(PAIR.acts)[after.frame], strikes


def test_monster_facing_the_player_moves_in_the_tics_of_the_game() -> None:
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


def test_monster_facing_away_waits_for_a_shot() -> None:
    position, acts, _ = watch(EAST, (700, 0), (800, 0), noise=25)
    assert (acts[:26] == Act.WATCH).all()
    assert (position[:26] == position[0]).all()
    assert acts[31].tolist() == [Act.CHASE, Act.CHASE]


def test_demon_bites_after_16_tics_and_marine_keeps_sawing() -> None:
    _, _, strikes = watch(WEST, (0, 59), (-59, 0))
    # Noticed at 9 and 7, in reach at once; the bite at 9 + 16, the saw at 7 + 4 and every 4.
    assert np.flatnonzero(strikes[:, 0]).tolist()[:1] == [25]
    assert np.flatnonzero(strikes[:, 1]).tolist() == list(range(11, 40, 4))


def test_monsters_in_a_crowd_do_not_overlap() -> None:
    kinds = [DEMON, CHAINSAW_MARINE] * 4
    horde, count = Horde(kinds, walls=NO_WALLS), len(kinds)
    angle = np.arange(count) * (2 * np.pi / count)
    spots = places(*np.stack([np.cos(angle), np.sin(angle)], 1).tolist()) * 200
    monsters = horde.placed(
        spots, jnp.zeros(count, jnp.uint32), jnp.ones(count, bool), jnp.full(count, 9)
    ).replace(alarmed=jnp.ones(count, bool))
    given = place(0, 0), jnp.zeros(200, bool), jax.random.key(84)
    path = np.asarray(walked(horde, monsters, *given)[0].position).astype(np.int64)
    gap = np.abs(path[:, :, None] - path[:, None]).max(axis=-1)
    reach = (horde.half_width[:, None] + horde.half_width) * ONE
    assert ((gap >= reach) | np.eye(count, dtype=bool)).all()
    assert (np.abs(path).max(axis=-1) >= (horde.half_width + 16) * ONE).all()
    # They have come: in the end all but those behind others are near.
    assert np.median(np.abs(path[-1]).max(axis=-1)) < 120 * ONE


def test_distance_matches_the_game() -> None:
    assert approximate(jnp.array([[30, -40], [0, 7]], jnp.int32)).tolist() == [55, 7]


@pytest.mark.parametrize(("distance", "hurts"), [(59.9, True), (60, False)])
def test_bite_reaches_60_units(distance: float, hurts: bool) -> None:
    monsters = some(WEST, (distance, 0), (500, 500))
    monsters = monsters.replace(frame=jnp.asarray(PAIR.melee) + jnp.array([2, 1]))
    bits = jnp.full((2, 1), 3 << 16, jnp.uint32)
    both = jnp.ones(2, bool)
    lost, friendly, *_ = attack(PAIR, monsters, both, place(0, 0), bits)
    # A die of ten from byte 3 shows 4; a demon's bite is four times that.
    assert lost.tolist() == [16 if hurts else 0, 0]
    assert friendly.tolist() == [0, 0]


def test_saw_hits_a_monster_in_between() -> None:
    monsters = some(WEST, (30, 0), (59, 0))
    monsters = monsters.replace(frame=jnp.asarray(PAIR.melee) + jnp.array([0, 1]))
    bits = jnp.full((2, 1), 9 << 16, jnp.uint32)
    strikes = jnp.array([False, True])
    lost, friendly, *_ = attack(PAIR, monsters, strikes, place(0, 0), bits)
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


def test_flinching_monster_shoots_back() -> None:
    """Even one that would wait, or leave it for now as far away as this, but not within a leg."""
    horde = Horde([standing(IMP)] * 2, walls=NO_WALLS)
    start = horde.placed(
        places((1000, 0), (1000, 200)), jnp.full(2, WEST), jnp.ones(2, bool), jnp.array([60, 60])
    )
    walking = jnp.asarray(horde.walk)
    start = start.replace(frame=walking, tics=jnp.ones(2, jnp.int32), steps_left=jnp.array([0, 4]))
    # The lowest byte of the first number decides who dares: none does with zero.
    bits = jnp.zeros((2, 2), jnp.uint32)

    @jax.jit
    def after(monsters: Monsters) -> Monsters:
        return act(horde, monsters, place(0, 0), jnp.bool_(False), bits)[0]

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
