"""Compare `look="game"` with frames of the running game, pixel by pixel.

    python -m fidelity.doom_looks [--frames N] [--seed N] [--only NAME] [--picture FILE.png]

Needs the extra `vizdoom`. The game plays random buttons, and our frame is drawn from the pose and
the things of each of its states, with the best-fitting picture of each thing. The table has the
share of pixels with three equal bytes, the number of frames that are equal as a whole, and the mean
absolute error of a byte, at two screen sizes of the game and at 64x64, which has pixels of the
game's 320x240. The indented line compares with another frame.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jaxenstein
from fidelity.commands import run_command
from fidelity.doom_picture import SIZES, STEPPED, renderers, shares
from fidelity.doom_views import PLAYER, View, fitted, views
from jaxenstein.adapters.vizdoom_buffers import picked_image
from jaxenstein.cli.arguments import add_seed, whole
from jaxenstein.engine.render import render
from jaxenstein.engine.scene import Held, Sprites
from jaxenstein.files import check_writable
from jaxenstein.tasks.doom.fixed import ONE
from jaxenstein.tasks.doom.game_look import gilded
from jaxenstein.tasks.doom.game_weapon import pictures_of
from jaxenstein.tasks.doom.view import EYE
from jaxenstein.tasks.doom.wad import Wad, find_iwad
from jaxenstein.view.recording import mosaic, save_png

LEVEL = (
    *("my_way_home", "health_gathering", "health_gathering_supreme", "basic", "take_cover"),
    *("defend_the_line", "defend_the_center", "deadly_corridor"),
)
SCENARIOS = (*LEVEL, *STEPPED)
# A shade is worth so many steps of the map's light.
LIGHT_OF_A_SHADE = 4
SMALL = 64, 64
PICTURES = 4

Pairs = list[tuple[np.ndarray, np.ndarray]]


def ours(
    scenario: str, views: Sequence[View], size: tuple[int, int], samples: int = 1
) -> list[np.ndarray]:
    """Our frame uint8[height, width, 3] for each view; `size` is (width, height)."""
    name, (width, height) = f"doom-{scenario.replace('_', '-')}", size
    env: Any
    env, params = jaxenstein.make(name, look="game", width=width, height=height, samples=samples)
    first = env.first_state(jax.random.key(0), params)
    count = max(len(view.things) for view in views)

    @jax.jit
    def draw(state: Any, lift: jax.Array, sprites: Any, held: Any, glare: jax.Array, gold: Any):
        scene = env.dressed(env.scene(state, params), state)
        scene = scene.replace(lift=lift, sprites=sprites)
        if scene.held is not None:
            scene = scene.replace(held=held, glare=glare)
        return gilded(render(scene, env.camera, "rgb", env.sprite_layers), gold)

    found = []
    for view in views:
        place = jnp.array([view.pose.x, view.pose.y], jnp.int32)
        angle = jnp.uint32(view.pose.angle)
        state = env.at_pose(first, place, jnp.zeros(2, jnp.int32), angle)
        lift = np.float32((view.pose.z - EYE * ONE) / (ONE * env.unit))
        glare = np.int32(view.flash // LIGHT_OF_A_SHADE)
        gold = np.bool_(view.gold > 0)
        image = draw(state, lift, billboards(env, view, count), over(env, view), glare, gold)
        found.append(np.asarray(image))
    return found


def billboards(env: Any, view: View, count: int) -> Sprites:
    """The things of a view in our pictures: those with the nearest height; unknown ones are not."""
    places, rows, visible = np.zeros((count, 2), np.int32), np.zeros(count, np.int32), []
    table = env.game_look.views
    for number, (look, x, y, z) in enumerate(view.things):
        same = [
            (abs(own.height * ONE - z), index)
            for index, own in enumerate(env.game_look.looks)
            if (PLAYER if own.green else own.sprite, own.letter) == (look.sprite, look.frame)
        ]
        visible.append(bool(same))
        if same:
            places[number], index = (x, y), min(same)[1]
            rows[number] = table.first[index] + look.side * table.turns[index]
    shown = np.array([*visible, *[False] * (count - len(visible))])
    return Sprites(env.to_tiles(jnp.asarray(places)), jnp.asarray(rows), jnp.asarray(shown))


def over(env: Any, view: View) -> Held | None:
    """The weapon of a view."""
    if not env.game_look.weapons:
        return None
    known, held = pictures_of(env.game_look.weapons), [*reversed(view.held)]
    pictures = [known.index((one.sprite, one.frame)) for one in held]
    places = [(one.x / ONE, one.y / ONE) for one in held]
    lacking = 2 - len(held)
    return Held(
        jnp.array([*pictures, *[0] * lacking], np.int32),
        jnp.array([*places, *[(0, 0)] * lacking], np.float32),
        jnp.array([True] * len(held) + [False] * lacking),
    )


def compare(scenario: str, frames: int, seed: int) -> Pairs:
    """Play a scenario at all sizes and print the table; return the pairs of the first size."""
    pictures = Wad(find_iwad())
    screens = renderers(scenario, pictures)
    played = [list(views(scenario, size, frames, seed)) for size in SIZES]
    # Of maps that are drawn flat, one size tells as much about the things.
    fits = SIZES[:1] if scenario in STEPPED else SIZES
    order = [screens[size] for size in fits]
    same = [fitted(order, pictures, one) for one in zip(*played[: len(fits)], strict=True)]
    seen = [views[0] for views in same]
    theirs = {
        size: [view.frame for view in found] for size, found in zip(SIZES, played, strict=True)
    }
    theirs[SMALL] = [picked_image(frame, (SMALL[1], SMALL[0])) for frame in theirs[SIZES[1]]]
    pairs: Pairs = []
    for size, expected in theirs.items():
        images = ours(scenario, seen, size)
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
        "--frames", type=whole(), default=200, help="frames per scenario (default %(default)s)"
    )
    add_seed(parser)
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
    run_command(main)
