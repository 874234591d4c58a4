"""How large things are drawn in Doom's scenarios, here and in the game.

    python -m fidelity.doom_sizes [--episodes N] [--seed N] [--counts] [ID ...]

Needs the extra `vizdoom`. Random players are watched in the game on a screen of 1280 by 960, the
eye not bobbing: of each thing that is seen whole, what its pixels cover in map units, from the
thing's place on the floor, beside the box and the area of our pictures. `--counts` lets random
players see labels of 16 by 64 at frame skip 4 in both, and prints how many pixels each label has a
frame, with standard errors.
"""

from __future__ import annotations

import argparse
import collections
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jaxenstein
from fidelity.players import mean_and_error
from jaxenstein.adapters.vizdoom import GameSession
from jaxenstein.adapters.vizdoom_buffers import SCREENS, running
from jaxenstein.engine.art import load_art
from jaxenstein.maps.symbols import LABEL_NAMES
from jaxenstein.tasks.doom.view import ROW_FOCAL_SHARE, Picture

IDS = ("doom-take-cover", "doom-defend-the-center", "doom-defend-the-line")
VARIABLES = ("POSITION_X", "POSITION_Y", "ANGLE", "CAMERA_POSITION_Z")
# Tics of an episode that are watched, and map units from which on things are looked at.
_TICS, _NEAREST = 150, 30
# Decisions that a random player keeps an action for, on average; those that are watched.
_KEPT, _DECISIONS = 8, 75


def covered(seen: Any, label: Any) -> list[float] | None:
    """Left, right, lower and upper end and area of a thing's pixels; None if an edge cuts them."""
    x, y, angle, eye = seen.game_variables
    east, north = label.object_position_x - x, label.object_position_y - y
    cos, sin = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    depth, aside = east * cos + north * sin, east * sin - north * cos
    mask = seen.labels_buffer == label.value
    rows, columns = np.nonzero(mask)
    if depth < _NEAREST or not len(rows):
        return None
    height, width = mask.shape
    if not (
        rows.min() > 0 < columns.min() and rows.max() < height - 1 and columns.max() < width - 1
    ):
        return None
    across, up = depth / (width / 2), depth / (ROW_FOCAL_SHARE * height)
    return [
        (columns.min() - width / 2) * across - aside,
        (columns.max() + 1 - width / 2) * across - aside,
        eye - (rows.max() + 1 - height / 2) * up,
        eye - (rows.min() - height / 2) * up,
        mask.sum() * across * up,
    ]


def measured(env: Any, episodes: int, seed: int) -> dict[str, np.ndarray]:
    """float[N, 5] of `covered` of each thing by the game's name."""
    found: dict[str, list[list[float]]] = collections.defaultdict(list)
    draw = np.random.default_rng(seed)

    def prepare(game: Any) -> None:
        game.set_labels_buffer_enabled(True)
        game.set_objects_info_enabled(True)
        game.set_render_hud(False)
        game.set_render_weapon(False)
        game.set_render_crosshair(False)
        game.add_game_args("+movebob 0")

    with running(
        env.scenario, seed=seed, variables=VARIABLES, size=SCREENS[-1], prepare=prepare
    ) as game:
        count = len(env.button_names)
        for _ in range(episodes):
            game.new_episode()
            held = [0] * count
            for _ in range(_TICS):
                if game.is_episode_finished():
                    break
                seen = game.get_state()
                for label in seen.labels:
                    if label.object_name in env.game_labels and (box := covered(seen, label)):
                        found[label.object_name].append(box)
                if draw.random() * _KEPT < 1:
                    held = np.eye(count + 1, count, dtype=int)[draw.integers(count + 1)].tolist()
                game.make_action(held, 1)
    return {name: np.array(rows) for name, rows in found.items()}


def box(picture: Picture) -> list[float]:
    """The same of one of our pictures."""
    bits = (load_art(picture.art)[0][None] >> np.arange(31, -1, -1)[:, None].astype(np.uint32)) & 1
    cell = picture.side / 32
    rows, columns = np.nonzero(bits)
    return [
        (columns.min() - 16) * cell,
        (columns.max() - 15) * cell,
        picture.lift + (31 - rows.max()) * cell,
        picture.lift + (32 - rows.min()) * cell,
        bits.sum() * cell**2,
    ]


def pixels(frames: Sequence[np.ndarray]) -> np.ndarray:
    """float[256]: pixels of each label a frame."""
    return np.mean([np.bincount(frame.ravel(), minlength=256) for frame in frames], axis=0)


def seen_here(env: Any, params: Any, episodes: int, seed: int) -> list[np.ndarray]:
    """What random players see in our environment, episode by episode as `pixels`."""

    def play(key: jax.Array) -> tuple[jax.Array, jax.Array]:
        def step(carry: tuple[Any, jax.Array], key: jax.Array) -> Any:
            state, action = carry
            keys = jax.random.split(key, 3)
            drawn = jax.random.randint(keys[0], (), 0, env.num_actions)
            action = jnp.where(jax.random.uniform(keys[1]) * _KEPT < 1, drawn, action)
            after = env.advance(keys[2], state, action, params)[0]
            return (after, action), (env.observe(state, params), state.done)

        first, steps = jax.random.split(key)
        start = env.init_state(first, params), jnp.int32(0)
        return jax.lax.scan(step, start, jax.random.split(steps, _DECISIONS))[1]

    keys = jax.random.split(jax.random.key(seed), episodes)
    images, done = jax.device_get(jax.jit(jax.vmap(play))(keys))
    return [pixels(frames[~over]) for frames, over in zip(images, done, strict=True)]


def seen_there(env: Any, params: Any, episodes: int, seed: int) -> list[np.ndarray]:
    """Likewise in the game."""
    random, found = np.random.default_rng(seed), []
    with GameSession(env, params, seed) as session:
        for number in range(episodes):
            session.reset(seed + number)
            action, frames = 0, []
            while not session.over and len(frames) < _DECISIONS:
                frames.append(np.asarray(session.observation))
                if random.random() * _KEPT < 1:
                    action = int(random.integers(env.num_actions))
                session.step(action)
            found.append(pixels(frames))
    return found


def counts(id: str, episodes: int, seed: int) -> dict[int, list[float]]:
    """Pixels of each label that random players see, means and errors here and in the game."""
    settings: dict[str, Any] = {"height": 16, "width": 64, "frame_skip": 4}
    env: Any
    env, params = jaxenstein.make(id, observation="labels", **settings)
    params = env.check_params(params)
    sides = [np.array(seen(env, params, episodes, seed)) for seen in (seen_here, seen_there)]
    found = np.flatnonzero(sides[0].any(axis=0) | sides[1].any(axis=0)).tolist()
    return {n: [v for side in sides for v in mean_and_error(side[:, n])] for n in found}


def in_words(name: str, row: Sequence[float]) -> str:
    """A line of the table."""
    return f"{name:36}" + "".join(f"{value:9.2f}" for value in row)


def main(argv: Sequence[str] | None = None) -> None:
    """Play and print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    parser.add_argument("ids", nargs="*", metavar="ID", default=IDS, help="(default: %(default)s)")
    parser.add_argument("--episodes", type=int, default=6, help="(default %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the draws (default %(default)s)")
    parser.add_argument("--counts", action="store_true", help="pixels of each label as well")
    options = parser.parse_args(argv)
    for id in options.ids:
        env: Any = jaxenstein.make(id)[0]
        print(f"{id:36}     left    right    lower    upper     area", flush=True)
        for name, rows in measured(env, options.episodes, options.seed).items():
            print(in_words(f"game: {name} ({len(rows)})", np.median(rows, axis=0).tolist()))
        shown = [thing for part in env.parts for thing in part.objects]
        for picture in (picture for thing in shown for picture in thing.pictures):
            print(in_words(f"here: {picture.art}", box(picture)))
        if options.counts:
            print(f"{'pixels of a label':36}     here       +-     game       +-")
            for label, row in counts(id, options.episodes, options.seed).items():
                print(in_words(LABEL_NAMES[label], row), flush=True)


if __name__ == "__main__":
    main()
