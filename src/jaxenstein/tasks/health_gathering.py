"""ViZDoom's Health Gathering: an acid floor, and medkits to stay alive on.

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

# Tiles of the room from wall to wall: 1216 of Doom's map units, 32 of which are a tile.
ROOM = 38
# Room for all medkits of an episode of 2100 steps: 17 at first, then one every 30 steps.
CAPACITY = 88
MOST_AT_FIRST = 32
# Medkits (half-width 20 units) do not stick into walls, which stand one tile inside the map.
_FIRST_PLACE, _LAST_PLACE = 1 + 20 / 32, 1 + ROOM - 20 / 32
FLOOR: tuple[RGB, RGB] = ((52, 122, 34), (40, 98, 26))
CEILING: RGB = (26, 26, 62)


class HealthGatheringParams(SteeringParams):
    """The numbers of the task.

    Attributes:
        damage: health lost to the floor at a time, the first before the first observation.
        damage_period: steps from one damage to the next.
        heal: health gained by a medkit, up to 100.
        medkits: how many lie there in the first observation, at most `MOST_AT_FIRST`.
        medkit_period: steps from one new medkit to the next.
        pickup_reach: a step forward takes the medkits whose x and y are both nearer than this,
            in tiles: the boxes of Doom's player and medkit, 16 + 20 units.
        living_reward: reward of every step, the last one included.
        death_penalty: taken off the reward of the step that dies.
    """

    max_steps_in_episode: Scalar = 2100
    discount: Scalar = 0.99
    damage: Scalar = number(8, 0)
    damage_period: Scalar = number(32, 1)
    heal: Scalar = number(25, 1)
    medkits: Scalar = number(17, 0, MOST_AT_FIRST)
    medkit_period: Scalar = number(30, 1)
    pickup_reach: Scalar = number(36 / 32, 0)
    living_reward: Scalar = 1.0
    death_penalty: Scalar = 100.0


class HealthGatheringState(State):
    """State of the task; N is `CAPACITY`.

    Attributes:
        health: int32[], 0 to 100.
        medkits: float32[N, 2], (x, y) in tiles of each place for a medkit.
        present: bool[N], which of them hold one.
        placed: int32[], medkits placed since the reset. With more than N of them, the newest
            takes the place of the oldest.
    """

    health: jax.Array
    medkits: jax.Array
    present: jax.Array
    placed: jax.Array


def greedy_medkits(env: HealthGathering, params: HealthGatheringParams) -> Choose:
    """Go to the nearest medkit, wait there until all of it is needed, then take it."""
    body = movement_of(env, params)

    def choose(key: jax.Array, state: HealthGatheringState) -> jax.Array:
        del key
        offset = state.medkits - state.position[None]
        distance = jnp.where(state.present, jnp.sum(offset**2, axis=-1), jnp.inf)
        offset = offset[jnp.argmin(distance)]
        in_reach = jnp.all(jnp.abs(offset) < params.pickup_reach)
        needed = state.health <= FULL_HEALTH - params.heal
        wait = ~jnp.any(state.present) | (in_reach & ~needed)
        return jnp.where(wait, NO_OP, towards(body, env.scene(state, params), offset))

    return choose


GREEDY_MEDKITS = Player(
    "goes to the nearest medkit and waits there while it is not needed; sees the whole state",
    greedy_medkits,
    waits="waits: healthy",
)


class HealthRoom(HealthTask[S, P], FixedMap[S, P]):
    """Base of tasks of health in one room with medkits in it."""

    ceiling: ClassVar[RGB] = CEILING

    @functools.cached_property
    def theme(self) -> Theme:
        """How the room looks."""
        return build_theme((MEDKIT.label,), doors=False, floor=FLOOR, ceiling=self.ceiling)


@dataclasses.dataclass(frozen=True, kw_only=True)
class HealthGathering(HealthRoom[HealthGatheringState, HealthGatheringParams]):
    """Stay alive on a floor that hurts, by walking over medkits.

    Actions: turn left, turn right, forward. The floor takes 8 health every 32 steps; a medkit
    gives back 25, up to 100, and is left where it lies at full health. A new one appears
    somewhere every 30 steps. Reward: 1 a step, and -100 more for dying, which terminates.

    Attributes:
        hud: show the health as a bar in a strip below the view, which then is as much lower;
            for images of colours or greys.
    """

    hud: bool = False
    # Medkits are as high as the eye: of 512 frames with 40 of them, a third one in a column would
    # change 0.002 % of the pixels.
    sprite_layers: int = 2

    params_class: ClassVar[type[Params]] = HealthGatheringParams
    action_names: ClassVar[tuple[str, ...]] = ACTION_NAMES[:3]

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        check_strip(self.hud, self.observation, self.height)

    @functools.cached_property
    def tilemap(self) -> TileMap:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The room, with its wall one tile thick."""
        side = ROOM // 2
        rows = ["U" * (ROOM + 2), *["U" + "." * ROOM + "U"] * ROOM, "U" * (ROOM + 2)]
        rows[side + 1] = "U" + "." * side + "S" + "." * (side - 1) + "U"
        return parse_ascii("\n".join(rows), "health-gathering", goal_required=False)

    def init_state(self, key: jax.Array, params: HealthGatheringParams) -> HealthGatheringState:
        """Stand in the centre, look east, and place the first medkits."""
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
        """Move, suffer, take medkits, then a new one appears."""
        time = state.time + 1
        closed = jnp.zeros(0, bool)
        position, heading = steer(self.level, closed, state.position, state.heading, action, params)
        hurt = time % jnp.maximum(params.damage_period, 1) == 0
        health = state.health - jnp.where(hurt, params.damage, 0)
        dead = health <= 0
        state = state.replace(position=position, heading=heading, health=jnp.maximum(health, 0))
        # Doom looks for things to take only where something moves.
        state, count = _take(state, (action == FORWARD) & ~dead, params)
        state = _appear(state, key, time % jnp.maximum(params.medkit_period, 1) == 0)
        reward = params.living_reward - jnp.where(dead, params.death_penalty, 0)
        return state, reward, dead, {"took_medkit": count, "died": dead}

    def about(self) -> About:
        """What the task says of itself."""
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
        """The room and the medkits in it."""
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
        """Rows of the image above the strip."""
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
    """Take the medkits in reach one after another while health is missing; and int32[] how many."""
    offset = jnp.abs(state.medkits - state.position[None])
    near = state.present & jnp.all(offset < params.pickup_reach, axis=-1) & able
    missing = FULL_HEALTH - state.health
    needed = -(-missing // jnp.maximum(params.heal, 1))
    taken = near & (_rank(near) < needed)
    count = jnp.sum(taken, dtype=jnp.int32)
    health = jnp.minimum(state.health + params.heal * count, FULL_HEALTH)
    return state.replace(health=health, present=state.present & ~taken), count


def _rank(chosen: jax.Array) -> jax.Array:
    """int32[N]: how many of bool[N] come before each."""
    words = pack_bits(chosen[None])[0]
    counts = jax.lax.population_count(words)
    before = jnp.cumsum(counts) - counts
    # Without a gather, which would compute all of this anew for every member.
    below = jnp.asarray(((1 << np.arange(WORD)) - 1).astype(np.uint32))
    within = jax.lax.population_count(words[:, None] & below[None])
    return (before[:, None] + within).reshape(-1)[: chosen.shape[0]].astype(jnp.int32)


def _appear(state: HealthGatheringState, key: jax.Array, due: jax.Array) -> HealthGatheringState:
    """A medkit more, if it is time."""
    here = (jnp.arange(CAPACITY, dtype=jnp.int32) == state.placed % CAPACITY) & due
    place = _place(jax.random.bits(key, (2,), jnp.uint32))
    return state.replace(
        medkits=jnp.where(here[:, None], place[None], state.medkits),
        present=state.present | here,
        placed=state.placed + due.astype(jnp.int32),
    )
