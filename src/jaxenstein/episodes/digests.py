"""Digests of all states and observations of a session, and the trajectory that holds them."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..machine import made_by
from ..spec import Spec, spec_of
from ..trajectory import DIGITS, Checks, Trajectory, digest_spacing
from .session import Session


class Digests:
    """Digests of all states and observations of a session."""

    def __init__(self) -> None:
        """Start without digests."""
        self._states: list[bytes] = []
        self._observations: list[bytes] = []

    def add(self, session: Session) -> None:
        """Add the current state and observation; call it after the reset and after each step."""
        self._states.append(digest(session.state))
        self._observations.append(digest(session.observation))

    def checks(self, session: Session) -> Checks:
        """The checks for a trajectory."""
        every = digest_spacing(len(self._states))
        return Checks(
            rewards=tuple(session.rewards),
            terminated=session.terminated,
            truncated=session.truncated,
            every=every,
            states=_thinned(self._states, every),
            observations=_thinned(self._observations, every),
        )


def digest(tree: Any) -> bytes:
    """SHA-256 of the dtype, shape and bytes of each leaf of a pytree, in order."""
    sha = hashlib.sha256()
    for leaf in jax.device_get(jax.tree.map(_plain, jax.tree.leaves(tree))):
        array = np.asarray(leaf)
        little = array.astype(array.dtype.newbyteorder("<"), copy=False)
        sha.update(f"{array.dtype.name}{array.shape}".encode())
        sha.update(little.tobytes())
    return sha.digest()


def _plain(leaf: Any) -> Any:
    """The numbers of a random key; other arrays unchanged."""
    keys = isinstance(leaf, jax.Array) and jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key)
    return jax.random.key_data(leaf) if keys else leaf


def _thinned(digests: Sequence[bytes], every: int) -> tuple[str, ...]:
    """One digest for every `every` digests."""
    groups = (digests[start : start + every] for start in range(0, len(digests), every))
    return tuple(hashlib.sha256(b"".join(group)).hexdigest()[:DIGITS] for group in groups)


def trajectory_of(session: Session) -> Trajectory:
    """The trajectory of a session; replays its actions to compute the digests.

    Args:
        session: an episode, finished or not.

    Raises:
        TrajectoryError: neither `make` nor `from_ascii` builds its environment.
    """
    spec = spec_of(session.env, session.params)
    again = Session(session.env, session.params, session.seed)
    digests = Digests()
    digests.add(again)
    for action in session.actions:
        again.step(action)
        digests.add(again)
    return make_trajectory(again, digests, spec)


def make_trajectory(session: Session, digests: Digests, spec: Spec) -> Trajectory:
    """The trajectory of a session, from the digests of all its states and observations."""
    return Trajectory(
        environment=spec,
        seed=session.seed,
        actions=tuple(session.actions),
        checks=digests.checks(session),
        made_by=made_by(),
    )
