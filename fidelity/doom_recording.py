"""Record episodes of ViZDoom's scenarios tic by tic, as the integers inside the game.

The game reports positions in map units and angles in degrees, precisely enough to recover its
integers. After the last tic of an episode it still reports the values before that tic, so only its
reward is recorded.
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
from jaxenstein.adapters.vizdoom_state import turns_of
from jaxenstein.tasks.doom.fixed import to_fixed

VARIABLES = ("POSITION_X", "POSITION_Y", "ANGLE", "VELOCITY_X", "VELOCITY_Y", "HEALTH")
LONGEST_HOLD = 13
"""Buttons are held for 1 to LONGEST_HOLD tics."""


# Fields that files store as differences between tics.
_SMOOTH = ("position", "velocity", "angle")


@dataclass(frozen=True)
class Recording:
    """One episode of T tics.

    Attributes:
        buttons: uint8[T], the buttons held in each tic; bit i is button i of the scenario.
        position: int32[T, 2], 16.16 map units, before the first tic and after all but the last.
        velocity: int32[T, 2], at the same times.
        angle: uint32[T], at the same times; 2**32 is a full turn.
        health: int16[T], at the same times.
        reward: float32[T], the reward of each tic.
        finished: bool[], whether the last tic ended the episode.
        things: int32[M, 6]: kind (index into the requested names), id in the game, x and y in 16.16
            map units, the first index of the arrays above at which the thing exists, and the first
            index after that at which it does not (T if there is none).
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
    """Play a scenario with random buttons and combinations of buttons.

    Args:
        scenario: name of the scenario, such as `"my_way_home"`.
        episodes: number of episodes.
        seed: seed of the game and the buttons.
        things: names of the kinds of things to record.
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
    return [to_fixed(x), to_fixed(y), turns_of(angle), to_fixed(dx), to_fixed(dy), round(health)]


def _watch(game: Any, kinds: Sequence[str], found: dict[int, list[int]], time: int) -> None:
    """Record the existing things; each counts as gone at the next time until it is seen again."""
    if not kinds:
        return
    for thing in game.get_state().objects:
        if thing.name in kinds:
            place = to_fixed(thing.position_x), to_fixed(thing.position_y)
            new = [kinds.index(thing.name), thing.id, *place, time, time + 1]
            found.setdefault(thing.id, new)[5] = time + 1


def save(path: Path, recordings: Sequence[Recording]) -> None:
    """Write recordings to a file for `load`, as differences, which compress better."""
    arrays = {}
    for number, recording in enumerate(recordings):
        for name, value in dataclasses.asdict(recording).items():
            steps = value.copy()
            if name in _SMOOTH:
                steps[1:] -= value[:-1]
            arrays[f"{number}.{name}"] = steps
    np.savez_compressed(path, **arrays)


def load(path: Path) -> list[Recording]:
    """Read the recordings of a file."""
    with np.load(path) as arrays:
        count = len({name.split(".")[0] for name in arrays})
        return [_unpack({f: arrays[f"{i}.{f}"] for f in _FIELDS}) for i in range(count)]


def _unpack(arrays: dict[str, np.ndarray]) -> Recording:
    sums = {n: np.cumsum(arrays[n], axis=0, dtype=arrays[n].dtype) for n in _SMOOTH}
    return Recording(**(arrays | sums))
