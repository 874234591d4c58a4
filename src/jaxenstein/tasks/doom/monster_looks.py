"""The game's own pictures of monsters: letters and tics of their frames.

Numbers and letters are those of the game's own tables (ViZDoom 1.3.2, wadsrc/static/actors).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from .game_things import Look
from .monster_kinds import FOREVER, Act, MonsterFrame, MonsterKind, Pose

Letters = tuple[tuple[str, int], ...]
"""Letters of frames, and how many tics each lasts."""


@dataclass(frozen=True)
class MonsterLook:
    """The letters of a monster's frames; small ones are in full light.

    Attributes:
        sprite: the four letters of its pictures' names.
        walk: of the steps.
        attack: of the frames of an attack.
        pain: of flinching.
        die: of its death.
        stand: of standing.
    """

    sprite: str
    walk: str
    attack: str
    pain: Letters
    die: Letters
    stand: str = "AB"


_STEPS = "AABBCCDD"
_SOLDIER = MonsterLook(
    "POSS",
    walk=_STEPS,
    attack="EfE",
    pain=(("G", 3), ("G", 3)),
    die=(("H", 5), ("I", 5), ("J", 5), ("K", 5), ("L", FOREVER)),
)
MONSTER_LOOKS = {
    "Demon": MonsterLook(
        "SARG",
        walk=_STEPS,
        attack="EFG",
        pain=(("H", 2), ("H", 2)),
        die=(("I", 8), ("J", 8), ("K", 4), ("L", 4), ("M", 4), ("N", FOREVER)),
    ),
    "DoomImp": MonsterLook(
        "TROO",
        walk=_STEPS,
        attack="EFG",
        pain=(("H", 2), ("H", 2)),
        die=(("I", 8), ("J", 8), ("K", 6), ("L", 6), ("M", FOREVER)),
    ),
    "HellKnight": MonsterLook(
        "BOS2",
        walk=_STEPS,
        attack="EFG",
        pain=(("H", 2), ("H", 2)),
        die=(*((letter, 8) for letter in "IJKLMN"), ("O", FOREVER)),
    ),
    "MarineChainsawVzd": MonsterLook(
        "PLAY",
        walk="ABCD",
        attack="EE",
        pain=(("G", 4),),
        die=(("H", 10), ("I", 10), ("J", 10), ("K", 10), ("L", 10), ("M", 10), ("N", FOREVER)),
        stand="A",
    ),
    "Cacodemon": MonsterLook(
        "HEAD",
        walk="A",
        attack="BCd",
        pain=(("E", 3), ("E", 3), ("F", 6)),
        die=(("G", 8), ("H", 8), ("I", 8), ("J", 8), ("K", 8), ("L", FOREVER)),
        stand="A",
    ),
    "Zombieman": _SOLDIER,
    "ShotgunGuy": replace(_SOLDIER, sprite="SPOS"),
    "ChaingunGuy": replace(
        _SOLDIER,
        sprite="CPOS",
        attack="EfeF",
        die=(*((letter, 5) for letter in "HIJKLM"), ("N", FOREVER)),
    ),
}
"""The pictures of monsters, by the game's names."""
TARGET = tuple(Look("HEAD", letter, picture=number) for number, letter in enumerate("AG"))
"""The pictures of a cacodemon alive and hit."""


def detailed(kind: MonsterKind) -> MonsterKind:
    """A kind of monster that acts alike, and has a frame for each of the game's pictures."""
    look = MONSTER_LOOKS[kind.game_name]
    stand, step = kind.stand[0], kind.walk[0]
    return replace(
        kind,
        stand=tuple(replace(stand, letter=letter) for letter in look.stand),
        walk=tuple(replace(step, letter=letter) for letter in look.walk),
        melee=_named(kind.melee, look.attack),
        missile=_named(kind.missile, look.attack),
        pain=_timed(look.pain, Pose.AIM),
        die=_timed(look.die, Pose.DEAD),
    )


def look_of(kind: MonsterKind, frame: MonsterFrame, picture: int) -> Look:
    """The game's picture of a frame; `picture` shows the monster in other images."""
    look = MONSTER_LOOKS.get(kind.game_name)
    if look is None:
        return Look("", picture=picture)
    letter = frame.letter
    return Look(look.sprite, letter.upper(), letter.islower(), picture=picture)


def _named(frames: Sequence[MonsterFrame], letters: str) -> tuple[MonsterFrame, ...]:
    """Frames with letters, or none."""
    if not frames:
        return ()
    return tuple(
        replace(frame, letter=letter, faces=frame.act not in (Act.BITE, Act.THROW))
        for frame, letter in zip(frames, letters, strict=True)
    )


def _timed(letters: Letters, pose: Pose) -> tuple[MonsterFrame, ...]:
    return tuple(MonsterFrame(tics, pose, letter=letter) for letter, tics in letters)
