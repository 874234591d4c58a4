"""Compare `look="game"` with frames of the running game, pixel by pixel.

    python -m fidelity.doom_looks [--frames N] [--seed N] [--only NAME] [--picture FILE.png]

Needs the extra `vizdoom`. The game plays random buttons, and our frame is drawn from the pose and
the things of each of its states, with the best-fitting picture of each thing. The table has the
share of pixels with three equal bytes, the number of frames that are equal as a whole, and the mean
absolute error of a byte, at two screen sizes of the game and at 64x48, the middle one of every 5x5
pixels of the game's 320x240. The indented line compares with another frame.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jaxenstein
from fidelity.doom_picture import SIZES, renderers, shares
from fidelity.doom_views import View, fitted, views
from jaxenstein.engine.render import render
from jaxenstein.files import check_writable
from jaxenstein.tasks.doom.fixed import ONE
from jaxenstein.tasks.doom.game_look import gilded
from jaxenstein.tasks.doom.view import EYE
from jaxenstein.tasks.doom.wad import Wad, find_iwad
from jaxenstein.view.recording import mosaic, save_png

SCENARIOS = "my_way_home", "health_gathering", "health_gathering_supreme"
SMALL, EACH = (64, 48), np.s_[2::5, 2::5]
PICTURES = 4

Pairs = list[tuple[np.ndarray, np.ndarray]]


def ours(scenario: str, views: Sequence[View], size: tuple[int, int]) -> list[np.ndarray]:
    """Our frame uint8[height, width, 3] for each view; `size` is (width, height)."""
    name, (width, height) = f"doom-{scenario.replace('_', '-')}", size
    env: Any
    env, params = jaxenstein.make(name, look="game", width=width, height=height)
    first = env.first_state(jax.random.key(0), params)
    looks = [(one.sprite, frame.letter) for one in env.animations for frame in one.frames]

    @jax.jit
    def draw(state: Any, lift: jax.Array, sprites: Any, gold: jax.Array) -> jax.Array:
        scene = env.dressed(env.scene(state, params), state)
        sprites = sprites.replace(position=env.to_tiles(sprites.position))
        scene = scene.replace(lift=lift, sprites=sprites)
        return gilded(render(scene, env.camera, "rgb", env.sprite_layers), gold)

    found = []
    for view in views:
        place = jnp.array([view.pose.x, view.pose.y], jnp.int32)
        angle = jnp.uint32(view.pose.angle)
        state = env.at_pose(first, place, jnp.zeros(2, jnp.int32), angle)
        sprites = jax.tree.map(np.zeros_like, env.scene(state, params).sprites)
        places = np.zeros(sprites.position.shape, np.int32)
        for number, seen in enumerate(view.things):
            places[number] = seen.x, seen.y
            sprites.visible[number] = True
            # Use frame A for a thing of which we have only one frame.
            which = (seen.look.sprite, seen.look.frame)
            which = which if which in looks else (seen.look.sprite, "A")
            sprites.picture[number] = looks.index(which)
        lift = np.float32((view.pose.z - EYE * ONE) / (ONE * env.unit))
        sprites = sprites.replace(position=places)
        found.append(np.asarray(draw(state, lift, sprites, jnp.bool_(view.gold > 0))))
    return found


def compare(scenario: str, frames: int, seed: int) -> Pairs:
    """Play a scenario at all sizes and print the table; return the pairs of the first size."""
    pictures = Wad(find_iwad())
    screens = renderers(scenario, pictures)
    played = [list(views(scenario, size, frames, seed)) for size in SIZES]
    order = [screens[size] for size in SIZES]
    same = [fitted(order, pictures, one) for one in zip(*played, strict=True)]
    seen = dict(zip(SIZES, zip(*same, strict=True), strict=True))
    theirs = {size: [view.frame for view in found] for size, found in seen.items()}
    theirs[SMALL] = [frame[EACH] for frame in theirs[SIZES[1]]]
    pairs: Pairs = []
    for size, expected in theirs.items():
        images = ours(scenario, seen[SIZES[0]], size)
        print("{} {}x{}: {}".format(scenario, *size, shares(images, expected)), flush=True)
        pairs = pairs or list(zip(images, expected, strict=True))
    turned = [expected for _, expected in pairs]
    turned = [*turned[1:], turned[0]]
    print(f"    another frame: {shares([image for image, _ in pairs], turned)}", flush=True)
    return pairs


def main(argv: Sequence[str] | None = None) -> int:
    """Play, compare and print; write an image of the worst frames, ours on top."""
    parser = argparse.ArgumentParser(description="Compare look='game' with the running game.")
    parser.add_argument(
        "--frames", type=int, default=200, help="frames per scenario (default %(default)s)"
    )
    parser.add_argument("--seed", type=int, default=0, help="random seed (default %(default)s)")
    parser.add_argument("--only", choices=SCENARIOS, help="compare only this scenario")
    parser.add_argument(
        "--picture", type=Path, metavar="FILE", help="write the worst frames, ours on top"
    )
    options = parser.parse_args(argv)
    if options.picture:
        check_writable(options.picture)
    worst: Pairs = []
    for name in [options.only] if options.only else SCENARIOS:
        pairs = compare(name, options.frames, options.seed)
        worst += sorted(pairs, key=lambda pair: (pair[0] == pair[1]).all(axis=-1).mean())[:PICTURES]
    if options.picture:
        above = np.stack([np.concatenate(pair) for pair in worst])
        save_png(mosaic(above, PICTURES), options.picture)
    return 0


if __name__ == "__main__":
    sys.exit(main())
