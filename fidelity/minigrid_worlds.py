"""Compare the statistics of MiniGrid's worlds and ours.

    python -m fidelity.minigrid_worlds [ID ...] [--resets N] [--episodes N] [--plans N]

Needs the extra `minigrid`. Tables count the places of walls, doors, things and starts, colours,
instructions, and, if `minigrid_moves` supports the world, the minimum number of moves. The exit
status is 1 if a table differs by more than chance explains (5 % for all tables of all ids
together). `--episodes` plays that many episodes with a random policy in both.
`--plans` plays that many of our levels with our planner, and compares its steps with the minimum
number of moves, converted at 1 / 0.15 steps per move, as in the time limits.
"""

from __future__ import annotations

import argparse
import re
import warnings
from collections.abc import Sequence
from typing import Any

import jax
import numpy as np

import jaxenstein
from fidelity import players
from fidelity.commands import run_command
from fidelity.frequencies import Observation, chances
from fidelity.minigrid_moves import PREFIX, end_of, fewest_moves, source_of
from jaxenstein.catalogue import ENTRIES, STEPS_A_MOVE
from jaxenstein.cli.arguments import whole
from jaxenstein.maps.symbols import DOOR_LABELS
from jaxenstein.maps.things import COLOUR_NAMES
from jaxenstein.players import UNIFORM, play, player_of

SIGNIFICANCE = 0.05
# MiniGrid's names of our kinds of things.
KINDS = ("key", "ball", "box", "goal", "lava")
# Worlds with an instruction, and the attributes of MiniGrid that hold it.
ASKED = {
    "instructions:Fetch": (("targetColor", "targetType"),),
    "instructions:GoToDoor": (("target_color", None),),
    "instructions:GoToObject": (("target_color", "targetType"),),
    "instructions:PutNear": (("moveColor", "move_type"), ("target_color", "target_type")),
}


def original_id(name: str, registered: Sequence[str]) -> str:
    """MiniGrid's id for one of ours (without prefix): the latest version with the same letters."""

    def letters(text: str) -> str:
        return re.sub(r"^MiniGrid-|-v\d+$|-", "", text).lower()

    return max(one for one in registered if letters(one) == letters(name))


def from_minigrid(env: Any, name: str) -> Observation:
    """The content of one of MiniGrid's levels."""
    found: Observation = {"walls": [], "doors": [], "things": [], "colours": [], "asked": []}
    grid = env.grid
    for row in range(grid.height):
        for column in range(grid.width):
            cell = grid.get(column, row)
            if cell is None:
                continue
            place = f"{column},{row}"
            if cell.type == "wall":
                found["walls"].append(place)
            elif cell.type == "door":
                _add(found, "doors", place, "locked" if cell.is_locked else "door", cell.color)
            else:
                shade = cell.color if cell.type in KINDS[:3] else ""
                _add(found, "things", place, cell.type, shade)
                if getattr(cell, "contains", None):
                    found["colours"].append(f"hidden {cell.contains.color}")
    start = (*(int(part) for part in env.agent_pos), int(env.agent_dir))
    for attributes in ASKED.get(source_of(name), ()):
        words = [getattr(env, attribute) if attribute else "door" for attribute in attributes]
        found["asked"].append(" ".join(words))
    return {**found, "start": [str(start)], "heading": [str(start[2])]}


def from_ours(state: Any, name: str) -> Observation:
    """The content of one of our first states."""
    found: Observation = {"walls": [], "doors": [], "things": [], "colours": [], "asked": []}
    walls = np.asarray(state.level.walls)[0]
    # GoToDoor has an additional border, since doors cannot be on the border of a map.
    shift = 1 if source_of(name) == "instructions:GoToDoor" else 0
    for row, column in np.argwhere(walls != 0).tolist():
        label = int(walls[row, column])
        place = f"{column - shift},{row - shift}"
        if label in DOOR_LABELS:
            kind = label - DOOR_LABELS.start
            _add(found, "doors", place, "locked" if kind > 5 else "door", COLOUR_NAMES[kind % 6])
        else:
            found["walls"].append(place)
    things = state.things
    for kind, colour, tile, where in zip(*_lists(things), strict=True):
        shade = COLOUR_NAMES[colour] if kind < 3 else ""
        if where == 0:
            _add(found, "things", f"{tile[0]},{tile[1]}", KINDS[kind], shade)
        elif where == 2:
            found["colours"].append(f"hidden {shade}")
    if source_of(name) in ASKED:
        rows = [(k, c) for k, c in np.asarray(state.asked).tolist() if k >= 0]
        found["asked"] += [f"{COLOUR_NAMES[c]} {(*KINDS, 'door')[k]}" for k, c in rows]
    turn = round(float(state.heading) / (np.pi / 2)) % 4
    cell = np.floor(np.asarray(state.position)).astype(int) - shift
    return {**found, "start": [str((*cell.tolist(), turn))], "heading": [str(turn)]}


def _lists(things: Any) -> tuple[list, list, list, list]:
    parts = (things.kind, things.colour, things.tile, things.place)
    kind, colour, tile, place = (np.asarray(part).tolist() for part in parts)
    return kind, colour, tile, place


def _add(found: Observation, table: str, place: str, kind: str, colour: str) -> None:
    found[table].append(f"{kind} {place}")
    found["colours"].append(f"{kind} {colour}")


def samples(name: str, resets: int) -> tuple[list[Observation], list[Observation]]:
    """Samples of MiniGrid's levels and ours."""
    env = original(name)
    theirs = []
    for reset in range(resets):
        env.reset(seed=0 if reset == 0 else None)
        theirs.append(from_minigrid(env, name))
    _, _, states = first_states(name, resets)
    ours = [from_ours(jax.tree.map(lambda leaf, i=i: leaf[i], states), name) for i in range(resets)]
    if end := end_of(name):
        for found in (*theirs, *ours):
            found["moves"] = [str(fewest_moves(found, end))]
    return theirs, ours


def original(name: str) -> Any:
    """MiniGrid's environment."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import gymnasium  # pyright: ignore[reportMissingImports]
        import minigrid  # noqa: F401  # pyright: ignore[reportMissingImports]
    return gymnasium.make(original_id(name, list(gymnasium.registry))).unwrapped


def first_states(name: str, count: int) -> tuple[Any, Any, Any]:
    """Our environment, its params, and first states as NumPy arrays."""
    env, params = jaxenstein.make(f"minigrid-{name}", height=8, width=8)
    params = env.check_params(params)
    return env, params, jax.device_get(players.first_states(env, params, count, seed=1))


def by_chance(name: str, episodes: int) -> tuple[float, float]:
    """The success rate of a random policy in MiniGrid and here."""
    env, rng, solved = original(name), np.random.default_rng(0), 0
    # The policy does not use observations.
    env.gen_obs = lambda: {}
    for episode in range(episodes):
        env.reset(seed=0 if episode == 0 else None)
        over, reward = False, 0.0
        while not over:
            _, reward, terminated, truncated, _ = env.step(rng.integers(env.action_space.n))
            over = terminated or truncated
        solved += reward > 0
    ours, params, states = first_states(name, episodes)
    played = play(ours, UNIFORM, params, jax.random.key(2), states)
    return solved / episodes, float((np.asarray(played.successes) > 0).mean())


def by_plan(name: str, levels: int) -> str:
    """A text with the steps of the planner in our levels."""
    env, params, states = first_states(name, levels)
    steps = np.asarray(play(env, player_of(env), params, jax.random.key(0), states).length)
    told = f"{steps.mean():.1f} steps, at most {steps.max() / int(params.max_steps_in_episode):.3f}"
    if not (end := end_of(name)):
        return f"{told} of the limit"
    found = [
        from_ours(jax.tree.map(lambda leaf, i=i: leaf[i], states), name) for i in range(levels)
    ]
    moves = np.array([fewest_moves(one, end) for one in found])
    shares = steps / np.maximum(moves * STEPS_A_MOVE, 1)
    return (
        f"{told} of the limit; fewest moves {moves.mean():.1f}, steps over rescaled moves "
        f"{steps.mean() / moves.mean() / STEPS_A_MOVE:.2f}, at most {shares.max():.2f}"
    )


def compared(name: str, resets: int, ids: int) -> bool:
    """Compare levels and print the result; return whether a table differs significantly."""
    both = samples(name, resets)
    found = chances(*both)
    if source_of(name) in ("multi_room:MultiRoom", "instructions:GoToDoor"):
        del found["walls"]  # everything outside the rooms is solid here
    beyond = [table for table, chance in found.items() if chance < SIGNIFICANCE / len(found) / ids]
    shown = ", ".join(f"{table} {chance:.3f}" for table, chance in found.items())
    moves = [np.mean([int(one["moves"][0]) for one in side]) for side in both if "moves" in found]
    told = "; fewest moves {:.1f} and {:.1f}".format(*moves) if moves else ""
    print(f"{name}: {shown}{told}; beyond chance: {', '.join(beyond) or 'none'}", flush=True)
    return bool(beyond)


def main(argv: Sequence[str] | None = None) -> int:
    """Compare and print; return the exit status."""
    every = [name.removeprefix(PREFIX) for name in ENTRIES if name.startswith(PREFIX)]
    parser = argparse.ArgumentParser(description="Compare worlds with MiniGrid's.")
    parser.add_argument("ids", nargs="*", default=every, metavar="ID", help="without minigrid-")
    parser.add_argument(
        "--resets", type=whole(0), default=1000, help="levels of each (default 1000)"
    )
    parser.add_argument(
        "--episodes", type=whole(0), default=0, help="episodes with a random policy"
    )
    parser.add_argument("--plans", type=whole(0), default=0, help="levels to play with the planner")
    options = parser.parse_args(argv)
    failed = [
        compared(name, options.resets, len(options.ids)) for name in options.ids if options.resets
    ]
    for name in options.ids if options.episodes else ():
        theirs, ours = by_chance(name, options.episodes)
        print(f"{name}: random policy {theirs:.1%} in MiniGrid, {ours:.1%} here", flush=True)
    for name in options.ids if options.plans else ():
        print(f"{name}: planner {by_plan(name, options.plans)}", flush=True)
    return int(any(failed))


if __name__ == "__main__":
    run_command(main)
