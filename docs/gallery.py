"""Blocks of a contact sheet: views of an environment, and its map from above.

The views come from episodes of a simple player. The blocks show those views that show most things.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from PIL import Image, ImageDraw, ImageFont

import jaxenstein
from jaxenstein.catalogue import ENTRIES
from jaxenstein.episodes.recorder import snapshots
from jaxenstein.maps.symbols import DECAL_LABELS, DOOR_LABELS, FLOOR, LABEL_NAMES, WALL_LABELS
from jaxenstein.maps.things import THING_OF
from jaxenstein.tasks.first_person import FirstPerson
from jaxenstein.tasks.levels import closed_doors
from jaxenstein.view.recording import BACKGROUND, FAINT, TEXT
from jaxenstein.view.topdown import draw_map

# Episodes of each environment, their steps, and the steps between two candidate views.
EPISODES, STEPS, EVERY = 24, 400, 8
# Columns and rows of views, and their size in pixels; they are drawn at this size.
ACROSS, DOWN, VIEW = 3, 2, (136, 102)
# Candidates are judged by label images of this size.
GLANCE = (32, 24)
# Columns of blocks; margins around blocks, gaps within them, and the height of titles.
COLUMNS, MARGIN, GAP, TITLE = 2, 24, 4, 40
MAP_SIDE = DOWN * VIEW[1] + (DOWN - 1) * GAP

Env = FirstPerson[Any, Any]


class Walk(NamedTuple):
    """The state of a player that walks straight on, and turns by a random angle if blocked.

    Attributes:
        turns: int32[], remaining turns, negative to the left.
        position: float32[2], position before the last action.
        walked: bool[], whether the last action was a step forward.
    """

    turns: jax.Array
    position: jax.Array
    walked: jax.Array


class Acts(NamedTuple):
    """The actions of the player, -1 without one: to the left, to the right, forward, interact."""

    left: int
    right: int
    ahead: int
    hand: int


def acts_of(names: Sequence[str]) -> Acts:
    """The player's actions among those of an environment; it sidesteps where it cannot turn."""
    wanted = (
        ("turn left", "move left"),
        ("turn right", "move right"),
        ("forward",),
        ("interact", "pick up"),
    )
    numbers = {name: number for number, name in enumerate(names)}
    return Acts(*(next((numbers[n] for n in each if n in numbers), -1) for each in wanted))


def walk_on(walk: Walk, key: jax.Array, state: Any, acts: Acts) -> tuple[Walk, jax.Array]:
    """The next action."""
    turn_key, side_key, hand_key = jax.random.split(key, 3)
    stuck = walk.walked & jnp.all(walk.position == state.position)
    # A turn now and then, even if not blocked, lets it explore more.
    drift = jax.random.uniform(hand_key) < 0.03
    angle = jax.random.randint(turn_key, (), 1, 9, jnp.int32)
    side = jnp.where(jax.random.bernoulli(side_key), 1, -1).astype(jnp.int32)
    turns = jnp.where((stuck | drift) & (walk.turns == 0), angle * side, walk.turns)
    turning = turns != 0
    touching = (acts.hand >= 0) & stuck & (jax.random.uniform(side_key) < 0.5)
    sides = jnp.where(turns < 0, acts.left, acts.right)
    action = jnp.where(touching, acts.hand, jnp.where(turning, sides, acts.ahead))
    turns = jnp.where(touching, turns, turns - jnp.sign(turns))
    walked = action == acts.ahead
    # Without a way ahead, the first action: waiting, in Doom.
    return Walk(turns, state.position, walked), jnp.maximum(action, 0).astype(jnp.int32)


def play(env: Env, params: Any, seed: int) -> tuple[Any, np.ndarray]:
    """Play episodes in parallel, each with its own seed.

    Returns:
        States at regular times, [EPISODES, STEPS // EVERY, ...], and their label images,
        uint8[EPISODES, STEPS // EVERY, h, w].
    """

    acts = acts_of(env.action_names)

    def step(carry: Any, key: jax.Array) -> tuple[Any, None]:
        _, state, walk = carry
        policy_key, step_key = jax.random.split(key)
        walk, action = walk_on(walk, policy_key, state, acts)
        obs, state, *_ = env.step(step_key, state, action, params)
        return (obs, state, walk), None

    def stretch(carry: Any, key: jax.Array) -> tuple[Any, Any]:
        carry, _ = jax.lax.scan(step, carry, jax.random.split(key, EVERY))
        return carry, carry[:2]

    def episode(key: jax.Array) -> Any:
        reset_key, key = jax.random.split(key)
        obs, state = env.reset(reset_key, params)
        walk = Walk(jnp.int32(0), state.position, jnp.bool_(False))
        carry = obs, state, walk
        return jax.lax.scan(stretch, carry, jax.random.split(key, STEPS // EVERY))[1]

    keys = jax.random.split(jax.random.key(seed), EPISODES)
    images, states = jax.device_get(jax.jit(jax.vmap(episode))(keys))
    return states, images


def interest() -> np.ndarray:
    """float64[labels]: the value of showing each label for the first time."""
    worth = np.zeros(len(LABEL_NAMES))
    worth[list(WALL_LABELS)] = 0.6
    worth[list(DECAL_LABELS)] = 1.2
    worth[list(DOOR_LABELS)] = 2.0
    worth[[label for label in THING_OF if label < len(worth)]] = 3.0
    return worth


def choose(images: np.ndarray, count: int) -> list[tuple[int, int]]:
    """The (episode, time) of views that together show many things; at most one per episode.

    Args:
        images: uint8[episodes, times, h, w], label images.
        count: number of views.
    """
    shares = np.stack([(images == label).mean((2, 3)) for label in range(len(LABEL_NAMES))], -1)
    # A few percent of the image are enough to see a thing. Views with much floor beat close walls.
    shown = np.minimum(shares / 0.04, 1.0)
    open_view = np.minimum(shares[..., FLOOR] / 0.2, 1.0)
    worth, chosen = interest(), []
    for _ in range(count):
        score = shown @ worth + 2.0 * open_view
        for episode, _ in chosen:
            score[episode] = -1.0
        episode, time = divmod(int(score.argmax()), images.shape[1])
        chosen.append((episode, time))
        # Labels already shown count less.
        worth = worth * (1.0 - 0.6 * shown[episode, time])
    return chosen


def block(name: str, seed: int = 0) -> Image.Image:
    """The picture of one environment: title, map of the first view, views."""
    width, height = GLANCE
    small, params = jaxenstein.make(name, height=height, width=width, observation="labels")
    assert isinstance(small, FirstPerson)
    states, images = play(small, params, seed)
    chosen = choose(images, ACROSS * DOWN)
    seen = [jax.tree.map(lambda leaf, at=at: leaf[at], states) for at in chosen]
    env, _ = jaxenstein.make(name, height=VIEW[1], width=VIEW[0])
    stacked = jax.tree.map(lambda *leaves: np.stack(leaves), *seen)
    frames = np.asarray(jax.jit(jax.vmap(env.observe, (0, None)))(stacked, params))
    sheet = Image.new("RGB", block_size(), BACKGROUND)
    _write(ImageDraw.Draw(sheet), name, ENTRIES[name].summary, sheet.width)
    overview = map_picture(small, params, seen[0])
    corner = (MAP_SIDE - overview.width) // 2, TITLE + (MAP_SIDE - overview.height) // 2
    sheet.paste(overview, corner)
    for i, frame in enumerate(frames):
        left = MAP_SIDE + 2 * GAP + (i % ACROSS) * (VIEW[0] + GAP)
        top = TITLE + (i // ACROSS) * (VIEW[1] + GAP)
        sheet.paste(Image.fromarray(frame), (left, top))
    return sheet


def block_size() -> tuple[int, int]:
    """Width and height of a block in pixels."""
    return MAP_SIDE + 2 * GAP + ACROSS * (VIEW[0] + GAP) - GAP, TITLE + MAP_SIDE


def map_picture(env: Env, params: Any, state: Any) -> Image.Image:
    """The map of a state, with all things and the agent."""
    tilemap, seen = env.tilemap_of(state), snapshots(env, params)(state)
    picture = draw_map(tilemap, size=MAP_SIDE).state(
        pose=(seen["positions"], float(seen["headings"])),
        field_of_view=env.field_of_view,
        closed=closed_doors(tilemap, seen["doors"], seen["closed"]),
        things=(seen["sprites"], seen["labels"], seen["visible"]),
    )
    return picture.image()


def _write(draw: ImageDraw.ImageDraw, name: str, summary: str, width: int) -> None:
    draw.text((0, 0), name, TEXT, ImageFont.load_default(16))
    small = ImageFont.load_default(12)
    while draw.textlength(summary, small) > width:
        summary = summary.removesuffix(" ...").rsplit(" ", 1)[0] + " ..."
    draw.text((0, 20), summary, FAINT, small)


def arrange(blocks: Sequence[Image.Image]) -> Image.Image:
    """All blocks on one sheet, row by row."""
    width, height = block_size()
    columns = min(COLUMNS, len(blocks))
    rows = -(-len(blocks) // columns)
    size = columns * (width + MARGIN) + MARGIN, rows * (height + MARGIN) + MARGIN
    sheet = Image.new("RGB", size, BACKGROUND)
    for i, picture in enumerate(blocks):
        row, column = divmod(i, columns)
        sheet.paste(picture, (MARGIN + column * (width + MARGIN), MARGIN + row * (height + MARGIN)))
    return sheet
