"""Worlds with an instruction: go to a door or thing, fetch a thing, put one near another."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ...fields import check_whole
from ...maps.things import GREEN
from ...params import number
from ...players.walking import mask_of
from ..steering import INTERACT
from .sketch import COLOURS, Sketch
from .state import (
    BALL_KIND,
    BOX_KIND,
    DONE,
    DOOR_KIND,
    DROP,
    GOAL_KIND,
    KEY_KIND,
    NOWHERE,
    PICK_UP,
    PORTABLE,
    GridState,
    Step,
    Subgoal,
    around,
    beside,
)
from .world import GridWorld, PickUpWorld


@dataclasses.dataclass(frozen=True, kw_only=True)
class GoToDoor(GridWorld):
    """A room with four doors of different colours: say "done" beside the requested one.

    Interact also ends the episode, as a failure.

    Attributes:
        size: the largest number of tiles along the room's sides, which are random, walls
            included; at least 5.
    """

    size: int = number(5, 5, 32)

    kinds: ClassVar[tuple[int, ...]] = (GOAL_KIND,)
    asks: ClassVar[bool] = True
    aim_words: ClassVar[str] = "said done beside the requested thing"
    fail_words: ClassVar[str] = "said done elsewhere"

    def lay_out(self, key: jax.Array) -> GridState:
        """Sample the room, its doors, the start and the instruction."""
        # A margin of one tile, because doors may not be on the border of a map.
        sketch = Sketch(key, self.size + 2, self.size + 2)
        columns, rows = sketch.number(5, self.size + 1), sketch.number(5, self.size + 1)
        sketch.wall(~sketch.area(2, 2, columns - 2, rows - 2))
        north, south = sketch.number(2, columns - 2), sketch.number(2, columns - 2)
        west, east = sketch.number(2, rows - 2), sketch.number(2, rows - 2)
        colours = sketch.shuffled(COLOURS)
        sketch.door(north + 1, 1, colours[0])
        sketch.door(south + 1, rows, colours[1])
        sketch.door(1, west + 1, colours[2])
        sketch.door(columns, east + 1, colours[3])
        sketch.start_in(sketch.free)
        return sketch.state(asked=(DOOR_KIND, colours[sketch.number(0, 4)]))

    def target(self, state: GridState) -> jax.Array:
        """bool[rows, columns], the tile of the requested thing."""
        return self.door_tiles(state, state.doors.colour == state.asked[0, 1])

    def judge(self, step: Step) -> tuple[jax.Array, jax.Array]:
        """Whether the agent says done at the right place; whether elsewhere, or it interacts."""
        there = self.stands_beside(step.after, self.target(step.after))
        said = step.action == DONE
        return said & there, (said & ~there) | (step.action == INTERACT)

    def subgoal(self, state: GridState) -> Subgoal:
        """To say done beside the target."""
        return Subgoal(self.target(state), jnp.int32(DONE))


@dataclasses.dataclass(frozen=True, kw_only=True)
class GoToObject(GoToDoor):
    """A room with things of different kinds or colours: say "done" beside the requested one.

    Attributes:
        size: tiles along the room's side, walls included; at least 5.
        objects: the number of things.
    """

    size: int = 6
    objects: int = number(2, 1, 4)

    kinds: ClassVar[tuple[int, ...]] = (KEY_KIND, BALL_KIND, BOX_KIND)

    def lay_out(self, key: jax.Array) -> GridState:
        """Sample the things, the start and the instruction."""
        sketch = Sketch(key, self.size, self.size)
        drawn = _different(sketch, self.objects)
        for kind, colour in drawn:
            sketch.thing(kind, colour, sketch.tile_in(sketch.free))
        sketch.start_in(sketch.free)
        chosen = drawn[sketch.number(0, self.objects)]
        return sketch.state(asked=(chosen[0], chosen[1]))

    def target(self, state: GridState) -> jax.Array:
        """bool[rows, columns], the tile of the requested thing."""
        return self.tiles_of(state, self.asked_for(state))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Fetch(PickUpWorld):
    """A room with keys and balls: pick up the requested one; any other ends the episode.

    Attributes:
        size: tiles along the room's side, walls included; at least 5.
        objects: the number of things, 2 or 3.
    """

    size: int = number(8, 5, 32)
    objects: int = number(3, 2, 3)

    kinds: ClassVar[tuple[int, ...]] = (KEY_KIND, BALL_KIND)
    asks: ClassVar[bool] = True
    fail_words: ClassVar[str] = "picked up something else"

    def lay_out(self, key: jax.Array) -> GridState:
        """Sample the things, the start, and which thing to fetch.

        In MiniGrid, two things may enclose the agent or the target in a corner. Here, these
        layouts (two in ten thousand) have another start or another target.
        """
        sketch = Sketch(key, self.size, self.size)
        rows = []
        for _ in range(self.objects):
            kind, colour = sketch.number(KEY_KIND, BALL_KIND + 1), sketch.colour()
            tile = sketch.tile_in(sketch.free)
            sketch.thing(kind, colour, tile)
            rows.append(jnp.stack([kind, colour, *tile]))
        things = jnp.stack(rows)
        reached = beside(sketch.free)
        sketch.start_in(sketch.free & reached)
        open_to = reached[things[:, 3], things[:, 2]]
        rank = jnp.cumsum(open_to.astype(jnp.int32))
        chosen = jnp.sum(rank <= sketch.number(0, rank[-1]), dtype=jnp.int32)
        return sketch.state(asked=(things[chosen, 0], things[chosen, 1]))

    def judge(self, step: Step) -> tuple[jax.Array, jax.Array]:
        """Whether the target is in the hand, and whether another thing is."""
        solved, _ = super().judge(step)
        return solved, jnp.any(step.after.things.held) & ~solved


@dataclasses.dataclass(frozen=True, kw_only=True)
class PutNear(GridWorld):
    """A room with different things: put one of them down beside another, as requested.

    Picking up another thing or putting it down elsewhere ends the episode. Beside means on one of
    the eight tiles around.

    Attributes:
        size: tiles along the room's side, walls included; at least 6.
        objects: the number of things, 2 or 3.
    """

    size: int = number(6, 6, 32)
    objects: int = 2

    kinds: ClassVar[tuple[int, ...]] = (KEY_KIND, BALL_KIND, BOX_KIND)
    asks: ClassVar[bool] = True
    aim_words: ClassVar[str] = "put the requested thing beside the other"
    fail_words: ClassVar[str] = "picked up something else, or put it down elsewhere"

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        check_whole("objects", self.objects, 2, 2 if self.size < 8 else 3)

    def lay_out(self, key: jax.Array) -> GridState:
        """Sample the things, no two of them next to each other, the start and the instruction."""
        sketch = Sketch(key, self.size, self.size)
        drawn, near = _different(sketch, self.objects), jnp.zeros((self.size, self.size), bool)
        for kind, colour in drawn:
            tile = sketch.tile_in(sketch.free & ~near)
            sketch.thing(kind, colour, tile)
            near = near | around(tile, near.shape)
        sketch.start_in(sketch.free)
        order = sketch.shuffled(self.objects)
        moved, other = drawn[order[0]], drawn[order[1]]
        return sketch.state(asked=(moved[0], moved[1]), near=(other[0], other[1]))

    def judge(self, step: Step) -> tuple[jax.Array, jax.Array]:
        """Whether the thing is there now; whether another was picked up or it was put elsewhere."""
        held, after = step.before.things.held, step.after
        moved = self.asked_for(after)
        dropped = jnp.any(held & after.things.lying)
        tried = (step.action == DROP) & jnp.any(held)
        tile = jnp.sum(jnp.where(moved[:, None], after.things.tile, 0), axis=0, dtype=jnp.int32)
        other = self.tiles_of(after, self.asked_for(after, 1))
        near = jnp.any(other & around(tile, other.shape))
        wrong = jnp.any(after.things.held & ~moved)
        return dropped & near & ~wrong, wrong | (tried & ~(dropped & near))

    def subgoal(self, state: GridState) -> Subgoal:
        """To pick it up, then to drop it on a free tile around the other."""
        moved = self.asked_for(state)
        held = jnp.any(state.things.held & moved)
        other = self.asked_for(state, 1)
        tile = jnp.sum(jnp.where(other[:, None], state.things.tile, 0), axis=0, dtype=jnp.int32)
        shape = state.level.walls.shape[-2:]
        taken = self.tiles_of(state, state.things.lying) | (jnp.asarray(state.level.walls)[0] != 0)
        spots = around(tile, shape) & ~taken & ~mask_of(state.cell, shape)
        tiles = jnp.where(held, spots, self.tiles_of(state, moved))
        return Subgoal(tiles, jnp.where(held, DROP, PICK_UP).astype(jnp.int32))


def _different(sketch: Sketch, count: int) -> jax.Array:
    """int32[count, 2], the kind and colour of things that differ in at least one of both."""
    pairs = sketch.shuffled(PORTABLE * COLOURS)[:count]
    return jnp.stack([pairs // COLOURS, pairs % COLOURS], axis=-1)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Memory(GridWorld):
    """A room with a key or a ball, and a hall to a junction with one of each: go to the same kind.

    Going to the other thing ends the episode. The start is anywhere between the room and the
    junction, facing east, so the agent may have to turn back and look first. Nothing can be picked
    up.

    Attributes:
        size: tiles along the world's side, walls included; odd.
        random_length: whether the length of the hall is random.
    """

    size: int = number(9, 7, 63)
    random_length: bool = False

    kinds: ClassVar[tuple[int, ...]] = (KEY_KIND, BALL_KIND)
    hands: ClassVar[bool] = False
    aim_words: ClassVar[str] = "went to the thing of the same kind"
    fail_words: ClassVar[str] = "went to the other thing"

    def lay_out(self, key: jax.Array) -> GridState:
        """Sample the first thing, the sides of the other two, the hall's length and the start."""
        size, middle = self.size, self.size // 2
        sketch = Sketch(key, size, size)
        end = sketch.number(4, size - 2) if self.random_length else jnp.int32(size - 3)
        for row, side in ((middle - 2, middle - 1), (middle + 2, middle + 1)):
            sketch.wall(sketch.area(1, row, 4, 1) | sketch.tile(4, side))
            sketch.wall(sketch.area(5, side, end - 5, 1))
        crossing = sketch.area(end, 0, 1, size) | sketch.area(end + 2, 0, 1, size)
        sketch.wall(crossing & ~sketch.tile(end, middle))
        sketch.start((sketch.number(1, end + 1), middle))
        first, upper = (sketch.number(KEY_KIND, BALL_KIND + 1) for _ in range(2))
        sketch.thing(first, GREEN, (1, middle - 1))
        sketch.thing(upper, GREEN, (end + 1, middle - 2))
        sketch.thing(BALL_KIND - upper, GREEN, (end + 1, middle + 2))
        return sketch.state()

    def ends(self, state: GridState) -> tuple[jax.Array, jax.Array]:
        """int32[2], int32[2]: the tiles in front of the matching thing and of the other one."""
        things = state.things
        inward = np.array(((0, 1), (0, -1)), np.int32)
        before = things.tile[1:] + inward
        like = things.kind[1] == things.kind[0]
        return jnp.where(like, before[0], before[1]), jnp.where(like, before[1], before[0])

    def judge(self, step: Step) -> tuple[jax.Array, jax.Array]:
        """Which of the two tiles the agent is on, if any."""
        right, wrong = self.ends(step.after)
        return jnp.all(step.after.cell == right), jnp.all(step.after.cell == wrong)

    def subgoal(self, state: GridState) -> Subgoal:
        """The tile in front of the matching thing."""
        tiles = mask_of(self.ends(state)[0], state.level.walls.shape[-2:])
        return Subgoal(tiles, jnp.int32(NOWHERE))
