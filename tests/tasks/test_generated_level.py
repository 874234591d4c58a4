"""A task whose map is drawn at each reset and lives in the state, drawn by the same engine."""

import dataclasses
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxenstein.engine.level import Level, compile_level, level_from_walls
from jaxenstein.engine.motion import forward, walk
from jaxenstein.engine.render import render
from jaxenstein.engine.scene import Scene, Sprites
from jaxenstein.environment import Params, State
from jaxenstein.maps.symbols import DEFAULT_WALL
from jaxenstein.maps.things import GOAL
from jaxenstein.tasks.appearance import build_theme
from jaxenstein.tasks.first_person import FirstPerson

SIDE = 9
DEFAULTS = Params(max_steps_in_episode=7)


class ForestState(State):
    """A state with its own map."""

    level: Level
    walls: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class Forest(FirstPerson[ForestState, Params]):
    """Walk between random pillars; the reward is the x travelled."""

    action_names: ClassVar[tuple[str, ...]] = ("forward", "turn")

    @property
    def default_params(self):
        return DEFAULTS

    def init_state(self, key, params):
        del params
        pillars = jax.random.bernoulli(key, 0.3, (SIDE, SIDE)).at[0].set(True).at[-1].set(True)
        pillars = pillars.at[:, 0].set(True).at[:, -1].set(True)
        pillars = pillars.at[SIDE // 2, SIDE // 2].set(False)
        walls = jnp.where(pillars, jnp.uint8(DEFAULT_WALL), jnp.uint8(0))
        return ForestState(
            position=jnp.full(2, SIDE / 2, jnp.float32),
            heading=jax.random.uniform(key, (), jnp.float32, 0, 6.28),
            time=jnp.int32(0),
            episode_return=jnp.float32(0),
            done=jnp.bool_(False),
            level=level_from_walls(walls),
            walls=walls,
        )

    def transition(self, key, state, action, params):
        del key, params
        step = forward(state.heading) * jnp.where(action == 0, jnp.float32(0.3), 0)
        position = walk(state.level, jnp.zeros(0, bool), state.position, step)
        heading = state.heading + jnp.where(action == 1, jnp.float32(0.5), 0)
        reward = position[0] - state.position[0]
        return state.replace(position=position, heading=heading), reward, jnp.bool_(False), {}

    def scene(self, state, params):
        del params
        return look_at(state.level, state.position, state.heading)


def look_at(level, position, heading):
    return Scene(
        level=level,
        closed=jnp.zeros(0, bool),
        position=position,
        heading=heading,
        sprites=Sprites(
            position=jnp.array([[2.5, 2.5]], jnp.float32),
            look=jnp.zeros(1, jnp.int32),
            visible=jnp.ones(1, bool),
        ),
        theme=build_theme((GOAL.label,), doors=False),
    )


@pytest.fixture(scope="module")
def played():
    env = Forest(height=20, width=24)

    def body(state, key):
        action = jax.random.randint(key, (), 0, 2)
        obs, state, *rest = env.step(key, state, action)
        return state, (obs, state, rest)

    def play(key):
        _, state = env.reset(key)
        return jax.lax.scan(body, state, jax.random.split(key, 20))[1]

    keys = jax.random.split(jax.random.key(0), 6)
    return env, jax.tree.map(np.asarray, jax.jit(jax.vmap(play))(keys))


def test_each_episode_has_its_own_map(played):
    _, (_, states, (_, _, truncated, _)) = played
    for lane in range(6):
        maps = states.walls[lane].reshape(20, -1)
        for t in range(1, 20):
            same = (maps[t] == maps[t - 1]).all()
            assert same != truncated[lane, t]
    assert len(np.unique(states.walls.reshape(-1, SIDE * SIDE), axis=0)) > 10


def test_frames_equal_those_of_the_same_map_as_a_constant(played):
    env, (frames, states, _) = played
    for lane, t in [(0, 0), (1, 9), (2, 13), (5, 19)]:
        level = compile_level(states.walls[lane, t], np.zeros((0, 2), np.int32))
        scene = look_at(
            level, jnp.asarray(states.position[lane, t]), jnp.asarray(states.heading[lane, t])
        )
        expected = np.asarray(jax.jit(lambda s=scene: render(s, env.camera))())
        assert (expected != frames[lane, t]).mean() < 0.01
        assert expected.std() > 5


def test_nobody_walks_through_pillars(played):
    _, (_, states, _) = played
    cells = np.floor(states.position).astype(int)
    lanes, times = np.indices(cells.shape[:2])
    assert (states.walls[lanes, times, cells[..., 1], cells[..., 0]] == 0).all()
