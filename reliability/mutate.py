"""Spoiling valid input in ways that people, disks and enemies do: bytes, words, grids, trees."""

from __future__ import annotations

import copy
import json
import random
import re
from collections.abc import Callable, Sequence
from typing import Any

Rng = random.Random

NUMBERS = (
    *("0", "-0", "1", "-1", "2", "7", "63", "255", "256", "257", "4096", "4097", "65536"),
    *("2147483647", "2147483648", "-2147483649", "4294967295", "4294967296", "1e18", "1e400"),
    *("-1e400", "nan", "inf", "-inf", "0.1", "1e-30", "3e6", "1_000", "0x10", "9" * 5000),
    *("0.5", "-0.5", "1.5", "100.25", "١٢", "²", "+5", " 5", "5 ", "1e", "--1"),
)
WORDS = (
    *(
        "",
        " ",
        "\0",
        "\t",
        "\n",
        "\r\n",
        "\ufeff",
        "\u2028",
        "é",
        "\U0001f98a",
        "\ud800",
        "a" * 3000,
    ),
    *("..", "../../x", "/etc/passwd", "~", "$HOME", "%s", "{0}", "<b>", "'", '"', "\\", "\x1b[2J"),
    *("null", "true", "false", "None", "__class__", "self", "env", "id", "params", "settings"),
    *("simple", "key-door", "rgb", "ppo", "forward", "random", "-", "--", "=", ",", "#", "//"),
)
_TOKEN = re.compile(r"\d+(?:\.\d+)?|\w+|\s+|[^\w\s]")
VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, 1, -1, 2, 7, 255, 4097, 2**31, 2**32, -(2**63), 10**30, 10**400),
    *(0.5, -0.5, 1e-30, 1e308, float("nan"), float("inf"), -float("inf")),
    *("", "x", "simple", "rgb", "../../x", "/etc/passwd", "\0", "\ud800", "a" * 3000, "12"),
    *([], {}, [[]], [0], [1, 2], [1, 2, 3], [None], {"a": 1}, [[1, 2, 3]], "#SG#", ["#SG#"]),
)


def spoil_bytes(data: bytes, rng: Rng) -> bytes:
    """One change of some bytes."""
    kind = rng.randrange(7)
    start = rng.randrange(len(data) + 1)
    end = min(len(data), start + rng.choice((1, 1, 2, 4, 16, 64, 500)))
    if kind == 0:
        return data[:start]
    if kind == 1:
        return data[:start] + data[end:]
    if kind == 2:
        return data[:start] + data[start:end] * 2 + data[end:]
    if kind == 3:
        return data[:start] + bytes(rng.randrange(256) for _ in range(end - start)) + data[end:]
    if kind == 4 and data:
        place = min(start, len(data) - 1)
        return data[:place] + bytes([data[place] ^ 1 << rng.randrange(8)]) + data[place + 1 :]
    if kind == 5:
        other = rng.randrange(len(data) + 1)
        return data[:start] + data[other : other + end - start] + data[start:]
    # No text in UTF-8, the ends of encodings, marks of other ones.
    extra = rng.choice((b"\xff", b"\xc0\x80", b"\xed\xa0\x80", b"\0", b"\xef\xbb\xbf", b"\xfe\xff"))
    return data[:start] + extra + data[start:]


def spoil_lines(text: str, rng: Rng) -> str:
    """Lines removed, repeated, swapped, cut or joined."""
    lines = text.split("\n")
    one, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    kind = rng.randrange(6)
    if kind == 0:
        del lines[min(one, other) : max(one, other) + 1]
    elif kind == 1:
        lines[one:one] = lines[min(one, other) : max(one, other) + 1]
    elif kind == 2:
        lines[one], lines[other] = lines[other], lines[one]
    elif kind == 3:
        lines[one] = lines[one][: rng.randrange(len(lines[one]) + 1)]
    elif kind == 4:
        lines[one] += lines[other]
    else:
        lines[one] = lines[one] * rng.choice((2, 3, 40, 300))
    return "\n".join(lines)


def spoil_words(text: str, rng: Rng, known: Sequence[str] = ()) -> str:
    """A word, number or sign replaced, removed, repeated or moved; `known` are words that fit."""
    tokens = _TOKEN.findall(text) or [""]
    place = rng.randrange(len(tokens))
    kind = rng.randrange(6)
    if kind == 0:
        del tokens[place]
    elif kind == 1:
        tokens.insert(place, tokens[rng.randrange(len(tokens))])
    elif kind == 2:
        other = rng.randrange(len(tokens))
        tokens[place], tokens[other] = tokens[other], tokens[place]
    elif kind == 3:
        numbers = [i for i, token in enumerate(tokens) if token[:1].isdigit()]
        tokens[rng.choice(numbers) if numbers else place] = rng.choice(NUMBERS)
    elif kind == 4 and known:
        tokens[place] = rng.choice(known)
    else:
        tokens[place] = rng.choice(WORDS)
    return "".join(tokens)


def spoil_grid(text: str, rng: Rng, known: Sequence[str]) -> str:
    """One character of a grid, mostly another one of those that may stand there."""
    lines = text.split("\n")
    row = rng.randrange(len(lines))
    place = rng.randrange(len(lines[row]) + 1)
    new = rng.choice(known) if rng.random() < 0.8 else rng.choice(WORDS)
    keep = rng.random() < 0.2
    lines[row] = lines[row][:place] + new + lines[row][place + (0 if keep else 1) :]
    return "\n".join(lines)


def spoil_tree(tree: Any, rng: Rng, known: Sequence[Any] = ()) -> Any:
    """JSON values with one of them replaced, removed, renamed, wrapped or moved."""
    tree = copy.deepcopy(tree)
    places = list(_places(tree))
    if not places:
        return rng.choice(VALUES)
    parent, key = rng.choice(places)
    kind = rng.randrange(7)
    if kind == 0:
        del parent[key]
    elif kind == 1 and isinstance(parent, dict):
        parent[rng.choice([*WORDS, f"{key}s", str(key).upper()])] = parent.pop(key)
    elif kind == 2:
        parent[key] = rng.choice(([parent[key]], {"a": parent[key]}, [parent[key]] * 3))
    elif kind == 3:
        there, name = rng.choice(places)
        parent[key] = copy.deepcopy(there[name]) if name in _keys(there) else None
    elif kind == 4 and isinstance(parent[key], int | float):
        steps = (-1, 1, 0.5, 2**31, -(2**31), 10**12, 1e300)
        parent[key] = _shifted(parent[key], rng.choice(steps))
    elif kind == 5 and known:
        parent[key] = copy.deepcopy(rng.choice(known))
    else:
        parent[key] = copy.deepcopy(rng.choice(VALUES))
    return tree


def _shifted(value: float, step: float) -> float:
    try:
        return value + step
    except OverflowError:
        return step


def _keys(node: Any) -> Sequence[Any]:
    return list(node) if isinstance(node, dict) else range(len(node))


def _places(tree: Any) -> Any:
    """Every (parent, key) of nested lists and dictionaries."""
    if isinstance(tree, dict | list):
        for key in _keys(tree):
            yield tree, key
            yield from _places(tree[key])


def spoil_json(data: bytes, rng: Rng, known: Sequence[Any] = ()) -> bytes:
    """A JSON text whose tree, or whose bytes, are spoilt."""
    if rng.random() < 0.05:
        return spoil_bytes(data, rng)
    if rng.random() < 0.01:
        deep = rng.choice((100, 5_000, 200_000))
        return b"[" * deep + b"]" * deep
    try:
        tree = json.loads(data)
    except (ValueError, RecursionError):
        return spoil_bytes(data, rng)
    spoilt = spoil_tree(tree, rng, known)
    return json.dumps(spoilt, default=str).encode("utf-8", "surrogatepass")


def as_text(change: Callable[[str, Rng], str]) -> Callable[[bytes, Rng], bytes]:
    """A change of text as one of bytes, which need be no UTF-8 before nor after."""

    def run(data: bytes, rng: Rng) -> bytes:
        text = data.decode("utf-8", "surrogateescape")
        return change(text, rng).encode("utf-8", "surrogatepass")

    return run
