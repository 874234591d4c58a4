"""What the rules of ViZDoom's Health Gathering are, measured on the game itself."""

from __future__ import annotations

import math
import random
from collections import Counter
from collections.abc import Callable
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
Policy = Callable[["Snapshot"], list[int]]


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


def idle_player(findings: Findings, episodes: int, seed: int) -> None:
    """Length, return, damage and arrivals of medkits while nobody moves."""
    runs: Counter[tuple[int, float, tuple[int, ...], tuple[int, ...], float, int]] = Counter()
    places: list[tuple[float, float]] = []
    under = 0
    with running("health_gathering", seed=seed, variables=VARIABLES, prepare=_with_objects) as game:
        for _ in range(episodes):
            game.new_episode()
            seen = [snapshot(game)]
            calls = 0
            while not game.is_episode_finished():
                game.make_action([0, 0, 0])
                calls += 1
                if not game.is_episode_finished():
                    seen.append(snapshot(game))
            health = [state.health for state in seen]
            drops = tuple(i for i in range(1, len(seen)) if health[i] != health[i - 1])
            counts = [len(state.medkits) for state in seen]
            arrivals = tuple(i for i in range(1, len(seen)) if counts[i] > counts[i - 1])
            key = calls, game.get_total_reward(), drops, arrivals, health[0], counts[0]
            runs[key] += 1
            places += seen[-1].medkits.values()
            under += sum(seen[-1].distance(place) < REACH for place in seen[-1].medkits.values())
    (calls, total, drops, arrivals, first, count), same = runs.most_common(1)[0]
    findings.add("idle: calls until the end", calls, episodes, f"the same in {same}")
    findings.add("idle: return", total, episodes)
    findings.add("idle: health at the first observation", first, episodes)
    findings.add("idle: calls after which health is lower", drops, episodes, "by 8 each")
    findings.add("idle: medkits at the first observation", count, episodes)
    findings.add("idle: calls after which one more lies there", arrivals, episodes)
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
    with running("health_gathering", seed=seed, variables=VARIABLES) as game:
        for _ in range(episodes):
            game.new_episode()
            start = place = game.get_state().game_variables[1:3]
            while not game.is_episode_finished():
                game.make_action(draw.choice(actions), skip)
                if not game.is_episode_finished():
                    now = game.get_state().game_variables[1:3]
                    paths += math.dist(place, now)
                    tics += skip
                    place = now
            returns.append(game.get_total_reward())
            ends.append(math.dist(start, place))
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
    with running("health_gathering", seed=seed, variables=VARIABLES, prepare=_with_objects) as game:
        for _ in range(episodes):
            game.new_episode()
            before, tic = snapshot(game), 0
            while not game.is_episode_finished():
                game.make_action(towards_nearest(before))
                tic += 1
                if not game.is_episode_finished():
                    after = snapshot(game)
                    note(contacts, before, after, damage=tic % DAMAGE_EVERY == 0)
                    before = after
            returns.append(game.get_total_reward())
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
    steps, taken = contacts.steps, contacts.taken
    findings.add(
        "taken: largest of |dx|, |dy| from the player afterwards",
        round(max(contacts.taken_at), 3),
        taken,
        "36 units is the bound",
    )
    findings.add(
        "not taken below full health: smallest of max(|dx|, |dy|) after a move",
        round(min(contacts.left_nearest), 3),
        len(contacts.left_nearest),
        f"{contacts.left_in_reach} within reach",
    )
    findings.add(
        "at full health: medkits taken in moves with one within reach",
        contacts.full_taken,
        contacts.full_in_reach,
    )
    for label, changes in (
        ("without damage", contacts.heals),
        ("in a step with damage", contacts.on_damage),
    ):
        gains = Counter(_gain(change) for change in changes.elements())
        findings.add(
            f"taken {label}: health after less before",
            dict(sorted(gains.items(), key=lambda item: -item[1])),
            sum(gains.values()),
        )
    findings.add(
        "below full health, standing still: medkits taken, of those within reach a step",
        contacts.still_taken,
        contacts.still_in_reach,
    )
    findings.add("greedy: medkits taken", taken, steps, "steps counted")


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


def _gain(change: tuple[float, float]) -> str:
    """The change of health, and whether it ended at the cap."""
    before, after = change
    return f"{after - before:+g}" + (" (to 100)" if after == FULL_HEALTH else "")


def _with_objects(game: Any) -> None:
    game.set_objects_info_enabled(True)
