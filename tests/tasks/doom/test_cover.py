"""How eyes bob, and pictures against numbers that were read off the running game."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from jaxenstein.engine.art import load_art
from jaxenstein.tasks.doom.fixed import ONE
from jaxenstein.tasks.doom.monster_kinds import CHAINSAW_MARINE, DEMON, IMP
from jaxenstein.tasks.doom.physics import MOVE_LEFT, MOVE_RIGHT, bob_height, bobbed, hold
from jaxenstein.tasks.doom.projectiles import fireballs
from jaxenstein.tasks.doom.view import Picture

BUTTONS = (MOVE_LEFT, MOVE_RIGHT)

# What covers a picture in the game: left, right, lower and upper end and area, in map units from
# the thing's place on the floor: read off ViZDoom's labels on a screen of 1280 by 960.
MEASURED: list[tuple[Picture, tuple[float, float, float, float], float]] = [
    (IMP.pictures[0], (-24, 24.5, -3.4, 57.2), 1600),
    (IMP.pictures[2], (-27, 27, -3.4, 58), 1580),
    (DEMON.pictures[0], (-22, 22, -3.4, 55), 1540),
    (DEMON.pictures[2], (-18, 18, -3.6, 55), 1230),
    (CHAINSAW_MARINE.pictures[0], (-17.4, 16.9, -1.7, 54.4), 1143),
    (fireballs(1).objects[0].pictures[0], (-8.3, 6.8, 28.2, 43.7), 182),
    (fireballs(1).objects[0].pictures[1], (-19, 21, 22, 57), 918),
]


def test_pushes_do_not_bob_the_eye_and_walls_damp_it() -> None:
    """A body that is pushed at 10 units a tic, and one that walks along a wall it is slowed by."""
    still, right = (hold(BUTTONS, jnp.int32(held)) for held in (0, 2))
    none, east = jnp.zeros(2, jnp.int32), jnp.uint32(0)
    pushed = jnp.array([-10 * ONE, 0], jnp.int32)
    steps, pace = bobbed(none, east, still, pushed, jnp.bool_(False))
    assert not steps.any()
    assert not pace.any()
    fast, slow = jnp.array([0, -6 * ONE], jnp.int32), jnp.array([0, -ONE], jnp.int32)
    steps, pace = bobbed(fast, east, right, slow, jnp.bool_(True))
    # The game thrusts by three quarters of a unit, and looks before the wall slows the body.
    assert steps.tolist() == [0, -6.75 * ONE]
    assert pace.tolist() == slow.tolist()
    # A quarter of the squared speed, halved, at the crest; 8 at most.
    assert float(bob_height(steps, jnp.int32(25))) == pytest.approx(6.75**2 / 8)
    assert float(bob_height(3 * steps, jnp.int32(25))) == pytest.approx(8)
    assert float(bob_height(3 * steps, jnp.int32(35))) == pytest.approx(-8)
    assert float(bob_height(steps, jnp.int32(40))) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize(("picture", "ends", "area"), MEASURED, ids=lambda p: getattr(p, "art", ""))
def test_picture_sizes_match_the_game(
    picture: Picture, ends: tuple[float, float, float, float], area: float
) -> None:
    bits = (load_art(picture.art)[0][None] >> np.arange(31, -1, -1)[:, None].astype(np.uint32)) & 1
    cell = picture.side / 32
    rows, columns = np.nonzero(bits)
    ours = (
        (columns.min() - 16) * cell,
        (columns.max() - 15) * cell,
        picture.lift + (31 - rows.max()) * cell,
        picture.lift + (32 - rows.min()) * cell,
    )
    assert ours == pytest.approx(ends, abs=3.5)
    assert bits.sum() * cell**2 == pytest.approx(area, rel=0.1)
