"""Levels of each generated environment can be solved: thousands by search, some by the planner."""

from typing import Any

import jax
import numpy as np
import pytest

import jaxenstein
from jaxenstein.catalogue import ENTRIES
from jaxenstein.players import play, player_of
from jaxenstein.tasks.minigrid.world import GridWorld
from tests.tasks.minigrid.search import check_placement
from tests.tasks.solving import solvable

FAMILIES = (
    "key-corridor",
    "dmlab-explore",
    "memory-maze",
    "minigrid",
    "miniworld",
    "miniworld-objects",
)
# Survival is not guaranteed there: the next medkit may be too far away.
IDS = [
    name
    for name, entry in ENTRIES.items()
    if entry.family in FAMILIES and name != "miniworld-collect-health"
]
LEVELS = 4096
# The number of levels that the planner plays.
PLANNED = 64


def test_every_generated_environment_is_tested() -> None:
    generated = {name for name in ENTRIES if jaxenstein.make(name)[0].about().generated}
    assert generated <= set(IDS)
    assert len(generated) >= 88


@pytest.mark.slow
@pytest.mark.parametrize("name", IDS)
def test_thousands_of_levels_are_solvable(name) -> None:
    env: Any
    env, params = jaxenstein.make(name, height=8, width=8)
    params = env.check_params(params)
    keys = jax.random.split(jax.random.key(5), LEVELS)
    states = jax.device_get(jax.jit(jax.vmap(lambda key: env.init_state(key, params)))(keys))
    good = solvable(env, params, states)
    assert good.shape == (LEVELS,)
    assert good.all(), f"{(~good).sum()} of {LEVELS} cannot be solved"
    if isinstance(env, GridWorld):
        check_placement(env, states)


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n in IDS if n.startswith("minigrid-")])
def test_planner_solves_levels(name) -> None:
    env, params = jaxenstein.make(name, height=8, width=8)
    keys = jax.random.split(jax.random.key(5), PLANNED)
    states = jax.vmap(lambda key: env.init_state(key, params))(keys)
    played = play(env, player_of(env), params, jax.random.key(0), states)
    assert np.asarray(played.successes).all()
