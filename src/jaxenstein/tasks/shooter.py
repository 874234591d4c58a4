"""Shooters of one's own: a map in characters with monsters on it, a weapon, a goal.

The rules are those of the `doom-*` environments: Doom's motion, and its monsters, shots and
fireballs, on a map whose tiles are 64 of Doom's map units wide. A step is a tic, of which a second
has 35.
"""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ..about import About, Event
from ..environment import Info
from ..params import Params, Scalar, number
from .doom.arena import DoomArenaParams
from .doom.blasts import MOST
from .doom.creatures import Creatures, placed
from .doom.drawn_arena import KINDS, DrawnArena, DrawnState
from .doom.hunting import HUNT
from .doom.kinds import Kind, standing
from .doom.projectiles import no_projectiles
from .doom.shooter import EVENTS
from .doom.weapons import PISTOL, ROCKET_LAUNCHER, Weapon
from .draws import draw_index
from .health import FULL_HEALTH

__all__ = [
    "KINDS",
    "PISTOL",
    "ROCKET_LAUNCHER",
    "Kind",
    "Shooter",
    "ShooterParams",
    "ShooterState",
    "Weapon",
    "standing",
]

# The first look of a monster is one of so many tics.
_FIRST_LOOKS = 10
# The health and the shots below which a player fetches more.
_HURT, _SHORT = 60, 8


class ShooterParams(DoomArenaParams):
    """The numbers of a shooter.

    Attributes:
        kill_reward: reward of each monster that dies, whoever killed it.
        win_reward: reward of the tic that reaches the aim.
        death_penalty: taken off the reward of the tic in which the player dies.
        living_reward: reward of every tic.
        monster_health: what the health of each kind is multiplied by.
        medkit: health that one gives, up to 100.
        clip: shots that a box of ammunition gives, up to the most there can be.
    """

    max_steps_in_episode: Scalar = 2100
    discount: Scalar = 0.99
    kill_reward: Scalar = 1.0
    win_reward: Scalar = 10.0
    death_penalty: Scalar = 1.0
    living_reward: Scalar = 0.0
    monster_health: Scalar = number(1.0, 0)
    medkit: Scalar = number(25, 0)
    clip: Scalar = number(10, 0)


class ShooterState(DrawnState):
    """State of a shooter: that of its player, its monsters and its map."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Shooter(DrawnArena[ShooterState, ShooterParams]):
    """Reach the goal of a map with monsters; of one without a goal, kill them all.

    A subclass changes what it likes: `weapon`, `ammo`, `monsters`, `button_names`, `won`, `reward`.
    Monsters look anywhere at first, and stay where they are until they see the player before them
    or hear a shot. Medkits and ammunition are taken by walking over them while they are needed.
    Rockets, where the weapon fires them, hurt all around where they burst, the player too.

    Attributes:
        text: the map, as for `from_ascii`, with the symbols of `KINDS`, `+` for medkits and `=`
            for ammunition; without doors, keys and apples.
        heading: degrees of the first heading, 0 eastwards and growing clockwise: None for any, a
            number, or (lowest, highest).

    Raises:
        MapError: with line and column of what is wrong with the map; or it has no monster, or more
            than `MOST_MONSTERS`, or more than `MOST_TILES` columns or rows.
        SettingError: a setting is out of range, or a kind of monster has a name for which there
            are no pictures.
    """

    params_class: ClassVar[type[Params]] = ShooterParams
    weapon: ClassVar[Weapon] = PISTOL
    ammo: ClassVar[int] = 50
    most_ammo: ClassVar[int] = 100
    # What success means, in words that follow "the agent"; "" for what the map says.
    aim: ClassVar[str] = ""

    def init_state(self, key: jax.Array, params: ShooterParams) -> ShooterState:
        """Draw start, heading, and where each monster looks."""
        count = len(self.roster)
        bits = jax.random.bits(key, (2 + 2 * count,), jnp.uint32)
        return ShooterState(
            **self.drawn(bits[:2], self.angles),
            **self.armed(),
            creatures=self._asleep(bits[2:], params),
            kills=jnp.int32(0),
            balls=no_projectiles(self.most_balls),
            left=jnp.ones(len(self.supplies), bool),
            rockets=no_projectiles(MOST if self.weapon.speed else 0),
        )

    def _asleep(self, bits: jax.Array, params: ShooterParams) -> Creatures:
        """The monsters of the map, from random bits uint32[2 N]."""
        count = len(self.roster)
        healthy = jnp.asarray(self.roster.health, jnp.float32) * params.monster_health
        creatures = placed(
            self.roster,
            jnp.asarray(self.posts),
            bits[:count] & np.uint32(7 << 29),
            jnp.ones(count, bool),
            jnp.maximum(jnp.round(healthy), 1).astype(jnp.int32),
        )
        return creatures.replace(tics=1 + draw_index(bits[count:], _FIRST_LOOKS))

    def transition(
        self, key: jax.Array, state: ShooterState, action: jax.Array, params: ShooterParams
    ) -> tuple[ShooterState, jax.Array, jax.Array, Info]:
        """Fight, take what lies there, and look whether the aim is reached."""
        fight_key, ball_key, rocket_key = jax.random.split(key, 3)
        before, hits = state, jnp.zeros(0, bool)
        state, fought = self.fight(fight_key, state, action, params)
        if self.weapon.speed:
            state = self.fly_rockets(rocket_key, state, fought.fires, params)
        if self.most_balls:
            state, hits = self.burn(ball_key, state, fought, params)
        dead = state.health <= 0
        state, took = self._take(state, ~dead, params)
        won = self.won(state) & ~dead
        events = {"shots": fought.fires.astype(jnp.int32), "kills": state.kills - before.kills}
        events |= {"hits": jnp.sum(hits, dtype=jnp.int32), **took, "won": won, "died": dead}
        return state, self.reward(before, state, won, params), dead | won, events

    def won(self, state: ShooterState) -> jax.Array:
        """bool[]: whether the aim is reached, which ends the episode: a goal, or all are dead."""
        if self.tilemap.goals:
            return jnp.any(self.touches(state, self.places(self.tilemap.goals)))
        return ~jnp.any(state.creatures.living)

    def reward(
        self, before: ShooterState, after: ShooterState, won: jax.Array, params: ShooterParams
    ) -> jax.Array:
        """float32[]: of a tic; `won` is bool[], and `after.health` 0 where the player died."""
        kills = (after.kills - before.kills).astype(jnp.float32)
        reward = params.living_reward + params.kill_reward * kills
        reward = reward + jnp.where(won, params.win_reward, 0)
        return reward - jnp.where(after.health <= 0, params.death_penalty, 0)

    def _take(
        self, state: ShooterState, able: jax.Array, params: ShooterParams
    ) -> tuple[ShooterState, dict[str, jax.Array]]:
        """The state after the player, if able to, has taken what it needs; and how much."""
        reach = state.left & self.touches(state, self.supplies) & able
        trigger, most = state.trigger, self._most_ammo
        healing = reach & self.medkits & (state.health < FULL_HEALTH)
        loading = reach & ~self.medkits & (trigger.ammo < most)
        healed, loaded = (jnp.sum(taken, dtype=jnp.int32) for taken in (healing, loading))
        health = jnp.minimum(state.health + healed * params.medkit, FULL_HEALTH)
        ammo = jnp.minimum(trigger.ammo + loaded * params.clip, most)
        state = state.replace(
            health=health,
            trigger=trigger.replace(ammo=ammo),
            left=state.left & ~healing & ~loading,
        )
        return state, {"took_medkit": healed, "took_ammunition": loaded}

    def supply_places(self, state: ShooterState) -> jax.Array:
        """int32[M, 2]: where medkits and ammunition lie, or lay."""
        del state
        return jnp.asarray(self.supplies)

    def wanted(self, state: ShooterState) -> jax.Array:
        """bool[M]: which of them the player `hunt` fetches."""
        return jnp.where(self.medkits, state.health < _HURT, state.trigger.ammo < _SHORT)

    def errand(self, state: ShooterState) -> jax.Array:
        """bool[rows, columns]: the tiles where the player `hunt` goes when it sees no monster."""
        if self.tilemap.goals:
            goals = self.places(self.tilemap.goals)
            return self.tiles_of(goals, np.ones(len(goals), bool))
        return self.tiles_of(state.creatures.position, state.creatures.living)

    def succeeded(
        self,
        state: ShooterState,
        reward: jax.Array,
        terminated: jax.Array,
        events: Info,
        params: ShooterParams,
    ) -> jax.Array:
        """Whether the aim was reached."""
        del state, reward, terminated, params
        return events["won"]

    def about(self) -> About:
        """What the task says of itself."""
        usual = "reached the goal" if self.tilemap.goals else "killed all monsters"
        aim = self.aim or usual
        burnt = {"hits": Event("was hit by a fireball", "was hit by {} fireballs")}
        return About(
            aim=aim,
            ends="where the aim is reached, and where the player dies",
            rewards={
                "kill_reward": "{:+g} for each monster that dies",
                "win_reward": "{:+g} for reaching the aim",
                "death_penalty": "-{:g} at death",
                "living_reward": "{:+g} a tic",
            },
            events={
                **EVENTS,
                **(burnt if self.most_balls else {}),
                "took_medkit": Event("took a medkit", "took {} medkits"),
                "took_ammunition": Event("took ammunition", "took {} boxes of ammunition"),
                "won": Event(aim),
                "died": Event("died"),
            },
            variables={"health": "0 to 100", "ammo": "shots left", "killed": "monsters killed"},
            captions=("health", "ammo", "killed"),
            players={"hunt": HUNT},
            expert="hunt",
        )
