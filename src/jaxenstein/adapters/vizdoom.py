"""Play in ViZDoom itself, with the observations of our `doom-` environments.

An agent trained on `doom-my-way-home` can act in the game. `GameSession` turns the game's buffers
into observations of the same kind, size and units, and passes actions on, so every policy of
`jaxenstein.record` can play there. `play_game` plays many episodes, and `GameEnv` is a Gymnasium
environment for training in the game. Needs the extra `vizdoom`.
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable
from typing import Any, SupportsIndex

import jax
import numpy as np

from ..environment import AnyEnvironment
from ..episodes.policies import Policy
from ..episodes.session import NO_OP, Session, whole_action
from ..errors import SettingError, quoted
from ..fields import check_seed
from ..params import drawn
from ..seeds import key_of
from ..tasks.doom.game_look import screen_of
from ..tasks.doom.scenario import DoomScenario
from ..tasks.doom.view import label_of
from .gymnasium import gymnasium, gymnasium_space, resolve
from .vizdoom_buffers import (
    VARIABLES,
    colour_image,
    depth_image,
    grey,
    label_image,
    load_vizdoom,
    picked_image,
    running,
    screen_for,
)
from .vizdoom_state import told_by, with_pose


def check_scenario(env: AnyEnvironment) -> str:
    """The name of the ViZDoom scenario that matches an environment.

    Raises:
        SettingError: there is no such scenario.
    """
    if not isinstance(env, DoomScenario) or env.scenario is None:
        raise SettingError(
            f"ViZDoom has no scenario for {quoted(env.name)}; it has one for each doom- "
            "environment except the sparse variants of doom-my-way-home"
        )
    return env.scenario


class GameSession(Session):
    """An episode in the game instead of in our environment.

    Rewards, ends and the time limit are the game's. `state` is our state with the pose, health and
    things of the game, for scripted players and maps. The last observation of an episode is the
    one before its end, because the game shows none after it. Call `close`, or use `with`.

    Observations come from the game's buffers. Depths are in tiles; they come from 8 bits, in steps
    of 7.1 map units. `labels` distinguishes floor, ceiling, walls and things. In maps with several
    textures, wall labels are looked up on the map, because no buffer has them. With
    `look="game"` or `"random"`, colours are the pixels of the game's screen that these looks
    reproduce. Otherwise they are means of the game's pixels, where ours are means of whole
    textures.
    """

    env: DoomScenario[Any, Any]  # pyright: ignore[reportIncompatibleVariableOverride]

    def __init__(
        self,
        env: AnyEnvironment,
        params: Any = None,
        seed: int = 0,
        prepare: Callable[[Any], object] = lambda game: None,
    ) -> None:
        """Start the game.

        Args:
            env: an environment of the `doom-` family; its buttons, frame skip, image size, kind
                of observation and WAD file also apply in the game.
            params: its params, which may be ranges; only `max_steps_in_episode` matters in the
                game.
            seed: the seed of the first episode.
            prepare: a function that changes more settings of the `vizdoom.DoomGame` before it
                starts.

        Raises:
            SettingError: the game has no such scenario or no screen for the image, the params
                have a batch axis, or the seed is invalid.
        """
        check_seed(seed)
        scenario = check_scenario(env)
        assert isinstance(env, DoomScenario)
        params = env.single_params(drawn(params, seed))
        limit = int(params.max_steps_in_episode)
        self._picks = env.on_screen and env.observation in ("rgb", "gray", "dict")
        size, weapon = screen_for(env.height, env.width), env.show_weapon
        if self._picks:
            rows, columns = screen_of(env.view_height, int(env.width), int(env.samples))
            size, weapon = (columns, rows), env.shows_weapon

        def settings(game: Any) -> None:
            game.set_screen_format(load_vizdoom().ScreenFormat.RGB24)
            game.set_render_weapon(weapon)
            game.set_render_crosshair(False)
            game.set_render_hud(False)
            game.set_depth_buffer_enabled(env.observation == "depth")
            game.set_labels_buffer_enabled(env.observation == "labels")
            game.set_objects_info_enabled(True)
            game.set_episode_timeout(limit)
            if env.wad is not None:
                game.set_doom_game_path(env.wad)
            prepare(game)

        self._stack = contextlib.ExitStack()
        self._game = self._stack.enter_context(
            running(
                scenario,
                seed=seed,
                variables=(*VARIABLES, *env.game_variables),
                size=size,
                prepare=settings,
            )
        )
        self._held = [
            [held >> i & 1 for i in range(len(env.button_names))]
            for held in (*env.action_buttons.tolist(), 0)
        ]
        # Sampled once: parts of the state that the game does not report stay as after our reset.
        key = key_of(0)
        self._first = jax.device_get(env.reset(key, params)[1])
        self._labels = env.game_labels
        textures = sorted({*map(label_of, env.tiles.textures)})
        self._wall = textures[0] if len(textures) == 1 else None
        super().__init__(env, params, seed)

    def __enter__(self) -> GameSession:
        """Return the session."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close the game."""
        self.close()

    def close(self) -> None:
        """Close the game."""
        self._stack.close()

    def reset(self, seed: int) -> Any:
        """Start an episode of the game with `seed`; returns its first observation."""
        self.seed = check_seed(seed)
        self._key = None
        # The game's generator starts similarly for neighbouring seeds.
        self._game.set_seed(int(np.random.SeedSequence(self.seed).generate_state(1)[0]))
        self._game.new_episode()
        self.actions: list[int] = []
        self.rewards: list[float] = []
        self.terminated = self.truncated = False
        self.info = {"success": False}
        self._look()
        return self.observation

    def step(self, action: SupportsIndex) -> Any:
        """Hold an action's buttons for the tics of the frame skip; returns the observation.

        Raises:
            SettingError: the action is not a whole number, or the episode is over.
        """
        if self.over:
            raise SettingError("the episode is over: call reset before step")
        chosen = whole_action(action)
        if not 0 <= chosen < self.env.num_actions:
            chosen = NO_OP
        reward = self._game.make_action(self._held[chosen], self.env.frame_skip)
        self.actions.append(chosen)
        self.rewards.append(float(reward))
        if self._game.is_episode_finished():
            dead = self._game.is_player_dead()
            late = self._game.is_episode_timeout_reached() and not dead
            self.terminated, self.truncated = not late, late
            self.info = {"success": self._succeeded(dead, late)}
        else:
            self._look()
        return self.observation

    def _succeeded(self, dead: bool, late: bool) -> bool:
        """Whether an episode that is over reached its aim."""
        if count := self.env.success_count:
            return self._game.get_game_variable(getattr(load_vizdoom().GameVariable, count)) > 0
        # A player who is still alive has reached the time limit or, before it, the event.
        return not dead and late != bool(self.env.success_event)

    def policy_key(self) -> jax.Array:
        """A random key for choosing the next action."""
        if self._key is None:  # not before: a game inside a compiled program must not call JAX
            self._key = key_of(self.seed)
        return jax.random.fold_in(self._key, len(self.actions))

    @property
    def screen(self) -> np.ndarray:
        """uint8[h, w, 3]: the game's screen from which the last observation was sampled."""
        return self._seen.screen_buffer

    def _look(self) -> None:
        """Read what the game shows now."""
        self._seen = self._game.get_state()
        kind, size = self.env.observation, (self.env.height, self.env.width)
        self._state: Any = None
        self._told: Any = None
        if kind == "depth":
            self.observation = depth_image(self._seen.depth_buffer, size, self.env.unit)
        elif kind == "labels":
            names = {label.value: label.object_name for label in self._seen.labels}
            things = {v: self._labels[name] for v, name in names.items() if name in self._labels}
            if self._wall is None:
                walls = _walls_ahead(self.env, self.state, self.params)
            else:
                walls = np.full(self.env.width, self._wall, np.uint8)
            self.observation = label_image(self._seen.labels_buffer, size, things, walls)
        else:
            view = self.env.view_height, int(self.env.width)
            if self._picks:
                image = picked_image(self.screen, view, int(self.env.samples))
            else:
                image = colour_image(self.screen, view)
            if kind == "gray":
                image = grey(image)
            if self.env.hud:
                strip = self.env.strip(self.state, "gray" if kind == "gray" else "rgb")
                image = np.concatenate([image, np.asarray(strip)])
            self.observation = image
            if kind == "dict":
                variables = jax.device_get(self.env.variables(self.state))
                self.observation = {"image": image, **variables}

    @property
    def told(self) -> Any:
        """Our state for what the game shows, in numpy, without `position` and `heading`.

        `env.at_pose` computes these from the pose.
        """
        if self._told is not None:
            return self._told
        names = (*VARIABLES, *self.env.game_variables)
        values = dict(zip(names, map(float, self._seen.game_variables), strict=True))
        time = len(self.actions) * self.env.frame_skip
        self._told = told_by(self.env, self._first, self._seen.objects, values, time)
        return self._told

    @property
    def state(self) -> Any:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Our state for what the game shows."""
        if self._state is None:
            self._state = with_pose(self.env, self.told)
        return self._state


def _walls_ahead(env: Any, state: Any, params: Any) -> np.ndarray:
    """uint8[width]: wall labels at the horizon, where nothing hides the walls."""
    row = dataclasses.replace(env, height=1, observation="labels")
    return np.asarray(row.observe(state, params))[0]


@dataclasses.dataclass(frozen=True)
class Games:
    """The results of E episodes in the game.

    Attributes:
        returns: float32[E], undiscounted sums of rewards.
        lengths: int32[E], steps of `frame_skip` tics each.
        successes: bool[E], whether the aim of the task was reached.
    """

    returns: np.ndarray
    lengths: np.ndarray
    successes: np.ndarray


def play_game(
    env: AnyEnvironment,
    params: Any,
    policy: Policy,
    *,
    episodes: int = 100,
    seed: int = 0,
    prepare: Callable[[Any], object] = lambda game: None,
    notify: Callable[[int], object] = lambda done: None,
) -> Games:
    """Play whole episodes in the game.

    Args:
        env: see `GameSession`.
        params: its params.
        policy: a policy as in `jaxenstein.record`: a trained policy, or one from
            `episodes.policies.named_policy`.
        episodes: the number of episodes.
        seed: the seed of the first episode; each next episode adds 1.
        prepare: see `GameSession`.
        notify: called with the number of episodes played so far.

    Raises:
        SettingError: the game has no such scenario.
    """
    returns, lengths, successes = [], [], []
    with GameSession(env, params, seed, prepare) as session:
        for number in range(episodes):
            if number:
                session.reset((seed + number) % 2**32)
            while not session.over:
                session.step(policy(session))
            returns.append(session.episode_return)
            lengths.append(len(session.actions))
            successes.append(session.info["success"])
            notify(number + 1)
    return Games(
        np.array(returns, np.float32), np.array(lengths, np.int32), np.array(successes, bool)
    )


class GameEnv(gymnasium.Env[Any, Any]):
    """The game as a Gymnasium environment with our observations, for training in it.

    Unlike ViZDoom's own environments, it has our depths in tiles and our labels, and its infos
    have `success`.

    Attributes:
        session: the current episode.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012

    def __init__(self, env: AnyEnvironment | str, params: Any = None, **settings: Any) -> None:
        """Start the game; env, params and settings are those of `GymnasiumEnv`."""
        env, params = resolve(env, params, settings)
        self.session = GameSession(env, params)
        self.observation_space = gymnasium_space(env, params)
        self.action_space = gymnasium.spaces.Discrete(env.num_actions)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start an episode."""
        seed = None if seed is None else check_seed(seed, 64)
        super().reset(seed=seed, options=options)
        game_seed = int(self.np_random.integers(2**32))
        return self.session.reset(game_seed), dict(self.session.info)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Take a step; at the end, the observation is the one before it."""
        session = self.session
        observation = session.step(action)
        flags = session.terminated, session.truncated
        return observation, session.rewards[-1], *flags, dict(session.info)

    def close(self) -> None:
        """Close the game."""
        self.session.close()
