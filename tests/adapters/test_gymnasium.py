"""Gymnasium's own checks of a single environment, and its registration."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest

import jaxenstein
from jaxenstein.adapters.registration import gymnasium_ids, vizdoom_ids

gymnasium = pytest.importorskip("gymnasium")
env_checker = pytest.importorskip("gymnasium.utils.env_checker")
adapter = pytest.importorskip("jaxenstein.adapters.gymnasium")

pytestmark = pytest.mark.usefixtures("plain_frames")
SOURCE = Path(jaxenstein.__file__).parent.parent
SMALL = {"height": 12, "width": 16}
# The goal is reached by going forward.
MAP = "#########\n#SSSSS.G#\n#########"
FORWARD = 2


@pytest.fixture(scope="module")
def made() -> tuple[Any, Any]:
    return jaxenstein.from_ascii(MAP, heading=0.0, **SMALL)


@pytest.fixture
def env(made: Any) -> Any:
    return adapter.GymnasiumEnv(*made, render_mode="rgb_array")


def run_python(code: str) -> str:
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(SOURCE), *sys.path[1:]])}
    done = subprocess.run(
        [sys.executable, "-W", "error::UserWarning", "-c", code],
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


COUNT_IDS = "print(sum(id.startswith('jaxenstein/') for id in gymnasium.registry))"


@pytest.mark.parametrize(
    "imports",
    [
        "import gymnasium, jaxenstein",
        # Asking whether a package is there is not importing it.
        "import jaxenstein, importlib.util; importlib.util.find_spec('gymnasium')\n"
        "import sys; assert 'gymnasium' not in sys.modules\nimport gymnasium\n"
        "assert gymnasium.__spec__.loader is gymnasium.__loader__\n"
        "assert not any('jaxenstein' in type(finder).__module__ for finder in sys.meta_path)",
        "import gymnasium; gymnasium.make('jaxenstein:jaxenstein/simple-v0')",
    ],
)
def test_ids_are_registered_in_either_import_order(imports: str) -> None:
    assert run_python(f"{imports}\n{COUNT_IDS}") == str(len(gymnasium_ids() | vizdoom_ids()))


def test_gymnasium_ids_include_the_version() -> None:
    ids = gymnasium_ids()
    assert {"jaxenstein/my-way-home-v0", "jaxenstein/key-corridor-s4r3-v0"} <= set(ids)
    assert set(ids.values()) == set(jaxenstein.environment_ids())
    for id, name in ids.items():
        spec = gymnasium.spec(id)
        assert (spec.kwargs, spec.namespace) == ({"env": name}, "jaxenstein")
        assert spec.version == jaxenstein.make(name)[0].version
        assert (spec.max_episode_steps, spec.nondeterministic) == (None, False)


# An environment of each task, and each kind of observation; the later ones are slow together.
CHECKED = [
    *(("simple", "rgb"), ("key-door", "dict"), ("health-gathering", "depth")),
    *(("simple", "gray"), ("key-door", "labels"), ("my-way-home", "rgb")),
    *(("health-gathering", "dict"), ("key-corridor-s3r1", "rgb")),
    ("dmlab-random-goal-01-respawn", "rgb"),
]


@pytest.mark.parametrize(
    ("name", "kind"),
    [*CHECKED[:3], *(pytest.param(*case, marks=pytest.mark.slow) for case in CHECKED[3:])],
)
def test_gymnasium_env_checker_passes(name: str, kind: str) -> None:
    """Warnings are errors here, so that there are none."""
    env = gymnasium.make(f"jaxenstein/{name}-v0", observation=kind, **SMALL)
    env_checker.check_env(env.unwrapped, skip_render_check=True)
    rng = np.random.default_rng(0)
    observation, _ = env.reset(seed=1)
    for _ in range(20):
        assert env.observation_space.contains(observation)
        observation, *_ = env.step(int(rng.integers(env.action_space.n)))
    env.close()


@pytest.mark.parametrize("id", list(gymnasium_ids()))
def test_every_id_is_made_with_its_spaces(id: str) -> None:
    """Nothing is compiled here: the environments have their own tests."""
    env = gymnasium.make(id, **SMALL)
    assert env.spec is not None
    assert env.spec.id == id
    assert env.unwrapped.env.name == gymnasium_ids()[id]  # type: ignore[attr-defined]
    assert env.observation_space.contains(env.observation_space.sample())


def test_gymnasium_warnings_are_shown() -> None:
    """Makes sure that the checks above can fail."""
    env = gymnasium.make("jaxenstein/simple-v0", **SMALL)
    env.reset()
    with pytest.warns(UserWarning, match="without a render mode"):
        assert env.render() is None


def test_returned_values_have_gymnasium_types(env: Any) -> None:
    observation, info = env.reset(seed=1)
    assert type(observation) is np.ndarray
    assert (observation.shape, observation.dtype) == ((12, 16, 3), np.uint8)
    assert env.observation_space == gymnasium.spaces.Box(0, 255, (12, 16, 3), np.uint8)
    assert env.action_space == gymnasium.spaces.Discrete(5)
    observation[:] = 0  # the caller's own
    assert env.render().any()
    stepped = env.step(np.int64(FORWARD))
    assert [type(value) for value in stepped[1:4]] == [float, bool, bool]
    told = stepped[4]
    assert type(told["reached_goal"]) is bool
    assert (type(told["heading"]), type(told["cell"])) == (np.float32, np.ndarray)
    assert told.keys() > info.keys()


def test_params_may_be_committed_to_a_device(made: Any) -> None:
    """The adapter's programs run on a device of their own."""
    env, params = made
    limited = jax.device_put(params.replace(max_steps_in_episode=2), jax.devices()[0])
    alone = adapter.GymnasiumEnv(env, limited)
    assert alone.params.max_steps_in_episode.devices() == {jax.devices()[0]}
    for _ in range(2):
        alone.reset(seed=3)
        assert [alone.step(0)[3] for _ in range(2)] == [False, True]
    assert alone._batch.drawn_params.max_steps_in_episode == 2


def test_first_reset_without_seed_uses_gymnasium_generator(made: Any) -> None:
    keys = []
    for _ in range(2):
        env = adapter.GymnasiumEnv(*made)
        env.np_random = np.random.default_rng(2)
        env.reset()
        keys.append(np.asarray(env.unwrapped._batch._kept))
    np.testing.assert_array_equal(*keys)


def test_time_limit_is_set_by_the_environment(made: Any) -> None:
    native, params = made
    env = adapter.GymnasiumEnv(native, params.replace(max_steps_in_episode=3))
    env.reset(seed=1)
    assert [env.step(0)[3] for _ in range(3)] == [False, False, True]
    for limit, wanted in ((2, 2), (50, 3)):
        limited = gymnasium.make(
            "jaxenstein/simple-v0", max_steps_in_episode=3, max_episode_steps=limit, **SMALL
        )
        limited.reset(seed=1)
        ends = [limited.step(0)[3] for _ in range(wanted)]
        assert ends == [False] * (wanted - 1) + [True]


def test_stepping_out_of_order(made: Any) -> None:
    native, params = made
    env = adapter.GymnasiumEnv(native, params.replace(max_steps_in_episode=1))
    with pytest.raises(gymnasium.error.ResetNeeded, match="has not started"):
        env.step(0)
    env.reset()
    assert env.step(0)[3]
    with pytest.raises(gymnasium.error.ResetNeeded, match="is over"):
        env.step(0)
    env.reset()
    env.step(0)


@pytest.mark.parametrize("action", ["1", None, [1], np.array([1])])
def test_non_numeric_actions(env: Any, action: Any) -> None:
    env.reset(seed=1)
    with pytest.raises(gymnasium.error.InvalidAction, match="action must be"):
        env.step(action)


def test_settings_and_params_by_name() -> None:
    env = adapter.GymnasiumEnv("health-gathering", height=9, hud=True, damage=10, heal=3)
    assert (env.env.height, env.env.hud) == (9, True)
    assert (int(env.params.damage), int(env.params.heal)) == (10, 3)


@pytest.mark.parametrize(
    "kind",
    [
        "dict",
        "depth",
        *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("rgb", "gray", "labels")),
    ],
)
def test_render_is_in_colour_for_every_observation_kind(made: Any, kind: str) -> None:
    """The frame of every kind is the observation of the kind rgb."""
    env = adapter.GymnasiumEnv(
        dataclasses.replace(made[0], observation=kind), made[1], render_mode="rgb_array"
    )
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.render()
    coloured = adapter.GymnasiumEnv(*made)
    for one in (env, coloured):
        one.reset(seed=2)
        wanted, *_ = one.step(1)
    frame = env.render()
    np.testing.assert_array_equal(frame, wanted)
    assert frame.flags.writeable


def test_rgb_array_list_collects_frames() -> None:
    env = gymnasium.make("jaxenstein/simple-v0", render_mode="rgb_array_list", **SMALL)
    env.reset(seed=1)
    env.step(0)
    assert [frame.shape for frame in env.render()] == [(12, 16, 3)] * 2


def test_human_mode_shows_frames_in_a_window(made: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setattr(adapter.Interface, "render_fps", 1000)
    with warnings.catch_warnings():
        # pygame uses deprecated Python features.
        warnings.simplefilter("ignore", DeprecationWarning)
        env = adapter.GymnasiumEnv(*made, render_mode="human")
        env.reset(seed=1)
        env.step(0)
        observation, *_ = env.step(0)
        assert env.render() is None
    window = env._screen._window
    box, pixels = window.view, window.pixels()
    shown = pixels[box.top : box.top + box.height, box.left : box.left + box.width]
    factor = box.height // 12
    assert factor == box.width // 16 >= 32
    np.testing.assert_array_equal(shown[::factor, ::factor], observation)
    env.close()
    env.close()


def test_human_mode_without_pygame(made: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    env = adapter.GymnasiumEnv(*made, render_mode="human")
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "pygame", None)
        with pytest.raises(jaxenstein.SettingError, match=r"jaxenstein\[play\]"):
            env.reset()
    env.close()


@pytest.mark.parametrize("seed", [True, -1, 1.5, [1], "1", 2**64])
def test_wrong_seeds(made: Any, seed: Any) -> None:
    env = adapter.GymnasiumEnv(*made)
    with pytest.raises(jaxenstein.SettingError, match=r"a seed must be .* from 0 to 2\*\*64 - 1"):
        env.reset(seed=seed)
