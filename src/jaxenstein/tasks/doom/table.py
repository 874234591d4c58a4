"""ViZDoom's scenarios with weapons or monsters, without importing them."""

from __future__ import annotations

from typing import NamedTuple


class Scenario(NamedTuple):
    """A scenario: module and class, what it is about, the id that stands for it, its version."""

    module: str
    kind: str
    summary: str
    main: str = ""
    version: int = 0


SHOOTERS: dict[str, Scenario] = {
    "doom-basic": Scenario(
        "basic", "DoomBasic", "Basic itself: step aside until the monster is ahead, and shoot"
    ),
    "doom-simpler-basic": Scenario(
        "basic", "DoomSimplerBasic", "Simpler Basic itself: the monster is nearer", "doom-basic"
    ),
    "doom-defend-the-center": Scenario(
        "defend",
        "DoomDefendTheCenter",
        "Defend the Center itself: turn and shoot what comes from all around",
        version=2,
    ),
    "doom-defend-the-line": Scenario(
        "defend_line",
        "DoomDefendTheLine",
        "Defend the Line itself: turn and shoot what is at the other side of a room",
        "doom-defend-the-center",
        version=2,
    ),
    "doom-take-cover": Scenario(
        "cover",
        "DoomTakeCover",
        "Take Cover itself: dodge the fireballs of ever more imps",
        version=1,
    ),
    "doom-rocket-basic": Scenario(
        "rockets",
        "DoomRocketBasic",
        "Rocket Basic itself: a rocket needs a second to get there",
        "doom-basic",
    ),
    "doom-predict-position": Scenario(
        "predict",
        "DoomPredictPosition",
        "Predict Position itself: one rocket for a monster that walks to and fro",
        "doom-basic",
    ),
    "doom-deadly-corridor": Scenario(
        "corridor",
        "DoomDeadlyCorridor",
        "Deadly Corridor itself: past six marksmen to the armour",
        version=1,
    ),
    "doom-deathmatch": Scenario(
        "deathmatch",
        "DoomDeathmatch",
        "Deathmatch itself, alone: monsters without end, seven weapons, things to take",
        version=2,
    ),
}
