"""Compare Doom's motion here and in the game, tic by tic: positions, angles and velocities.

    python -m fidelity.doom_motion [--episodes N] [--seed N] [--record FOLDER]

Needs the extra `vizdoom`. It plays random buttons in the game, and replays them with our motion
from the same first pose. It prints the number of tics that differ in any bit, which should be 0.
With `--record`, it only writes recordings like those in `tests/tasks/doom/recordings`, with things.
"""

from __future__ import annotations

import argparse
import functools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from fidelity.commands import run_command
from fidelity.doom_recording import Recording, record, save
from jaxenstein.cli.arguments import whole
from jaxenstein.files import make_folder
from jaxenstein.tasks.doom.collision import load_geometry
from jaxenstein.tasks.doom.health_gathering import DoomHealthGathering
from jaxenstein.tasks.doom.my_way_home import DoomMyWayHome
from jaxenstein.tasks.doom.physics import Body, hold, tic

SCENARIOS = DoomMyWayHome(), DoomHealthGathering(), DoomHealthGathering(supreme=True)
BUTTONS = {scenario.room.map_name: scenario.button_names for scenario in SCENARIOS}
"""The buttons of each scenario, by the name of its map."""


def main(argv: Sequence[str] | None = None) -> int:
    """Record, compare and print the table; return 1 if anything differs."""
    parser = argparse.ArgumentParser(description="Compare Doom's motion here and in the game.")
    parser.add_argument(
        "--episodes", type=whole(), default=100, help="episodes of each scenario (default 100)"
    )
    parser.add_argument("--seed", type=whole(0), default=0, help="of game and buttons (default 0)")
    help = "write a file of recordings for each scenario instead"
    parser.add_argument("--record", type=Path, metavar="FOLDER", help=help)
    options = parser.parse_args(argv)
    if options.record:
        make_folder(options.record)
        for scenario in SCENARIOS:
            name, things = scenario.room.map_name, getattr(scenario, "pickups", None)
            kinds = [kind.game_name for kind in things.kinds] if things else []
            scenario_name = name.replace("-", "_")
            played = record(scenario_name, options.episodes, seed=options.seed, things=kinds)
            save(options.record / f"{name}.npz", list(played))
        return 0
    rows = [compare(name, options.episodes, options.seed) for name in BUTTONS]
    return int(any(row["tics_that_differ"] for row in rows))


def compare(name: str, episodes: int, seed: int) -> dict[str, Any]:
    """Record episodes of a scenario, replay them, print a line and return its numbers."""
    scenario = name.replace("-", "_")
    # The player cannot die, so that all episodes have their full length.
    recordings = list(record(scenario, episodes, seed=seed, unhurt=name != "my-way-home"))
    differ, slid = replay(name, recordings)
    row = {
        "scenario": name,
        "episodes": episodes,
        "tics": sum(len(recording.position) - 1 for recording in recordings),
        "tics_at_a_wall": int(slid.sum()),
        "tics_that_differ": int(differ.sum()),
        "episodes_that_differ": int(differ.any(axis=0).sum()),
    }
    print(", ".join(f"{key.replace('_', ' ')} {value}" for key, value in row.items()), flush=True)
    return row


def replay(name: str, recordings: Sequence[Recording]) -> tuple[np.ndarray, np.ndarray]:
    """Replay the buttons of recordings with our motion, from their first poses.

    Returns:
        bool[T, B] twice, for T tics of the longest of B episodes: whether the tic differs from the
        recording in any bit, and whether a wall was in the way.
    """
    longest = max(len(recording.position) - 1 for recording in recordings)
    lengths = np.array([len(recording.position) - 1 for recording in recordings])

    def padded(values: Sequence[np.ndarray]) -> np.ndarray:
        width = [((0, longest - len(v)), *((0, 0),) * (v.ndim - 1)) for v in values]
        return np.stack([np.pad(v, w) for v, w in zip(values, width, strict=True)], axis=1)

    tics = [len(recording.position) - 1 for recording in recordings]
    held = padded([r.buttons[:n].astype(np.int32) for r, n in zip(recordings, tics, strict=True)])
    first = Body(
        position=jnp.asarray(np.stack([r.position[0] for r in recordings])),
        velocity=jnp.asarray(np.stack([r.velocity[0] for r in recordings])),
        angle=jnp.asarray(np.stack([r.angle[0] for r in recordings])),
        turn_tics=jnp.zeros(len(recordings), jnp.int32),
    )
    (position, velocity, angle), slid = _play(name, first, jnp.asarray(held))
    differ = (np.asarray(position) != padded([r.position[1:] for r in recordings])).any(axis=-1)
    differ |= (np.asarray(velocity) != padded([r.velocity[1:] for r in recordings])).any(axis=-1)
    differ |= np.asarray(angle) != padded([r.angle[1:] for r in recordings])
    valid = np.arange(longest)[:, None] < lengths
    return differ & valid, np.asarray(slid) & valid


@functools.partial(jax.jit, static_argnums=0)
def _play(name: str, first: Body, held: jax.Array) -> Any:
    geometry, buttons = load_geometry(name), BUTTONS[name]

    def step(body: Body, held: jax.Array) -> Any:
        def one(body: Body, held: jax.Array) -> Any:
            return tic(geometry, body, hold(buttons, held))

        body, tried = jax.vmap(one)(body, held)
        return body, ((body.position, body.velocity, body.angle), tried.slid)

    return jax.lax.scan(step, first, held)[1]


if __name__ == "__main__":
    run_command(main)
