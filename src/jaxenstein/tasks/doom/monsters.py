"""The monsters of a scenario: tables and states, their enemies, and damage to them.

One rule updates all monsters of a state at once (`monster_ai`), from the tables of their kinds.
They attack the player or, with infighting, each other. The rules are those of the game (ZDoom's
p_interaction.cpp and p_enemy.cpp): a monster that survives a hit attacks its source, unless it has
turned to another enemy in this way less than a hundred steps ago. The kinds do not matter, except
that fireballs do not hurt the thrower's own kind. When the enemy is dead, the monster attacks the
player again.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ...environment import Info
from ...pytree import PyTreeNode
from .collision import RADIUS
from .fixed import byte
from .game_things import Look, Shown
from .monster_kinds import Act, MonsterFrame, MonsterKind, Pose
from .monster_looks import detailed, look_of
from .parts import Game, GameObject, Part, Sprites

REACTION = 8
"""Steps after waking up in which no monster shoots."""
STUBBORN = 100
"""Steps for which a monster keeps the enemy that it has turned to."""


class Infighting(PyTreeNode):
    """The enemies of N monsters.

    Attributes:
        target: int32[N], the number of another monster; N for the player.
        anger: int32[N], steps for which it keeps that enemy.
    """

    target: jax.Array
    anger: jax.Array


class Monsters(PyTreeNode):
    """N monsters, each of the kind that the horde has at its index.

    Attributes:
        position: int32[N, 2], map units in 16.16.
        facing: uint32[N], the heading, 2**32 per turn; without the game's pictures, only that of
            standing monsters changes.
        present: bool[N], whether it is on the map, dead or alive.
        health: int32[N], at most 0 if it is dead.
        frame: int32[N], a row of the horde's frames.
        tics: int32[N], tics until the next frame.
        direction: int32[N], of its walk, counter-clockwise from east; 8 for none.
        steps_left: int32[N], steps until it chooses another direction.
        reaction: int32[N], steps before it may shoot.
        just_attacked: bool[N], whether it has just shot and now walks first.
        alarmed: bool[N], whether it has heard the player shoot.
        infighting: its enemies; None if that is always the player.
        just_hit: bool[N], whether it has flinched, and shoots at the next opportunity; None if no
            kind both flinches and shoots.
    """

    position: jax.Array
    facing: jax.Array
    present: jax.Array
    health: jax.Array
    frame: jax.Array
    tics: jax.Array
    direction: jax.Array
    steps_left: jax.Array
    reaction: jax.Array
    just_attacked: jax.Array
    alarmed: jax.Array
    infighting: Infighting | None = None
    just_hit: jax.Array | None = None

    @property
    def living(self) -> jax.Array:
        """bool[N]: which of them block the way and can be hurt."""
        return self.present & (self.health > 0)


class Horde(Part):
    """The monsters of a scenario: `state.monsters`, and `state.kills`, the number killed.

    Attributes:
        kinds: the kinds of monsters, without repetition.
        kind_of: int32[N], the index of each monster's kind.
        fast: whether they react at once and attack without pausing, as in the game's skill 5.
        infighting: whether monsters that are hurt by another one attack it.
        pictured: whether they have the game's pictures: a frame for each, and they turn.
        opaque: float32[L, 4], the walls that block sight and bullets.
        walls: float32[L, 4], the walls that block monsters.
        frame_tics, following, back, acts, poses, faces: int32[F], for each frame.
        stand, walk, melee, missile, pain, die: int32[N], the first such frame of each, or -1.
        half_width, speed, health, pain_chance, dice, sides, rays, spread, ball_speed, ball_dice,
            ball_sides: int32[N], as in `MonsterKind`.
        reach: float32[N], as in `MonsterKind`.
    """

    game_variables = ("KILLCOUNT",)

    def __init__(
        self,
        kinds: Sequence[MonsterKind],
        *,
        walls: np.ndarray,
        opaque: np.ndarray | None = None,
        fast: bool = False,
        infighting: bool = False,
        pictured: bool = False,
    ) -> None:
        """Build the tables.

        Args:
            kinds: the kind of each monster.
            walls: as in the class.
            opaque: as in the class; none by default.
            fast: as in the class.
            infighting: as in the class.
            pictured: as in the class.
        """
        kinds = [detailed(kind) for kind in kinds] if pictured else kinds
        self.pictured = pictured
        self.fast, self.infighting = np.bool_(fast), infighting
        self.walls = walls
        self.opaque = np.zeros((0, 4), np.float32) if opaque is None else opaque
        self.kinds = tuple(dict.fromkeys(kinds))
        self.kind_of = np.array([self.kinds.index(kind) for kind in kinds], np.int32)
        self.objects = tuple(GameObject(k.game_name, k.label, k.pictures) for k in self.kinds)
        self._rows: list[tuple[int, int, int, int, int, int, Look]] = []
        starts = np.array([self._lay_out(kind) for kind in self.kinds], np.int32)
        tables = np.array([row[:5] for row in self._rows], np.int32).T
        self.frame_tics, self.following, self.back, self.acts, self.poses = tables
        self.faces = np.array([row[5] for row in self._rows], np.int32)
        self._looks = [row[6] for row in self._rows]
        firsts = starts[self.kind_of].T
        self.stand, self.walk, self.melee, self.missile, self.pain, self.die = firsts
        self.half_width, self.speed = self._numbers("half_width"), self._numbers("speed")
        self.health, self.pain_chance = self._numbers("health"), self._numbers("pain_chance")
        self.dice, self.sides = self._numbers("dice"), self._numbers("sides")
        self.rays, self.spread = self._numbers("rays"), self._numbers("spread")
        self.reach = self._numbers("reach").astype(np.float32)
        self.ball_speed, self.ball_dice = self._numbers("ball_speed"), self._numbers("ball_dice")
        self.ball_sides = self._numbers("ball_sides")

    def __len__(self) -> int:
        """The number of monsters."""
        return len(self.kind_of)

    def _numbers(self, name: str) -> np.ndarray:
        return np.array([getattr(self.kinds[i], name) for i in self.kind_of], np.int32)

    def _lay_out(self, kind: MonsterKind) -> tuple[int, ...]:
        """Add the frames of a kind; returns the first frame of each sequence."""
        walk = len(self._rows)
        walks = self._add(kind, kind.walk, walk)
        stand = self._add(kind, kind.stand, len(self._rows))
        melee = self._add(kind, kind.melee, walk)
        missile = self._add(kind, kind.missile, walk)
        pain = self._add(kind, kind.pain, walk)
        die = self._add(kind, kind.die, len(self._rows) + len(kind.die) - 1)
        return stand, walks, melee, missile, pain, die

    def _add(self, kind: MonsterKind, frames: Sequence[MonsterFrame], after: int) -> int:
        """Add frames that lead to row `after`; returns the row of the first one, or -1."""
        pictures = len(Pose) * self.kinds.index(kind)
        first = len(self._rows)
        for i, frame in enumerate(frames):
            row = first + i
            following = row + 1 if i + 1 < len(frames) else after
            back = row - frame.back if frame.back >= 0 else -1
            look = look_of(kind, frame, pictures + frame.pose)
            row = frame.tics, following, back, frame.act, frame.pose, frame.faces, look
            self._rows.append(row)
        return first if frames else -1

    def place_of(self, kind: MonsterKind) -> int:
        """The index of the first monster of a kind."""
        return int(np.argmax(self.kind_of == self.kinds.index(kind)))

    def at(self, table: np.ndarray, frame: jax.Array) -> jax.Array:
        """int32[N]: the entries of a table of frames."""
        return jnp.asarray(table).at[frame].get(mode="promise_in_bounds")

    def healthy(self, factor: Any) -> jax.Array:
        """int32[N]: the health of new monsters, times a factor, at least 1."""
        health = jnp.asarray(self.health, jnp.float32) * factor
        return jnp.maximum(jnp.round(health), 1).astype(jnp.int32)

    def sprites(self, state: Any) -> Sprites:
        """The monsters, dead or alive."""
        monsters = state.monsters
        pictures = jnp.asarray(self.kind_of) * len(Pose) + self.at(self.poses, monsters.frame)
        return Sprites(monsters.position, pictures, monsters.present)

    @property
    def looks(self) -> tuple[Look, ...]:
        """The game's pictures of all frames, each once."""
        return tuple(dict.fromkeys(self._looks))

    def shown(self, state: Any, tic: jax.Array) -> Shown:
        """The monsters in the game's pictures."""
        del tic
        looks = self.looks
        table = np.array([looks.index(look) for look in self._looks], np.int32)
        monsters = state.monsters
        look = self.at(table, monsters.frame)
        return Shown(monsters.position, look, monsters.present, monsters.facing)

    def describe(self, state: Any) -> Info:
        """The number of monsters killed so far."""
        return {"killed": state.kills}

    def from_game(self, state: Any, game: Game) -> Any:
        """Read the monsters of the game, kind by kind, into the horde's indices."""
        place, present = np.zeros((len(self), 2), np.int32), np.zeros(len(self), bool)
        for number, kind in enumerate(self.kinds):
            slots = np.flatnonzero(self.kind_of == number)
            rows = game.of(kind.game_name)[: len(slots)]
            place[slots[: len(rows)]], present[slots[: len(rows)]] = rows[:, :2], True
        monsters = state.monsters.replace(
            position=place, present=present, health=np.where(present, 1, 0).astype(np.int32)
        )
        return state.replace(monsters=monsters, kills=np.int32(game.variables["KILLCOUNT"]))

    # States.

    def placed(
        self, position: jax.Array, facing: jax.Array, present: jax.Array, health: jax.Array
    ) -> Monsters:
        """Standing monsters that have not looked yet; the arguments are as in `Monsters`."""
        count = len(self)
        none = jnp.zeros(count, jnp.int32)
        shoots_back = (self.missile >= 0) & (self.pain_chance > 0)
        return Monsters(
            position=position,
            facing=facing,
            present=present,
            health=health,
            frame=jnp.asarray(self.stand),
            tics=jnp.asarray(self.frame_tics[self.stand]),
            direction=none,
            steps_left=none,
            reaction=none + (0 if self.fast else REACTION),
            just_attacked=jnp.zeros(count, bool),
            alarmed=jnp.zeros(count, bool),
            infighting=Infighting(jnp.full(count, count, jnp.int32), none)
            if self.infighting
            else None,
            just_hit=jnp.zeros(count, bool) if shoots_back.any() else None,
        )

    def enemies(
        self, monsters: Monsters, player: jax.Array
    ) -> tuple[jax.Array, jax.Array | np.ndarray]:
        """int32[N, 2], the position of each monster's enemy; int32[N], its half-width in map units.

        Args:
            monsters: the monsters.
            player: int32[2], the position of the player.
        """
        count = len(self)
        if monsters.infighting is None:
            return jnp.broadcast_to(player[None], (count, 2)), np.full(count, RADIUS, np.int32)
        places = jnp.concatenate([monsters.position, player[None]])
        widths = jnp.asarray(np.append(self.half_width, np.int32(RADIUS)))
        target = monsters.infighting.target
        return places[target], widths[target]

    def hurt(
        self,
        monsters: Monsters,
        damage: jax.Array,
        bits: jax.Array,
        source: jax.Array | None = None,
    ) -> Monsters:
        """The monsters after damage: some flinch, some die.

        Args:
            monsters: the monsters before.
            damage: int32[N].
            bits: uint32[N], random.
            source: int32[N], the monster that hurt each one; None for the player.
        """
        hit = monsters.living & (damage > 0)
        health = monsters.health - jnp.where(hit, damage, 0)
        dies = hit & (health <= 0)
        flinches = hit & ~dies & (byte(bits, 3) < self.pain_chance)
        wakes = hit & ~dies & (self.at(self.acts, monsters.frame) == Act.WATCH)
        frame = jnp.where(wakes, self.walk, monsters.frame)
        frame = jnp.where(flinches, self.pain, jnp.where(dies, self.die, frame))
        changed = frame != monsters.frame
        tics = jnp.where(flinches | dies, self.at(self.frame_tics, frame), monsters.tics)
        return monsters.replace(
            health=health,
            frame=frame,
            tics=jnp.where(changed & wakes & ~flinches, 1, tics),
            reaction=jnp.where(hit, 0, monsters.reaction),
            infighting=_provoked(monsters.infighting, hit & ~dies, source),
            just_hit=None if monsters.just_hit is None else monsters.just_hit | flinches,
        )


def _provoked(
    before: Infighting | None, hurt: jax.Array, source: jax.Array | None
) -> Infighting | None:
    """The infighting after damage.

    Args:
        before: the infighting before.
        hurt: bool[N], which monsters were hurt and are alive.
        source: int32[N], the monster that hurt each one, N for the player; None for the player.
    """
    if before is None:
        return None
    own = np.arange(before.target.shape[0], dtype=np.int32)
    by = jnp.full(own.shape, len(own), jnp.int32) if source is None else source
    turns = hurt & (by != own) & ((before.anger == 0) | (by == before.target))
    target = jnp.where(turns, by, before.target)
    return Infighting(target, jnp.where(turns, STUBBORN, before.anger))
