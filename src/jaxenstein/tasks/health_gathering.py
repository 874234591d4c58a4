"""ViZDoom's Health Gathering: stay alive on an acid floor by collecting medkits.

Rules and numbers are those of the scenario `health_gathering` of ViZDoom 1.3 and of Doom's
engine, measured by running them; docs/originals/health-gathering.md has the table.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ..about import About, Choose, Event, Player
from ..engine.level import WORD, pack_bits
from ..engine.scene import Scene, Sprites, Theme
from ..engine.shade import ImageKind
from ..environment import Info, Params, Scalar, State
from ..maps.ascii import parse_ascii
from ..maps.things import MEDKIT, RGB
from ..maps.tilemap import TileMap
from ..params import number
from ..players.chance import NO_OP
from ..players.walking import movement_of, towards
from .appearance import build_theme
from .draws import sample_unit
from .health import FULL_HEALTH, HealthTask, P, S, about_health
from .hud import bar, check_strip, strip_rows
from .navigation import FixedMap
from .steering import ACTION_NAMES, FORWARD, SteeringParams, steer

# Tiles of the room from wall to wall: 1216 map units of Doom, 32 per tile.
ROOM = 38
# Enough places for all medkits of an episode of 2100 steps: 17 at first, then one per 30 steps.
CAPACITY = 88
MOST_AT_FIRST = 32
# Medkits (half-width 20 units) do not stick into walls, which begin one tile inside the map.
_FIRST_PLACE, _LAST_PLACE = 1 + 20 / 32, 1 + ROOM - 20 / 32
FLOOR: tuple[RGB, RGB] = ((52, 122, 34), (40, 98, 26))
CEILING: RGB = (26, 26, 62)


class HealthGatheringParams(SteeringParams):
    """The params of the task.

    Attributes:
        damage: health that the floor takes each time; the first time before the first observation.
        damage_period: steps from one damage to the next.
        heal: health gained by a medkit, up to 100.
        medkits: number of medkits in the first observation, at most `MOST_AT_FIRST`.
        medkit_period: steps from one new medkit to the next.
        pickup_reach: a step forward takes the medkits whose distances in x and y are both less
            than this, in tiles: the boxes of Doom's player and medkit, 16 + 20 units.
        living_reward: reward of every step, including the last one.
        death_penalty: subtracted from the reward of the step in which the agent dies.
    """

    max_steps_in_episode: Scalar = 2100
    discount: Scalar = 0.99
    damage: Scalar = number(8, 0, 99)
    damage_period: Scalar = number(32, 1)
    heal: Scalar = number(25, 1)
    medkits: Scalar = number(17, 0, MOST_AT_FIRST)
    medkit_period: Scalar = number(30, 1)
    pickup_reach: Scalar = number(36 / 32, 0)
    living_reward: Scalar = 1.0
    death_penalty: Scalar = 100.0


class HealthGatheringState(State):
    """The state of the task; N is `CAPACITY`.

    Attributes:
        health: int32[], 0 to 100.
        medkits: float32[N, 2], (x, y) in tiles of each place for a medkit.
        present: bool[N], which places have a medkit.
        placed: int32[], medkits placed since the reset. From N on, the newest replaces the oldest.
    """

    health: jax.Array
    medkits: jax.Array
    present: jax.Array
    placed: jax.Array


def greedy_medkits(env: HealthGathering, params: HealthGatheringParams) -> Choose:
    """Go to the nearest medkit, wait there until its full effect is needed, then take it."""
    body = movement_of(env, params)

    def choose(key: jax.Array, state: HealthGatheringState) -> jax.Array:
        del key
        offset = state.medkits - state.position[None]
        distance = jnp.where(state.present, jnp.sum(offset**2, axis=-1), jnp.inf)
        offset = offset[jnp.argmin(distance)]
        in_reach = jnp.all(jnp.abs(offset) < params.pickup_reach)
        # A medkit that fills more than the life that is left still must not come too late.
        needed = state.health <= jnp.maximum(FULL_HEALTH - params.heal, params.damage)
        wait = ~jnp.any(state.present) | (in_reach & ~needed)
        return jnp.where(wait, NO_OP, towards(body, env.scene(state, params), offset))

    return choose


GREEDY_MEDKITS = Player(
    "goes to the nearest medkit and waits until it is needed; sees the whole state",
    greedy_medkits,
    waits="waits: healthy",
)


class HealthRoom(HealthTask[S, P], FixedMap[S, P]):
    """Base of health tasks in one room with medkits."""

    ceiling: ClassVar[RGB] = CEILING

    @functools.cached_property
    def theme(self) -> Theme:
        """The look of the room."""
        return build_theme((MEDKIT.label,), doors=False, floor=FLOOR, ceiling=self.ceiling)


@dataclasses.dataclass(frozen=True, kw_only=True)
class HealthGathering(HealthRoom[HealthGatheringState, HealthGatheringParams]):
    """Stay alive on a floor that hurts, by walking over medkits.

    Actions: turn left, turn right, forward. The floor takes 8 health every 32 steps. A medkit
    gives 25, up to 100; at full health the agent does not take it. A new one appears somewhere
    every 30 steps. Reward: 1 per step, and -100 for dying, which terminates the episode.

    Attributes:
        hud: show the health as a bar in a strip below the view, which becomes shorter by as much;
            only for images of colours or greys.
    """

    hud: bool = False
    # Medkits are as high as the eye: in 512 frames with 40 of them, a third layer would change
    # 0.002 % of the pixels.
    sprite_layers: int = 2

    params_class: ClassVar[type[Params]] = HealthGatheringParams
    action_names: ClassVar[tuple[str, ...]] = ACTION_NAMES[:3]

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        check_strip(self.hud, self.observation, self.height)

    @functools.cached_property
    def tilemap(self) -> TileMap:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The room, with a wall one tile thick."""
        side = ROOM // 2
        rows = ["U" * (ROOM + 2), *["U" + "." * ROOM + "U"] * ROOM, "U" * (ROOM + 2)]
        rows[side + 1] = "U" + "." * side + "S" + "." * (side - 1) + "U"
        return parse_ascii("\n".join(rows), "health-gathering", goal_required=False)

    def init_state(self, key: jax.Array, params: HealthGatheringParams) -> HealthGatheringState:
        """Start in the centre, looking east, and place the first medkits."""
        bits = jax.random.bits(key, (MOST_AT_FIRST, 2), jnp.uint32)
        placed = jnp.clip(params.medkits, 0, MOST_AT_FIRST)
        rest = jnp.zeros((CAPACITY - MOST_AT_FIRST, 2), jnp.float32)
        return HealthGatheringState(
            position=jnp.full(2, 1 + ROOM / 2, jnp.float32),
            heading=jnp.float32(0),
            health=FULL_HEALTH - jnp.asarray(params.damage),
            medkits=jnp.concatenate([_place(bits), rest]),
            present=jnp.arange(CAPACITY, dtype=jnp.int32) < placed,
            placed=placed,
        )

    def transition(
        self,
        key: jax.Array,
        state: HealthGatheringState,
        action: jax.Array,
        params: HealthGatheringParams,
    ) -> tuple[HealthGatheringState, jax.Array, jax.Array, Info]:
        """Move, take damage, take medkits; then a new one may appear."""
        time = state.time + 1
        closed = jnp.zeros(0, bool)
        position, heading = steer(self.level, closed, state.position, state.heading, action, params)
        hurt = time % jnp.maximum(params.damage_period, 1) == 0
        health = state.health - jnp.where(hurt, params.damage, 0)
        dead = health <= 0
        state = state.replace(position=position, heading=heading, health=jnp.maximum(health, 0))
        # Doom only picks things up when something moves.
        state, count = _take(state, (action == FORWARD) & ~dead, params)
        state = _appear(state, key, time % jnp.maximum(params.medkit_period, 1) == 0)
        reward = params.living_reward - jnp.where(dead, params.death_penalty, 0)
        return state, reward, dead, {"took_medkit": count, "died": dead}

    def about(self) -> About:
        """A description of the task."""
        taken = {"took_medkit": Event("took a medkit", "took {} medkits")}
        about = about_health(taken, GREEDY_MEDKITS, "step")
        holds = {
            **about.holds,
            "no more medkits lie there than were placed": lambda state: (
                jnp.sum(state.present, dtype=jnp.int32) <= state.placed
            ),
        }
        return dataclasses.replace(about, holds=holds)

    def scene(self, state: HealthGatheringState, params: HealthGatheringParams) -> Scene:
        """The room and its medkits."""
        del params
        return Scene(
            level=self.level,
            closed=jnp.zeros(0, bool),
            position=state.position,
            heading=state.heading,
            sprites=Sprites(
                position=state.medkits,
                picture=jnp.zeros(CAPACITY, jnp.int32),
                visible=state.present,
            ),
            theme=self.theme,
        )

    @property
    def view_height(self) -> int:
        """The number of image rows above the strip."""
        return self.height - strip_rows(self.height) if self.hud else self.height

    def draw(
        self, state: HealthGatheringState, params: HealthGatheringParams, kind: ImageKind
    ) -> jax.Array:
        """Add the strip below the view."""
        image = super().draw(state, params, kind)
        if not self.hud:
            return image
        strip = bar(state.health / FULL_HEALTH, strip_rows(self.height), self.width, kind)
        return jnp.concatenate([image, strip])


def _place(bits: jax.Array) -> jax.Array:
    """float32[..., 2]: uniform places for medkits from uint32 bits."""
    return _FIRST_PLACE + sample_unit(bits) * jnp.float32(_LAST_PLACE - _FIRST_PLACE)


def _take(
    state: HealthGatheringState, able: jax.Array, params: HealthGatheringParams
) -> tuple[HealthGatheringState, jax.Array]:
    """Take medkits in reach one by one while health is missing; also int32[], their number."""
    offset = jnp.abs(state.medkits - state.position[None])
    near = state.present & jnp.all(offset < params.pickup_reach, axis=-1) & able
    missing = FULL_HEALTH - state.health
    needed = -(-missing // jnp.maximum(params.heal, 1))
    taken = near & (_rank(near) < needed)
    count = jnp.sum(taken, dtype=jnp.int32)
    health = jnp.minimum(state.health + params.heal * count, FULL_HEALTH)
    return state.replace(health=health, present=state.present & ~taken), count


def _rank(chosen: jax.Array) -> jax.Array:
    """int32[N]: how many entries of bool[N] before each one are true."""
    words = pack_bits(chosen[None])[0]
    counts = jax.lax.population_count(words)
    before = jnp.cumsum(counts) - counts
    # Without a gather, which would compute all of this again for every member of the batch.
    below = jnp.asarray(((1 << np.arange(WORD)) - 1).astype(np.uint32))
    within = jax.lax.population_count(words[:, None] & below[None])
    return (before[:, None] + within).reshape(-1)[: chosen.shape[0]].astype(jnp.int32)


def _appear(state: HealthGatheringState, key: jax.Array, due: jax.Array) -> HealthGatheringState:
    """Add a medkit, if it is due."""
    here = (jnp.arange(CAPACITY, dtype=jnp.int32) == state.placed % CAPACITY) & due
    place = _place(jax.random.bits(key, (2,), jnp.uint32))
    return state.replace(
        medkits=jnp.where(here[:, None], place[None], state.medkits),
        present=state.present | here,
        placed=state.placed + due.astype(jnp.int32),
    )
