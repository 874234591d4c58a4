"""The pictures of the site: `python -m docs.pictures WHAT [ID ...]`.

- `episodes`: docs/_static/episodes/ID.webp, an animated episode of the expert, a still for readers
  who prefer reduced motion, and docs/images/environments/ID-map.png. If the package has an agent
  `pretrained/ID`, ID-agent.webp and its still show the agent and its view;
- `sheets`: docs/images/environments/ID.png, views of an environment and its map, and a sheet of all
  environments, docs/images/environments.png (`docs/gallery.py`);
- `looks`: docs/images/looks/ID.png, the looks of the first environment of each family;
- `films`: docs/_static/episodes/ID-both.webp and its still, the start of an episode, or some short
  episodes, of the agent `pretrained/ID-pixels` here and in ViZDoom, and, without ids,
  doom-both.webp, a whole episode beside maps (needs the extras `baselines` and `vizdoom`);
- `engine`: docs/images/engine, results of the engine (`docs/engine_pictures.py`).

Equal versions of JAX, Pillow and this code draw equal files.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np
from PIL import Image

import jaxenstein
from docs import gallery
from docs.page_parts import FAMILIES, PIXELS, each
from jaxenstein.baselines import load_policy
from jaxenstein.baselines.runs.trained import pretrained
from jaxenstein.errors import SettingError
from jaxenstein.files import atomic, make_folder
from jaxenstein.tasks.first_person import FirstPerson
from jaxenstein.view.episode import Episode, Pictures, overview
from jaxenstein.view.recording import save_png
from jaxenstein.view.topdown import draw_map

HERE = Path(__file__).parent
EPISODES = HERE / "_static" / "episodes"
IMAGES = HERE / "images"
# (height, width) of the view, and the longer side of the map beside it.
VIEW, BESIDE = (168, 224), 180
# The longer side of the map on its own.
MAP_SIZE = 560
# The last step shown of long episodes, the maximum number of pictures, and their rate.
MOST_STEPS, PICTURES, FRAMES_A_SECOND = 480, 60, 10
# WebP quality, 0 to 100; from about 60 on, edges of walls and sprites are clean.
QUALITY = 60
# For looks: (width, height) of a view, the gap between views, and the number of candidate starts.
LOOK, GAP, STARTS = (136, 102), 4, 48
# For the film beside maps: the agent, the seed of an episode that starts far from the goal, and the
# steps per picture.
AGENT, SEED, EVERY = "pretrained/doom-my-way-home", 16, 2
# For the other films: the tics of a picture, about real time, the maximum number of pictures of an
# episode, and the number of pictures until which episodes follow each other.
TICS, SHOWN, ENOUGH = 4, 100, 30
FILMED = tuple(name.removesuffix(PIXELS) for name in pretrained() if name.endswith(PIXELS))
"""The scenarios of ViZDoom for which the package has an agent that sees pixels."""


def play(name: str, seed: int = 1) -> Episode:
    """The episode to show of an environment."""
    height, width = VIEW
    env, params = jaxenstein.make(name, height=height, width=width)
    return jaxenstein.record(env, params, "expert", seed=seed, steps=MOST_STEPS)


def play_agent(name: str, seed: int = 1) -> Episode:
    """An episode of the pretrained agent with this name."""
    policy = load_policy(f"pretrained/{name}")
    return jaxenstein.record(policy.env, policy.params, policy, seed=seed, steps=MOST_STEPS)


def save_webp(pictures: Sequence[np.ndarray], path: Path) -> None:
    """Write an animation that repeats forever and pauses at its last picture."""
    first, *others = map(Image.fromarray, pictures)
    pause = 1000 // FRAMES_A_SECOND
    with atomic(path) as temporary:
        first.save(
            temporary,
            format="WEBP",
            save_all=True,
            append_images=others,
            duration=[pause] * len(others) + [10 * pause],
            loop=0,
            quality=QUALITY,
            method=6,
        )


def save_with_still(pictures: Sequence[np.ndarray], name: str) -> int:
    """Write an animation and its still; returns the bytes of the animation."""
    path = EPISODES / f"{name}.webp"
    save_webp(pictures, path)
    save_webp(pictures[len(pictures) // 2 :][:1], EPISODES / f"{name}-still.webp")
    return path.stat().st_size


def animate(episode: Episode, name: str, scale: int = 1) -> int:
    """Write the animation of an episode and its still; returns the bytes of the animation."""
    every = -(-episode.steps // (PICTURES - 1))
    pictures = list(Pictures(episode, scale=scale, map_size=BESIDE, every=every))
    return save_with_still(pictures, name)


def draw_episode(name: str) -> int:
    """Write the files of an environment; returns the bytes of its animations."""
    episode = play(name)
    # For a class such as examples.custom_shooter:Outpost, file names use the last part.
    name = name.rpartition(":")[2].lower()
    size = animate(episode, name)
    if name in pretrained():
        seen = play_agent(name)
        rows, columns = seen.frames.shape[1:3]
        size += animate(seen, f"{name}-agent", min(VIEW[0] // rows, VIEW[1] // columns))
    assert episode.tilemap is not None
    ground = draw_map(episode.tilemap, size=MAP_SIZE)
    save_png(
        np.asarray(overview(ground, episode, 0).image()),
        IMAGES / "environments" / f"{name}-map.png",
    )
    return size


def has_patterns(name: str) -> bool:
    """Whether an environment can have patterned surfaces."""
    try:
        jaxenstein.make(name, look="patterned")
    except SettingError:
        return False
    return True


WITH_LOOKS = tuple(family.ids[0] for family in FAMILIES if has_patterns(family.ids[0]))
"""The first environment of each family that can have patterned surfaces."""


def strip(name: str) -> np.ndarray:
    """uint8[height, width, 3]: a start with a plain, a patterned and two random looks.

    The start is the one with the most to see.
    """
    width, height = LOOK
    env, params = jaxenstein.make(name, look="random", height=height, width=width)
    assert isinstance(env, FirstPerson)
    glance, _ = jaxenstein.make(
        name, observation="labels", height=gallery.GLANCE[1], width=gallery.GLANCE[0]
    )
    keys = jax.random.split(jax.random.key(0), STARTS)
    states = jax.jit(jax.vmap(env.first_state, (0, None)))(keys, params)
    labels = jax.jit(jax.vmap(glance.observe, (0, None)))(states, params)
    start, _ = gallery.choose(np.asarray(labels)[:, None], 1)[0]
    state = jax.tree.map(lambda leaf: leaf[start], states)
    plain, patterned = (
        jaxenstein.make(name, look=look, height=height, width=width)[0]
        for look in ("plain", "patterned")
    )
    seen = [(plain, state), (patterned, state)]
    seen += [(env, state.replace(look=np.uint32(seed))) for seed in (1, 6)]
    return _side_by_side([_frame(one, state, params) for one, state in seen])


def _frame(env: Any, state: Any, params: Any) -> np.ndarray:
    return np.asarray(jax.jit(env.observe)(state, params))


def _side_by_side(frames: Sequence[np.ndarray]) -> np.ndarray:
    gap = np.full((LOOK[1], GAP, 3), 255, np.uint8)
    return np.concatenate([part for frame in frames for part in (gap, frame)][1:], axis=1)


def draw_episodes(ids: Sequence[str]) -> None:
    """Draw the animations and the maps."""
    make_folder(EPISODES)
    make_folder(IMAGES / "environments")
    sizes = [draw_episode(name) for name in each(ids, "recording")]
    print(f"wrote {len(sizes)} animations to {EPISODES}, {sum(sizes) / 1000:.0f} kB")


def draw_sheets(ids: Sequence[str]) -> None:
    """Draw the pictures of environments and, without ids, the sheet of all environments."""
    folder, blocks = make_folder(IMAGES / "environments"), []
    for name in each(ids, "drawing"):
        blocks.append(gallery.block(name))
        save_png(np.asarray(blocks[-1])[gallery.TITLE :], folder / f"{name}.png")
    if not ids:
        save_png(np.asarray(gallery.arrange(blocks)), IMAGES / "environments.png")


def draw_looks(ids: Sequence[str]) -> None:
    """Draw the strips of looks."""
    folder = make_folder(IMAGES / "looks")
    for name in each(ids or WITH_LOOKS, "drawing"):
        save_png(strip(name), folder / f"{name}.png")


def draw_films(ids: Sequence[str]) -> None:
    """Draw the films of agents here and in ViZDoom."""
    from jaxenstein.cli.beside_vizdoom import Both, film, play_both

    for name in each(ids or FILMED, "filming"):
        policy = load_policy(f"pretrained/{name}{PIXELS}")
        every = max(1, TICS // policy.env.frame_skip)
        gap = [(0, 0), (0, 0), (0, GAP), (0, 0)]
        pictures: list[np.ndarray] = []
        seed = 0
        while len(pictures) < ENOUGH:
            seed += 1
            here, there = (part.frames[: SHOWN * every : every] for part in play_both(policy, seed))
            pictures += Both(np.pad(here, gap, constant_values=255), there)
        save_with_still(pictures, f"{name}-both")
    if not ids:
        beside_maps, _ = film(load_policy(AGENT), SEED, EVERY)
        save_webp([*beside_maps], EPISODES / "doom-both.webp")


def draw_engine(ids: Sequence[str]) -> None:
    """Draw the pictures of the engine in docs/architecture.md."""
    from docs.engine_pictures import draw_all

    del ids
    draw_all(make_folder(IMAGES / "engine"))


DRAWN: Mapping[str, Callable[[Sequence[str]], None]] = {
    "episodes": draw_episodes,
    "sheets": draw_sheets,
    "looks": draw_looks,
    "films": draw_films,
    "engine": draw_engine,
}


def main(argv: Sequence[str] | None = None) -> None:
    """Draw the chosen pictures."""
    parser = argparse.ArgumentParser(prog="python -m docs.pictures", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("what", choices=DRAWN, metavar="WHAT", help=", ".join(DRAWN))
    told = "environments (default: all but variants)"
    parser.add_argument("ids", nargs="*", metavar="ID", help=told)
    options = parser.parse_args(argv)
    DRAWN[options.what](options.ids)


if __name__ == "__main__":
    main()
