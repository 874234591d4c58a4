"""The integer rules of the game's renderer beside digests of its frames.

Needs the pictures and maps that ViZDoom brings, but does not run the game. It is the only test that
sees whether the slow reference, with which our pictures are compared, is the game's own.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from fidelity.doom_picture import Seen, digest, drawn, moved, renderers
from jaxenstein.tasks.doom.wad import Wad, find_iwad
from tests.reference.doom_picture import Pose

RECORDED = json.loads((Path(__file__).parent / "recordings" / "views.json").read_text())
SIZES = [tuple(size) for size in RECORDED["sizes"]]


@pytest.fixture(scope="module")
def pictures() -> Wad:
    pytest.importorskip("vizdoom")
    return Wad(find_iwad())


def things_of(view: dict[str, Any]) -> list[Seen]:
    return [Seen((tuple(thing[:3]),), *thing[3:]) for thing in view["things"]]  # type: ignore[arg-type]


@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize("scenario", sorted({view["scenario"] for view in RECORDED["views"]}))
def test_every_recorded_frame_is_drawn(pictures: Wad, scenario: str, size: tuple[int, int]) -> None:
    renderer = renderers(scenario, pictures)[size]
    found = [view for view in RECORDED["views"] if view["scenario"] == scenario]
    differ, bare, aside = [], 0, 0
    for number, view in enumerate(found):
        pose, things, gold = Pose(*view["pose"]), things_of(view), view["gold"]
        expected = view["digests"][SIZES.index(size)]
        if digest(drawn(renderer, pictures, pose, things, gold)) != expected:
            differ.append(number)
        bare += digest(drawn(renderer, pictures, pose, (), gold)) == expected
        aside += digest(drawn(renderer, pictures, moved(pose, z=1 << 12), things, gold)) == expected
    assert not differ
    # Digests tell what the things and a sixteenth of a unit change.
    assert len(found) >= 12
    assert bare < len(found)
    assert aside == 0
