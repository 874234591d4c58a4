"""The game's frames beside those of the integer rules of its renderer, pixel by pixel.

    python -m fidelity.doom_picture [--frames N] [--seed N] [--record FILE]

Needs the extra `vizdoom`. The game plays random buttons; poses and things of its states are given
to the renderer of `tests/reference/doom_picture.py`. What is printed are the shares of pixels with
three equal bytes and of frames that are wholly equal, and the mean absolute error of a byte. The
indented lines are what wrong rules would give: another frame, the eye one map unit aside or half a
unit higher, an angle one entry of the table of sines off, and no things.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import hashlib
import json
import math
import random
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fidelity.doom_recording import LONGEST_HOLD, pick
from jaxenstein.adapters.vizdoom_buffers import SCREENS, load_vizdoom, running
from jaxenstein.files import atomic, check_writable
from jaxenstein.tasks.doom.fixed import ONE, to_fixed
from jaxenstein.tasks.doom.maps import load_map, rasterise
from jaxenstein.tasks.doom.wad import Picture, Wad, find_iwad
from tests.reference.doom_nodes import read_game_map
from tests.reference.doom_picture import Pose, Renderer
from tests.reference.doom_things import Thing

SCENARIOS = "my_way_home", "health_gathering", "health_gathering_supreme"
SIZES = SCREENS[:2]
CAMERA = ("CAMERA_POSITION_X", "CAMERA_POSITION_Y", "CAMERA_POSITION_Z", "CAMERA_ANGLE")
EPISODES = 10
# Tics between two frames: at least and at most.
APART = 3, 40

# Every fourth frame is shot from beside a thing: at most so many map units away from it.
BESIDE = 256
# So many views are recorded of scenarios other than the first one.
FEW = 12
# How many 256ths of gold lie over the frame in which the vest is taken.
FLASH = 48

Look = tuple[str, str, bool]
"""Sprite, frame, and whether it is bright."""
LOOKS: dict[str, tuple[Look, ...]] = {
    "GreenArmor": (("ARM1", "A", False), ("ARM1", "B", True)),
    "Medikit": (("MEDI", "A", False),),
    "CustomMedikit": (("MEDI", "A", False),),
    "Poison": tuple(("BON1", frame, False) for frame in "ABCD"),
}
"""What a thing may look like, by the game's names. The game does not tell which it is, for the
first frame of each thing lasts for a random time: it is found by its pixels."""


class Seen(NamedTuple):
    """A thing: what it may look like, and its feet in 16.16."""

    looks: tuple[Look, ...]
    x: int
    y: int
    z: int


@dataclass(frozen=True)
class View:
    """What the eye sees, and its picture.

    Attributes:
        pose: of the camera.
        things: what is there besides walls.
        gold: 256ths of gold over the frame.
        frame: uint8[height, width, 3], the game's picture.
    """

    pose: Pose
    things: tuple[Seen, ...]
    gold: int
    frame: np.ndarray


def views(scenario: str, size: tuple[int, int], frames: int, seed: int) -> Iterator[View]:
    """Views of episodes, every second one at a random place; equal seeds give equal poses."""
    draw, places = random.Random(seed), open_places(scenario)

    def prepare(game: Any) -> None:
        game.set_screen_format(load_vizdoom().ScreenFormat.RGB24)
        game.set_objects_info_enabled(True)
        # The hardest level allows no jumps to another place.
        game.set_doom_skill(3)

    with running(scenario, seed=seed, variables=CAMERA, size=size, prepare=prepare) as game:
        buttons = [1 << i for i in range(game.get_available_buttons_size())]
        for number in range(frames):
            if number % max(2, frames // EPISODES) == 0:
                game.new_episode()
            if number % 2:
                near = places
                if number % 4 == 3 and (things := look(scenario, game.get_state()).things):
                    thing = draw.choice(things)
                    place = thing.x / ONE, thing.y / ONE
                    near = [other for other in places if math.dist(other, place) < BESIDE] or places
                game.send_game_command("warp {} {}".format(*draw.choice(near)))
            for held in buttons_held(draw, len(buttons)):
                game.make_action([int(held & bit > 0) for bit in buttons])
                if game.is_episode_finished():
                    game.new_episode()
                elif look(scenario, game.get_state()).gold:
                    break
            yield look(scenario, game.get_state())


def buttons_held(draw: random.Random, count: int) -> Iterator[int]:
    """The buttons of some tics, as bits."""
    tics = draw.randint(*APART)
    while tics > 0:
        hold, held = draw.randint(1, LONGEST_HOLD), pick(draw, count)
        yield from [held] * min(hold, tics)
        tics -= hold


def open_places(scenario: str) -> list[tuple[float, float]]:
    """Where a player has room, in map units: the middles of tiles with open ones around them."""
    tiles = rasterise(load_map(scenario.replace("_", "-")))
    free = np.lib.stride_tricks.sliding_window_view(~tiles.solid, (3, 3)).all(axis=(2, 3))
    rows, columns = np.nonzero(free)
    x = tiles.west + (columns + 1.5) * tiles.unit
    y = tiles.north - (rows + 1.5) * tiles.unit
    return list(zip(x.tolist(), y.tolist(), strict=True))


def look(scenario: str, state: Any) -> View:
    """The view that a state of the game shows."""
    x, y, z, angle = (float(value) for value in state.game_variables)
    # The game divides by the greatest angle there is, not by the circle.
    turns = round(angle / 360 * (2**32 - 1)) % 2**32
    things = tuple(
        Seen(LOOKS[o.name], *map(to_fixed, (o.position_x, o.position_y, o.position_z)))
        for o in state.objects
        if o.name in LOOKS
    )
    pose = Pose(to_fixed(x), to_fixed(y), to_fixed(z), turns)
    taken = scenario == "my_way_home" and not things
    return View(pose, things, FLASH if taken else 0, np.array(state.screen_buffer))


def renderers(scenario: str, pictures: Wad) -> dict[tuple[int, int], Renderer]:
    """A renderer of a scenario for each size of the screen."""
    folder = Path(load_vizdoom().scenarios_path)
    game_map = read_game_map(Wad(folder / f"{scenario}.wad"))
    return {size: Renderer(game_map, pictures, size[1], size[0]) for size in SIZES}


def drawn(
    renderer: Renderer, pictures: Wad, pose: Pose, things: Sequence[Seen], gold: int = 0
) -> np.ndarray:
    """uint8[height, width, 3]: the renderer's picture of a view, each thing in its first look."""
    shown = []
    for seen in things:
        sprite, frame, bright = seen.looks[0]
        shown.append(Thing(front(pictures, sprite, frame), seen.x, seen.y, seen.z, bright))
    return renderer.draw(pose, shown, gold=gold)


@functools.cache
def front(pictures: Wad, sprite: str, frame: str) -> Picture:
    """A sprite's first view."""
    return pictures.sprite(sprite, frame)[0]


def fitted(renderer: Renderer, pictures: Wad, view: View) -> View:
    """A view with the one look of each thing that gives the most equal pixels."""
    for number, seen in enumerate(view.things):
        tries = []
        for look in seen.looks if len(seen.looks) > 1 else ():
            things = list(view.things)
            things[number] = seen._replace(looks=(look,))
            frame = drawn(renderer, pictures, view.pose, things, view.gold)
            tries.append(((frame != view.frame).sum(), len(tries), things))
        if tries:
            view = dataclasses.replace(view, things=tuple(min(tries)[2]))
    return view


def moved(pose: Pose, **change: int) -> Pose:
    """A pose with something added to its numbers."""
    added = {name: getattr(pose, name) + value for name, value in change.items()}
    return dataclasses.replace(pose, **added)


def digest(frame: np.ndarray) -> str:
    """Of a picture."""
    return hashlib.blake2b(frame.tobytes(), digest_size=8).hexdigest()


def shares(ours: Sequence[np.ndarray], theirs: Sequence[np.ndarray]) -> str:
    """What is equal, in words."""
    equal = np.array([(a == b).all(axis=-1).mean() for a, b in zip(ours, theirs, strict=True)])
    errors = [np.abs(a.astype(int) - b).mean() for a, b in zip(ours, theirs, strict=True)]
    return (
        f"{equal.mean():.5%} of pixels equal, {(equal == 1).sum()} of {len(equal)} frames wholly, "
        f"mean absolute error {np.mean(errors):.4f}"
    )


def compare(scenario: str, frames: int, seed: int) -> list[tuple[View, ...]]:
    """Play a scenario at all sizes, print the figures; returns what was seen at each size."""
    pictures, found = Wad(find_iwad()), []
    for size, renderer in renderers(scenario, pictures).items():
        played = views(scenario, size, frames, seed)
        seen = tuple(fitted(renderer, pictures, view) for view in played)
        theirs = [view.frame for view in seen]

        def draw(renderer: Renderer = renderer, seen: Any = seen, **change: int) -> Any:
            return [
                drawn(renderer, pictures, moved(view.pose, **change), view.things, view.gold)
                for view in seen
            ]

        ours = draw()
        title = "{} {}x{}".format(scenario, *size)
        print(f"{title}: {shares(ours, theirs)}", flush=True)
        if size == SIZES[0]:
            for what, other in (
                ("another frame", [*ours[1:], ours[0]]),
                ("one unit aside", draw(x=ONE)),
                ("half a unit higher", draw(z=ONE // 2)),
                ("an entry of the sines off", draw(angle=1 << 19)),
                ("without things", [renderer.draw(v.pose, gold=v.gold) for v in seen]),
            ):
                print(f"    {what}: {shares(other, theirs)}", flush=True)
        found.append(seen)
    return found


def record(path: Path, seen: dict[str, list[tuple[View, ...]]]) -> None:
    """Write poses, things and digests of the game's frames at all sizes, but no pictures."""
    lines = []
    for scenario, at_sizes in seen.items():
        views_of = list(zip(*at_sizes, strict=True))
        for same in views_of if scenario == SCENARIOS[0] else views_of[:FEW]:
            # What a thing looks like is seen best on the largest screen.
            view = same[-1]
            assert all(other.pose == view.pose for other in same)
            row = {
                "scenario": scenario,
                "pose": dataclasses.astuple(view.pose),
                "things": [[*thing.looks[0], *thing[1:]] for thing in view.things],
                "gold": view.gold,
                "digests": [digest(other.frame) for other in same],
            }
            lines.append(json.dumps(row, separators=(",", ":")))
    with atomic(path) as temporary:
        rows = ",\n".join(lines)
        temporary.write_text(f'{{"sizes": {json.dumps(SIZES)}, "views": [\n{rows}\n]}}\n')


def main(argv: Sequence[str] | None = None) -> int:
    """Play, compare, print, write."""
    parser = argparse.ArgumentParser(description="Compare the game's frames with its rules.")
    parser.add_argument("--frames", type=int, default=200, help="of each (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the episodes (default %(default)s)")
    parser.add_argument("--record", type=Path, metavar="FILE", help="views, for a test")
    options = parser.parse_args(argv)
    if options.record:
        check_writable(options.record)
    seen = {name: compare(name, options.frames, options.seed) for name in SCENARIOS}
    if options.record:
        record(options.record, seen)
    return 0


if __name__ == "__main__":
    sys.exit(main())
