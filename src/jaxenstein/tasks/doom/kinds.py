"""Kinds of monsters: health, size, speed, and the frames that they go through.

Numbers are those of the game's own tables (ViZDoom 1.3.2, wadsrc/static/actors/doom).
"""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

NOWHERE = 99
"""The rank of a direction that is not free."""
FOREVER = 1 << 30
"""Tics of a frame that stays."""


class Act(enum.IntEnum):
    """What a monster does as a frame begins; those from `BITE` on strike."""

    NOTHING, LOOK, CHASE, BITE, SHOOT, THROW = range(6)


class Pose(enum.IntEnum):
    """What a monster looks like."""

    ONE, TWO, AIM, DEAD = range(4)


@dataclass(frozen=True)
class Frame:
    """A frame.

    Attributes:
        tics: how long it lasts.
        pose: what it shows.
        act: what begins it.
        back: how many frames earlier it goes on while the player can still be struck; -1 for
            nothing of the kind.
    """

    tics: int
    pose: Pose
    act: Act = Act.NOTHING
    back: int = -1


def _standing(tics: int) -> tuple[Frame, ...]:
    return (Frame(tics, Pose.ONE, Act.LOOK),)


def _walking(tics: int) -> tuple[Frame, ...]:
    poses = (Pose.ONE, Pose.ONE, Pose.TWO, Pose.TWO)
    return tuple(Frame(tics, pose, Act.CHASE) for pose in poses)


@dataclass(frozen=True)
class Kind:
    """A kind of monster.

    Attributes:
        name: what it is called.
        game_name: what the game calls it.
        health: of a new one.
        half_width: in map units.
        speed: map units a step.
        stand: frames of one that has not noticed the player.
        walk: of one that has, and after all others.
        melee: of one that strikes a player near by; none if it cannot.
        missile: of one that strikes from afar.
        flinch: tics for which pain stops it.
        pain_chance: of 256, to flinch when hit.
        dice: damage is this times a die.
        sides: of that die.
        rays: bullets of a shot.
        spread: bits by which the sum of two bytes is shifted to be the error of their angle.
        reach: how far they go, in map units.
        ball_speed: of what it throws, map units a tic.
        ball_dice: the damage of that is this times a die.
        ball_sides: of that die.
    """

    name: str
    game_name: str
    health: int
    half_width: int
    speed: int
    stand: tuple[Frame, ...]
    walk: tuple[Frame, ...]
    melee: tuple[Frame, ...] = ()
    missile: tuple[Frame, ...] = ()
    flinch: int = 4
    pain_chance: int = 0
    dice: int = 0
    sides: int = 1
    rays: int = 0
    spread: int = 0
    reach: float = 2048
    ball_speed: int = 10
    ball_dice: int = 3
    ball_sides: int = 8
    die: tuple[Frame, ...] = field(default=(Frame(FOREVER, Pose.DEAD),))


DEMON = Kind(
    "demon",
    "Demon",
    health=150,
    half_width=30,
    speed=10,
    stand=_standing(10),
    walk=_walking(2),
    melee=(Frame(8, Pose.AIM), Frame(8, Pose.AIM), Frame(8, Pose.AIM, Act.BITE)),
    pain_chance=180,
    dice=4,
    sides=10,
)
_THROWING = (Frame(8, Pose.AIM), Frame(8, Pose.AIM), Frame(6, Pose.TWO, Act.THROW))
IMP = Kind(
    "imp",
    "DoomImp",
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
CHAINSAW_MARINE = Kind(
    "chainsaw marine",
    "MarineChainsawVzd",
    health=100,
    half_width=16,
    speed=8,
    stand=_standing(8),
    walk=_walking(4),
    melee=(Frame(4, Pose.AIM), Frame(4, Pose.AIM, Act.SHOOT, back=0)),
    pain_chance=160,
    dice=2,
    sides=10,
    rays=1,
    spread=18,
    reach=65,
)


CACODEMON = Kind(
    "cacodemon",
    "Cacodemon",
    health=400,
    half_width=31,
    speed=8,
    stand=_standing(10),
    walk=(Frame(3, Pose.ONE, Act.CHASE),),
    flinch=12,
    pain_chance=128,
)
_BRUISING = (Frame(8, Pose.AIM), Frame(8, Pose.AIM), Frame(8, Pose.TWO, Act.THROW))
HELL_KNIGHT = Kind(
    "hell knight",
    "HellKnight",
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
ZOMBIE = Kind(
    "zombie",
    "Zombieman",
    health=20,
    half_width=20,
    speed=8,
    stand=_standing(10),
    walk=_walking(4),
    missile=(Frame(10, Pose.AIM), Frame(8, Pose.AIM, Act.SHOOT), Frame(8, Pose.AIM)),
    flinch=6,
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
    health=30,
    walk=_walking(3),
    missile=(Frame(10, Pose.AIM), Frame(10, Pose.AIM, Act.SHOOT), Frame(10, Pose.AIM)),
    pain_chance=170,
    rays=3,
)
CHAINGUN_GUY = replace(
    ZOMBIE,
    name="chaingun guy",
    game_name="ChaingunGuy",
    health=70,
    walk=_walking(3),
    missile=(
        Frame(10, Pose.AIM),
        Frame(4, Pose.AIM, Act.SHOOT),
        Frame(4, Pose.AIM, Act.SHOOT),
        Frame(1, Pose.AIM, back=2),
    ),
    pain_chance=170,
)


def standing(kind: Kind) -> Kind:
    """A kind that never leaves its place."""
    return replace(kind, speed=0)


class Roster:
    """Which kind each of N monsters is, and the tables of their frames; constants of a program.

    Attributes:
        kinds: the kinds, without repetition.
        cast: int32[N], the number of each monster's kind.
        fast: whether they react at once and strike without pausing, as in the game's skill 5.
        feuds: whether those hurt by another monster turn on it.
        tics, following, back, acts, poses: int32[F], of each frame.
        stand, walk, melee, missile, pain, die: int32[N], the first such frame of each, or -1.
        half_widths, speeds, health, pain_chance, dice, sides, rays, spread, ball_speed, ball_dice,
            ball_sides: int32[N].
        reach: float32[N].
    """

    def __init__(self, cast: Sequence[Kind], *, fast: bool = False, feuds: bool = False) -> None:
        """Lay out the tables.

        Args:
            cast: the kind of each monster.
            fast: see the class.
            feuds: likewise.
        """
        self.feuds = feuds
        self.kinds = tuple(dict.fromkeys(cast))
        self.fast = np.bool_(fast)
        self.cast = np.array([self.kinds.index(kind) for kind in cast], np.int32)
        self._rows: list[tuple[int, int, int, int, int]] = []
        starts = np.array([self._lay_out(kind) for kind in self.kinds], np.int32)
        tables = np.array(self._rows, np.int32).T
        self.tics, self.following, self.back, self.acts, self.poses = tables
        self.stand, self.walk, self.melee, self.missile, self.pain, self.die = starts[self.cast].T
        self.half_widths = self._numbers("half_width")
        self.speeds = self._numbers("speed")
        self.health, self.pain_chance = self._numbers("health"), self._numbers("pain_chance")
        self.dice, self.sides = self._numbers("dice"), self._numbers("sides")
        self.rays, self.spread = self._numbers("rays"), self._numbers("spread")
        self.reach = self._numbers("reach").astype(np.float32)
        self.ball_speed, self.ball_dice = self._numbers("ball_speed"), self._numbers("ball_dice")
        self.ball_sides = self._numbers("ball_sides")

    def __len__(self) -> int:
        """How many monsters there are."""
        return len(self.cast)

    def _numbers(self, name: str) -> np.ndarray:
        return np.array([getattr(self.kinds[i], name) for i in self.cast], np.int32)

    def _lay_out(self, kind: Kind) -> tuple[int, ...]:
        """Add a kind's frames; the first of each sequence."""
        walk = len(self._rows)
        walks = self._add(kind.walk, walk)
        stand = self._add(kind.stand, len(self._rows))
        melee = self._add(kind.melee, walk)
        missile = self._add(kind.missile, walk)
        pain = self._add((Frame(kind.flinch, Pose.AIM),), walk)
        die = self._add(kind.die, len(self._rows) + len(kind.die) - 1)
        return stand, walks, melee, missile, pain, die

    def _add(self, frames: Sequence[Frame], after: int) -> int:
        """Add frames that lead to row `after`; the first one's row, or -1."""
        first = len(self._rows)
        for i, frame in enumerate(frames):
            row = first + i
            following = row + 1 if i + 1 < len(frames) else after
            back = row - frame.back if frame.back >= 0 else -1
            self._rows.append((frame.tics, following, back, frame.act, frame.pose))
        return first if frames else -1
