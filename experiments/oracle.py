r"""`dmlab-static-01` with an oracle's bonus: a reward for each tile that is new in its episode.

    jaxenstein train --env experiments.oracle:dmlab-static-01-oracle --frame-skip 3 --height 16 \
        --width 16 --param goal_reward=1 --recipe tuned --seeds 3 --total-steps 5e6 --out DIR

Whether the goal is found tells what a bonus that knows the map could do: what is not learned with
it is not the bonus' fault.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp

import jaxenstein
from jaxenstein.environment import Info, Scalar
from jaxenstein.tasks.maze import Maze, MazeParams, MazeState


class OracleParams(MazeParams):
    """The numbers of the maze, and the reward of each tile that is new."""

    tile_reward: Scalar = 0.02


class OracleState(MazeState):
    """The state of the maze; seen: bool[rows, columns], the tiles of this episode."""

    seen: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class Oracle(Maze):
    """A maze that pays for new tiles."""

    def init_state(self, key: jax.Array, params: Any) -> OracleState:
        """Begin with no tile seen."""
        state = super().init_state(key, params)
        columns, rows = self.map_size
        return OracleState(**_fields(state), seen=jnp.zeros((rows, columns), bool))

    def transition(
        self, key: jax.Array, state: Any, action: jax.Array, params: Any
    ) -> tuple[Any, jax.Array, jax.Array, Info]:
        """Move, and pay for the tile if it is new."""
        state, reward, reached, events = super().transition(key, state, action, params)
        column, row = jnp.floor(state.position).astype(jnp.int32)
        reward = reward + jnp.where(state.seen[row, column], 0, params.tile_reward)
        return state.replace(seen=state.seen.at[row, column].set(True)), reward, reached, events


def build(id: str = "dmlab-static-01", **settings: Any) -> Oracle:
    """The maze of an id, as an oracle's."""
    env: Any = jaxenstein.make(id, **settings)[0]
    given = _fields(env)
    given["defaults"] = OracleParams(**_fields(env.defaults))
    return Oracle(**given)


def _fields(record: Any) -> dict[str, Any]:
    return {field.name: getattr(record, field.name) for field in dataclasses.fields(record)}


jaxenstein.register("dmlab-static-01-oracle", build, summary="dmlab-static-01 that pays for tiles")
