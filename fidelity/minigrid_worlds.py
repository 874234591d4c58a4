"""Worlds of the `minigrid-*` ids, MiniGrid's and ours, compared by their statistics.

    python -m fidelity.minigrid_worlds [--resets N] [ID ...]

Needs the `minigrid` extra. Tables are of where walls, doors, things and the start are, of their
colours, and of what is asked for. The status is 1 if one differs by more than chance explains (5 %
for all tables of all ids together).
"""

from __future__ import annotations

import argparse
import re
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from fidelity.frequencies import Observation, chances
from jaxenstein.maps.symbols import DOOR_LABELS
from jaxenstein.maps.things import COLOUR_NAMES

SIGNIFICANCE = 0.05
# What MiniGrid calls them, by our kinds of things.
KINDS = ("key", "ball", "box", "goal", "lava")
# Worlds with an instruction, and the attributes in which MiniGrid keeps it.
ASKED = {
    "fetch": (("targetColor", "targetType"),),
    "go-to-door": (("target_color", None),),
    "go-to-object": (("target_color", "targetType"),),
    "put-near": (("moveColor", "move_type"), ("target_color", "target_type")),
}


def original_id(name: str, registered: Sequence[str]) -> str:
    """MiniGrid's id of one of ours, without the prefix: the latest version of the same letters."""

    def letters(text: str) -> str:
        return re.sub(r"^MiniGrid-|-v\d+$|-", "", text).lower()

    return max(one for one in registered if letters(one) == letters(name))


def from_minigrid(env: Any, name: str) -> Observation:
    """What one of MiniGrid's levels shows."""
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
    for attributes in next((a for key, a in ASKED.items() if name.startswith(key)), ()):
        words = [getattr(env, attribute) if attribute else "door" for attribute in attributes]
        found["asked"].append(" ".join(words))
    return {**found, "start": [str(start)], "heading": [str(start[2])]}


def from_ours(state: Any, name: str) -> Observation:
    """What one of our first states shows."""
    found: Observation = {"walls": [], "doors": [], "things": [], "colours": [], "asked": []}
    walls = np.asarray(state.level.walls)[0]
    # Doors of GoToDoor do not stand on the map's border, which it has for that.
    shift = 1 if name.startswith("go-to-door") else 0
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
    if any(name.startswith(key) for key in ASKED):
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
    """Levels of MiniGrid and of ours."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import gymnasium  # pyright: ignore[reportMissingImports]
        import minigrid  # noqa: F401  # pyright: ignore[reportMissingImports]
    import jax

    import jaxenstein

    env = gymnasium.make(original_id(name, list(gymnasium.registry))).unwrapped
    theirs = []
    for reset in range(resets):
        env.reset(seed=0 if reset == 0 else None)
        theirs.append(from_minigrid(env, name))
    world, params = jaxenstein.make(f"minigrid-{name}", height=8, width=8)
    keys = jax.random.split(jax.random.key(1), resets)
    states = jax.device_get(jax.jit(jax.vmap(lambda key: world.init_state(key, params)))(keys))
    ours = [from_ours(jax.tree.map(lambda leaf, i=i: leaf[i], states), name) for i in range(resets)]
    return theirs, ours


def main(argv: Sequence[str] | None = None) -> int:
    """Compare and print; returns the exit status."""
    from jaxenstein.tasks.minigrid.table import WORLDS

    every = [name for world in WORLDS for name in world.sizes]
    parser = argparse.ArgumentParser(description="Compare worlds with MiniGrid's.")
    parser.add_argument("ids", nargs="*", default=every, metavar="ID", help="without minigrid-")
    parser.add_argument("--resets", type=int, default=1000, help="levels a side (default 1000)")
    options = parser.parse_args(argv)
    failed = False
    for name in options.ids:
        found = chances(*samples(name, options.resets))
        if name.startswith(("multi-room", "go-to-door")):
            del found["walls"]  # what lies outside of the rooms is solid here
        limit = SIGNIFICANCE / len(found) / len(options.ids)
        beyond = [table for table, chance in found.items() if chance < limit]
        shown = ", ".join(f"{table} {chance:.3f}" for table, chance in found.items())
        print(f"{name}: {shown}; beyond chance: {', '.join(beyond) or 'none'}", flush=True)
        failed |= bool(beyond)
    return int(failed)


if __name__ == "__main__":
    raise SystemExit(main())
