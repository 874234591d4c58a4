"""Users' own tasks: ids, modules, and all ways to use them."""

from __future__ import annotations

import functools
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import jaxenstein
from examples.custom_task import Fruit
from jaxenstein import SettingError, TrajectoryError, UnknownEnvironmentError, registry
from jaxenstein.cli import main
from jaxenstein.environment import Environment
from jaxenstein.spec import spec_of
from jaxenstein.tasks.first_person import SETTINGS, FirstPerson
from jaxenstein.tasks.health_gathering import HealthGathering

pytestmark = pytest.mark.usefixtures("plain_frames")

SIZE = {"height": 8, "width": 12}
# A module like a user's: a task with its own setting, registered and by its class.
MODULE = '''
"""Tasks of a user."""
import dataclasses
import jaxenstein
from examples.custom_task import Fruit
from jaxenstein.errors import SettingError

@dataclasses.dataclass(frozen=True, kw_only=True)
class Slow(Fruit):
    """A room with a number."""
    number: int = 3
    version: int = 2

def build(*, cue: int = 5, **settings):
    return Slow(number=cue, **settings)

jaxenstein.register("slow", Slow, summary="a slow one", version=4)
jaxenstein.register("slow-by-function", build)
nothing = 3
'''


def make(id: str, **settings: Any) -> Any:
    return jaxenstein.make(id, **settings)


@pytest.fixture(autouse=True)
def _restored_registry(monkeypatch: pytest.MonkeyPatch) -> None:
    """Removes the ids that a test registers."""
    monkeypatch.setattr(registry, "ENTRIES", dict(registry.ENTRIES))


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The name of that module, which no other test has imported."""
    name = f"tasks_of_{tmp_path.name}"
    (tmp_path / f"{name}.py").write_text(MODULE, "utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    yield name
    sys.modules.pop(name, None)


@pytest.fixture
def importable(module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The same module, where Python finds it."""
    monkeypatch.syspath_prepend(tmp_path)
    return module


def test_registered_class_is_built_with_its_settings() -> None:
    jaxenstein.register("acid", HealthGathering, version=3)
    first_line = "Stay alive on a floor that hurts, by walking over medkits"
    env, params = make("acid", hud=True, **SIZE)
    assert (env.name, env.version, env.hud, env.height) == ("acid", 3, True, 8)
    assert int(params.damage) == 8
    assert jaxenstein.environment_ids()[-1] == "acid"
    assert registry.find("acid")[1].summary == first_line
    with pytest.raises(SettingError, match="'hug', did you mean 'hud'"):
        make("acid", hug=True)
    with pytest.raises(SettingError, match=r"params\.replace\(damage="):
        make("acid", damage=3)


def test_registered_function_defines_its_settings() -> None:
    def build(*, cue: int, **settings: Any) -> Fruit:
        return Fruit(final_observation=cue > 3, **settings)

    jaxenstein.register("cue", build)
    assert registry.find("cue")[1].settings == (*SETTINGS, "cue")
    assert make("cue", cue=4, **SIZE)[0].final_observation
    with pytest.raises(SettingError, match="'cue' needs the setting cue"):
        make("cue")
    jaxenstein.register("bound", functools.partial(build, cue=2))
    assert registry.find("bound")[1].settings == SETTINGS
    assert not make("bound")[0].final_observation


@pytest.mark.parametrize("id", ["", "a b", "-a", "a--b", "a/b", "a:b", "task-v0", None, 3])
def test_malformed_ids_are_refused(id: Any) -> None:
    with pytest.raises(SettingError, match="an id is letters, digits"):
        jaxenstein.register(id, Fruit)


def test_taken_ids_are_refused(importable: str) -> None:
    for id in ("simple", "key-corridor-s4r3"):
        with pytest.raises(SettingError, match=f"'{id}' is taken by an environment of the package"):
            jaxenstein.register(id, Fruit)
    make(f"{importable}:slow")
    with pytest.raises(
        SettingError, match=f"'slow' is already registered by the module '{importable}'"
    ):
        jaxenstein.register("slow", Fruit)
    jaxenstein.register("again", Fruit)
    jaxenstein.register("again", HealthGathering)
    assert isinstance(make("again")[0], HealthGathering)


@pytest.mark.parametrize("build", [3, "Fruit", int, FirstPerson, Environment, Fruit(height=8)])
def test_non_factories_are_refused(build: Any) -> None:
    with pytest.raises(SettingError, match="build must be a subclass"):
        jaxenstein.register("mine", build)


def test_function_that_returns_no_environment_is_refused() -> None:
    def build(**settings: Any) -> Any:
        return settings

    jaxenstein.register("mine", build)
    with pytest.raises(SettingError, match="'mine' must build an environment"):
        make("mine")


def test_version_must_be_a_whole_number() -> None:
    for version in (-1, 0.5, True, "1"):
        with pytest.raises(SettingError, match="version must be a whole number"):
            jaxenstein.register("mine", Fruit, version=version)  # pyright: ignore[reportArgumentType]


def test_id_with_a_module_imports_it(importable: str) -> None:
    env, _ = make(f"{importable}:slow", number=7, **SIZE)
    assert (env.name, env.version, env.number) == ("slow", 4, 7)
    assert make("slow", number=7, **SIZE)[0] == env
    other, _ = make(f"{importable}:Slow", number=7, **SIZE)
    assert (other.name, other.version, other.number) == (f"{importable}:Slow", 2, 7)
    assert make(f"{importable}:slow-by-function", cue=9)[0].number == 9


def test_wrong_modules_and_names_are_refused(importable: str, tmp_path: Path) -> None:
    for id, words in (
        ("no_such_module:a", "no module 'no_such_module' to import"),
        (":a", "'' is not the name of a module"),
        ("a b:c", "'a b' is not the name of a module"),
        (
            f"{importable}:slow-by",
            "has no environment and no class named 'slow-by', .*'slow-by-function'",
        ),
        (f"{importable}:nothing", "a concrete subclass of jaxenstein.Environment .*not 3"),
        (
            f"{importable}:build",
            "use jaxenstein.register to give an id to a function",
        ),
        (f"{importable}:jaxenstein", "a concrete subclass of jaxenstein.Environment"),
    ):
        with pytest.raises(UnknownEnvironmentError, match=words):
            make(id)
    (tmp_path / "broken_module.py").write_text("import no_such_library", "utf-8")
    with pytest.raises(ModuleNotFoundError, match="no_such_library"):
        make("broken_module:a")


@pytest.mark.parametrize("name", ["slow", "Slow"])
def test_specs_name_the_module_and_import_nothing(importable: str, name: str) -> None:
    env, params = make(f"{importable}:{name}", number=5, **SIZE)
    spec = spec_of(env, params)
    assert spec.id == f"{importable}:{name}"
    assert spec.settings["number"] == 5
    built, _ = spec.build()
    assert built.name == env.name
    del sys.modules[importable]
    with pytest.raises(UnknownEnvironmentError, match=f"runs no code: import {importable} first"):
        spec.build()


def test_a_function_need_not_take_the_settings_of_every_environment() -> None:
    def plain(hud: bool = False) -> HealthGathering:
        return HealthGathering(hud=hud, height=8, width=8)

    jaxenstein.register("plain", plain)
    env, params = make("plain", hud=True)
    built: Any = spec_of(env, params).build()[0]
    assert (built.hud, built.autoreset, env.autoreset) == (True, None, "same-step")


def test_ids_of_other_packages_do_not_hide_a_class(importable: str) -> None:
    jaxenstein.register("Slow", Fruit)
    assert type(make(f"{importable}:Slow", number=5)[0]).__name__ == "Slow"


def test_map_can_have_the_name_of_an_id() -> None:
    text = "#####\n#S.G#\n#####"
    env, params = jaxenstein.from_ascii(text, name="health-gathering", heading=0, **SIZE)
    episode = jaxenstein.record(env, params, "expert")
    assert episode.ending == "terminated"
    assert episode.trajectory is not None
    assert episode.trajectory.environment.id is None


def test_environment_not_built_by_its_id_cannot_be_saved() -> None:
    jaxenstein.register("mine", Fruit)
    with pytest.raises(TrajectoryError, match="'fruit' cannot be saved"):
        spec_of(Fruit(), Fruit().default_params)


def test_every_command_accepts_a_registered_task(
    module: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    task, view = f"{module}:slow", ["--height", "8", "--width", "8"]
    assert main(["list", task]) == 0
    assert re.search("^slow +7x6 +100 +0.99 +a slow one$", capsys.readouterr().out, re.MULTILINE)
    walk = ["--actions", "forward*4", "--out", "a.gif", "--save", "a.json"]
    assert main(["record", task, *view, *walk]) == 0
    assert json.loads((tmp_path / "a.json").read_text())["environment"]["id"] == task
    assert main(["replay", "a.json"]) == 0
    assert main(["rollout", task, *view, "--envs", "2", "--steps", "3", "--out", "p"]) == 0
    assert sorted(path.name for path in (tmp_path / "p").iterdir()) == ["slow.gif", "slow.png"]
    sys.modules.pop(module)
    registry.ENTRIES.pop("slow")
    capsys.readouterr()
    assert main(["replay", "a.json"]) == 2
    assert f"--import {module}" in capsys.readouterr().err
    assert main(["replay", "a.json", "--import", module]) == 0
    assert main(["replay", "a.json", "--import", "no_such_module"]) == 2
    assert "there is no module 'no_such_module' to import" in capsys.readouterr().err


@pytest.mark.slow
def test_registered_task_is_trained_resumed_and_evaluated(
    module: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    numbers = {"height": 12, "width": 16, "horizon": 10, "total-steps": 192, "num-envs": 4}
    numbers |= {"rollout": 8, "minibatches": 2, "epochs": 2, "features": 8, "hidden": 8, "head": 8}
    flags = [f"--{name}={value}" for name, value in numbers.items()]
    flags += ["--convolutions=4x4x4", "--no-tensorboard", "--out=run", "--set=number=6"]
    assert main(["train", f"--env={module}:slow", *flags]) == 0
    config = json.loads((tmp_path / "run" / "config.json").read_text())
    assert config["environment"]["id"] == f"{module}:slow"
    assert config["environment"]["settings"]["number"] == 6
    sys.modules.pop(module)
    registry.ENTRIES.pop("slow")
    capsys.readouterr()
    again = ["evaluate", "run", "--episodes=4"]
    assert main(again) == 2
    assert f"--import {module}" in capsys.readouterr().err
    assert main([*again, "--import", module]) == 0
    assert main(["train", "--out=run", "--resume", "--no-tensorboard"]) == 0


@pytest.mark.parametrize("order", ["import gymnasium, jaxenstein", "import jaxenstein, gymnasium"])
def test_gymnasium_knows_registered_ids(order: str) -> None:
    pytest.importorskip("gymnasium")
    code = (
        f"{order}\nfrom examples.custom_task import Fruit\n"
        "jaxenstein.register('my-task', Fruit, version=2)\n"
        "env = gymnasium.make('jaxenstein/my-task-v2', height=6, width=8, reach=0.3)\n"
        "print(env.observation_space.shape)\n"
        "jaxenstein.register('my-task', Fruit, version=3)\n"
        "assert 'jaxenstein/my-task-v3' in gymnasium.registry\n"
        "assert 'jaxenstein/my-task-v2' not in gymnasium.registry\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.stdout.strip(), done.returncode) == ("(6, 8, 3)", 0), done.stderr
