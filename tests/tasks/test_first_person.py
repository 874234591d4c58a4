"""What `FirstPerson` gives a task that defines only the required methods."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxenstein import Params, SettingError, State
from jaxenstein.engine.level import compile_level
from jaxenstein.engine.scene import Scene, Sprites
from jaxenstein.maps.ascii import parse_ascii
from jaxenstein.spaces import Box, Dict
from jaxenstein.tasks.appearance import build_theme
from jaxenstein.tasks.first_person import FirstPerson

MAP = parse_ascii("######\n#S.R.#\n#22###", "bare", goal_required=False)
LEVEL = compile_level(MAP.walls, MAP.door_tiles)
THEME = build_theme((), doors=True)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Bare(FirstPerson[State, Params]):
    """Stand and look at a door."""

    name: str = "bare"
    action_names: ClassVar[tuple[str, ...]] = ("stay",)

    @property
    def default_params(self) -> Params:
        return Params(max_steps_in_episode=5)

    def init_state(self, key: jax.Array, params: Params) -> State:
        return State(
            position=jnp.array([1.5, 1.5], jnp.float32),
            heading=jnp.float32(0),
            time=jnp.int32(0),
            episode_return=jnp.float32(0),
            done=jnp.bool_(False),
        )

    def transition(self, key: jax.Array, state: State, action: jax.Array, params: Params) -> Any:
        return state, jnp.float32(0), jnp.bool_(False), {}

    def scene(self, state: State, params: Params) -> Scene:
        nothing = Sprites(
            jnp.zeros((0, 2), jnp.float32), jnp.zeros(0, jnp.int32), jnp.zeros(0, bool)
        )
        return Scene(LEVEL, jnp.ones(1, bool), state.position, state.heading, nothing, THEME)


def test_default_map_matches_the_scene() -> None:
    env = Bare(height=8, width=8)
    _, state = env.reset(jax.random.key(0))
    found = env.tilemap_of(state)
    assert found.name == "bare"
    assert found.tiles == MAP.tiles
    assert found.doors == MAP.doors
    assert env.map_size == (6, 3)


def test_dict_without_variables_has_only_the_image() -> None:
    plain, named = (Bare(height=8, width=8, observation=kind) for kind in ("rgb", "dict"))
    image, state = plain.reset(jax.random.key(0))
    obs, same = named.reset(jax.random.key(0))
    assert list(obs) == ["image"]
    np.testing.assert_array_equal(obs["image"], image)
    space = named.observation_space(named.default_params)
    assert isinstance(space, Dict)
    assert list(space.spaces) == ["image"]
    assert isinstance(space.spaces["image"], Box)
    assert jax.tree.all(jax.tree.map(np.array_equal, state, same))


@pytest.mark.parametrize("name", ["keys", "items", "pop"])
def test_variable_names_must_not_be_dict_methods(name: str) -> None:
    class Named(Bare):
        def variable_spaces(self) -> dict[str, Box]:
            return {name: Box(0.0, 1.0, (1,), np.dtype(np.float32))}

    with pytest.raises(SettingError, match=f"must not be called '{name}'"):
        Named(observation="dict").observation_space()
