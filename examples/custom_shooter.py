"""Your own shooter: find the chief of an outpost, shoot him, and get out again.

    python examples/custom_shooter.py [--out outpost.gif]

The map is drawn in characters, with guards, medkits and ammunition. This file defines the rifle,
the chief and the aim, and compares a player that hunts the guards with one that stands still.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
from collections.abc import Sequence
from pathlib import Path

import jax
import jax.numpy as jnp

import jaxenstein
from jaxenstein.players import play, player_of
from jaxenstein.tasks.shooter import (
    KINDS,
    Shooter,
    ShooterState,
    Weapon,
    reached_aim,
    tiles_of,
    toward_aim,
)

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


def chief_lives(env: Shooter, state: ShooterState) -> jax.Array:
    """bool[]: whether the chief is alive."""
    return state.monsters.living[env.horde.place_of(CHIEF)]


def won(env: Shooter, state: ShooterState) -> jax.Array:
    """bool[]: whether the player is at the exit and the chief is dead; other guards may live."""
    return reached_aim(env, state) & ~chief_lives(env, state)


def destination(env: Shooter, state: ShooterState) -> jax.Array:
    """bool[rows, columns]: the target of the scripted player: first the chief, then the exit."""
    is_chief = env.horde.kind_of == env.horde.kinds.index(CHIEF)
    to_chief = tiles_of(env, state.monsters.position, is_chief)
    return jnp.where(chief_lives(env, state), to_chief, toward_aim(env, state))


Outpost = functools.partial(
    Shooter,
    text=MAP,
    weapon=RIFLE,
    ammo=30,
    most_ammo=50,
    monsters={"c": CHIEF},
    aim="killed the chief and got out",
    won=won,
    destination=destination,
)


def main(argv: Sequence[str] | None = None) -> dict[str, float]:
    """Play episodes with each player; return the share that each wins."""
    parser = argparse.ArgumentParser(description="Play a shooter of your own.")
    parser.add_argument("--episodes", type=int, default=64, help="episodes of each player")
    parser.add_argument("--out", type=Path, help="write a film of one episode, .gif")
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
