"""Projectiles, fireballs and rockets: they fly straight until they meet a body or a wall."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import varying
from ...about import Event
from ...engine.textures import ADD, COVER
from ...maps.things import FIREBALL, ROCKET
from ...pytree import PyTreeNode
from .collision import RADIUS, along, bearing, crosses
from .fixed import ONE
from .game_things import Look, MissileLook, Shown
from .parts import Game, GameObject, Part, Sprites
from .view import Picture
from .weapons import Weapon

_FIREBALLS = (
    Picture("fireball", 16, (236, 140, 40), (255, 230, 150), lift=28),
    Picture("blaze", 40, (200, 80, 20), (255, 200, 90), lift=20),
)
_ROCKETS = (
    Picture("rocket", 14, (120, 116, 112), (255, 200, 90), lift=28),
    Picture("burst", 60, (200, 80, 20), (255, 200, 90), lift=4),
)
# Monsters throw and players launch at this height, in map units; missiles keep it.
_HEIGHT = 32
_FIREBALL_LOOK = MissileLook("BAL1", "AB", 4, (("C", 6), ("D", 6), ("E", 6)), ADD, _HEIGHT)
_BARON_LOOK = replace(_FIREBALL_LOOK, sprite="BAL7", turns=True)
_ROCKET_LOOK = MissileLook(
    "MISL", "A", 1, (("B", 8), ("C", 6), ("D", 4)), COVER, _HEIGHT, turns=True
)
HITS = {"hits": Event("was hit by a fireball", "was hit by {} fireballs")}
"""The event for players that fireballs hit."""
# Tics for which the explosion of a projectile is visible.
_BURST = 18


class Projectiles(PyTreeNode):
    """At most M projectiles; a new one replaces the oldest.

    Attributes:
        position: int32[M, 2], map units in 16.16.
        velocity: int32[M, 2], units per tic.
        flies: bool[M], whether it is in flight.
        bursts: int32[M], tics for which its explosion is still visible.
        owner: int32[M], the body that it cannot hit.
        next: int32[], the index of the next new one.
        age: int32[M], with `look="game"` tics since it was thrown; else None.
    """

    position: jax.Array
    velocity: jax.Array
    flies: jax.Array
    bursts: jax.Array
    owner: jax.Array
    next: jax.Array
    age: jax.Array | None = None


def throw(
    projectiles: Projectiles,
    throws: jax.Array,
    origin: jax.Array,
    way: jax.Array,
    speed: int | np.ndarray,
) -> Projectiles:
    """Add new projectiles, which have already flown for half a tic.

    Args:
        projectiles: the projectiles so far.
        throws: bool[N], which bodies throw one.
        origin: int32[N, 2], positions of these bodies, the first N of `fly`.
        way: float32[N, 2], directions of length 1.
        speed: map units per tic, for all or int32[N].
    """
    count = projectiles.flies.shape[0]
    fixed = np.asarray(speed, np.float32).reshape(-1, 1) * np.float32(ONE)
    velocity = (way * fixed).astype(jnp.int32)
    order = jnp.cumsum(throws.astype(jnp.int32)) - 1
    slot = jnp.where(throws, (projectiles.next + order) % count, count)
    index = np.arange(throws.shape[0], dtype=np.int32)

    def put(values: jax.Array, new: jax.Array) -> jax.Array:
        return values.at[slot].set(new, mode="drop")

    return Projectiles(
        position=put(projectiles.position, origin + (velocity >> 1)),
        velocity=put(projectiles.velocity, velocity),
        flies=put(projectiles.flies, throws),
        bursts=put(projectiles.bursts, jnp.zeros_like(slot)),
        owner=put(projectiles.owner, jnp.asarray(index)),
        next=(projectiles.next + jnp.sum(throws, dtype=jnp.int32)) % count,
        age=None if projectiles.age is None else put(projectiles.age, jnp.zeros_like(slot)),
    )


def _pairs(projectiles: Projectiles) -> list[tuple[jax.Array, jax.Array]]:
    """int32[M], position and velocity along x, and along y."""
    return [(projectiles.position[:, i], projectiles.velocity[:, i]) for i in (0, 1)]


def _quotient(value: jax.Array, divisor: int) -> jax.Array:
    """int32: the quotient rounded down."""
    cut = jax.lax.div(value, np.int32(divisor))
    return cut - (cut * divisor > value).astype(jnp.int32)


def _met(
    way: list[jax.Array],
    half_width: int,
    bodies: tuple[jax.Array, np.ndarray, jax.Array],
    owner: jax.Array,
) -> jax.Array:
    """int32[checks, M]: the first body met at each check, or N; arguments are as in `fly`."""
    places, widths, there = bodies
    reach = jnp.asarray((widths + half_width) * ONE)
    count = len(widths)

    # One body after another, like walls in `crosses`.
    def visit(k: jax.Array, found: jax.Array) -> jax.Array:
        i = count - 1 - k
        close = [jnp.abs(way[axis] - places[i, axis]) < reach[i] for axis in (0, 1)]
        return jnp.where(close[0] & close[1] & there[i] & (owner != i)[None], i, found)

    none = varying(jnp.full(way[0].shape, count, jnp.int32), way, bodies, owner)
    return jax.lax.fori_loop(0, count, visit, none)


class Missiles(Part):
    """Projectiles of one kind, in the state field named `field`.

    Attributes:
        field: `"fireballs"` or `"rockets"`.
        count: the most projectiles.
        half_width: half-width of each, in map units.
        checks: how often per tic each checks for collisions.
        look: the game's pictures, with `look="game"`.
    """

    def __init__(
        self,
        field: str,
        objects: tuple[GameObject, ...],
        *,
        count: int,
        half_width: int,
        checks: int = 3,
        look: MissileLook | None = None,
    ) -> None:
        """Store the attributes. The first object's pictures: in flight, and exploding."""
        self.field, self.objects, self.look = field, objects, look
        self.count, self.half_width, self.checks = count, half_width, checks

    def none(self) -> Projectiles:
        """No projectiles; with `look="game"`, they have an age."""
        pairs = jnp.zeros((self.count, 2), jnp.int32)
        nothing = jnp.zeros(self.count, jnp.int32)
        flies = jnp.zeros(self.count, bool)
        age = None if self.look is None else nothing
        return Projectiles(pairs, pairs, flies, nothing, nothing, jnp.int32(0), age)

    @property
    def looks(self) -> tuple[Look, ...]:
        """The game's pictures: in flight, then exploding."""
        return () if self.look is None else self.look.looks()

    def shown(self, state: Any, tic: jax.Array) -> Shown:
        """Those in flight, and the explosions of others, in the game's pictures."""
        del tic
        shots: Projectiles = getattr(state, self.field)
        assert self.look is not None
        assert shots.age is not None
        look = self.look.look_at(shots.flies, shots.age, _BURST - shots.bursts)
        facing = bearing(shots.velocity).astype(jnp.uint32) if self.look.turns else None
        return Shown(shots.position, look, shots.flies | (shots.bursts > 0), facing)

    def sprites(self, state: Any) -> Sprites:
        """Those in flight, and the explosions of others."""
        shots: Projectiles = getattr(state, self.field)
        ends = jnp.where(shots.flies, 0, 1).astype(jnp.int32)
        return Sprites(shots.position, ends, shots.flies | (shots.bursts > 0))

    def from_game(self, state: Any, game: Game) -> Any:
        """Read the game's projectiles; exploded ones stand still, and surplus ones are dropped."""
        rows, count = game.of(*(thing.name for thing in self.objects)), self.count
        order = np.argsort(rows[:, 4] == 0, kind="stable")[:count]
        place, speed = np.zeros((count, 2), np.int32), np.zeros(count)
        place[: len(order)], speed[: len(order)] = rows[order, :2], rows[order, 4]
        bursts = (np.arange(count) < len(order)) & (speed == 0)
        shots = getattr(state, self.field)
        shots = shots.replace(position=place, flies=speed > 0, bursts=bursts.astype(np.int32))
        return state.replace(**{self.field: shots})

    def fly(
        self,
        projectiles: Projectiles,
        bodies: tuple[jax.Array, np.ndarray, jax.Array],
        walls: np.ndarray,
    ) -> tuple[Projectiles, jax.Array]:
        """The projectiles after a tic; bool[M, N], the body that each has just hit.

        Args:
            projectiles: the projectiles before the tic.
            bodies: int32[N, 2] positions, int32[N] half-widths, bool[N] which are present. If two
                are met at once, the first is hit.
            walls: float32[L, 4], from `collision.segments`.
        """
        checks = self.checks
        part = np.arange(1, checks + 1, dtype=np.int32)[:, None]
        way = [at[None] + _quotient(by[None] * part, checks) for at, by in _pairs(projectiles)]
        found = _met(way, self.half_width, bodies, projectiles.owner)
        size = np.full((1, 1), self.half_width, np.float32)
        ends = (found < len(bodies[1])) | crosses(jnp.stack(way, axis=-1), size, walls)
        stops = projectiles.flies & jnp.any(ends, axis=0)
        last = found[-1], way[0][-1], way[1][-1]
        for k in reversed(range(checks - 1)):
            here = zip((found[k], way[0][k], way[1][k]), last, strict=True)
            last = tuple(jnp.where(ends[k], value, later) for value, later in here)
        index = np.arange(len(bodies[1]), dtype=np.int32)[None]
        hits = stops[:, None] & (last[0][:, None] == index)
        place = jnp.stack(last[1:], axis=-1)
        after = projectiles.replace(
            position=jnp.where(projectiles.flies[:, None], place, projectiles.position),
            flies=projectiles.flies & ~stops,
            bursts=jnp.where(stops, _BURST, jnp.maximum(projectiles.bursts - 1, 0)),
            age=None if projectiles.age is None else projectiles.age + 1,
        )
        return after, hits


def fireballs(count: int, pictured: bool = False, knights: bool = False) -> Missiles:
    """The fireballs of monsters, at most `count` in flight; more replace the oldest.

    Args:
        count: how many there may be.
        pictured: whether they have the game's pictures.
        knights: whether they have the pictures of those of hell knights.
    """
    objects = (
        GameObject("DoomImpBall", FIREBALL.label, _FIREBALLS),
        GameObject("BaronBall", FIREBALL.label),
    )
    look = _BARON_LOOK if knights else _FIREBALL_LOOK
    shown = look if pictured else None
    return Missiles("fireballs", objects, count=count, half_width=6, look=shown)


def rockets(
    count: int = 3, half_width: int = 11, name: str = "Rocket", pictured: bool = False
) -> Missiles:
    """The player's rockets, of which at most three are ever visible.

    Args:
        count: the most rockets.
        half_width: in map units; rockets without width check for bodies once per tic.
        name: the game's name.
        pictured: whether they have the game's pictures.
    """
    objects = (GameObject(name, ROCKET.label, _ROCKETS),)
    look = _ROCKET_LOOK if pictured else None
    checks = 3 if half_width else 1
    return Missiles(
        "rockets", objects, count=count, half_width=half_width, checks=checks, look=look
    )


def with_player(
    player: jax.Array, bodies: tuple[jax.Array, np.ndarray, jax.Array]
) -> tuple[jax.Array, np.ndarray, jax.Array]:
    """Bodies for `Missiles.fly`, with the player first, whom its own rockets cannot hit."""
    places, widths, there = bodies
    return (
        jnp.concatenate([player[None], places]),
        np.append(np.int32(RADIUS), widths),
        jnp.append(jnp.bool_(False), there),
    )


def launch(
    before: Projectiles, weapon: Weapon, fires: jax.Array, origin: jax.Array, angle: jax.Array
) -> Projectiles:
    """The rockets with one more from int32[2] along an angle uint32[], if bool[] it is fired."""
    return throw(before, fires[None], origin[None], along(angle)[None], weapon.speed)
