"""ViZDoom's Gymnasium environments, made of `doom-` environments.

`gymnasium.make("jaxenstein/VizdoomMyWayHome-v1", frame_skip=4)` and `gymnasium.make_vec` make them.
Keyword arguments, spaces, rewards and ends are those of `vizdoom.gymnasium_wrapper` 1.3.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import SettingError, quoted
from ..fields import check_whole
from ..registry import ENTRIES, make
from .gymnasium import GymnasiumEnv, Interface, checked_actions, gymnasium, resolve
from .gymnasium_vector import GymnasiumVectorEnv
from .registration import NAMESPACE, VIZDOOM_SCENARIOS
from .vizdoom_buffers import MissingViZDoomError

# Scenarios with buttons that take numbers, and how many.
_DELTAS = {"Deathmatch": 3}
# Scenarios without a time limit in the game.
_ENDLESS = ("DefendLine", "TakeCover")
_NEVER = int(np.iinfo(np.int32).max)
# Settings of the game that have another name here.
_RENAMED = {"render_weapon": "show_weapon", "doom_game_path": "wad"}
# Settings of the game that have only one value here.
_ONLY: dict[str, Any] = {
    "automap_buffer_enabled": False,
    "audio_buffer_enabled": False,
    "depth_buffer_enabled": False,
    "kill_reward": 0,
    "labels_buffer_enabled": False,
    "mode": "PLAYER",
    "notifications_buffer_enabled": False,
    "render_crosshair": False,
    "render_decals": False,
    "render_hud": False,
    "render_particles": False,
    "screen_format": "RGB24",
    "sound_enabled": False,
    "window_visible": False,
}
_INSTEAD = {
    "depth_buffer_enabled": "{} with observation='depth' has depths, in tiles",
    "labels_buffer_enabled": "{} with observation='labels' has labels",
    "kill_reward": "the param of this name in {} replaces the script's reward",
    "screen_format": "gymnasium.wrappers.GrayscaleObservation makes greys",
}


class VizdoomInterface(Interface):
    """The actions, observations and ends of ViZDoom's wrapper."""

    render_fps = 35

    def __init__(
        self,
        screen: tuple[int, int],
        variables: Sequence[str],
        buttons: int,
        *,
        deltas: int = 0,
        most: int = 0,
        multi_binary: bool = True,
        truncates: bool = True,
    ) -> None:
        """Set the spaces.

        Args:
            screen: height and width.
            variables: the entries of the `dict` observation that are the game variables.
            buttons: the number of buttons that are held or not.
            deltas: the number of other buttons, which must stay 0.
            most: how many buttons an action can hold; 0 for a space with an entry for each button.
            multi_binary: whether that is `MultiBinary`, not `MultiDiscrete`.
            truncates: whether the time limit truncates.
        """
        spaces, far = gymnasium.spaces, float(np.finfo(np.float32).max)
        self._variables, self._buttons, self._truncates = variables, buttons, truncates
        # An environment numbers its actions as this space does, if at most one button is held;
        # otherwise by their buttons, the first of which is the highest bit.
        numbers = np.arange(1 << buttons, dtype=np.int32)
        allowed = numbers[np.bitwise_count(numbers) <= most]
        self._numbers = np.arange(len(allowed), dtype=np.int32) if most == 1 else allowed
        self._each = most == 0
        held: gymnasium.Space[Any] = spaces.Discrete(len(allowed))
        if self._each:
            several = (
                spaces.MultiBinary if multi_binary else lambda n: spaces.MultiDiscrete([2] * n)
            )
            held = several(buttons)
        self.action_space, self._deltas = held, deltas
        if deltas:
            turned = spaces.Box(-far, far, (deltas,), np.float32)
            self.action_space = spaces.Dict({"binary": held, "continuous": turned})
        parts: dict[str, gymnasium.Space[Any]] = {
            "screen": spaces.Box(0, 255, (*screen, 3), np.uint8)
        }
        if variables:
            parts["gamevariables"] = spaces.Box(-far, far, (len(variables),), np.float32)
        self.observation_space = spaces.Dict(parts)

    def actions(self, actions: Any, count: int) -> np.ndarray:
        """int32[count]: the environment's numbers of actions."""
        if self._deltas:
            actions = self._without_deltas(actions, count)
        if not self._each:
            return self._numbers[checked_actions(actions, count, len(self._numbers))]
        held = np.asarray(actions)
        wanted = (count, self._buttons)
        if (
            held.shape != wanted
            or held.dtype.kind not in "biu"
            or ((held != 0) & (held != 1)).any()
        ):
            raise gymnasium.error.InvalidAction(
                f"an action must be {self._buttons} numbers, each 0 or 1, not {quoted(actions)}"
            )
        return held.astype(np.int32) @ (1 << np.arange(self._buttons, dtype=np.int32)[::-1])

    def _without_deltas(self, actions: Any, count: int) -> Any:
        if not isinstance(actions, dict) or set(actions) != {"binary", "continuous"}:
            raise gymnasium.error.InvalidAction(
                f"an action must be a dict of 'binary' and 'continuous', not {quoted(actions)}"
            )
        turned = np.asarray(actions["continuous"])
        if turned.shape != (count, self._deltas) or np.any(turned):
            raise gymnasium.error.InvalidAction(
                f"the {self._deltas} numbers of 'continuous' must be 0: buttons that take numbers "
                f"do not exist here; not {quoted(turned.tolist())}"
            )
        return actions["binary"]

    def observation(self, observation: Any, over: np.ndarray | np.bool_) -> dict[str, np.ndarray]:
        """The screen and the game variables, which are zero when the episode is over."""
        parts = {"screen": observation["image"]}
        if self._variables:
            values = [np.asarray(observation[name]) for name in self._variables]
            parts["gamevariables"] = np.concatenate(values, axis=-1)
        return {name: _cleared(part, over) for name, part in parts.items()}

    def frames(self, frames: np.ndarray, over: np.ndarray | np.bool_) -> np.ndarray:
        """The screens, which are black when the episode is over."""
        return _cleared(frames, over)

    def ends(self, terminated: Any, truncated: Any) -> tuple[Any, Any]:
        """The time limit terminates, and also truncates if the caller wants it."""
        return terminated | truncated, truncated & self._truncates


def vizdoom_env(scenario: str, *, render_mode: str | None = None, **settings: Any) -> GymnasiumEnv:
    """One environment; see `vizdoom_vector_env`."""
    env, params, interface = made(None, scenario, **settings)
    return GymnasiumEnv(env, params, render_mode=render_mode, interface=interface)


def vizdoom_vector_env(scenario: str, num_envs: int = 1, **settings: Any) -> GymnasiumVectorEnv:
    """N environments, which one compiled program steps.

    Args:
        scenario: the name in an id, such as `"MyWayHome"`.
        num_envs: N.
        **settings: keyword arguments of ViZDoom's wrapper; settings of its game that exist here;
            settings and params of the environment; arguments of `GymnasiumVectorEnv`, except
            `max_episode_steps`.

    Raises:
        SettingError: a setting does not exist here, or its value is invalid.
        MissingViZDoomError: ViZDoom, which has the pictures, is not installed.
    """
    if settings.pop("max_episode_steps", None) is not None:
        # It would shorten a time limit that terminates, where Gymnasium's truncates.
        raise SettingError("these ids take episode_timeout, in tics, instead of max_episode_steps")
    names = "autoreset_mode", "copy", "render_mode"
    own = {name: settings.pop(name) for name in names if name in settings}
    env, params, interface = made(None, scenario, **settings)
    return GymnasiumVectorEnv(env, params, num_envs, interface=interface, **own)


def made(
    params: Any,
    scenario: str,
    *,
    max_buttons_pressed: int = 0,
    use_multi_binary_action_space: bool = True,
    treat_episode_timeout_as_truncation: bool = True,
    **settings: Any,
) -> tuple[Any, Any, VizdoomInterface]:
    """An environment, its params and its interface; for arguments see `vizdoom_vector_env`."""
    name, variables = VIZDOOM_SCENARIOS[scenario]
    plain: Any = make(name)[0]
    buttons = len(plain.button_names)
    most = _most(max_buttons_pressed, buttons)
    chosen = {
        "height": 240,
        "width": 320,
        "look": "game" if plain.takes_game_look else "plain",
        **({"show_weapon": True} if plain.limits.get("ammo") else {}),
        **({"max_steps_in_episode": _NEVER} if params is None and scenario in _ENDLESS else {}),
        **_translated(settings, name),
        "observation": "dict",
        "buttons": "single" if most == 1 else "all",
    }
    env: Any
    try:
        env, params = resolve(name, params, chosen)
    except MissingViZDoomError as error:
        raise MissingViZDoomError(
            f"{error}, which has the pictures of {scenario}; or read them from a file with "
            "wad='DOOM2.WAD', or choose look='plain', in flat colours"
        ) from error
    interface = VizdoomInterface(
        (env.height, env.width),
        variables,
        buttons,
        deltas=_DELTAS.get(scenario, 0),
        most=most,
        multi_binary=bool(use_multi_binary_action_space),
        truncates=bool(treat_episode_timeout_as_truncation),
    )
    return env, params, interface


def _most(most: Any, buttons: int) -> int:
    """How many buttons can be held, at most as many as there are."""
    most = check_whole("max_buttons_pressed", most, 0)
    if most > buttons:
        warnings.warn(
            f"max_buttons_pressed={most} is more than the {buttons} buttons that there are, and "
            f"counts as {buttons}",
            stacklevel=2,
        )
    return min(most, buttons)


def _translated(settings: dict[str, Any], name: str) -> dict[str, Any]:
    """The settings of the game in the terms of the environment `name`."""
    ours = f"{NAMESPACE}/{name}-v{ENTRIES[name].version}"
    found: dict[str, Any] = {}
    for key, given in settings.items():
        value = getattr(given, "name", given)
        if key in ("observation", "buttons"):
            raise SettingError(f"{key} is that of ViZDoom's wrapper; make {ours} to choose it")
        if key in _ONLY:
            if value != _ONLY[key]:
                hint = f"; {_INSTEAD[key].format(ours)}" if key in _INSTEAD else ""
                raise SettingError(
                    f"{key} can only be {_ONLY[key]!r} here, not {quoted(value)}{hint}"
                )
            continue
        more = {_RENAMED.get(key, key): given}
        if key == "screen_resolution":
            more = dict(zip(("height", "width"), _screen(value), strict=True))
        elif key == "episode_timeout":
            more = {"max_steps_in_episode": _NEVER if value == 0 else value}
        if twice := {*more} & {*found}:
            raise SettingError(f"{key} and another setting both set {min(twice)}; give only one")
        found |= more
    return found


def _screen(name: Any) -> tuple[int, int]:
    """Height and width of a resolution."""
    match = re.fullmatch(r"RES_(\d+)X(\d+)", str(name))
    width, height = map(int, match.groups()) if match else (0, 0)
    if not height or 4 * height != 3 * width:
        raise SettingError(
            f"screen_resolution must have the shape 4 to 3, such as RES_160X120, not {quoted(name)}"
        )
    return height, width


def _cleared(array: np.ndarray, over: np.ndarray | np.bool_) -> np.ndarray:
    """The array [...], as a copy with zeros where bool[...] `over`, if that is anywhere."""
    if np.any(over):
        array = np.array(array)
        array[over] = 0
    return array
