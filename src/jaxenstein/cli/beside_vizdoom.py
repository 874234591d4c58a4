"""Film one episode of a trained agent here and one in ViZDoom, from the same start."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import jax
import numpy as np

from ..adapters.vizdoom import GameSession
from ..adapters.vizdoom_buffers import picked_image
from ..episodes.policies import Policy
from ..episodes.recorder import play
from ..episodes.session import Session
from ..params import drawn
from ..view.episode import Episode, Pictures

# Both pictures have the size of the game's smallest screen.
HEIGHT, WIDTH, SCALE, MAP = 120, 160, 2, 240


class Both(Sequence[np.ndarray]):
    """The pictures of two episodes side by side; the shorter one repeats its last picture."""

    def __init__(self, left: Pictures | np.ndarray, right: Pictures | np.ndarray) -> None:
        """Take the pictures of both episodes, each uint8[h, w, 3]."""
        self._parts = left, right

    def __len__(self) -> int:
        """The number of pictures."""
        return max(map(len, self._parts))

    def __getitem__(self, index: int) -> np.ndarray:  # type: ignore[override]
        """One picture."""
        return np.concatenate([part[min(index, len(part) - 1)] for part in self._parts], axis=1)

    def __iter__(self) -> Iterator[np.ndarray]:
        """All pictures in order."""
        return (self[index] for index in range(len(self)))


def film(policy: Any, seed: int, every: int = 1) -> tuple[Both, str]:
    """Play an episode in ViZDoom, then one here from the same start.

    Args:
        policy: a trained policy; see `baselines.load_policy`.
        seed: seed of both episodes.
        every: show every `every`-th step.

    Returns:
        The pictures, with ours on the left, and both summaries in one line.
    """
    both = play_both(policy, seed)
    pictures = [Pictures(part, scale=SCALE, map_size=MAP, every=every) for part in both]
    return Both(*pictures), "; ".join(part.summary() for part in both)


def play_both(policy: Any, seed: int) -> tuple[Episode, Episode]:
    """An episode here and one in ViZDoom from the same start, with frames of 120x160.

    Args:
        policy: a trained policy, which sees observations of its own size.
        seed: seed of both episodes.
    """
    env, params = policy.env, drawn(policy.params, seed)
    shown = dataclasses.replace(
        env, observation="rgb", height=HEIGHT, width=WIDTH, autoreset=None, final_observation=False
    )
    draw = jax.jit(shown.observe)
    session = Session(env, params, seed)
    with GameSession(env, params, seed) as game:
        session.state = game.state
        session.observation = env.observe(session.state, session.params)
        there = _episode(
            game, policy, lambda played: picked_image(played.screen, (HEIGHT, WIDTH)), "ViZDoom"
        )
    here = _episode(
        session, policy, lambda played: np.asarray(draw(played.state, played.params)), env.name
    )
    return here, there


def _episode(session: Any, policy: Policy, see: Callable[[Any], np.ndarray], name: str) -> Episode:
    """Play to the end; `see` returns the frame of each step."""
    frames = []

    def act(session: Session) -> Any:
        frames.append(see(session))
        return policy(session)

    steps = int(session.env.most_steps(session.params))
    episode = play(session, act, steps)
    frames.append(see(session))
    return dataclasses.replace(episode, frames=np.stack(frames), name=name)
