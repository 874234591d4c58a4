"""Measure the rules of ViZDoom's tasks in the game.

    python -m fidelity.vizdoom_rules [--only health|home] [--seed N]

Needs the extra `vizdoom`. Each row of the table has the number of episodes, steps or things. The
games use their own config files, except for the size of the screen. Each decision calls
`make_action` once; with frame skip 4, the game repeats the action.
"""

from __future__ import annotations

import argparse
import itertools
import math
import random
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fidelity.commands import run_command
from fidelity.players import mean_and_error
from jaxenstein.adapters.vizdoom_buffers import load_vizdoom, running
from jaxenstein.cli.arguments import add_seed, whole
from jaxenstein.tasks.doom.maps import MAP_SPOT, load_map

VARIABLES = ("HEALTH", "POSITION_X", "POSITION_Y", "ANGLE")
MEDKIT = "Medikit"
# The range of positions of medkits in a room of 1216 units, and the number of sectors of headings.
EXTENT = (20.0, 1196.0)
HEADINGS = 16
TURN_LEFT, TURN_RIGHT, FORWARD = range(3)


@dataclass(frozen=True)
class Snapshot:
    """One state of the game; `medkits` has positions by the ids of the game."""

    health: float
    x: float
    y: float
    angle: float
    medkits: dict[int, tuple[float, float]]


Choose = Callable[[Snapshot], list[int]]


def row(what: str, value: object, n: int, note: str = "") -> None:
    """Print a row of the table; `n` is the number of measured things."""
    print(f"| {what} | {value} | {n} | {note} |", flush=True)


def single_buttons(count: int, *, idle: bool) -> list[list[int]]:
    """Actions that press one of `count` buttons; with `idle`, the first presses none."""
    pressed = [[int(i == j) for j in range(count)] for i in range(count)]
    return [[0] * count, *pressed] if idle else pressed


def episodes_of(
    scenario: str, choose: Choose, episodes: int, seed: int, skip: int = 1
) -> Iterator[tuple[list[Snapshot], float]]:
    """Yield the states of each episode, without the last, and its return."""

    def prepare(game: Any) -> None:
        game.set_objects_info_enabled(True)

    def look(game: Any) -> Snapshot:
        state = game.get_state()
        things = {t.id: (t.position_x, t.position_y) for t in state.objects if t.name == MEDKIT}
        health, x, y, angle = map(float, state.game_variables)
        return Snapshot(health, x, y, angle, things)

    with running(scenario, seed=seed, variables=VARIABLES, prepare=prepare) as game:
        for _ in range(episodes):
            game.new_episode()
            seen = [look(game)]
            while True:
                game.make_action(choose(seen[-1]), skip)
                if game.is_episode_finished():
                    break
                seen.append(look(game))
            yield seen, game.get_total_reward()


def idle_player(episodes: int, seed: int) -> None:
    """Length, return, damage and new medkits without any action."""
    runs: Counter[tuple[Any, ...]] = Counter()
    places: list[tuple[float, float]] = []
    for seen, total in episodes_of("health_gathering", lambda _: [0, 0, 0], episodes, seed):
        pairs = list(enumerate(itertools.pairwise(seen), 1))
        drops = [i for i, (one, other) in pairs if other.health != one.health]
        arrivals = [i for i, (one, other) in pairs if len(other.medkits) > len(one.medkits)]
        first = seen[0].health, str(drops), len(seen[0].medkits), str(arrivals)
        runs[len(seen), total, *first] += 1
        places += seen[-1].medkits.values()
    facts, same = runs.most_common(1)[0]
    names = (
        *("calls until the end", "return", "health at the first observation"),
        *("calls after which health is lower", "medkits at the first observation"),
        "calls after which one more lies there",
    )
    for what, value in zip(names, facts, strict=True):
        row(f"idle: {what}", value, episodes, f"the same in {same}")
    axes = np.array(places)
    for name, values in zip("xy", axes.T, strict=True):
        row(f"medkits: {name}", f"{values.min():.2f} to {values.max():.2f}", len(values))
    fields = np.histogramdd(axes, bins=8, range=(EXTENT, EXTENT))[0]
    uniform("medkits: uniform over 8 by 8 fields", fields.ravel().tolist())


def uniform(what: str, counts: Sequence[float]) -> None:
    """Print a row that tests whether counts are uniform."""
    from scipy import stats

    found = stats.chisquare(counts)
    told = f"{len(counts) - 1} degrees, chance of more: {found.pvalue:.2g}"
    row(f"{what}, chi-square", round(float(found.statistic), 1), int(sum(counts)), told)


def player(who: str, scenario: str, choose: Choose, episodes: int, seed: int, skip: int) -> None:
    """Measure the returns of a player, and how often they are positive."""
    played = list(episodes_of(scenario, choose, episodes, seed, skip))
    returns = [total for _, total in played]
    mean, error = mean_and_error(returns)
    note = f"standard error {error:.3g}, {min(returns):g} to {max(returns):g}"
    row(f"{who}, frame skip {skip}: mean return", f"{mean:.4g}", episodes, note)
    rate, error = mean_and_error([float(total > 0) for total in returns])
    row(f"{who}: return above 0", f"{rate:.1%}", episodes, f"standard error {error:.1%}")
    row(f"{who}: most calls of an episode", max(len(seen) for seen, _ in played), episodes)


def towards_nearest(state: Snapshot) -> list[int]:
    """The button that leads to the nearest medkit: turn if it lies to the side, else walk."""
    if not state.medkits:
        return [0, 0, 0]
    x, y = min(state.medkits.values(), key=lambda p: math.dist(p, (state.x, state.y)))
    bearing = math.degrees(math.atan2(y - state.y, x - state.x)) - state.angle
    side = (bearing + 180.0) % 360.0 - 180.0
    action = [0, 0, 0]
    action[FORWARD if abs(side) < 8.0 else TURN_LEFT if side > 0 else TURN_RIGHT] = 1
    return action


def starts(resets: int, seed: int) -> None:
    """Measure the start positions and headings of My Way Home."""
    spots = load_map("my-way-home").of_kind(MAP_SPOT)
    found, sectors, farthest = Counter[int](), [0] * HEADINGS, 0.0
    with running("my_way_home", seed=seed, variables=VARIABLES) as game:
        for _ in range(resets):
            game.new_episode()
            _, x, y, angle = (float(value) for value in game.get_state().game_variables)
            off, spot = min((max(abs(s.x - x), abs(s.y - y)), s.id) for s in spots)
            farthest = max(farthest, off)
            found[spot] += 1
            sectors[int(angle / 360.0 * HEADINGS) % HEADINGS] += 1
    row("start: farthest from a map spot, units", round(farthest, 4), resets)
    uniform("start: uniform over spots", [found[spot.id] for spot in spots])
    uniform(f"start: uniform over headings in {HEADINGS} sectors", sectors)


def measure(options: argparse.Namespace) -> None:
    """Print the table."""
    episodes, seed = options.episodes, options.seed
    print("| what | measured | n | note |\n|---|---|---:|---|", flush=True)
    tasks = (("health", "health_gathering", 3), ("home", "my_way_home", 5))
    for task, scenario, buttons in tasks:
        if options.only not in (None, task):
            continue
        actions = single_buttons(buttons, idle=task == "home")
        for skip in (1, 4):
            draw = random.Random(seed)
            who = f"{task}: random, {len(actions)} actions"
            player(who, scenario, lambda _, d=draw, a=actions: d.choice(a), episodes, seed, skip)
        if task == "health":
            idle_player(episodes, seed)
            who = "health: greedy (nearest medkit)"
            player(who, scenario, towards_nearest, options.greedy, seed, 1)
        else:
            starts(options.resets, seed)


def main(argv: Sequence[str] | None = None) -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description="Measure rules of ViZDoom's tasks.")
    parser.add_argument("--only", choices=("health", "home"), help="measure only this task")
    add_seed(parser)
    parser.add_argument(
        "--episodes", type=whole(), default=300, help="episodes of each player (default 300)"
    )
    parser.add_argument(
        "--greedy", type=whole(), default=20, help="episodes of the greedy player (default 20)"
    )
    parser.add_argument(
        "--resets", type=whole(), default=2000, help="resets to measure starts (default 2000)"
    )
    options = parser.parse_args(argv)
    print(f"ViZDoom {load_vizdoom().__version__}\n")
    measure(options)


if __name__ == "__main__":
    run_command(main)
