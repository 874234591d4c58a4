"""An animated episode of each environment, and its map, for the site.

    python -m docs.episodes [ID ...]

writes docs/_static/episodes/ID.webp, a still of it for readers who prefer less motion, and
docs/images/environments/ID-map.png. The project's own recorder plays and draws them, with the
player that knows the way. Where a trained agent `pretrained/ID` comes with the package,
ID-agent.webp and its still show that one, and what it sees. The same versions of JAX, Pillow and
this code give the same files.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

import jaxenstein
from docs.command import each, parser_of
from jaxenstein.baselines import load_policy
from jaxenstein.baselines.runs.trained import pretrained
from jaxenstein.files import atomic, make_folder
from jaxenstein.view.episode import Episode, Pictures, overview
from jaxenstein.view.recording import save_png
from jaxenstein.view.topdown import draw_map

HERE = Path(__file__).parent
EPISODES = HERE / "_static" / "episodes"
MAPS = HERE / "images" / "environments"
# The view in pixels, height first, and the longer side of the map beside it.
VIEW, BESIDE = (168, 224), 180
# The map by itself.
MAP_SIZE = 560
# Long episodes are shown up to this step, in this many pictures at most.
MOST_STEPS, PICTURES, FRAMES_A_SECOND = 480, 60, 10
# WebP's 0 to 100; edges of walls and pixels of sprites stay clean from about here on.
QUALITY = 60


def play(name: str, seed: int = 1) -> Episode:
    """The episode of an environment that is shown."""
    height, width = VIEW
    env, params = jaxenstein.make(name, height=height, width=width)
    return jaxenstein.record(env, params, "expert", seed=seed, steps=MOST_STEPS)


def play_agent(name: str, seed: int = 1) -> Episode:
    """An episode of the package's trained agent of that name."""
    policy = load_policy(f"pretrained/{name}")
    return jaxenstein.record(policy.env, policy.params, policy, seed=seed, steps=MOST_STEPS)


def save_webp(pictures: Sequence[np.ndarray], path: Path) -> None:
    """Write an animation that repeats for ever, whole or not at all; its last picture stays."""
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


def animate(episode: Episode, name: str, scale: int = 1) -> int:
    """Write the animation of an episode and its still; returns the bytes of the animation."""
    every = -(-episode.steps // (PICTURES - 1))
    pictures = list(Pictures(episode, scale=scale, map_size=BESIDE, every=every))
    path = EPISODES / f"{name}.webp"
    save_webp(pictures, path)
    save_webp(pictures[len(pictures) // 2 :][:1], EPISODES / f"{name}-still.webp")
    return path.stat().st_size


def draw(name: str) -> int:
    """Write the files of an environment; returns the bytes of its animations."""
    episode = play(name)
    # Of a class ("examples.custom_shooter:Outpost") the files have the last part.
    name = name.rpartition(":")[2].lower()
    size = animate(episode, name)
    if name in pretrained():
        seen = play_agent(name)
        rows, columns = seen.frames.shape[1:3]
        size += animate(seen, f"{name}-agent", min(VIEW[0] // rows, VIEW[1] // columns))
    assert episode.tilemap is not None
    ground = draw_map(episode.tilemap, size=MAP_SIZE)
    save_png(np.asarray(overview(ground, episode, 0).image()), MAPS / f"{name}-map.png")
    return size


def main(argv: Sequence[str] | None = None) -> None:
    """Draw those that are asked for, or all."""
    ids = parser_of("docs.episodes", __doc__).parse_args(argv).ids
    make_folder(EPISODES)
    make_folder(MAPS)
    sizes = [draw(name) for name in each(ids, "recording")]
    print(f"wrote {len(sizes)} animations to {EPISODES}, {sum(sizes) / 1000:.0f} kB")


if __name__ == "__main__":
    main()
