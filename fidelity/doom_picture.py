"""Compare the game's frames, pixel by pixel, with a renderer that follows the game's integer rules.

    python -m fidelity.doom_picture [--frames N] [--seed N] [--only NAME] [--particles]
    python -m fidelity.doom_picture --record FILE

Needs the extra `vizdoom`. The game plays random buttons; `tests/reference/doom_picture.py` draws
the poses and things of its states. Particles and decals are off without `--particles`, because the
state does not contain them. The table has the share of pixels with three equal bytes, the number of
frames that are equal as a whole, and the mean absolute error of a byte. The indented lines show the
effect of errors: another frame, the eye one map unit aside or half a unit higher, an angle one
entry of the sine table off, and no things or weapon.
"""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fidelity.commands import run_command
from fidelity.doom_views import View, drawn, fitted, views
from jaxenstein.adapters.vizdoom_buffers import SCREENS, load_vizdoom
from jaxenstein.cli.arguments import add_seed, whole
from jaxenstein.files import atomic, check_writable
from jaxenstein.tasks.doom.fixed import ONE
from jaxenstein.tasks.doom.wad import Wad, find_iwad
from tests.reference.doom_nodes import read_game_map
from tests.reference.doom_picture import Renderer

SCENARIOS = (
    *("my_way_home", "health_gathering", "health_gathering_supreme", "take_cover"),
    *("basic", "defend_the_center", "defend_the_line", "deadly_corridor"),
)
SIZES = SCREENS[:2]
# Maps with steps in floor and ceiling, which we draw flat.
STEPPED = ("predict_position", "deathmatch")
# The number of recorded views of a scenario after the first. The last scenario has none: its states
# do not show how the weapon bobs once the player is hit.
FEW = 12


def renderers(scenario: str, pictures: Wad) -> dict[tuple[int, int], Renderer]:
    """The renderers of a scenario, by screen size."""
    folder = Path(load_vizdoom().scenarios_path)
    game_map = read_game_map(Wad(folder / f"{scenario}.wad"), scenario in STEPPED)
    return {size: Renderer(game_map, pictures, size[1], size[0]) for size in SIZES}


def moved(view: View, **change: int) -> View:
    """A view with changes added to its pose."""
    added = {name: getattr(view.pose, name) + value for name, value in change.items()}
    return dataclasses.replace(view, pose=dataclasses.replace(view.pose, **added))


def digest(frame: np.ndarray) -> str:
    """The digest of an image."""
    return hashlib.blake2b(frame.tobytes(), digest_size=8).hexdigest()


def shares(ours: Sequence[np.ndarray], theirs: Sequence[np.ndarray]) -> str:
    """The shares of equal pixels and frames, and the error, in words."""
    pairs = list(zip(ours, theirs, strict=True))
    equal = np.array([(a == b).all(axis=-1).mean() for a, b in pairs])
    error = np.mean([np.abs(a.astype(int) - b).mean() for a, b in pairs])
    return (
        f"{equal.mean():.5%} of pixels equal, {(equal == 1).sum()} of {len(equal)} frames wholly, "
        f"mean absolute error {error:.4f}"
    )


def compare(
    scenario: str, frames: int, seed: int, particles: bool = False
) -> list[tuple[View, ...]]:
    """Play a scenario at all sizes and print the table; return each view at all sizes."""
    pictures = Wad(find_iwad())
    drawers = renderers(scenario, pictures)
    played = [list(views(scenario, size, frames, seed, particles)) for size in SIZES]
    assert all([v.pose for v in views] == [v.pose for v in played[0]] for views in played)
    order = [drawers[size] for size in SIZES]
    same = [fitted(order, pictures, views) for views in zip(*played, strict=True)]
    for size, seen in zip(SIZES, zip(*same, strict=True), strict=True):

        def draw(changed: Sequence[View], renderer: Renderer = drawers[size]) -> list[np.ndarray]:
            return [drawn(renderer, pictures, view) for view in changed]

        theirs, ours = [view.frame for view in seen], draw(seen)
        print("{} {}x{}: {}".format(scenario, *size, shares(ours, theirs)), flush=True)
        if size == SIZES[0]:
            for what, other in (
                ("another frame", [*ours[1:], ours[0]]),
                ("one unit aside", draw([moved(view, x=ONE) for view in seen])),
                ("half a unit higher", draw([moved(view, z=ONE // 2) for view in seen])),
                ("an entry of the sines off", draw([moved(view, angle=1 << 19) for view in seen])),
                ("bare", draw([dataclasses.replace(v, things=(), held=()) for v in seen])),
            ):
                print(f"    {what}: {shares(other, theirs)}", flush=True)
    return same


def record(path: Path, seen: dict[str, list[tuple[View, ...]]]) -> None:
    """Write the views at all sizes with digests of the game's frames instead of images."""
    lines = []
    for scenario, played in seen.items():
        for same in played:
            view = same[0]
            row = {
                "scenario": scenario,
                "pose": dataclasses.astuple(view.pose),
                "things": view.things,
                "held": view.held,
                "gold": view.gold,
                "flash": view.flash,
                "digests": [digest(other.frame) for other in same],
            }
            lines.append(json.dumps(row, separators=(",", ":")))
    with atomic(path) as temporary:
        rows = ",\n".join(lines)
        temporary.write_text(f'{{"sizes": {json.dumps(SIZES)}, "views": [\n{rows}\n]}}\n')


def main(argv: Sequence[str] | None = None) -> int:
    """Play, compare, print and record."""
    parser = argparse.ArgumentParser(
        description="Compare the game's frames with the reference renderer."
    )
    parser.add_argument(
        "--frames", type=whole(), default=200, help="frames per scenario (default %(default)s)"
    )
    add_seed(parser)
    parser.add_argument("--only", choices=SCENARIOS, help="compare only this scenario")
    parser.add_argument("--particles", action="store_true", help="leave particles and decals on")
    parser.add_argument("--record", type=Path, metavar="FILE", help="record views for a test")
    options = parser.parse_args(argv)
    if options.record:
        if options.only or options.particles:
            parser.error("--record records all scenarios, without particles")
        check_writable(options.record)
    names = [options.only] if options.only else SCENARIOS
    if options.record:
        seen = {}
        for name in SCENARIOS[:-1]:
            frames = options.frames if name == SCENARIOS[0] else FEW
            seen[name] = compare(name, frames, options.seed)
        record(options.record, seen)
    else:
        for name in names:
            compare(name, options.frames, options.seed, options.particles)
    return 0


if __name__ == "__main__":
    run_command(main)
