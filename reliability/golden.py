"""Golden episodes: the behaviour of every environment in its current version.

    python -m reliability.golden            write the episodes of new ids and raised versions
    python -m reliability.golden --check    only print differences

An episode is a seed and a list of actions; the file has digests of the results. Integers (tiles,
doors, events, times) and rewards must be the same bit for bit on any machine. JAX 0.7, 0.10 and
0.12 agree in all pixels, and in other numbers up to 1e-6. A processor without fused multiply-add
differs by up to 2e-6, and in single pixels at edges. So other numbers are rounded to hundredths;
seeds are chosen such that no number is close to a rounding boundary. Some frames are stored as they
are, and a few of their pixels may differ.
"""

from __future__ import annotations

import argparse
import base64
import dataclasses
import functools
import hashlib
import itertools
import json
import platform
import sys
import zlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jaxenstein
from jaxenstein.catalogue import ENTRIES, MAIN_IDS
from jaxenstein.files import atomic
from jaxenstein.players import player_of

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / "tests" / "contract" / "golden.json"
COMMAND = "python -m reliability.golden"
SIZE = {"height": 12, "width": 16}
# Steps of an episode, its time limit (so that it includes a reset), and steps per digest.
STEPS, LIMIT, BLOCK = 72, 60, 8
# Every KEPT-th frame is stored; at most the share FEW of its pixels may differ.
KEPT, FEW = 6, 0.02
# The rounding grid; in units of it, the minimum distance to a rounding boundary, and the maximum
# difference of stored poses on other kinds of processor.
GRID, MARGIN, NEAR = 1e-2, 2e-3, 1.5
# The probabilities that the generator deviates from the expert for one step, and for a longer walk.
WANDERING, STRAYING = 0.12, 0.04

# Monsters that would not appear in so few steps appear earlier and in larger numbers.
SOONER: dict[str, dict[str, float]] = {"doom-deathmatch": {"first": 4, "crowd": 40}}

Table = dict[str, Any]


@dataclasses.dataclass(frozen=True)
class Trace:
    """The results of the actions; the rows are the reset, then the steps.

    Attributes:
        layout: names, types and shapes of the content of a row.
        whole: int64 for each row: integers, bools, and the bits of rewards.
        real: float64 for each row: all other numbers.
        poses: float64[rows, 3], x, y and heading.
        frames: uint8[rows, height, width, 3].
    """

    layout: str
    whole: tuple[np.ndarray, ...]
    real: tuple[np.ndarray, ...]
    poses: np.ndarray
    frames: np.ndarray


def made(name: str) -> tuple[Any, Any]:
    """A small environment whose episodes end within the steps, and its params."""
    env, params = jaxenstein.make(name, **SIZE)
    return env, params.replace(max_steps_in_episode=LIMIT, **SOONER.get(name, {}))


def trace(name: str, seed: int, actions: Sequence[int]) -> Trace:
    """Play the actions after a reset with a seed."""
    env, params = made(name)
    played = _play(env, keys_of(seed), jnp.asarray(actions, jnp.int32), params)
    return trace_of(*jax.device_get(played))


def trace_of(first: tuple[Any, ...], steps: tuple[Any, ...]) -> Trace:
    """The trace of the results of `reset` and of the steps, stacked over time."""
    *front, info = steps
    # `success` follows from the others, and is not in the file.
    steps = *front, {name: value for name, value in info.items() if name != "success"}
    begin = jax.tree.map(lambda leaf: leaf[None], first[1])
    parts = _rows(begin), _rows(steps[1:])
    poses = [np.concatenate([s.position, s.heading[:, None]], -1) for s in (begin, steps[1])]
    return Trace(
        layout="; ".join(part[0] for part in parts),
        whole=tuple(row for part in parts for row in part[1]),
        real=tuple(row for part in parts for row in part[2]),
        poses=np.concatenate(poses).astype(np.float64),
        frames=np.concatenate([first[0][None], steps[0]]),
    )


def keys_of(seed: int) -> jax.Array:
    """The keys of the reset and of each step."""
    return jax.random.split(jax.random.key(seed, impl="threefry2x32"), STEPS + 1)


@functools.partial(jax.jit, static_argnums=0)
def _play(env: Any, keys: jax.Array, actions: jax.Array, params: Any) -> Any:
    def step(state: Any, given: Any) -> Any:
        out = env.step(given[0], state, given[1], params)
        return out[1], out

    first = env.reset(keys[0], params)
    return first, jax.lax.scan(step, first[1], (keys[1:], actions))[1]


def _rows(tree: Any) -> tuple[str, list[np.ndarray], list[np.ndarray]]:
    """Layout, whole numbers and other numbers of a pytree whose leaves are stacked over time."""
    names: list[str] = []
    whole: list[np.ndarray] = []
    real: list[np.ndarray] = []
    for path, leaf in jax.tree_util.tree_flatten_with_path(tree)[0]:
        leaf, name = np.asarray(leaf), jax.tree_util.keystr(path)
        names.append(f"{name} {leaf.dtype}{list(leaf.shape[1:])}")
        flat = leaf.reshape(len(leaf), -1)
        # Rewards and their sums are the same everywhere, and may be smaller than the grid.
        if name == "[1]" or name.endswith(("episode_return", "['episode_return']")):
            flat = flat.view(np.int32)
        (real if flat.dtype.kind == "f" else whole).append(flat)
    count = len(jax.tree.leaves(tree)[0])
    joined = [
        np.concatenate(parts, -1).astype(dtype) if parts else np.zeros((count, 0), dtype)
        for parts, dtype in ((whole, np.int64), (real, np.float64))
    ]
    return ", ".join(names), list(joined[0]), list(joined[1])


def describe(name: str, seed: int, actions: Sequence[int]) -> Table:
    """The entry of an environment in the file."""
    env, params = jaxenstein.make(name, **SIZE)
    found = trace(name, seed, actions)
    kept = found.frames[::KEPT]
    return {
        "version": env.version,
        "params": numbers_of(params),
        "seed": seed,
        "actions": [[value, len(list(group))] for value, group in itertools.groupby(actions)],
        "layout": digest([found.layout.encode()]),
        "whole": blocks(found.whole),
        "rounded": blocks(rounded(found.real)),
        "frames": blocks(found.frames),
        "poses": np.rint(found.poses[::KEPT] / GRID).astype(int).tolist(),
        "pictures": base64.b64encode(zlib.compress(kept.tobytes(), 9)).decode(),
    }


def numbers_of(params: Any) -> dict[str, float]:
    """The default params by name, in the shortest form that is exact in float32."""
    return {
        field.name: float(str(np.asarray(getattr(params, field.name))))
        for field in dataclasses.fields(params)
    }


def digest(parts: Iterable[bytes]) -> str:
    """Twelve hexadecimal digits for some bytes."""
    return hashlib.sha256(b"".join(parts)).hexdigest()[:12]


def blocks(rows: Sequence[np.ndarray] | np.ndarray) -> list[str]:
    """A digest of every BLOCK rows, independent of the byte order of the machine."""
    little = [row.astype(row.dtype.newbyteorder("<"), copy=False).tobytes() for row in rows]
    return [digest(little[start : start + BLOCK]) for start in range(0, len(little), BLOCK)]


def rounded(rows: Iterable[np.ndarray]) -> list[np.ndarray]:
    """Numbers rounded to units of the grid."""
    return [np.rint(row / GRID).astype(np.int64) for row in rows]


def actions_of(episode: Mapping[str, Any]) -> list[int]:
    """The actions of an episode, one for each step."""
    return [value for value, count in episode["actions"] for _ in range(count)]


def problem(name: str, wanted: Mapping[str, Any], found: Trace | None = None) -> str:
    """How an environment differs from its golden episode; "" if it does not.

    Args:
        name: the id.
        wanted: the episode.
        found: the trace of its actions; None plays them.
    """
    env, params = jaxenstein.make(name, **SIZE)
    if env.version != wanted["version"]:
        return f"its version is {env.version}, but {wanted['version']} in the file"
    numbers = numbers_of(params)
    if numbers != wanted["params"]:
        changed = {k: v for k, v in numbers.items() if wanted["params"].get(k) != v}
        return f"default params are now {changed or numbers}"
    if found is None:
        found = trace(name, wanted["seed"], actions_of(wanted))
    if digest([found.layout.encode()]) != wanted["layout"]:
        return f"states or info have another layout: {found.layout}"
    if at := _differing(blocks(found.whole), wanted["whole"]):
        return f"rewards, events or other integers in states differ from {at} on"
    at = _differing(blocks(rounded(found.real)), wanted["rounded"])
    if at and not _near(found.poses, wanted["poses"]):
        return f"positions or other numbers in states differ from {at} on"
    return _frames_problem(found.frames, wanted)


def _differing(found: Sequence[str], wanted: Sequence[str]) -> str:
    """The first steps whose digests differ, in words."""
    for index, (one, other) in enumerate(itertools.zip_longest(found, wanted)):
        if one != other:
            return f"one of steps {index * BLOCK} to {index * BLOCK + BLOCK - 1}"
    return ""


def _near(poses: np.ndarray, wanted: Any) -> bool:
    """Whether this is another kind of processor, and positions are equal up to rounding."""
    x86 = platform.machine().lower() in ("x86_64", "amd64", "i686")
    if jax.default_backend() == "cpu" and x86:
        return False
    return bool(np.all(np.abs(poses[::KEPT] / GRID - np.array(wanted)) <= NEAR))


def _frames_problem(frames: np.ndarray, wanted: Mapping[str, Any]) -> str:
    if not _differing(blocks(frames), wanted["frames"]):
        return ""
    kept = frames[::KEPT]
    data = zlib.decompress(base64.b64decode(wanted["pictures"]))
    pictures = np.frombuffer(data, np.uint8).reshape(-1, *kept.shape[1:])
    if pictures.shape != kept.shape:
        return "the number or size of frames differs"
    shares = (kept != pictures).any(axis=-1).mean(axis=(1, 2))
    worst = int(shares.argmax())
    if shares[worst] > FEW:
        return f"{shares[worst]:.1%} of the frame after step {worst * KEPT} differs"
    return ""


def message(name: str, what: str) -> str:
    """The message for a difference, with advice."""
    if what.startswith("its version"):
        return f"{name}: {what}: regenerate with {COMMAND}"
    return (
        f"behaviour of {name} changed: {what}. If intended, raise its version in the catalogue "
        f"and add a line to CHANGELOG.md, then regenerate with {COMMAND}"
    )


def load() -> dict[str, Table]:
    """The golden episodes by id."""
    return json.loads(FILE.read_text(encoding="utf-8"))


def choose(name: str, seeds: Iterable[int] = range(400)) -> Table:
    """An episode in which all numbers can be rounded safely."""
    for seed in seeds:
        actions = wander(name, seed)
        real = np.concatenate(trace(name, seed, actions).real) / GRID
        if not np.isfinite(real).all():
            raise ValueError(f"{name}: a number of a state is not finite")
        if (np.abs(real - np.floor(real) - 0.5) > MARGIN).all():
            return describe(name, seed, actions)
    raise ValueError(f"{name}: no seed has numbers that can all be rounded safely")


def wander(name: str, seed: int) -> list[int]:
    """Actions of the expert mixed with other actions, some of them invalid."""
    env, params = made(name)
    rng = np.random.default_rng(seed)
    others = rng.integers(-1, env.num_actions + 1, STEPS).astype(np.int32)
    away = rng.random(STEPS) < WANDERING
    for start in np.flatnonzero(rng.random(STEPS) < STRAYING):
        stray = [int(rng.integers(2))] * int(rng.integers(1, 5)) + [2] * 7
        others[start : start + len(stray)] = stray[: STEPS - start]
        away[start : start + len(stray)] = True
    return np.asarray(_choose(env, keys_of(seed), others, away, params)).tolist()


@functools.partial(jax.jit, static_argnums=0)
def _choose(env: Any, keys: jax.Array, others: jax.Array, away: jax.Array, params: Any) -> Any:
    choose = player_of(env)(env, params)

    def step(state: Any, given: Any) -> Any:
        key, other, wandering = given
        action = jnp.where(wandering, other, choose(key, state))
        after = env.advance(key, state, action, params)[0]
        return after, action

    state = env.init_state(keys[0], params)
    return jax.lax.scan(step, state, (keys[1:], others, away))[1]


def main(arguments: Sequence[str] | None = None) -> int:
    """Write or check the file."""
    parser = argparse.ArgumentParser(description="Write or check the golden episodes.")
    parser.add_argument("ids", nargs="*", metavar="ID", help="environments (default: all)")
    parser.add_argument("--check", action="store_true", help="write nothing")
    options = parser.parse_args(arguments)
    if unknown := [name for name in options.ids if name not in MAIN_IDS]:
        parser.error(f"unknown: {', '.join(unknown)}; known: {', '.join(MAIN_IDS)}")
    before = load() if FILE.exists() else {}
    table, wrong = {}, 0
    for name in MAIN_IDS:
        entry, old = ENTRIES[name], before.get(name)
        if options.ids and name not in options.ids:
            table |= {} if old is None else {name: old}
        elif old is not None and (options.check or old["version"] >= entry.version):
            table[name] = old
            what = problem(name, old)
            wrong += bool(what)
            print(message(name, what) if what else f"{name}: unchanged", flush=True)
        elif options.check:
            wrong += 1
            print(message(name, "it has no golden episode"), flush=True)
        else:
            table[name] = choose(name)
            print(f"{name}: version {entry.version}, seed {table[name]['seed']}", flush=True)
    if not options.check and table != before:
        with atomic(FILE) as temporary:
            temporary.write_text(to_text(table), encoding="utf-8", newline="\n")
    return int(wrong > 0)


def to_text(table: Mapping[str, Table]) -> str:
    """JSON with one entry per line, so that diffs are readable."""
    parts = []
    for name, entry in table.items():
        lines = (f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in entry.items())
        parts.append(f"{json.dumps(name)}: {{\n" + ",\n".join(lines) + "\n}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


if __name__ == "__main__":
    sys.exit(main())
