"""The command, with stand-ins for both sides."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from fidelity import minigrid_layouts
from fidelity.corridors import Layout, from_tilemap
from jaxenstein.maps import parse_ascii

SMALL = "#######\n#r'S{}G#\n#######"


def layouts(doors: str) -> list[Layout]:
    """KeyCorridorS3R1 layouts facing south, one for each locked door of `doors`."""
    maps = [parse_ascii(SMALL.format(door)) for door in doors]
    return [from_tilemap(found, np.array([3.5, 1.5]), math.pi / 2) for found in maps]


def run(monkeypatch: pytest.MonkeyPatch, theirs: str, ours: str, *options: str) -> int:
    monkeypatch.setattr(minigrid_layouts, "minigrid_layouts", lambda *_: layouts(theirs))
    monkeypatch.setattr(minigrid_layouts, "our_layouts", lambda *_: layouts(ours))
    return minigrid_layouts.main(["--sizes", "s3r1", *options])


def test_equal_layouts_pass(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, "R" * 9, "R" * 8) == 0
    out = capsys.readouterr().out
    assert "| heading | 1.000 |" in out
    assert "rules broken by ours: none" in out
    assert "tables beyond chance (p < 0.0023): none" in out


def test_a_broken_rule_fails(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = iter([[], [], [], ["solvable"]])
    monkeypatch.setattr(minigrid_layouts, "broken_rules", lambda _: next(broken))
    assert run(monkeypatch, "RR", "RR") == 1
    assert "rules broken by ours: {'solvable': 1}" in capsys.readouterr().out


class Standing(NamedTuple):
    position: jax.Array
    heading: jax.Array
    door: jax.Array


class Environment:
    """Draws the colour of the locked door."""

    maps = tuple(parse_ascii(SMALL.format(door).replace("r", door.lower())) for door in "RB")

    def reset(self, key: jax.Array, params: None) -> tuple[None, Standing]:
        door = jax.random.randint(key, (), 0, 2)
        return None, Standing(jnp.array([3.5, 1.5]), jnp.float32(math.pi), door)

    def tilemap_of(self, state: Standing) -> Any:
        return self.maps[int(state.door)]


def test_our_states_are_read_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: dict[str, Any] = {}

    def make(id: str, **settings: Any) -> tuple[Environment, None]:
        asked.update(settings, id=id)
        return Environment(), None

    monkeypatch.setattr(jaxenstein, "make", make)
    found = minigrid_layouts.our_layouts("s3r1", 20, seed=0)
    assert asked["id"] == "key-corridor-s3r1"
    assert len(found) == 20
    assert {layout.locked.colour for layout in found} == {0, 2}
    assert all(layout.heading == 2 and layout.start == (3, 1) for layout in found)
    assert all(layout.tilemap.keys[0].colour == layout.locked.colour for layout in found)
