"""Play in ViZDoom from other pictures, to find out whether pictures explain a difference.

    python -m experiments.other_pictures AGENT [--see ours|clean] [--episodes N] [--greedy]

AGENT is a run directory, an exported file or `pretrained/NAME`, of agents that see colours in a
scenario of ViZDoom. Each agent plays episodes of the game. With `--see ours`, it sees our picture
of each state of the game. With `--see clean`, it sees the game's pictures without blood, particles
and the smoke of bullets, which ours lack. The program prints the mean return over all agents and
episodes, with its 95 % interval.

Compare it with `jaxenstein evaluate AGENT`, here, and with `--in vizdoom`, from the game's pixels
of the same episodes. If it equals the return here, the gap comes from the pictures. Otherwise the
rules differ. With `--see ours` there is another possible cause: the game does not report the frames
of monsters and of the weapon, so our pictures of its states show the first frames. Needs the extras
`baselines` and `vizdoom`.
"""

from __future__ import annotations

import argparse
import contextlib
import struct
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

from jaxenstein.adapters.vizdoom import play_game
from jaxenstein.baselines.runs.policies import TrainedPolicy
from jaxenstein.baselines.runs.trained import Trained, load_trained
from jaxenstein.episodes.policies import Policy
from jaxenstein.errors import JAXensteinError
from jaxenstein.intervals import mean_interval

# Definitions that the game reads from a WAD file.
INVISIBLE = b"".join(
    b"actor Clean%s : %s replaces %s { RenderStyle None }\n" % (name, name, name)
    for name in (b"Blood", b"BulletPuff")
)


def from_our_pictures(policy: TrainedPolicy) -> Policy:
    """The agent, with our picture of the game's state in place of the game's."""
    draw = jax.jit(policy.env.observe)

    def act(session: Any) -> int:
        session.observation = jax.device_get(draw(session.state, session.params))
        return policy(session)

    return act


@contextlib.contextmanager
def without_blood() -> Iterator[Callable[[Any], None]]:
    """A `prepare` for `play_game`: no blood, no particles and no smoke of bullets."""
    entry = struct.pack("<ii8s", 12, len(INVISIBLE), b"DECORATE")
    wad = struct.pack("<4sii", b"PWAD", 1, 12 + len(INVISIBLE)) + INVISIBLE + entry
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "invisible.wad"
        path.write_bytes(wad)

        def prepare(game: Any) -> None:
            game.set_render_particles(False)
            game.set_render_decals(False)
            game.add_game_args(f"-file {path}")

        yield prepare


def returns(trained: Trained, see: str, episodes: int, greedy: bool) -> np.ndarray:
    """float32[agents, episodes]: the sums of the game's rewards."""
    found = []
    with without_blood() as clean:
        for run in range(len(trained.experiment.runs)):
            policy: Any = TrainedPolicy(trained, run, greedy)
            settings: dict[str, Any] = {"episodes": episodes}
            if see == "ours":
                act = from_our_pictures(policy)
            else:
                act, settings["prepare"] = policy, clean
            found.append(play_game(policy.env, policy.params, act, **settings).returns)
    return np.stack(found)


def main(argv: Sequence[str] | None = None) -> int:
    """Play and print."""
    parser = argparse.ArgumentParser(description="Play in ViZDoom from other pictures.")
    parser.add_argument("agent", metavar="AGENT", help="a run directory or an agent")
    parser.add_argument(
        "--see",
        choices=("ours", "clean"),
        default="ours",
        help="the pictures (default %(default)s)",
    )
    parser.add_argument(
        "--episodes", type=int, default=100, help="of each agent (default %(default)s)"
    )
    parser.add_argument("--greedy", action="store_true", help="take the most likely actions")
    options = parser.parse_args(argv)
    if options.episodes < 1:
        parser.error(f"--episodes should be at least 1, not {options.episodes}")
    try:
        trained = load_trained(options.agent)
        earned = mean_interval(returns(trained, options.see, options.episodes, options.greedy))
    except JAXensteinError as error:
        parser.error(str(error))
    print(f"{earned.mean:.4g} ({earned.low:.4g} to {earned.high:.4g})")
    return 0


if __name__ == "__main__":
    sys.exit(main())
