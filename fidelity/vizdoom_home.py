"""What the rules of ViZDoom's My Way Home are, measured on the game itself."""

from __future__ import annotations

import random
from collections import Counter

import numpy as np

from fidelity.doom_map import load_my_way_home
from fidelity.findings import Findings, chi_square, mean_and_error
from fidelity.vizdoom_game import running, single_buttons
from jaxenstein.tasks.doom.walls import MAP_SPOT

VARIABLES = ("POSITION_X", "POSITION_Y", "ANGLE", "CAMERA_POSITION_Z")
HEADINGS = 16
"""Sectors of the circle in which first headings are counted."""


def measure(findings: Findings, *, episodes: int, resets: int, seed: int) -> None:
    """Add all findings of My Way Home.

    Args:
        findings: where they go.
        episodes: how many of each random player.
        resets: how many to see where episodes start.
        seed: of the game and the players.
    """
    starts(findings, resets, seed)
    for skip in (1, 4):
        random_player(findings, episodes, seed, skip)


def starts(findings: Findings, resets: int, seed: int) -> None:
    """Where episodes start, and in which direction."""
    doom_map, _ = load_my_way_home()
    spots = {(thing.x, thing.y): thing.id for thing in doom_map.things if thing.kind == MAP_SPOT}
    found: Counter[int] = Counter()
    sectors = np.zeros(HEADINGS, int)
    farthest = 0.0
    with running("my_way_home", seed=seed, variables=VARIABLES) as game:
        for _ in range(resets):
            game.new_episode()
            x, y, angle, _ = (float(value) for value in game.get_state().game_variables)
            place = min(spots, key=lambda spot: max(abs(spot[0] - x), abs(spot[1] - y)))
            farthest = max(farthest, abs(place[0] - x), abs(place[1] - y))
            found[spots[place]] += 1
            sectors[int(angle / 360.0 * HEADINGS) % HEADINGS] += 1
    findings.add("start: farthest from a map spot, units", round(farthest, 4), resets)
    findings.add("start: times at each spot (by id)", dict(sorted(found.items())), resets)
    for what, counts in (
        ("spots", [found[number] for number in spots.values()]),
        (f"headings in {HEADINGS} sectors", list(sectors)),
    ):
        statistic, chance = chi_square(counts)
        findings.add(
            f"start: uniform over {what}, chi-square with {len(counts) - 1} degrees",
            round(statistic, 1),
            resets,
            f"chance of more: {chance:.2g}",
        )


def random_player(findings: Findings, episodes: int, seed: int, skip: int) -> None:
    """How often a uniformly random player (no-op and five buttons) arrives."""
    draw = random.Random(seed)
    actions = single_buttons(5, idle=True)
    returns, lengths, eyes = [], [], []
    with running("my_way_home", seed=seed, variables=VARIABLES) as game:
        for _ in range(episodes):
            game.new_episode()
            calls = 0
            while not game.is_episode_finished():
                game.make_action(draw.choice(actions), skip)
                calls += 1
                if calls % 16 == 0 and not game.is_episode_finished():
                    eyes.append(float(game.get_state().game_variables[3]))
            returns.append(game.get_total_reward())
            lengths.append(calls)
    who = f"random, no-op and 5 buttons, frame skip {skip}"
    rate, error = mean_and_error([float(total > 0) for total in returns])
    findings.add(f"{who}: arrives", f"{rate:.1%}", episodes, f"standard error {error:.1%}")
    mean, error = mean_and_error(returns)
    findings.add(f"{who}: mean return", round(mean, 4), episodes, f"standard error {error:.4f}")
    findings.add(f"{who}: calls of an episode without arrival", max(lengths), episodes)
    findings.add(
        f"{who}: height of the eye", f"{min(eyes):.1f} to {max(eyes):.1f}", len(eyes), "it bobs"
    )
