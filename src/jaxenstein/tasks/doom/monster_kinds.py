"""Kinds of monsters: health, size, speed, pictures, and the frames of their animations.

Numbers are those of the game's own tables (ViZDoom 1.3.2, wadsrc/static/actors/doom). The sizes of
the pictures of demons, imps and marines were measured on screens of 1280 by 960 pixels.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, replace

from ...maps import things
from ...maps.things import RGB
from .view import Picture

FOREVER = 1 << 30
"""The tics of a frame that stays."""


class Act(enum.IntEnum):
    """What a monster does at the start of a frame; values from `BITE` on are attacks."""

    NOTHING, WATCH, CHASE, BITE, SHOOT, THROW = range(6)


class Pose(enum.IntEnum):
    """The picture of a monster."""

    ONE, TWO, AIM, DEAD = range(4)


@dataclass(frozen=True)
class MonsterFrame:
    """A frame of a monster's animation.

    Attributes:
        tics: its duration.
        pose: its picture.
        act: the action at its start.
        back: how many frames to go back while the player can still be attacked; -1 for never.
        letter: of the game's picture, with `look="game"`.
        faces: whether the monster turns to its enemy at the start of the frame; only seen with
            `look="game"`.
    """

    tics: int
    pose: Pose
    act: Act = Act.NOTHING
    back: int = -1
    letter: str = ""
    faces: bool = False


def _standing(tics: int) -> tuple[MonsterFrame, ...]:
    return (MonsterFrame(tics, Pose.ONE, Act.WATCH),)


def _walking(tics: int) -> tuple[MonsterFrame, ...]:
    poses = (Pose.ONE, Pose.ONE, Pose.TWO, Pose.TWO)
    return tuple(MonsterFrame(tics, pose, Act.CHASE) for pose in poses)


def _pictures(
    art: str, side: float, shape: RGB, detail: RGB, lift: float = 0, dead: str = "body"
) -> tuple[Picture, ...]:
    """The pictures of a monster, one per pose (`Pose`)."""
    names = (f"{art}-one", f"{art}-two", f"{art}-aim", dead)
    return tuple(Picture(name, side, shape, detail, lift) for name in names)


@dataclass(frozen=True)
class MonsterKind:
    """A kind of monster.

    Attributes:
        name: its name.
        game_name: the game's name.
        label: its label id.
        pictures: its pictures, one per pose (`Pose`).
        health: initial health.
        half_width: in map units.
        speed: map units per step.
        stand: frames while it has not noticed the player.
        walk: frames after that, and after all others.
        melee: frames of an attack on a player close by; empty if it has none.
        missile: frames of an attack from a distance.
        pain: frames of flinching.
        pain_chance: probability of flinching when hit, in 256ths.
        dice: damage is this times the roll of a die.
        sides: sides of that die.
        rays: bullets per shot.
        spread: bits by which the difference of two bytes is shifted to give the angle error of a
            bullet.
        reach: range of bullets, in map units.
        ball_speed: speed of its fireballs, map units per tic.
        ball_dice: the damage of a fireball is this times the roll of a die.
        ball_sides: sides of that die.
        die: frames of its death.
    """

    name: str
    game_name: str
    label: int
    pictures: tuple[Picture, ...]
    health: int
    half_width: int
    speed: int
    stand: tuple[MonsterFrame, ...]
    walk: tuple[MonsterFrame, ...]
    melee: tuple[MonsterFrame, ...] = ()
    missile: tuple[MonsterFrame, ...] = ()
    pain: tuple[MonsterFrame, ...] = (MonsterFrame(4, Pose.AIM),)
    pain_chance: int = 0
    dice: int = 0
    sides: int = 1
    rays: int = 0
    spread: int = 0
    reach: float = 2048
    ball_speed: int = 10
    ball_dice: int = 3
    ball_sides: int = 8
    die: tuple[MonsterFrame, ...] = (MonsterFrame(FOREVER, Pose.DEAD),)


def standing(kind: MonsterKind) -> MonsterKind:
    """A kind of monster that never moves."""
    return replace(kind, speed=0)


DEMON = MonsterKind(
    "demon",
    "Demon",
    things.DEMON.label,
    _pictures("demon", 60, (161, 68, 68), (236, 206, 190), -3.4, "demon-dead"),
    health=150,
    half_width=30,
    speed=10,
    stand=_standing(10),
    walk=_walking(2),
    melee=(
        MonsterFrame(8, Pose.AIM),
        MonsterFrame(8, Pose.AIM),
        MonsterFrame(8, Pose.AIM, Act.BITE),
    ),
    pain_chance=180,
    dice=4,
    sides=10,
)
_THROWING = (
    MonsterFrame(8, Pose.AIM),
    MonsterFrame(8, Pose.AIM),
    MonsterFrame(6, Pose.TWO, Act.THROW),
)
IMP = MonsterKind(
    "imp",
    "DoomImp",
    things.IMP.label,
    _pictures("imp", 63, (82, 52, 28), (200, 170, 60), -3.4),
    health=60,
    half_width=20,
    speed=8,
    stand=_standing(10),
    walk=_walking(3),
    melee=_THROWING,
    missile=_THROWING,
    pain_chance=200,
    dice=3,
    sides=8,
)
CHAINSAW_MARINE = MonsterKind(
    "chainsaw marine",
    "MarineChainsawVzd",
    things.MARINE.label,
    _pictures("marine", 58, (74, 98, 65), (170, 140, 60), -1.7),
    health=100,
    half_width=16,
    speed=8,
    stand=_standing(8),
    walk=_walking(4),
    melee=(MonsterFrame(4, Pose.AIM), MonsterFrame(4, Pose.AIM, Act.SHOOT, back=0)),
    pain_chance=160,
    dice=2,
    sides=10,
    rays=1,
    spread=18,
    reach=65,
)
_CACODEMON_COLOURS = (66, 38, 42), (150, 120, 60)
CACODEMON = MonsterKind(
    "cacodemon",
    "Cacodemon",
    things.CACODEMON.label,
    (
        *(Picture("cacodemon", 66, *_CACODEMON_COLOURS),) * 3,
        Picture("cacodemon-dead", 66, (66, 38, 42), (70, 70, 160)),
    ),
    health=400,
    half_width=31,
    speed=8,
    stand=_standing(10),
    walk=(MonsterFrame(3, Pose.ONE, Act.CHASE),),
    pain=(MonsterFrame(12, Pose.AIM),),
    pain_chance=128,
)
_BRUISING = (*_THROWING[:2], MonsterFrame(8, Pose.TWO, Act.THROW))
HELL_KNIGHT = MonsterKind(
    "hell knight",
    "HellKnight",
    things.HELL_KNIGHT.label,
    _pictures("imp", 70, (140, 104, 84), (110, 70, 52)),
    health=500,
    half_width=24,
    speed=8,
    stand=_standing(10),
    walk=_walking(3),
    melee=_BRUISING,
    missile=_BRUISING,
    pain_chance=50,
    dice=10,
    sides=8,
    ball_speed=15,
    ball_dice=8,
)
ZOMBIE = MonsterKind(
    "zombie",
    "Zombieman",
    things.ZOMBIE.label,
    _pictures("soldier", 56, (92, 84, 60), (150, 130, 100)),
    health=20,
    half_width=20,
    speed=8,
    stand=_standing(10),
    walk=_walking(4),
    missile=(
        MonsterFrame(10, Pose.AIM),
        MonsterFrame(8, Pose.AIM, Act.SHOOT),
        MonsterFrame(8, Pose.AIM),
    ),
    pain=(MonsterFrame(6, Pose.AIM),),
    pain_chance=200,
    dice=3,
    sides=5,
    rays=1,
    spread=20,
)
SHOTGUN_GUY = replace(
    ZOMBIE,
    name="shotgun guy",
    game_name="ShotgunGuy",
    label=things.SHOTGUN_GUY.label,
    pictures=_pictures("soldier", 56, (60, 56, 52), (150, 50, 40)),
    health=30,
    walk=_walking(3),
    missile=(
        MonsterFrame(10, Pose.AIM),
        MonsterFrame(10, Pose.AIM, Act.SHOOT),
        MonsterFrame(10, Pose.AIM),
    ),
    pain_chance=170,
    rays=3,
)
CHAINGUN_GUY = replace(
    ZOMBIE,
    name="chaingun guy",
    game_name="ChaingunGuy",
    label=things.CHAINGUN_GUY.label,
    pictures=_pictures("soldier", 60, (112, 44, 36), (140, 140, 140)),
    health=70,
    walk=_walking(3),
    missile=(
        MonsterFrame(10, Pose.AIM),
        MonsterFrame(4, Pose.AIM, Act.SHOOT),
        MonsterFrame(4, Pose.AIM, Act.SHOOT),
        MonsterFrame(1, Pose.AIM, back=2),
    ),
    pain_chance=170,
)
