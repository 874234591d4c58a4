"""The animation of docs/doom.md: a pretrained agent here and in the running ViZDoom.

    python -m docs.doom_film

writes docs/_static/episodes/doom-both.webp. Needs the extras `baselines` and `vizdoom`.
"""

from __future__ import annotations

from docs.episodes import EPISODES, save_webp
from jaxenstein.baselines import load_policy
from jaxenstein.cli.crossing import film

AGENT = "pretrained/doom-my-way-home"
# An episode that begins in the dead end, far from the goal; every second decision is shown.
SEED, EVERY = 16, 2


def main() -> None:
    """Play and write."""
    pictures, summary = film(load_policy(AGENT), SEED, EVERY)
    path = EPISODES / "doom-both.webp"
    save_webp(list(pictures), path)
    print(f"{summary}, wrote {path.name}, {path.stat().st_size // 1000} kB")


if __name__ == "__main__":
    main()
