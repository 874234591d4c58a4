"""The cast against the float64 reference, over random maps, doors and poses."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given

from jaxenstein.engine.camera import Camera
from jaxenstein.engine.level import compile_level, level_from_walls
from jaxenstein.engine.raycast import Hits, cast
from tests.reference import raycaster
from tests.reference.comparison import Tally, compare
from tests.reference.search import SEEDS, search_settings
from tests.reference.worlds import World, draw_world

EXCUSED_AT_MOST = 0.02


@dataclasses.dataclass(frozen=True)
class Case:
    """One shape of map and image, so one compilation (two if a random border is solid)."""

    rows: int
    columns: int
    bordered: bool
    faces: int
    width: int
    field_of_view: float

    def __str__(self) -> str:
        """Name of the test."""
        border = "bordered" if self.bordered else "open"
        view = f"{self.width}px{self.field_of_view:.0f}"
        return f"{self.columns}x{self.rows}-{border}-{self.faces}face-{view}"

    def draw(self, seed: int, exact: bool) -> World:
        """A world for this case; small images get more poses."""
        return draw_world(
            seed,
            (self.rows, self.columns),
            bordered=self.bordered,
            faces=self.faces,
            poses=max(8, 512 // self.width),
            exact=exact,
        )

    @property
    def camera(self) -> Camera:
        """The camera; its height does not matter here."""
        return Camera(4, self.width, self.field_of_view)


CASES = [
    Case(3, 3, True, 1, 7, 60),
    Case(3, 3, False, 4, 7, 90),
    Case(5, 9, False, 4, 64, 60),
    Case(9, 5, False, 1, 1, 90),
    Case(32, 26, True, 1, 64, 60),
    Case(33, 40, False, 4, 160, 90),
    Case(64, 64, True, 4, 64, 120),
    Case(70, 70, False, 1, 7, 30),
    Case(128, 128, True, 1, 64, 60),
    Case(128, 128, False, 4, 7, 120),
    Case(3, 128, False, 1, 64, 30),
    Case(128, 3, False, 1, 64, 90),
]


@functools.cache
def caster(camera: Camera):
    """A jitted cast over a batch of poses in one level, which is an argument."""

    @jax.jit
    def run(level, closed, positions, headings) -> Hits:
        return jax.vmap(
            lambda p, h: cast(level=level, closed=closed, position=p, heading=h, camera=camera)
        )(positions, headings)

    return run


@pytest.mark.parametrize("exact", [False, True], ids=["anywhere", "exact"])
@pytest.mark.parametrize("case", CASES, ids=str)
def test_random_poses(case: Case, exact: bool) -> None:
    """Exact poses are on grid lines, in corners and centres, and face along axes and diagonals."""
    tally = Tally()

    @search_settings(25)
    @given(seed=SEEDS)
    def check(seed: int) -> None:
        world = case.draw(seed, exact)
        level = compile_level(world.walls, world.doors)
        hits = caster(case.camera)(level, world.closed, world.positions, world.headings)
        compare(world, case.camera, hits, tally)

    check()
    print(f"{tally.excused} of {tally.rays} rays excused")
    # From a corner of a wall every ray is ambiguous; so is the middle one along a grid line.
    at_most = (0.35 if case.width > 7 else 0.5) if exact else EXCUSED_AT_MOST
    assert tally.excused < at_most * tally.rays


@pytest.mark.parametrize(
    ("rise", "beyond", "excused"),
    [(1.0, 1e-4, True), (1.0, 5e-4, False), (0.01, 1e-3, True), (0.01, 2e-3, False)],
)
def test_only_rays_near_a_corner_may_hit_the_neighbour(
    rise: float, beyond: float, excused: bool
) -> None:
    """A ray is said to hit a tile, but hits the next one this far from their border."""
    solid = np.zeros((9, 9), bool)
    solid[5] = True
    eye, ray = np.array([3 + beyond, 5 - rise]), np.array([1.0, rise])
    tile = np.array([3, 5])
    said = raycaster.is_plausible(solid, eye, ray, 1.0, tile, raycaster.NORTH)
    assert said == excused
    assert raycaster.is_plausible(solid, eye, ray, 1.0, np.array([4, 5]), raycaster.NORTH)


def cast_one(walls: np.ndarray, eye: tuple[float, float], heading: float) -> Hits:
    """The hits of seven rays in a map without doors."""
    level = compile_level(walls, np.zeros((0, 2), np.int32))
    position, angle = np.array([eye], np.float32), np.array([heading], np.float32)
    return caster(Camera(4, 7, 60))(level, np.zeros(0, bool), position, angle)


@pytest.mark.parametrize("bordered", [True, False])
@pytest.mark.parametrize("quarter", range(4))
def test_no_ray_slips_through_a_corner(quarter: int, bordered: bool) -> None:
    """From the very corner of a solid tile, or an ulp before it, into that tile."""
    diagonal = np.pi / 4 + quarter * np.pi / 2
    side = np.sign([np.cos(diagonal), np.sin(diagonal)])
    walls = np.full((9, 9), 2, np.uint8)
    walls[int(bordered) : 9 - int(bordered), int(bordered) : 9 - int(bordered)] = 0
    column, row = np.where(side < 0, 3, 4)
    walls[row, column] = 5
    corner = np.full(2, 4, np.float32)
    before = np.nextafter(corner, (corner - side).astype(np.float32))
    # The corner itself belongs to the tile south-east of it.
    for x, y in (before,) if quarter == 0 else (before, corner):
        hits = cast_one(walls, (float(x), float(y)), diagonal)
        np.testing.assert_allclose(hits.depth[0], 0, atol=1e-5)
        assert (np.asarray(hits.wall) == 5).all()


@pytest.mark.parametrize("falling", [True, False])
def test_no_view_between_tiles_that_touch_at_a_corner(falling: bool) -> None:
    """From many places, the middle ray of an odd image goes right through that corner."""
    walls = np.zeros((17, 17), np.uint8)
    corner = 8
    walls[corner, corner - falling] = walls[corner - 1, corner - 1 + falling] = 5
    rng = np.random.default_rng(1)
    # Rays from grid points and centres hit it exactly; others up to rounding.
    places = np.stack(np.meshgrid(*[np.arange(0.5, 17, 0.5)] * 2), -1).reshape(-1, 2)
    places = np.concatenate([places, rng.uniform(0.3, 16.7, (800, 2))]).astype(np.float32)
    offsets = corner - places.astype(np.float64)
    sides = offsets[:, 0] * offsets[:, 1] * (1 if falling else -1)
    places, offsets = places[sides > 1e-2], offsets[sides > 1e-2]
    headings = np.arctan2(offsets[:, 1], offsets[:, 0]).astype(np.float32)
    level = compile_level(walls, np.zeros((0, 2), np.int32))
    camera = Camera(4, 7, 60)
    hits = caster(camera)(level, np.zeros(0, bool), places, headings)

    # Rays of the reference to either side give the distances of the two tiles.
    forward = offsets / np.linalg.norm(offsets, axis=1, keepdims=True)
    aside = 1e-3 * forward[:, ::-1] * [-1, 1]
    solid = np.pad(walls != 0, 1, constant_values=True)
    seen = [raycaster.march(solid, places + 1 + way * aside, forward) for way in (-1, 1)]
    nearest, farthest = (f([s.depth for s in seen], axis=0) for f in (np.minimum.reduce, np.max))
    reached = np.linalg.norm(offsets, axis=1)
    np.testing.assert_array_less(farthest, 1.5 * reached + 1.0)
    depth = np.asarray(hits.depth)[:, 3]
    assert (depth > nearest - 1e-3).all()
    assert (depth < np.maximum(farthest, reached) + 1e-3).all()


@pytest.mark.parametrize("bordered", [True, False])
def test_eye_one_ulp_before_a_wall_is_outside(bordered: bool) -> None:
    walls = np.full((20, 20), 2, np.uint8)
    walls[int(bordered) : 20 - int(bordered), int(bordered) : 20 - int(bordered)] = 0
    walls[:, 9] = 5
    eye = float(np.nextafter(np.float32(9), np.float32(0)))
    for y in (2.0, 2.5):
        hits = cast_one(walls, (eye, y), 0)
        np.testing.assert_allclose(hits.depth[0], 0, atol=1e-5)
        assert (np.asarray(hits.wall) == 5).all()
        back = cast_one(walls, (eye, y + 0.25), np.pi)
        assert float(back.depth[0, 3]) == pytest.approx(9 - int(bordered), rel=1e-5)


def test_depth_is_exact_beside_a_wall_far_from_the_origin() -> None:
    """The position in a tile must not be rounded to the precision of a large coordinate."""
    walls = np.zeros((3, 128), np.uint8)
    walls[:, 120] = 5
    eye = np.float32(119.99)
    hits = cast_one(walls, (float(eye), 1.5), 0)
    np.testing.assert_allclose(hits.depth[0], 120 - float(eye), rtol=1e-4)


@pytest.mark.parametrize("length", [30, 126])
@pytest.mark.parametrize("turn", range(4))
def test_long_corridors_have_no_phantom_walls(length: int, turn: int) -> None:
    """From one end of a corridor to the other; 126 tiles in maps of 3x128 and 128x3."""
    walls = np.full((3, length + 2), 2, np.uint8)
    walls[1, 1:-1] = 0
    for from_end in (0.5, 1.0, 0.25):
        place = 1 + from_end if turn < 2 else length + 1 - from_end
        eye = (place, 1.5) if turn % 2 == 0 else (1.5, place)
        turned = walls if turn % 2 == 0 else walls.T.copy()
        hits = cast_one(turned, eye, turn * np.pi / 2)
        assert float(hits.depth[0, 3]) == pytest.approx(length - from_end, rel=1e-5)


@pytest.mark.parametrize("bordered", [True, False])
@pytest.mark.parametrize("place", [2, 31, 32, 63, 64, 97, 126])
def test_doors_stop_rays_only_while_closed(place: int, bordered: bool) -> None:
    """In each word of the occupancy, and with and without a margin."""
    walls = np.full((3, 128), 7, np.uint8)
    walls[1, 1:-1] = 0
    if not bordered:
        walls[1, 0] = 0
    walls[1, place] = 30
    doors = np.array([(place, 1)], np.int32)
    camera = Camera(4, 7, 60)
    for tall in (False, True):
        level = compile_level(walls.T.copy() if tall else walls, doors[:, ::-1] if tall else doors)
        eyes = np.array([(1.5, 1.25)], np.float32)[:, :: -1 if tall else 1]
        headings = np.array([np.pi / 2 if tall else 0], np.float32)
        for closed in (True, False):
            hits = caster(camera)(level, np.array([closed]), eyes, headings)
            tile, depth = np.asarray(hits.tile)[0, 3], float(hits.depth[0, 3])
            assert tile[int(tall)] == (place if closed else 127)
            assert int(hits.wall[0, 3]) == (30 if closed else 7)
            assert depth == pytest.approx((place if closed else 127) - 1.5, rel=1e-5)


@pytest.mark.parametrize("shape", [(9, 7), (34, 70)])
def test_levels_in_the_state_equal_constants(shape: tuple[int, int]) -> None:
    """`level_from_walls` inside jit, another map in each lane, against `compile_level`."""
    camera = Camera(4, 33, 75)
    lanes = 5

    @jax.jit
    def generated(walls, doors, closed, position, heading) -> Hits:
        def one(w, d, c, p, h):
            level = level_from_walls(w, d)
            return cast(level=level, closed=c, position=p, heading=h, camera=camera)

        return jax.vmap(one)(walls, doors, closed, position, heading)

    @search_settings(8)
    @given(seed=SEEDS)
    def check(seed: int) -> None:
        worlds = [draw_world(seed + i, shape, bordered=True, poses=1) for i in range(lanes)]
        stacked = [
            np.stack([getattr(world, name) for world in worlds])
            for name in ("walls", "doors", "closed")
        ]
        poses = [
            np.concatenate([getattr(world, name) for world in worlds])
            for name in ("positions", "headings")
        ]
        together = generated(*stacked, *poses)
        for i, world in enumerate(worlds):
            mine = jax.tree.map(lambda leaf, i=i: leaf[i : i + 1], together)
            compare(world, camera, mine, Tally())
            level = compile_level(world.walls, world.doors)
            alone = caster(camera)(level, world.closed, world.positions, world.headings)
            same = np.asarray(alone.tile == mine.tile).all(axis=-1)
            np.testing.assert_allclose(alone.depth[same], mine.depth[same], rtol=1e-5)
            assert same.mean() > 0.95

    check()


def test_absent_doors_are_in_the_border() -> None:
    walls = jnp.full((5, 5), 3, jnp.uint8).at[1:-1, 1:-1].set(0).at[2, 2].set(31)
    doors = jnp.array([(0, 0), (2, 2), (0, 0)], jnp.int32)
    level = jax.jit(level_from_walls)(walls, doors)
    camera = Camera(4, 1, 60)
    eye, heading = np.array([[1.5, 2.5]], np.float32), np.zeros(1, np.float32)
    for closed, depth in ((np.array([True, False, True]), 2.5), (np.ones(3, bool), 0.5)):
        hits = caster(camera)(level, closed, eye, heading)
        assert float(hits.depth[0, 0]) == pytest.approx(depth)


def test_doors_can_have_their_own_face_ids() -> None:
    walls = np.zeros((4, 3, 3), np.uint8)
    walls[:, 1, 1] = [11, 12, 13, 14]
    level = compile_level(walls, np.array([(1, 1)], np.int32))
    eyes = np.array([(0.5, 1.5), (2.5, 1.5), (1.5, 0.5), (1.5, 2.5)], np.float32)
    headings = np.array([0, np.pi, np.pi / 2, -np.pi / 2], np.float32)
    hits = caster(Camera(4, 1, 60))(level, np.array([True]), eyes, headings)
    assert np.asarray(hits.wall)[:, 0].tolist() == [11, 12, 13, 14]
    assert np.asarray(hits.depth)[:, 0] == pytest.approx([0.5] * 4)
    hits = caster(Camera(4, 1, 60))(level, np.array([False]), eyes, headings)
    assert np.asarray(hits.depth)[:, 0] == pytest.approx([2.5] * 4)
