"""The integer rules of the game's renderer beside digests of its frames.

Needs the pictures and maps that ViZDoom brings, but does not run the game. It is the only test that
sees whether the slow reference, with which our pictures are compared, is the game's own.
"""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fidelity.doom_picture import digest, moved, renderers
from fidelity.doom_views import Held, Look, Seen, View, drawn
from jaxenstein.tasks.doom.wad import Wad, find_iwad
from tests.reference.doom_picture import Pose

RECORDED = json.loads((Path(__file__).parent / "recordings" / "views.json").read_text())
SIZES = [tuple(size) for size in RECORDED["sizes"]]


@pytest.fixture(scope="module")
def pictures() -> Wad:
    pytest.importorskip("vizdoom")
    return Wad(find_iwad())


def view_of(row: dict[str, Any]) -> View:
    """A recorded view without its frame."""
    return View(
        Pose(*row["pose"]),
        tuple(Seen(Look(*look), *feet) for look, *feet in row["things"]),
        tuple(Held(*held) for held in row["held"]),
        row["gold"],
        row["flash"],
        np.zeros(0),
    )


@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize("scenario", dict.fromkeys(row["scenario"] for row in RECORDED["views"]))
def test_every_recorded_frame_is_drawn(pictures: Wad, scenario: str, size: tuple[int, int]) -> None:
    renderer = renderers(scenario, pictures)[size]
    found = [row for row in RECORDED["views"] if row["scenario"] == scenario]
    differ, bare, aside = [], 0, 0
    for number, row in enumerate(found):
        view, expected = view_of(row), row["digests"][SIZES.index(size)]
        if digest(drawn(renderer, pictures, view)) != expected:
            differ.append(number)
        empty = dataclasses.replace(view, things=(), held=())
        bare += digest(drawn(renderer, pictures, empty)) == expected
        aside += digest(drawn(renderer, pictures, moved(view, z=1 << 12))) == expected
    assert not differ
    # Digests tell what things, weapon and a sixteenth of a unit change.
    assert len(found) >= 12
    assert bare < len(found)
    assert aside == 0
