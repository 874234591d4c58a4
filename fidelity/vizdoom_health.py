"""What the rules of ViZDoom's Health Gathering are, measured on the game itself."""

from __future__ import annotations

import itertools
import math
import random
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fidelity.findings import Findings, chi_square, mean_and_error
from fidelity.vizdoom_game import running, single_buttons

VARIABLES = ("HEALTH", "POSITION_X", "POSITION_Y", "ANGLE")
MEDKIT = "Medikit"
FULL_HEALTH = 100.0
DAMAGE_EVERY = 32
TURN_LEFT, TURN_RIGHT, FORWARD = range(3)
SIDE = 1216
"""Of the room, in map units."""
MEDKIT_RADIUS = 20.0
REACH = 36.0
"""The sum of the half-widths of player and medkit."""

Places = dict[int, tuple[float, float]]
"""Where each medkit lies, by its number in the game."""


@dataclass(frozen=True)
class Snapshot:
    """One state of the game."""

    health: float
    x: float
    y: float
    angle: float
    medkits: Places

    def distance(self, place: tuple[float, float]) -> float:
        """From the player to a place, in the metric of boxes."""
        return max(abs(place[0] - self.x), abs(place[1] - self.y))


@dataclass
class Contacts:
    """What happened around medkits, over many steps."""

    steps: int = 0
    taken: int = 0
    taken_at: list[float] = field(default_factory=list)
    heals: Counter[tuple[float, float]] = field(default_factory=Counter)
    on_damage: Counter[tuple[float, float]] = field(default_factory=Counter)
    left_in_reach: int = 0
    left_nearest: list[float] = field(default_factory=list)
    full_in_reach: int = 0
    full_taken: int = 0
    still_in_reach: int = 0
    still_taken: int = 0


def measure(findings: Findings, *, episodes: int, greedy: int, seed: int) -> None:
    """Add all findings of Health Gathering.

    Args:
        findings: where they go.
        episodes: how many of the idle player, and of each random one.
        greedy: how many of the player that walks to the nearest medkit.
        seed: of the game and the players.
    """
    idle_player(findings, episodes, seed)
    for idle in (True, False):
        for skip in (1, 4):
            random_player(findings, episodes, seed, idle=idle, skip=skip)
    greedy_player(findings, greedy, seed)
    stacked(findings, greedy, seed)


def snapshot(game: Any) -> Snapshot:
    """Read the state of the game."""
    state = game.get_state()
    health, x, y, angle = (float(value) for value in state.game_variables)
    medkits = {
        thing.id: (thing.position_x, thing.position_y)
        for thing in state.objects
        if thing.name == MEDKIT
    }
    return Snapshot(health, x, y, angle, medkits)


def episodes_of(
    choose: Callable[[Snapshot], list[int]], episodes: int, seed: int, skip: int = 1
) -> Iterator[tuple[list[Snapshot], float]]:
    """The states of each episode of a player, but for that of its end, and its return."""
    with running("health_gathering", seed=seed, variables=VARIABLES, prepare=_with_objects) as game:
        for _ in range(episodes):
            game.new_episode()
            seen = [snapshot(game)]
            while True:
                game.make_action(choose(seen[-1]), skip)
                if game.is_episode_finished():
                    break
                seen.append(snapshot(game))
            yield seen, game.get_total_reward()


def idle_player(findings: Findings, episodes: int, seed: int) -> None:
    """Length, return, damage and arrivals of medkits while nobody moves."""
    runs: Counter[tuple[Any, ...]] = Counter()
    places: list[tuple[float, float]] = []
    under = 0
    for seen, total in episodes_of(lambda _: [0, 0, 0], episodes, seed):
        pairs = list(enumerate(itertools.pairwise(seen), 1))
        drops = tuple(i for i, (one, other) in pairs if other.health != one.health)
        arrivals = tuple(i for i, (one, other) in pairs if len(other.medkits) > len(one.medkits))
        runs[len(seen), total, seen[0].health, drops, len(seen[0].medkits), arrivals] += 1
        places += seen[-1].medkits.values()
        under += sum(seen[-1].distance(place) < REACH for place in seen[-1].medkits.values())
    facts, same = runs.most_common(1)[0]
    for what, value, note in zip(
        (
            "calls until the end",
            "return",
            "health at the first observation",
            "calls after which health is lower",
            "medkits at the first observation",
            "calls after which one more lies there",
        ),
        facts,
        (f"the same in {same}", "", "", "by 8 each", "", ""),
        strict=True,
    ):
        findings.add(f"idle: {what}", value, episodes, note)
    findings.add(
        "idle: medkits within reach of the standing player at the end, not taken", under, episodes
    )
    medkit_places(findings, places)


def medkit_places(findings: Findings, places: list[tuple[float, float]]) -> None:
    """Extent and uniformity of where medkits lie."""
    axis = np.array(places)
    for name, values in (("x", axis[:, 0]), ("y", axis[:, 1])):
        extent = f"{values.min():.2f} to {values.max():.2f}"
        findings.add(f"medkits: {name} from lowest to highest", extent, len(values))
    extent = MEDKIT_RADIUS, SIDE - MEDKIT_RADIUS
    bins = np.histogramdd(axis, bins=8, range=(extent, extent))[0]
    statistic, chance = chi_square(bins.ravel().tolist())
    findings.add(
        "medkits: uniform over 8 by 8 fields of 20 to 1196, chi-square with 63 degrees",
        round(statistic, 1),
        len(places),
        f"chance of more: {chance:.2g}",
    )


def random_player(findings: Findings, episodes: int, seed: int, *, idle: bool, skip: int) -> None:
    """Returns and movement of a uniformly random player."""
    draw = random.Random(seed)
    actions = single_buttons(3, idle=idle)
    returns: list[float] = []
    ends: list[float] = []
    paths, tics = 0.0, 0
    for seen, total in episodes_of(lambda _: draw.choice(actions), episodes, seed, skip):
        places = [(state.x, state.y) for state in seen]
        paths += sum(itertools.starmap(math.dist, itertools.pairwise(places)))
        tics += skip * (len(seen) - 1)
        returns.append(total)
        ends.append(math.dist(places[0], places[-1]))
    mean, error = mean_and_error(returns)
    who = f"random, {'no-op and ' if idle else ''}3 buttons, frame skip {skip}"
    findings.add(
        f"{who}: mean return",
        round(mean, 1),
        episodes,
        f"standard error {error:.1f}, {min(returns):g} to {max(returns):g}",
    )
    findings.add(f"{who}: units travelled a tic", round(paths / tics, 3), tics)
    mean, error = mean_and_error(ends)
    findings.add(
        f"{who}: units from the start at the end",
        round(mean, 1),
        episodes,
        f"standard error {error:.1f}",
    )


def towards_nearest(state: Snapshot) -> list[int]:
    """One button that leads to the nearest medkit: turn if it lies to the side, else walk."""
    if not state.medkits:
        return [0, 0, 0]
    x, y = min(state.medkits.values(), key=lambda p: math.dist(p, (state.x, state.y)))
    bearing = math.degrees(math.atan2(y - state.y, x - state.x)) - state.angle
    side = (bearing + 180.0) % 360.0 - 180.0
    action = [0, 0, 0]
    action[FORWARD if abs(side) < 8.0 else TURN_LEFT if side > 0 else TURN_RIGHT] = 1
    return action


def greedy_player(findings: Findings, episodes: int, seed: int) -> None:
    """Returns of the player that walks to the nearest medkit, and how medkits are taken."""
    returns, contacts = [], Contacts()
    for seen, total in episodes_of(towards_nearest, episodes, seed):
        for tic, (before, after) in enumerate(itertools.pairwise(seen), 1):
            note(contacts, before, after, damage=tic % DAMAGE_EVERY == 0)
        returns.append(total)
    mean, error = mean_and_error(returns)
    spread = f"standard error {error:.1f}, {min(returns):g} to {max(returns):g}"
    findings.add("greedy (nearest medkit): mean return", round(mean, 1), episodes, spread)
    tell_contacts(findings, contacts)


def note(contacts: Contacts, before: Snapshot, after: Snapshot, *, damage: bool) -> None:
    """Count what one step did.

    Args:
        contacts: the counts, changed.
        before: the state before the step.
        after: the state after it.
        damage: whether the acid bites in this step.
    """
    contacts.steps += 1
    moved = (before.x, before.y) != (after.x, after.y)
    taken = [place for number, place in before.medkits.items() if number not in after.medkits]
    change = before.health, after.health
    if taken:
        contacts.taken += len(taken)
        contacts.taken_at += [after.distance(place) for place in taken]
        (contacts.on_damage if damage else contacts.heals)[change] += 1
    # One that appears in this step is not in reach of a move before.
    old = [place for number, place in after.medkits.items() if number in before.medkits]
    near = [place for place in old if after.distance(place) < REACH]
    if not moved:
        if before.health < FULL_HEALTH:
            contacts.still_taken += len(taken)
            contacts.still_in_reach += len(near)
        return
    if before.health < FULL_HEALTH and not damage and not taken:
        contacts.left_in_reach += len(near)
        nearest = min((after.distance(place) for place in old), default=math.inf)
        contacts.left_nearest.append(nearest)
    if before.health == FULL_HEALTH and not damage:
        contacts.full_taken += len(taken)
        contacts.full_in_reach += len(near)


def tell_contacts(findings: Findings, contacts: Contacts) -> None:
    """Add the findings about how medkits are taken."""
    found = contacts
    far, near = round(max(found.taken_at), 3), round(min(found.left_nearest), 3)
    within = f"{found.left_in_reach} within reach"
    for what, value, n, more in (
        ("taken: largest of |dx|, |dy| from the player afterwards", far, found.taken, "bound 36"),
        (
            "not taken below full health: smallest of max(|dx|, |dy|) after a move",
            *(near, len(found.left_nearest), within),
        ),
        (
            "at full health: medkits taken in moves with one within reach",
            *(found.full_taken, found.full_in_reach, ""),
        ),
        ("taken without damage: health after less before", *_gains(found.heals), ""),
        ("taken in a step with damage: health after less before", *_gains(found.on_damage), ""),
        (
            "below full health, standing still: medkits taken, of those within reach a step",
            *(found.still_taken, found.still_in_reach, ""),
        ),
        ("greedy: medkits taken", found.taken, found.steps, "steps counted"),
    ):
        findings.add(what, value, n, more)


def stacked(findings: Findings, episodes: int, seed: int, count: int = 4) -> None:
    """Several medkits on one spot, put there by the console in front of a weak player.

    The player waits until its health is 28 and then walks onto them.
    """
    outcomes: Counter[tuple[float, float, int, int]] = Counter()
    with running("health_gathering", seed=seed, variables=VARIABLES, prepare=_with_objects) as game:
        for _ in range(episodes):
            game.new_episode()
            while (start := snapshot(game)).health > 28:
                game.make_action([0, 0, 0])
            for _ in range(count):
                game.send_game_command(f"summon {MEDKIT}")
            game.make_action([0, 0, 0])
            before = snapshot(game)
            pile = before.medkits.keys() - start.medkits.keys()
            after = before
            for _ in range(30):
                if not pile <= after.medkits.keys():
                    break
                before = after
                game.make_action([0, 0, 1])
                after = snapshot(game)
            gone = len(pile - after.medkits.keys())
            outcomes[before.health, after.health, gone, len(pile)] += 1
    for (before, after, gone, there), times in outcomes.most_common():
        findings.add(
            f"{there} medkits on one spot: taken in one step, health before and after",
            f"{gone}, {before:g} to {after:g}",
            times,
            f"of {episodes} tries",
        )


def _gains(changes: Counter[tuple[float, float]]) -> tuple[dict[str, int], int]:
    """How often health changed by how much, and whether it ended at the cap; and how often."""
    gains = Counter(
        f"{after - before:+g}" + (" (to 100)" if after == FULL_HEALTH else "")
        for before, after in changes.elements()
    )
    return dict(gains.most_common()), gains.total()


def _with_objects(game: Any) -> None:
    game.set_objects_info_enabled(True)
