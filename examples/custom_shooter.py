"""A shooter of your own: find the chief of an outpost, shoot him, and get out again.

    python examples/custom_shooter.py [--out outpost.gif]

The map is drawn in characters, its guards, medkits and ammunition among them; the rifle, the chief
and the aim are this file's own. A player that hunts the guards plays beside one who stands still.
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

import jax
import jax.numpy as jnp

import jaxenstein
from jaxenstein.players import play, player_of
from jaxenstein.tasks.shooter import KINDS, Kind, Shooter, ShooterState, Weapon

# S start, G exit; z zombies, i an imp, d a demon, c the chief; + a medkit, = ammunition.
MAP = """
111111111111111111
1S...1.....1....z1
1....1..z..1.....1
1.............i..1
1....1.....1.....1
111.1111111111.111
3.......4........4
3..=....4........4
3...........d....4
3..z....4.....+..4
3.......4........4
33.33333344444.444
2......2.........2
2..G...2......c..2
2......2.........2
222222222222222222
"""
RIFLE = Weapon("rifle", shot=3, again=9, ready=12, dice=5, sides=4, spread=18)
CHIEF = dataclasses.replace(KINDS["c"], health=120)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Outpost(Shooter):
    """Kill the chief, then leave by the exit; the others may live."""

    text: str = MAP
    weapon: ClassVar[Weapon] = RIFLE
    ammo: ClassVar[int] = 30
    most_ammo: ClassVar[int] = 50
    monsters: ClassVar[Mapping[str, Kind]] = {**KINDS, "c": CHIEF}
    aim: ClassVar[str] = "killed the chief and got out"

    def chief_lives(self, state: ShooterState) -> jax.Array:
        """bool[]: whether there is something left to do here."""
        return state.creatures.living[self.cast.index(CHIEF)]

    def won(self, state: ShooterState) -> jax.Array:
        """bool[]: whether the player is at the exit, the chief dead."""
        return super().won(state) & ~self.chief_lives(state)

    def errand(self, state: ShooterState) -> jax.Array:
        """bool[rows, columns]: where the scripted player goes: to the chief, then to the exit."""
        chief = self.cast.index(CHIEF)
        his_tile = self.tiles_of(state.creatures.position[chief : chief + 1], jnp.ones(1, bool))
        return jnp.where(self.chief_lives(state), his_tile, super().errand(state))


def main(argv: Sequence[str] | None = None) -> dict[str, float]:
    """Play 64 episodes by each player; returns the share of those that each wins."""
    parser = argparse.ArgumentParser(description="Play a shooter of your own.")
    parser.add_argument("--episodes", type=int, default=64, help="episodes of each player")
    parser.add_argument("--out", type=Path, help="film of one episode, a .gif")
    options = parser.parse_args(argv)
    env = Outpost(name="outpost", height=80, width=120)
    params = env.check_params()
    states = jax.vmap(lambda key: env.first_state(key, params))(
        jax.random.split(jax.random.key(0), options.episodes)
    )
    shares = {}
    for name in ("hunt", "idle"):
        played = play(env, player_of(env, name), params, jax.random.key(1), states)
        shares[name] = float(jnp.mean(played.successes))
        print(f"{name}: wins {shares[name]:.0%}, mean return {played.returned.mean():+.1f}")
    if options.out:
        episode = jaxenstein.record(env, params, "hunt", seed=1)
        episode.save(options.out, every=3, fps=12)
        print(f"{episode.summary()}; wrote {options.out}")
    return shares


if __name__ == "__main__":
    main()
