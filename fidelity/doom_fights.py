"""Compare how monsters fight in Doom's scenarios here and in the game.

    python -m fidelity.doom_fights [--episodes N] [--seed N] [ID ...]

Needs the extra `vizdoom`. It follows episodes of scripted players tic by tic in both, and compares
the time of the first damage, the rate and the damage of hits, the speed of monsters, the rate of
fireballs, and in Defend the Center the hit rate of the player's shots by distance. It prints means
with standard errors, and marks means that differ by more than two standard errors, and
distributions of damage that differ significantly (p < 0.05).
"""

from __future__ import annotations

import argparse
import itertools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import jaxenstein
from fidelity.commands import run_command
from fidelity.doom_players import APART, UNSEEN, Mean, apart, play_games
from fidelity.players import mean_and_error
from jaxenstein.adapters.vizdoom import GameSession
from jaxenstein.cli.arguments import whole
from jaxenstein.players import players_of
from jaxenstein.tasks.doom.fixed import ONE

IDS = tuple(
    f"doom-{name}"
    for name in ("defend-the-center", "defend-the-line", "take-cover", "deadly-corridor")
)
UNLIKELY = 0.05
"""The p-value below which distributions are marked."""
# Tics to follow in an episode.
_TICS = 400
# Speed of a fireball in map units per tic, and the tolerance to recognise it in the next tic.
_FLIES, _SLACK = 10, 0.5
# The tic at which distances of monsters are compared, and the bounds of shot distances.
_AFTER = 100
_NEAR = (0, 150, 400, 800)


class Seen(NamedTuple):
    """The observed part of a state; in a trace, all fields have a leading axis of tics.

    Attributes:
        health: health of the player.
        ammo: remaining shots.
        player: float[2], position of the player in map units.
        angle: uint32, heading of the player; 2**32 is a full turn.
        places: float[N, 2], positions of monsters.
        living: bool[N].
        balls: float[M, 2], positions of fireballs; M may be 0.
        flies: bool[M].
    """

    health: Any
    ammo: Any
    player: Any
    angle: Any
    places: Any
    living: Any
    balls: Any
    flies: Any


class Measure(NamedTuple):
    """A measured quantity here and in the game.

    Attributes:
        scenario: id of the environment.
        player: name of the scripted player.
        what: description of the quantity.
        here: mean and standard error here.
        there: mean and standard error in the game.
        chance: p-value of the difference of the distributions; None to compare only means.
    """

    scenario: str
    player: str
    what: str
    here: Mean
    there: Mean
    chance: float | None = None


def seen(state: Any) -> Seen:
    """The observed part of one of our states."""
    fire = hasattr(state, "fireballs")
    none = jnp.zeros((0, 2), jnp.int32)
    return Seen(
        state.health,
        state.trigger.ammo,
        state.fixed_position,
        state.angle,
        state.monsters.position,
        state.monsters.living,
        state.fireballs.position if fire else none,
        state.fireballs.flies if fire else none[:, 0] > 0,
    )


def in_units(trace: Seen) -> Seen:
    """A trace with positions in map units."""
    return trace._replace(
        player=np.asarray(trace.player) / ONE,
        places=np.asarray(trace.places) / ONE,
        balls=np.asarray(trace.balls) / ONE,
    )


def traces_here(env: Any, params: Any, name: str, episodes: int, seed: int) -> list[Seen]:
    """Traces of episodes in our environment."""
    choose = players_of(env)[name](env, params)

    def play(key: jax.Array) -> tuple[Seen, jax.Array]:
        def step(state: Any, key: jax.Array) -> tuple[Any, tuple[Seen, jax.Array]]:
            draw, world = jax.random.split(key)
            after = env.advance(world, state, choose(draw, state), params)[0]
            return after, (seen(state), state.done)

        first, steps = jax.random.split(key)
        keys = jax.random.split(steps, _TICS)
        return jax.lax.scan(step, env.init_state(first, params), keys)[1]

    keys = jax.random.split(jax.random.key(seed), episodes)
    watched, done = jax.device_get(jax.jit(jax.vmap(play))(keys))
    ends = [int(np.argmax(row)) if row.any() else _TICS for row in done]
    return [
        in_units(jax.tree.map(lambda leaf, i=i, end=end: leaf[i, :end], watched))
        for i, end in enumerate(ends)
    ]


def traces_there(env: Any, params: Any, name: str, episodes: int, seed: int) -> list[Seen]:
    """Traces of episodes in the game."""
    rows: list[list[Seen]] = [[] for _ in range(episodes)]

    def watch(number: int, session: GameSession) -> None:
        rows[number].append(jax.tree.map(np.asarray, seen(session.told)))

    params = params.replace(max_steps_in_episode=np.int32(_TICS))
    play_games(env, params, name, episodes=episodes, seed=seed, watch=watch)
    return [in_units(jax.tree.map(lambda *leaves: np.stack(leaves), *row)) for row in rows]


def first_damage(trace: Seen) -> list[float]:
    """The tic of the first damage, if there is any."""
    lost = np.flatnonzero(np.diff(trace.health) < 0)
    return [float(lost[0] + 1)] if len(lost) else []


def damage(trace: Seen) -> list[float]:
    """The damage of each tic with damage, except for the last tic of a life."""
    change = -np.diff(trace.health)
    return change[change > 0].astype(float).tolist()


def distances(trace: Seen) -> np.ndarray:
    """float[T, N]: distances from the player to monsters; infinite for dead monsters."""
    gap = trace.places - trace.player[:, None]
    return np.where(trace.living, np.hypot(gap[..., 0], gap[..., 1]), np.inf)


def thrown(trace: Seen) -> np.ndarray:
    """int[T - 1]: new fireballs in each tic, which do not continue an earlier one."""
    counts = []
    for before, after in itertools.pairwise(range(len(trace.balls))):
        old = trace.balls[before][trace.flies[before]]
        new = trace.balls[after][trace.flies[after]]
        gap = np.hypot(*np.moveaxis(new[:, None] - old[None], -1, 0))
        known = (np.abs(gap - _FLIES) < _SLACK).any(axis=1)
        counts.append(int((~known).sum()))
    return np.array(counts, int)


def shots(trace: Seen) -> np.ndarray:
    """float[S, 2]: for each shot, the distance of its target, and whether a monster died."""
    far = distances(trace)
    gap = trace.places - trace.player[:, None]
    bearing = np.arctan2(gap[..., 1], gap[..., 0])
    off = np.angle(np.exp(1j * (bearing - trace.angle[:, None] * (2 * np.pi / 2**32))))
    aimed = np.argmin(np.where(trace.living, np.abs(off), np.inf), axis=1)
    fired = np.flatnonzero(np.diff(trace.ammo.astype(int)) < 0)
    dies = trace.living.sum(axis=1)[fired + 1] < trace.living.sum(axis=1)[fired]
    return np.stack([far[fired, aimed[fired]], dies], axis=1)


def likeness(here: Sequence[float], there: Sequence[float]) -> float:
    """The p-value of the difference of two samples (chi-square test); NaN if one is empty."""
    from scipy import stats

    if not len(here) or not len(there):
        return math.nan
    values = np.unique(np.concatenate([here, there]))
    table = np.array([[np.sum(np.equal(side, v)) for v in values] for side in (here, there)])
    # Pool rare values.
    common = table.sum(axis=0) >= 10
    table = np.column_stack([table[:, common], table[:, ~common].sum(axis=1)])
    table = table[:, table.sum(axis=0) > 0]
    if table.shape[1] == 1:
        return 1.0
    found: Any = stats.chi2_contingency(table)
    return float(found.pvalue)


def measure(id: str, episodes: int, seed: int) -> list[Measure]:
    """All measured quantities of a scenario."""
    env: Any
    env, params = jaxenstein.make(id, **UNSEEN)
    params, name = env.check_params(params), "idle"
    both = [f(env, params, name, episodes, seed) for f in (traces_here, traces_there)]
    rows: list[Measure] = []

    def add(what: str, sides: Sequence[Sequence[float]], *, spread: bool = False) -> None:
        here, there = (mean_and_error(side) for side in sides)
        chance = likeness(*sides) if spread else None
        rows.append(Measure(id, name, what, here, there, chance))

    add("first damage, tic", [_all(first_damage, side) for side in both])
    add("damage of a hit", [_all(damage, side) for side in both], spread=True)
    add("hits in 100 tics of a life", [_all(_hit_rate, side) for side in both])
    kinds = env.horde.kinds
    for i, kind in enumerate(kinds):
        own = env.horde.kind_of == i
        if kind.speed:
            come = [[t for t in side if len(t.health) > _AFTER] for side in both]
            far = [[float(distances(t)[_AFTER, own].mean()) for t in side] for side in come]
            far = [[mean for mean in side if np.isfinite(mean)] for side in far]  # all live
            add(f"{kind.name}s after {_AFTER} tics, map units off", far)
    if hasattr(env, "fireballs"):
        rates = [_all(_rate, side) for side in both]
        add("fireballs in 100 tics of a life", rates)
    elif "turn_and_shoot" in players_of(env):
        name = "turn_and_shoot"
        both = [f(env, params, name, episodes, seed) for f in (traces_here, traces_there)]
        fired = [np.concatenate([shots(trace) for trace in side]) for side in both]
        for low, high in itertools.pairwise(_NEAR):
            hits = [s[(s[:, 0] >= low) & (s[:, 0] < high), 1].tolist() for s in fired]
            if min(map(len, hits)) > 1:
                add(f"hits of shots from {low} to {high} map units", hits)
    return rows


def _all(figures: Any, traces: Sequence[Seen]) -> list[float]:
    return [value for trace in traces for value in figures(trace)]


def _hit_rate(trace: Seen) -> list[float]:
    """Tics with damage per 100 tics of an episode."""
    return [100.0 * len(damage(trace)) / (len(trace.health) - 1)]


def _rate(trace: Seen) -> list[float]:
    """Fireballs per 100 tics of an episode."""
    return [100.0 * thrown(trace).sum() / (len(trace.health) - 1)]


def in_words(row: Measure) -> str:
    """A line of the table."""
    means = [f"{mean:.4g} +- {error:.2g}" for mean, error in (row.here, row.there)]
    chance = "" if row.chance is None else f"alike {row.chance:.2g}"
    mark = "APART" if differs(row) else ""
    name = f"{row.scenario:24} {row.player:14} {row.what:48}"
    return f"{name} {means[0]:>16} {means[1]:>16} {mark:6} {chance}"


def differs(row: Measure) -> bool:
    """Whether the difference is larger than chance explains."""
    alike = row.chance is None or row.chance >= UNLIKELY
    return apart(row.here, row.there) > APART or not alike


def main(argv: Sequence[str] | None = None) -> int:
    """Play and print the table; return 1 if a difference is larger than chance explains."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    parser.add_argument(
        "ids", nargs="*", metavar="ID", default=IDS, help=f"of {', '.join(IDS)} (default: all)"
    )
    parser.add_argument(
        "--episodes", type=whole(), default=200, help="episodes in each (default %(default)s)"
    )
    parser.add_argument(
        "--seed", type=whole(0), default=1, help="random seed (default %(default)s)"
    )
    options = parser.parse_args(argv)
    if unknown := [id for id in options.ids if id not in IDS]:
        parser.error(f"{unknown[0]!r} should be one of {', '.join(IDS)}")
    rows: list[Measure] = []
    for id in options.ids:
        found = measure(id, options.episodes, options.seed)
        print(*map(in_words, found), sep="\n", flush=True)
        rows += found
    return int(any(map(differs, rows)))


if __name__ == "__main__":
    run_command(main)
