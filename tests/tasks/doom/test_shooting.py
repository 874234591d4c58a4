"""Shots and weapons by exact small cases, and against computations of another kind."""

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxenstein.pytree import PyTreeNode
from jaxenstein.tasks.doom.arsenal import Arsenal
from jaxenstein.tasks.doom.collision import (
    along,
    crosses,
    first_body,
    is_seen,
    overlap,
    segments,
    to_boxes,
    to_walls,
)
from jaxenstein.tasks.doom.fixed import ONE
from jaxenstein.tasks.doom.maps import Line
from jaxenstein.tasks.doom.weapons import PISTOL, ROCKET_LAUNCHER, Slot, Trigger, Weapon, pull
from tests.tasks.doom.cases import NO_WALLS, place, places, started

WALLS = segments([Line(100, -50, 100, 50, "-"), Line(-20, -80, 60, -60, "-")])


STEPS = np.arange(0, 400, 0.01)


def marched(ray: np.ndarray, inside: Any) -> float:
    """How far a point walks along a ray in small steps before it is inside."""
    met = inside(STEPS[:, None] * ray)
    return float(STEPS[met.argmax()]) if met.any() else float("inf")


def test_ray_hits_match_a_walking_point() -> None:
    draw = np.random.default_rng(0)
    for _ in range(12):
        angle = np.uint32(draw.integers(2**32))
        ray = np.asarray(along(jnp.uint32(angle)), np.float64)
        centre, half = draw.uniform(-200, 200, 2), draw.uniform(10, 60)
        walked = marched(ray, lambda at, c=centre, h=half: (np.abs(at - c) <= h).all(axis=1))
        found = to_boxes(jnp.float32(centre), jnp.float32(ray), jnp.float32(half))
        np.testing.assert_allclose(float(found), walked, atol=0.02)
        ends = draw.uniform(-200, 200, (2, 2))
        way = ends[1] - ends[0]

        def is_at_wall(at: np.ndarray, start: np.ndarray = ends[0], way: np.ndarray = way) -> Any:
            part = np.clip((at - start) @ way / (way @ way), 0, 1)[:, None]
            return np.hypot(*(at - start - part * way).T) < 0.02

        wall = ends.reshape(1, 4).astype(np.float32)
        found = float(to_walls(place(0, 0), jnp.float32(ray), wall))
        cosine = abs(ray[0] * way[1] - ray[1] * way[0]) / np.hypot(*way)
        walked = marched(ray, is_at_wall)
        if np.isfinite(found) and found < 399:
            np.testing.assert_allclose(found, walked, atol=0.05 / cosine)
        else:
            assert not np.isfinite(walked)


def test_point_behind_a_wall_is_not_visible() -> None:
    assert not is_seen(place(0, 0), place(200, 0), WALLS)
    assert is_seen(place(0, 0), place(99, 0), WALLS)
    assert is_seen(place(0, 0), place(200, 200), WALLS)
    assert not is_seen(place(0, 0), place(0, -100), WALLS)


@pytest.mark.parametrize(("off", "hits"), [(31, True), (31 + 1 / ONE, False), (-31, True)])
def test_shot_just_hits_or_just_misses(off: float, hits: bool) -> None:
    """A shot hits a body exactly at its edge, and misses 1 / 65536 map unit beside it."""
    bodies = jnp.stack([place(300, off), place(90, 500)])
    widths = np.array([31, 31])
    there = jnp.ones(2, bool)
    ray = along(jnp.uint32(0))
    struck = first_body(place(0, 0), ray, bodies, widths, there, NO_WALLS)
    assert struck.tolist() == [hits, False]


def test_nearest_body_or_wall_stops_a_shot() -> None:
    bodies = jnp.stack([place(300, 0), place(90, 0), place(60, 10)])
    widths, ray = np.array([20, 20, 20]), along(jnp.uint32(0))

    def struck(there: list[bool], walls: np.ndarray = NO_WALLS, reach: float = 999) -> list[bool]:
        hit = first_body(place(0, 0), ray, bodies, widths, jnp.array(there), walls, reach)
        return hit.tolist()

    assert struck([True, True, True]) == [False, False, True]
    assert struck([True, True, False]) == [False, True, False]
    assert struck([True, False, False]) == [True, False, False]
    assert struck([True, False, False], WALLS) == [False, False, False]
    assert struck([True, True, False], reach=70) == [False, True, False]
    assert struck([True, True, False], reach=69) == [False, False, False]


def test_bodies_in_a_doorway_touch_and_do_not_overlap() -> None:
    one, other = place(0, 0), place(40, 0)
    assert not overlap(one, jnp.int32(20), other, jnp.int32(20))
    assert overlap(one, jnp.int32(20), other - jnp.array([1, 0]), jnp.int32(20))
    door = segments([Line(0, 20, 0, 100, "-"), Line(0, -100, 0, -20, "-")])
    assert not crosses(place(0, 0), jnp.float32(20), door)
    assert crosses(place(0, 0.01), jnp.float32(20), door)
    assert crosses(place(0, 0), jnp.float32(20.1), door)


def test_box_wall_crossings_match_sampling() -> None:
    draw = np.random.default_rng(1)
    wall = np.array([[-30, -10, 50, 40]], np.float32)
    points = wall[0, :2] + np.linspace(0, 1, 2001)[:, None] * (wall[0, 2:] - wall[0, :2])
    centres = draw.uniform(-70, 70, (60, 2))
    sampled = (np.abs(points - centres[:, None]) < 20).all(axis=-1).any(axis=-1)
    found = crosses(places(*centres.tolist()), jnp.float32(20), wall)
    np.testing.assert_array_equal(found, sampled)


# Tics with ATTACK held (1) and what the arsenal is given: the tics in which ViZDoom's weapon fires.
PULLED: list[tuple[Weapon, list[int], dict[str, int], list[int]]] = [
    (PISTOL, [1] * 40, {}, [4, 18, 32]),
    (PISTOL, [1] + [0] * 13 + [1] * 10, {}, [4, 18]),
    (PISTOL, [1] * 14 + [0] + [1] * 12, {}, [4, 23]),
    (PISTOL, [1] * 25, {"raise_tics": 6}, [10, 24]),
    (PISTOL, [1] * 60, {"shots": 2}, [4, 18]),
    (PISTOL, [1] * 20, {"shots": 0}, []),
    # If ATTACK is held while a launcher is raised, it must be released first.
    (ROCKET_LAUNCHER, [0] * 3 + [1] * 50, {"raise_tics": 3}, [11, 31, 51]),
    (ROCKET_LAUNCHER, [0] * 5 + [1] + [0] * 20, {"raise_tics": 3}, [13]),
    (ROCKET_LAUNCHER, [1] * 50, {"raise_tics": 3}, []),
    (ROCKET_LAUNCHER, [0, 0] + [1] * 50, {"raise_tics": 3}, []),
    (ROCKET_LAUNCHER, [1] * 9 + [0] + [1] * 20, {"raise_tics": 3}, [18]),
]


@pytest.mark.parametrize(("weapon", "held", "given", "expected"), PULLED)
def test_weapon_fires_in_the_tics_of_the_game(
    weapon: Weapon, held: list[int], given: dict[str, int], expected: list[int]
) -> None:
    trigger = Arsenal([Slot(weapon)], **given).trigger()
    padded = np.pad(np.array(held, bool), (0, 64 - len(held)))
    fires = np.asarray(pulled(weapon)(trigger, padded))[: len(held)]
    assert np.flatnonzero(fires).tolist() == expected


@functools.cache
def pulled(weapon: Weapon) -> Any:
    """A function of a trigger and bool[64], ATTACK in each tic: the tics in which it fires."""
    step = functools.partial(pull, weapon)
    return jax.jit(lambda trigger, held: jax.lax.scan(step, trigger, held)[1])


def test_only_held_trigger_scatters_shots() -> None:
    """By 110 steps of 2**18: 2.4 degrees, which is 42 map units aside at a thousand."""
    arsenal = Arsenal([Slot(PISTOL)])
    ahead = jnp.stack([place(1000, 0), place(1000, 42)])
    targets = ahead, np.array([20, 20], np.int32), jnp.ones(2, bool)
    bits = jnp.array([200 | 90 << 8 | 3 << 16], jnp.uint32)

    def damage(held: bool) -> list[int]:
        shooter = Aiming(arsenal.trigger().replace(held=jnp.bool_(held)), jnp.uint32(0))
        shot = jnp.bool_(True), place(0, 0)
        return arsenal.bullets(shooter, shot, targets, NO_WALLS, bits).tolist()

    assert damage(held=False) == [5, 0]
    assert damage(held=True) == [0, 5]


class Aiming(PyTreeNode):
    """The parts of a state that a shot depends on."""

    trigger: Trigger
    angle: jax.Array


def test_basic_pays_a_hit_in_its_tic_and_then_ends() -> None:
    env, state, play = started("doom-basic")
    actions = [int(env.index_of("attack"))] * 6
    reward, ends, info, _ = play(state.replace(target=place(0, 32 + 31)), actions)
    assert reward.tolist() == [-1, -1, -1, -1, 100, -1]
    assert ends.tolist() == [False] * 5 + [True]
    assert info["ammo"][-1] == 49
    reward, ends, *_ = play(state.replace(target=place(0, 32 + 31.5)), actions)
    assert reward.tolist() == [-1, -1, -1, -1, -6, -1]
    assert not ends[-1]
