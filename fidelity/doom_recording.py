"""Episodes of ViZDoom's own scenarios, recorded tic by tic as the integers that the game holds.

The game reports places as numbers of map units and angles in degrees, both exact enough that the
integers behind them follow. After the tic that ends an episode it still reports those before it,
so that tic is left out but for its reward.
"""

from __future__ import annotations

import dataclasses
import random
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from jaxenstein.adapters.vizdoom_buffers import load_vizdoom, running
from jaxenstein.tasks.doom.fixed import to_fixed

VARIABLES = ("POSITION_X", "POSITION_Y", "ANGLE", "VELOCITY_X", "VELOCITY_Y", "HEALTH")
LONGEST_HOLD = 13
"""Buttons are held for 1 to so many tics."""


# What is kept in files as differences from one tic to the next.
_SMOOTH = ("position", "velocity", "angle")


@dataclass(frozen=True)
class Recording:
    """One episode of T tics.

    Attributes:
        buttons: uint8[T], the buttons held in each tic: bit i for the scenario's button i.
        position: int32[T, 2], before the first tic and after each but the last, 16.16 map units.
        velocity: int32[T, 2], likewise.
        angle: uint32[T], 2**32 a circle.
        health: int16[T].
        reward: float32[T], of each tic.
        finished: bool[], whether the last tic ended the episode.
        things: int32[M, 6]: kind (index into the names asked for), number in the game, x and y in
            16.16 map units, the first entry of the arrays above with which it is there, and the
            first without it (T if there is none).
    """

    buttons: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    angle: np.ndarray
    health: np.ndarray
    reward: np.ndarray
    finished: np.ndarray
    things: np.ndarray


_FIELDS = tuple(field.name for field in dataclasses.fields(Recording))


def record(
    scenario: str,
    episodes: int,
    *,
    seed: int,
    things: Sequence[str] = (),
    unhurt: bool = False,
) -> Iterable[Recording]:
    """Play a scenario with random buttons, single ones and any combination of them.

    Args:
        scenario: its name, such as `"my_way_home"`.
        episodes: how many.
        seed: of the game and the buttons.
        things: names of the kinds of things to write down.
        unhurt: whether the player cannot be hurt, so that no episode ends early.
    """
    draw = random.Random(seed)

    def prepare(game: Any) -> None:
        game.set_objects_info_enabled(bool(things))

    with running(scenario, seed=seed, variables=VARIABLES, prepare=prepare) as game:
        for _ in range(episodes):
            game.new_episode()
            if unhurt:
                game.send_game_command("god")
            yield _episode(game, draw, things)


def _episode(game: Any, draw: random.Random, kinds: Sequence[str]) -> Recording:
    count = game.get_available_buttons_size()
    seen = [_variables(game)]
    buttons, rewards, hold, held = [], [], 0, 0
    found: dict[int, list[int]] = {}
    _watch(game, kinds, found, 0)
    while not game.is_episode_finished():
        if hold == 0:
            hold, held = draw.randint(1, LONGEST_HOLD), pick(draw, count)
        hold -= 1
        rewards.append(game.make_action([held >> i & 1 for i in range(count)]))
        buttons.append(held)
        if not game.is_episode_finished():
            seen.append(_variables(game))
            _watch(game, kinds, found, len(seen) - 1)
    table = np.array(seen, np.int64)
    return Recording(
        buttons=np.array(buttons, np.uint8),
        position=table[:, 0:2].astype(np.int32),
        angle=table[:, 2].astype(np.uint32),
        velocity=table[:, 3:5].astype(np.int32),
        health=table[:, 5].astype(np.int16),
        reward=np.array(rewards, np.float32),
        finished=np.array(game.is_player_dead() or not game.is_episode_timeout_reached()),
        things=np.array(sorted(found.values()), np.int32).reshape(-1, 6),
    )


def pick(draw: random.Random, count: int) -> int:
    """At most one button, or any combination, as bits."""
    if draw.random() < 0.5:
        return draw.choice([0, *(1 << i for i in range(count))])
    return sum((draw.random() < 0.4) << i for i in range(count))


def _variables(game: Any) -> list[int]:
    vizdoom = load_vizdoom()
    x, y, angle, dx, dy, health = (
        float(game.get_game_variable(getattr(vizdoom.GameVariable, name))) for name in VARIABLES
    )
    # The game divides by the greatest angle there is, not by the circle.
    turns = round(angle / 360 * (2**32 - 1)) % 2**32
    return [to_fixed(x), to_fixed(y), turns, to_fixed(dx), to_fixed(dy), round(health)]


def _watch(game: Any, kinds: Sequence[str], found: dict[int, list[int]], time: int) -> None:
    """Note which things are there; each is expected to be gone next time until it is not."""
    if not kinds:
        return
    for thing in game.get_state().objects:
        if thing.name in kinds:
            place = to_fixed(thing.position_x), to_fixed(thing.position_y)
            new = [kinds.index(thing.name), thing.id, *place, time, time + 1]
            found.setdefault(thing.id, new)[5] = time + 1


def save(path: Path, recordings: Sequence[Recording]) -> None:
    """Write recordings to a file for `load`; differences, which pack better than values."""
    arrays = {}
    for number, recording in enumerate(recordings):
        for name, value in dataclasses.asdict(recording).items():
            steps = value.copy()
            if name in _SMOOTH:
                steps[1:] -= value[:-1]
            arrays[f"{number}.{name}"] = steps
    np.savez_compressed(path, **arrays)


def load(path: Path) -> list[Recording]:
    """The recordings of a file."""
    with np.load(path) as arrays:
        count = len({name.split(".")[0] for name in arrays})
        return [_unpack({f: arrays[f"{i}.{f}"] for f in _FIELDS}) for i in range(count)]


def _unpack(arrays: dict[str, np.ndarray]) -> Recording:
    sums = {n: np.cumsum(arrays[n], axis=0, dtype=arrays[n].dtype) for n in _SMOOTH}
    return Recording(**(arrays | sums))
