"""Measure scripted players in each task, beside results of the originals.

`python -m fidelity.players [--episodes N] [--ids ...] [--starts N] [--frame-skip N] [--param ...]`
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from fidelity.commands import run_command
from jaxenstein import make
from jaxenstein.catalogue import MAIN_IDS
from jaxenstein.cli.arguments import real, whole
from jaxenstein.environment import Environment
from jaxenstein.players import Choose, Player, play, player_of, players_of
from jaxenstein.players.walking import walking_actions
from jaxenstein.tasks.maze import Maze, far_starts
from jaxenstein.tasks.navigation import MapGoalTask
from jaxenstein.tasks.steering import centres, sample_heading

# Measured with ViZDoom 1.3.2; with skip 4, the game repeats each action four times.
ORIGINALS = {
    ("health-gathering", "idle"): "284 exactly, dead after 384 steps",
    ("health-gathering", "random"): "351.2 +- 4.3 (284 to 572); skip 4: 393.8 +- 7.3",
    ("health-gathering", "greedy_medkits"): "2100 in 20 of 20",
    ("my-way-home", "random_walk"): "success 7.0 +- 1.5 %; skip 4: 14 +- 2 %",
}
_HEADINGS = 4


def mean_and_error(values: Any) -> tuple[float, float]:
    """The mean and its standard error; NaN for fewer than two values."""
    values = np.asarray(values, np.float64)
    error = values.std(ddof=1) / math.sqrt(len(values)) if len(values) > 1 else math.nan
    return float(values.mean()), float(error)


def random_walk(env: Environment[Any, Any], params: Any) -> Choose:
    """Random turns and steps forward, the buttons of the originals."""
    del params
    moves = jnp.array(walking_actions(env.action_names))

    def choose(key: jax.Array, state: Any) -> jax.Array:
        del state
        return moves[jax.random.randint(key, (), 0, 3, jnp.int32)]

    return choose


RANDOM_WALK = Player("draws turn left, turn right or forward", random_walk)


def first_states(env: Any, params: Any, count: int, seed: int) -> Any:
    """The first states of `count` episodes."""
    keys = jax.random.split(jax.random.key(seed), count)
    return jax.jit(jax.vmap(lambda key: env.init_state(key, params)))(keys)


def all_starts(env: Any, params: Any, most: int) -> tuple[Any, bool]:
    """First states for every goal, start and 4 headings, and whether they are complete.

    If there are more than `most`, take a random sample. For generated levels, take `most` seeds.
    """
    if not isinstance(env, MapGoalTask):
        return first_states(env, params, most, seed=2), False
    distance = env.start_distance if isinstance(env, Maze) else 0
    starts, counts = far_starts(env.tilemap, distance)
    pairs = [(g, s) for g, n in enumerate(counts) for s in starts[g, :n]]
    rows = np.repeat(np.array(pairs, np.int32), _HEADINGS, axis=0)
    complete = len(rows) <= most
    if not complete:
        rows = np.random.default_rng(0).choice(rows, most, replace=False)
    bits = np.random.default_rng(1).integers(0, 2**32, len(rows), np.uint32)
    states = first_states(env, params, len(rows), seed=3)
    return states.replace(
        goal=jnp.asarray(rows[:, 0]),
        position=centres(env.tilemap.spawns)[rows[:, 1]],
        heading=jax.vmap(lambda b: sample_heading(b, env.heading))(jnp.asarray(bits)),
    ), complete


def measure(
    name: str,
    player: str,
    episodes: int,
    frame_skip: int = 1,
    changes: Sequence[tuple[str, float]] = (),
) -> dict[str, Any]:
    """Measure returns, lengths and successes of a player, and print them as a row."""
    env, params = make(name, height=8, width=8, frame_skip=frame_skip)
    params = params.replace(**dict(changes))
    states = first_states(env, params, episodes, seed=0)
    chosen = RANDOM_WALK if player == "random_walk" else player_of(env, player)
    result = play(env, chosen, params, jax.random.key(1), states)
    returned = np.asarray(result.returned).tolist()
    mean, error = mean_and_error(returned)
    row = {
        "id": name,
        "player": player,
        "episodes": episodes,
        "mean": mean,
        "error": error,
        "least": min(returned),
        "most": max(returned),
        "length": float(np.mean(result.length)),
        "success": float(np.mean(np.asarray(result.successes) > 0)),
        "goals": float(np.mean(result.successes)),
        "original": ORIGINALS.get((name, player), ""),
    }
    print(
        f"| {name} | {player} | {mean:.4g} +- {error:.2g} | {row['least']:.4g} | "
        f"{row['most']:.4g} | {row['length']:.1f} | {row['success']:.1%} | {row['goals']:.2f} | "
        f"{row['original']} |",
        flush=True,
    )
    return row


def solve(name: str, most: int) -> None:
    """Walk the shortest path from every start, and print a row."""
    env, params = make(name, height=8, width=8)
    states, complete = all_starts(env, params, most)
    result = play(env, player_of(env, "shortest_path"), params, jax.random.key(1), states)
    solved = np.asarray(result.successes) > 0
    starts = f"{len(solved)} ({'all' if complete else 'sample'})"
    length = f"{np.mean(result.length):.1f} | {np.max(result.length)}"
    horizon = int(params.max_steps_in_episode)
    print(f"| {name} | {starts} | {solved.sum()} | {length} | {horizon} |", flush=True)


def _ends_at_a_goal(name: str) -> bool:
    """Whether an episode ends at a goal, which `shortest_path` walks to."""
    env = make(name)[0]
    return "shortest_path" in players_of(env) and bool(env.about().ends)


def _players_of(name: str) -> list[str]:
    env = make(name)[0]
    walks = {"turn left", "turn right", "forward"} < {*env.action_names}
    walk = ["random_walk"] if walks else []
    return ["idle", "random", *walk, env.about().expert]


def _changed(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    return name, real(-math.inf, math.inf)(value)


def main(argv: Sequence[str] | None = None) -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--episodes", type=whole(), default=256, help="episodes of each player")
    parser.add_argument(
        "--starts", type=whole(), default=4096, help="maximum number of starts per id"
    )
    parser.add_argument("--ids", nargs="+", default=list(MAIN_IDS), metavar="ID")
    parser.add_argument(
        "--frame-skip", type=whole(), default=1, metavar="N", help="frame skip of the second table"
    )
    parser.add_argument(
        "--param",
        type=_changed,
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="param of the second table; may be given again",
    )
    options = parser.parse_args(argv)
    for name in options.ids:
        env, params = make(name, frame_skip=options.frame_skip)
        env.check_params(params.replace(**dict(options.param)))
    began = time.perf_counter()
    print("| id | starts | solved | mean length | longest | horizon |\n" + "|---" * 6 + "|")
    for name in options.ids:
        if _ends_at_a_goal(name):
            solve(name, options.starts)
    print(
        "\n| id | player | return | least | most | length | success | goals | original |\n"
        "|---|---|---:|---:|---:|---:|---:|---:|---|"
    )
    for name in options.ids:
        for player in _players_of(name):
            measure(name, player, options.episodes, options.frame_skip, options.param)
    print(f"\n{time.perf_counter() - began:.0f} s")


if __name__ == "__main__":
    run_command(main)
