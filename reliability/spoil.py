"""Input cases, and mutations like those by people, disks and attackers: bytes, words, trees."""

from __future__ import annotations

import copy
import dataclasses
import json
import random
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

Rng = random.Random
Spoil = Callable[[bytes, Rng], bytes]

NUMBERS = (
    *("0", "-0", "1", "-1", "2", "7", "63", "255", "256", "257", "4096", "4097", "65536"),
    *("2147483647", "2147483648", "-2147483649", "4294967295", "4294967296", "1e18", "1e400"),
    *("-1e400", "nan", "inf", "-inf", "0.1", "1e-30", "3e6", "1_000", "0x10", "9" * 5000),
    *("0.5", "-0.5", "1.5", "100.25", "١٢", "²", "+5", " 5", "5 ", "1e", "--1"),
)
WORDS = (
    *("", " ", "\0", "\t", "\n", "\r\n", "\ufeff", "\u2028", "é", "\U0001f98a", "\ud800"),
    *("..", "../../x", "/etc/passwd", "~", "$HOME", "%s", "{0}", "<b>", "'", '"', "\\", "\x1b[2J"),
    *("null", "true", "false", "None", "__class__", "self", "env", "id", "params", "settings"),
    *("simple", "key-door", "rgb", "ppo", "forward", "random", "-", "--", "=", ",", "#", "//"),
    "a" * 3000,
)
VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, 1, -1, 2, 7, 255, 4097, 2**31, 2**32, -(2**63), 10**30, 10**400),
    *(0.5, -0.5, 1e-30, 1e308, float("nan"), float("inf"), -float("inf")),
    *("", "x", "simple", "rgb", "../../x", "/etc/passwd", "\0", "\ud800", "a" * 3000, "12"),
    *([], {}, [[]], [0], [1, 2], [1, 2, 3], [None], {"a": 1}, [[1, 2, 3]], "#SG#", ["#SG#"]),
)
# Bytes that are not UTF-8, and byte order marks.
_BYTES = (b"\xff", b"\xc0\x80", b"\xed\xa0\x80", b"\0", b"\xef\xbb\xbf", b"\xfe\xff")
LINES, TOKENS, SIGNS = r"[^\n]*\n|[^\n]+", r"\d+(?:\.\d+)?|\w+|\s+|[^\w\s]", r"(?s:.)"


def spoil_bytes(data: bytes, rng: Rng) -> bytes:
    """Change some bytes; sometimes also cut off the rest."""
    start, other = rng.randrange(len(data) + 1), rng.randrange(len(data) + 1)
    old = data[start : start + rng.choice((1, 1, 2, 4, 16, 64, 500))]
    new = rng.choice(
        (
            b"",
            old * 2,
            data[other : other + len(old)],
            data[other : other + len(old)] + old,
            rng.choice(_BYTES) + old,
            bytes([rng.randrange(256)]) * len(old),
            bytes([byte ^ 1 << rng.randrange(8) for byte in old[:1]]) + old[1:],
        )
    )
    return data[:start] + new + (data[start + len(old) :] if rng.random() < 0.8 else b"")


def flip_bytes(data: bytes, rng: Rng) -> bytes:
    """A change of one or two bytes, with all others where they were."""
    spoilt = bytearray(data)
    for _ in range(rng.choice((1, 1, 2))):
        if spoilt:
            place = rng.randrange(len(spoilt))
            spoilt[place] = rng.choice((0, 1, 127, 128, 255, spoilt[place] ^ 1 << rng.randrange(8)))
    return bytes(spoilt)


def text_spoiler(pattern: str, known: Sequence[str] = ()) -> Spoil:
    """A mutation of one or more parts of a text.

    Args:
        pattern: pattern of a part: `LINES`, `TOKENS` or `SIGNS`.
        known: valid parts to insert.
    """

    def run(data: bytes, rng: Rng) -> bytes:
        text = data.decode("utf-8", "surrogateescape")
        parts = re.findall(pattern, text) or [""]
        _spoil_parts(parts, rng, known)
        return "".join(parts).encode("utf-8", "surrogatepass")

    return run


def _spoil_parts(parts: list[str], rng: Rng, known: Sequence[str]) -> None:
    place, other = rng.randrange(len(parts)), rng.randrange(len(parts))
    some = slice(min(place, other), max(place, other) + 1)
    kind = rng.randrange(9)
    if kind == 0:
        del parts[some]
    elif kind == 1:
        parts[place:place] = parts[some]
    elif kind == 2:
        parts[place], parts[other] = parts[other], parts[place]
    elif kind == 3:
        numbers = [i for i, part in enumerate(parts) if part[:1].isdigit()]
        parts[rng.choice(numbers or [place])] = rng.choice(NUMBERS)
    elif kind == 4:
        parts[place] = rng.choice((parts[place][: len(parts[place]) // 2], parts[place][:-1]))
    elif kind == 5:
        parts[place] *= rng.choice((2, 3, 40, 300))
    elif kind == 6 or not known:
        parts[place] = rng.choice(WORDS)
    else:
        parts[place] = rng.choice(known) + (parts[place] if rng.random() < 0.2 else "")


def tree_spoiler(known: Sequence[Any] = ()) -> Spoil:
    """A mutation of the tree of a JSON text, or of the tokens or bytes of other text.

    Args:
        known: valid values to insert.
    """
    words = text_spoiler(TOKENS, [value for value in known if isinstance(value, str)])

    def run(data: bytes, rng: Rng) -> bytes:
        if rng.random() < 0.01:
            deep = rng.choice((100, 5_000, 200_000))
            return b"[" * deep + b"]" * deep
        try:
            tree = json.loads(data.decode())
            if rng.random() < 0.9:
                spoilt = json.dumps(spoil_tree(tree, rng, known))
                return spoilt.encode("utf-8", "surrogatepass")
        except (ValueError, RecursionError):
            pass
        return rng.choice((words, spoil_bytes))(data, rng)

    return run


def spoil_tree(tree: Any, rng: Rng, known: Sequence[Any] = ()) -> Any:
    """Replace, remove, rename, wrap or move one of the values of a JSON tree."""
    tree = copy.deepcopy(tree)
    places = list(_places(tree))
    if not places:
        return rng.choice(VALUES)
    parent, key = rng.choice(places)
    there, name = rng.choice(places)
    kind = rng.randrange(7)
    if kind == 0:
        del parent[key]
    elif kind == 1 and isinstance(parent, dict):
        parent[rng.choice([*WORDS, f"{key}s", str(key).upper()])] = parent.pop(key)
    elif kind == 2:
        parent[key] = rng.choice(([parent[key]], {"a": parent[key]}, [parent[key]] * 3))
    elif kind == 3:
        parent[key] = copy.deepcopy(there[name])
    elif kind == 4 and isinstance(parent[key], int | float) and abs(parent[key]) < 1e300:
        parent[key] += rng.choice((-1, 1, 0.5, 2**31, -(2**31), 10**12, 1e300))
    else:
        parent[key] = copy.deepcopy(rng.choice(known if kind == 5 and known else VALUES))
    return tree


def _places(tree: Any) -> Iterator[tuple[Any, Any]]:
    """Every (parent, key) of nested lists and dictionaries."""
    if isinstance(tree, dict | list):
        for key in list(tree) if isinstance(tree, dict) else range(len(tree)):
            yield tree, key
            yield from _places(tree[key])


@dataclasses.dataclass(frozen=True)
class Case:
    """One input: the content of files by name; names may include folders."""

    files: Mapping[str, bytes]

    def write(self, folder: Path) -> None:
        """Put the files into a folder."""
        for name, data in self.files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)


@dataclasses.dataclass(frozen=True)
class Target:
    """A reader to fuzz.

    Attributes:
        seeds: valid cases to start with.
        run: reads a case, whose files are in the working directory.
        ways: mutations of files, by suffix; bytes of other files are changed.
        named: whether an error must name a file of the case.
    """

    seeds: Sequence[Case]
    run: Callable[[Case], object]
    ways: Mapping[str, Sequence[Spoil]] = dataclasses.field(default_factory=dict)
    named: bool = False

    def spoil(self, case: Case, rng: Rng) -> Case:
        """Mutate a case once; sometimes a file is removed, emptied, or replaced by another."""
        files = dict(case.files)
        # Choose the suffix first, so that a single config is chosen as often as many arrays.
        suffix = rng.choice(sorted({Path(name).suffix for name in files}))
        name = rng.choice([name for name in files if Path(name).suffix == suffix])
        if rng.random() < 0.05:
            del files[name]
            if not files or rng.random() < 0.7:
                files[name] = rng.choice((b"", *case.files.values()))
        else:
            way = rng.choice((*self.ways.get(suffix, ()), spoil_bytes))
            files[name] = way(files[name], rng)[: 1 << 20]
        return Case(files)
