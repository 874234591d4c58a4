"""The motion in JAX beside plain Python integers, and beside the game itself."""

from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fidelity.doom_motion import BUTTONS, replay
from fidelity.doom_recording import load
from jaxenstein.tasks.doom.collision import build_geometry, load_geometry
from jaxenstein.tasks.doom.maps import Line, ends_of, load_map, parse_map
from jaxenstein.tasks.doom.physics import Body, Buttons, numbered, tic
from jaxenstein.tasks.doom.slide import first_wall
from tests.reference.doom import ONE, Player, Wall, World

RECORDINGS = Path(__file__).parent / "recordings"


def world_of(name: str) -> World:
    return World([Wall(*ends) for ends in ends_of(load_map(name).walls).reshape(-1, 4).tolist()])


def inside(world: World, x: int, y: int) -> bool:
    """Whether a line from a point to the west crosses an odd number of walls."""
    crossed = [
        w.vertical and w.x0 * ONE < x and min(w.y0, w.y1) * ONE <= y < max(w.y0, w.y1) * ONE
        for w in world.walls
    ]
    return sum(crossed) % 2 == 1


def cases(world: World, count: int, seed: int) -> list[tuple[Player, Buttons]]:
    """Players that stand free with random velocities, most of them close to walls."""
    rng = np.random.default_rng(seed)
    players: list[Player] = []
    while len(players) < count:
        wall = world.walls[int(rng.integers(len(world.walls)))]
        along, across = rng.uniform(-0.2, 1.2), rng.choice([0, 1, rng.uniform(0, 30)])
        x = round(
            ONE * (wall.x0 + along * (wall.x1 - wall.x0) + rng.choice([-1, 1]) * (16 + across))
        )
        y = round(
            ONE * (wall.y0 + along * (wall.y1 - wall.y0) + rng.choice([-1, 1]) * (16 + across))
        )
        if rng.random() < 0.2:
            # On the borders of the blocks, and where walls end.
            x, y = (v - v % (16 * ONE) for v in (x, y))
        speed = 11.5 * ONE * rng.choice([1, 0.1, 0.001])
        vx, vy = (int(v) for v in rng.uniform(-speed, speed, 2))
        if rng.random() < 0.1:
            vx = -vy
        player = Player(x, y, vx, vy, int(rng.integers(2**32)), int(rng.integers(10)))
        if inside(world, x, y) and world.free((x, y)):
            players.append(player)
    held = rng.integers(0, 2, (count, 2)), rng.integers(-1, 2, (count, 2))
    turns, thrusts = (h.tolist() for h in held)
    return [
        (player, Buttons(bool(t[0]), bool(t[1]), *m))  # type: ignore[arg-type]
        for player, t, m in zip(players, turns, thrusts, strict=True)
    ]


def stacked(rows: list, **types: type) -> dict[str, jax.Array]:
    return {
        name: jnp.asarray(np.array([getattr(row, name) for row in rows]).astype(kind))
        for name, kind in types.items()
    }


@pytest.mark.parametrize("name", BUTTONS)
def test_tic_matches_plain_integers(name: str) -> None:
    world, geometry = world_of(name), load_geometry(name)
    drawn = cases(world, 300, seed=len(name))
    players, held = (list(part) for part in zip(*drawn, strict=True))
    body = Body(
        position=jnp.asarray([(p.x, p.y) for p in players], jnp.int32),
        velocity=jnp.asarray([(p.vx, p.vy) for p in players], jnp.int32),
        **stacked(players, angle=np.uint32),
        turn_tics=stacked(players, held=np.int32)["held"],
    )
    buttons = Buttons(
        **stacked(held, turn_left=bool, turn_right=bool, ahead=np.int32, aside=np.int32),
        **stacked(held, attack=bool),
    )
    run = jax.jit(jax.vmap(lambda body, buttons: tic(geometry, body, buttons)))
    after, tried = jax.tree.map(np.asarray, run(body, buttons))
    slides = 0
    for i, (player, b) in enumerate(drawn):
        want = world.tic(player, b.ahead, b.aside, b.turn_left, b.turn_right)  # type: ignore[arg-type]
        (x, y), (vx, vy) = after.position[i].tolist(), after.velocity[i].tolist()
        got = Player(x, y, vx, vy, int(after.angle[i]), int(after.turn_tics[i]))
        assert got == want, (player, b, world.tried)
        assert bool(tried.moving[i]) == bool(world.tried)
        if world.tried:
            assert tuple(tried.target[i]) == world.tried[0]
            others = {tuple(place) for place in tried.others[i].tolist()}
            # What is not a place of its own is the one that was reached.
            assert others | {world.tried[0]} == {*world.tried, (want.x, want.y)} | {world.tried[0]}
        assert bool(tried.slid[i]) == (len(world.tried) > 1)
        slides += len(world.tried) > 1
    assert slides > 50


def test_single_player_moves_as_in_plain_integers() -> None:
    """Without `jax.vmap` the slide is a plain conditional."""
    world, geometry = world_of("my-way-home"), load_geometry("my-way-home")
    run = jax.jit(lambda body, buttons: tic(geometry, body, buttons)[0])
    for player, b in cases(world, 30, seed=1):
        body = Body(
            position=jnp.asarray((player.x, player.y), jnp.int32),
            velocity=jnp.asarray((player.vx, player.vy), jnp.int32),
            angle=jnp.uint32(player.angle),
            turn_tics=jnp.int32(player.held),
        )
        buttons = Buttons(
            jnp.bool_(b.turn_left), jnp.bool_(b.turn_right), jnp.int32(b.ahead), jnp.int32(b.aside)
        )
        want = world.tic(player, b.ahead, b.aside, b.turn_left, b.turn_right)  # type: ignore[arg-type]
        got = run(body, buttons)
        assert tuple(got.position.tolist()) == (want.x, want.y)
        assert tuple(got.velocity.tolist()) == (want.vx, want.vy)


OTHERS = sorted(BUTTONS.keys() - {"health-gathering"})


# `test_scenarios` plays all of them, as environments.
@pytest.mark.parametrize(
    "name",
    ["health-gathering", *(pytest.param(name, marks=pytest.mark.slow) for name in OTHERS)],
)
def test_recorded_episodes_match_bit_for_bit(name: str) -> None:
    """Recorded by `fidelity.doom_recording` in ViZDoom 1.3.2."""
    recordings = load(RECORDINGS / f"{name}.npz")
    differ, slid = replay(name, recordings)
    assert not differ.any()
    assert slid.sum() > 100


def test_wrong_recording_is_detected() -> None:
    recordings = load(RECORDINGS / "health-gathering.npz")
    recordings[1].velocity[100, 1] += 1
    differ, _ = replay("health-gathering", recordings)
    assert np.argwhere(differ).tolist() == [[99, 1]]


def test_actions_are_numbered_as_in_the_wrapper() -> None:
    assert numbered(3, 1).tolist() == [0b000, 0b100, 0b010, 0b001]
    assert numbered(2, 2).tolist() == [0b00, 0b10, 0b01, 0b11]
    assert len(numbered(5, 5)) == 32


@pytest.mark.parametrize("name", BUTTONS)
def test_maps_round_trip_through_text(name: str) -> None:
    doom_map = load_map(name)
    assert parse_map(doom_map.text()) == doom_map


def test_far_walls_do_not_change_where_a_body_stops() -> None:
    """With thousands of walls, also if those of the body's blocks come last."""
    near, corner = Line(64, 256, 64, 0, "-"), Line(0, 0, 16, 0, "-")
    far = [
        Line(1024 + 64 * column, 1024 + 64 * row, 1088 + 64 * column, 1024 + 64 * row, "-")
        for row in range(50)
        for column in range(62)
    ]
    here = jnp.array([40 * ONE, 100 * ONE], jnp.int32)
    draw = np.random.default_rng(0)
    moves = draw.integers((8 * ONE, -9 * ONE), (12 * ONE, 9 * ONE), (200, 2)).astype(np.int32)
    ends = []
    for walls in ([near, corner], [near, corner, *far], [corner, *far, near]):
        meet = jax.jit(jax.vmap(partial(first_wall, build_geometry(walls), here)))
        ends.append(meet(jnp.asarray(moves)))
    assert ends[0][0].all()
    for other in ends[1:]:
        jax.tree.map(np.testing.assert_array_equal, ends[0], other)


def test_walls_off_the_lattice_are_refused() -> None:
    with pytest.raises(ValueError, match="lattice of 16 map units"):
        build_geometry([Line(0, 0, 0, 100, "BRICK")])
