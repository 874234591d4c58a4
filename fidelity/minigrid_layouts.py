"""KeyCorridor's layouts, MiniGrid's and ours, compared by their statistics.

    python -m fidelity.minigrid_layouts [--resets N] [--sizes s4r3 ...]

Needs the `minigrid` extra. Every layout of both sides is also checked against the rules of the
task and solved by search. `--null` compares MiniGrid with itself, under another seed: what a
perfect port looks like. The status is 1 if a layout of ours breaks a rule, or if a table differs
by more than chance explains (5 % for all tables of all sizes together).
"""

from __future__ import annotations

import argparse
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

from fidelity.corridors import Layout, broken_rules, from_minigrid, from_tilemap, observe
from fidelity.frequencies import chances

SIZES = ("s3r1", "s3r2", "s3r3", "s4r3", "s5r3", "s6r3")
SIGNIFICANCE = 0.05


def minigrid_layouts(size: str, resets: int, seed: int) -> list[Layout]:
    """Layouts of the original, all from one environment."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import gymnasium  # pyright: ignore[reportMissingImports]
        import minigrid  # noqa: F401  # pyright: ignore[reportMissingImports]

    env = gymnasium.make(f"MiniGrid-KeyCorridor{size.upper()}-v0").unwrapped
    env.reset(seed=seed)
    layouts = [from_minigrid(env)]
    while len(layouts) < resets:
        env.reset()
        layouts.append(from_minigrid(env))
    return layouts


def our_layouts(size: str, resets: int, seed: int) -> list[Layout]:
    """Layouts of this project."""
    import jax

    import jaxenstein

    id: Any = f"key-corridor-{size}"
    env: Any
    env, params = jaxenstein.make(id, height=16, width=16)
    keys = jax.random.split(jax.random.key(seed), resets)
    # The frames are not asked for, so the compiled program does not draw them.
    states = jax.device_get(jax.jit(jax.vmap(lambda key: env.reset(key, params)[1]))(keys))
    layouts = []
    for number in range(resets):
        state = jax.tree.map(lambda leaf, number=number: leaf[number], states)
        layouts.append(from_tilemap(env.tilemap_of(state), state.position, state.heading))
    return layouts


def main(argv: Sequence[str] | None = None) -> int:
    """Compare and print; returns the exit status."""
    arguments = _parser().parse_args(argv)
    title, draw = ("MiniGrid again", minigrid_layouts) if arguments.null else ("ours", our_layouts)
    failed = False
    for size in arguments.sizes:
        found, broken = _compare_size(size, arguments.resets, arguments.seed, draw)
        print(f"\n## KeyCorridor{size.upper()}: MiniGrid and {title}, {arguments.resets} each\n")
        print("| table | chance of such a difference |\n|---|---:|")
        print("\n".join(f"| {table} | {chance:.3f} |" for table, chance in found.items()))
        for side, rules in zip(("MiniGrid", title), broken, strict=True):
            print(f"\nrules broken by {side}: {dict(rules) or 'none'}")
        limit = SIGNIFICANCE / len(found) / len(arguments.sizes)
        beyond = [table for table, chance in found.items() if chance < limit]
        print(f"\ntables beyond chance (p < {limit:.4f}): {', '.join(beyond) or 'none'}")
        failed |= bool(beyond or broken[1])
    return int(failed)


def _compare_size(
    size: str, resets: int, seed: int, draw: Callable[[str, int, int], list[Layout]]
) -> tuple[dict[str, float], tuple[Counter[str], Counter[str]]]:
    """The comparison, and how often each side breaks which rule."""
    samples = minigrid_layouts(size, resets, seed), draw(size, resets, seed + 1)
    broken = [[broken_rules(layout) for layout in sample] for sample in samples]
    first, second = (
        [observe(layout) for layout, rules in zip(sample, lists, strict=True) if not rules]
        for sample, lists in zip(samples, broken, strict=True)
    )
    theirs, ours = (Counter(rule for rules in lists for rule in rules) for lists in broken)
    if not (first and second):
        raise SystemExit(f"{size}: no layout keeps the rules: {theirs}, {ours}")
    return chances(first, second), (theirs, ours)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Compare KeyCorridor layouts with MiniGrid's.")
    parser.add_argument("--resets", type=int, default=2000, help="layouts a side (default 2000)")
    parser.add_argument("--sizes", nargs="+", choices=SIZES, default=SIZES, metavar="SIZE")
    parser.add_argument("--seed", type=int, default=0, help="of MiniGrid; the other takes the next")
    parser.add_argument("--null", action="store_true", help="MiniGrid against itself")
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
