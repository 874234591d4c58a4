"""Files from others are data: they run no code, and nothing is written outside their folder."""

from __future__ import annotations

import ast
import json
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import jaxenstein
from jaxenstein import SettingError
from jaxenstein.episodes.recorder import record
from jaxenstein.episodes.trajectory_file import load_trajectory
from jaxenstein.errors import JAXensteinError
from jaxenstein.files import atomic

SOURCE = Path(jaxenstein.__file__).parent
# Functions that create objects or run code from their input.
MODULES = {"pickle", "cPickle", "dill", "cloudpickle", "joblib", "marshal", "shelve", "code"}
FUNCTIONS = {"eval", "exec", "compile", "__import__"}
METHODS = {("yaml", "load"), ("yaml", "unsafe_load"), ("yaml", "full_load"), ("os", "system")}
KEYWORDS = {"allow_pickle", "shell"}
MAP = "#####\n#S.G#\n#####"


def dangers(tree: ast.AST) -> Iterator[str]:
    """The dangerous calls in a source."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names if name.name.split(".")[0] in MODULES)
        elif isinstance(node, ast.ImportFrom):
            yield from [str(node.module)] * ((node.module or "").split(".")[0] in MODULES)
        elif isinstance(node, ast.Call):
            function = node.func
            if isinstance(function, ast.Name) and function.id in FUNCTIONS:
                yield function.id
            if isinstance(function, ast.Attribute) and isinstance(function.value, ast.Name):
                pair = function.value.id, function.attr
                yield from [".".join(pair)] * (pair in METHODS)
            yield from (str(word.arg) for word in node.keywords if word.arg in KEYWORDS)


def test_no_source_unpickles_or_evaluates() -> None:
    found = {
        str(path.relative_to(SOURCE)): list(dangers(ast.parse(path.read_text(encoding="utf-8"))))
        for path in SOURCE.rglob("*.py")
    }
    assert len(found) > 80
    assert {path: names for path, names in found.items() if names} == {}


@pytest.mark.parametrize(
    "text",
    [
        "import pickle",
        "from dill import loads",
        "eval(x)",
        "yaml.load(f)",
        "np.load(f, allow_pickle=1)",
    ],
)
def test_source_search_finds_forbidden_calls(text: str) -> None:
    assert list(dangers(ast.parse(text)))


class Watch:
    """Records audit events while enabled; audit hooks cannot be removed."""

    def __init__(self) -> None:
        self.on = False
        self.seen: list[str] = []
        sys.addaudithook(self.hear)

    def hear(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self.on:
            return
        if event in ("pickle.find_class", "os.system", "subprocess.Popen", "socket.connect"):
            self.seen.append(event)
        if event == "open" and isinstance(arguments[0], str | bytes | os.PathLike):
            path, mode, flags = os.fsdecode(arguments[0]), arguments[1], arguments[2]
            writes = (mode and set(mode) & set("wax+")) or (flags or 0) & (os.O_WRONLY | os.O_RDWR)
            # Programs compiled in tests are kept for other files.
            if writes and not Path(path).is_relative_to(os.environ["JAX_COMPILATION_CACHE_DIR"]):
                self.seen.append(f"wrote {path}")


@pytest.fixture(scope="module")
def hook() -> Watch:
    return Watch()


@pytest.fixture
def watch(hook: Watch) -> Iterator[Watch]:
    hook.seen, hook.on = [], False
    yield hook
    hook.on = False


def test_watch_detects_writes_and_unpickling(watch: Watch, tmp_path: Path) -> None:
    watch.on = True
    (tmp_path / "x").write_text("")
    # Protocol 0: the class is looked up by its name.
    __import__("pickle").loads(b"cbuiltins\nlen\n.")
    assert watch.seen == [f"wrote {tmp_path / 'x'}", "pickle.find_class"]


@pytest.mark.usefixtures("plain_frames")
def test_reading_a_trajectory_touches_nothing_else(watch: Watch, tmp_path: Path) -> None:
    env, params = jaxenstein.from_ascii(MAP, height=8, width=8, name="../../evil")
    trajectory = record(env, params, [2, 0], seed=1).trajectory
    assert trajectory is not None
    trajectory.save(tmp_path / "walk.json")
    watch.on = True
    assert load_trajectory(tmp_path / "walk.json").environment.settings["name"] == "../../evil"
    assert watch.seen == []


def test_reading_a_checkpoint_touches_nothing_else(watch: Watch, tmp_path: Path) -> None:
    pytest.importorskip("flax")
    from jaxenstein.baselines.runs.checkpoints import Checkpoints

    state = {"a": np.arange(3), "b": np.ones((2, 2), np.float32)}
    Checkpoints(tmp_path / "there").save(1, state)
    watch.on = True
    restored = Checkpoints(tmp_path / "there").restore(state)
    watch.on = False
    assert restored is not None
    np.testing.assert_array_equal(restored.state["b"], state["b"])
    assert watch.seen == []


def test_reading_an_agent_touches_nothing_else(watch: Watch) -> None:
    pytest.importorskip("flax")
    from jaxenstein.baselines.runs.trained import HERE, load_trained

    load_trained(HERE / "key-door.npz")  # what it imports and compiles may be kept
    watch.on = True
    assert load_trained(HERE / "key-door.npz").update > 0
    assert watch.seen == []


def test_writing_replaces_a_link_not_its_target(treasure: Path, tmp_path: Path) -> None:
    link(tmp_path / "map.json", treasure)
    with atomic(tmp_path / "map.json") as part:
        part.write_text("new")
    assert (tmp_path / "map.json").read_text() == "new"
    assert not (tmp_path / "map.json").is_symlink()


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run directory that has not been trained."""
    pytest.importorskip("flax")
    from jaxenstein.baselines.runs.folder import RunFolder
    from tests.baselines.tiny import tiny

    folder = RunFolder.create(tmp_path / "run", tiny())
    (folder.path / "checkpoints").mkdir()
    return folder.path


RUN_PATHS = (
    *(".lock", "metrics.jsonl", "timing.jsonl", "checkpoints", "tensorboard", ".probe"),
    *("checkpoints/7.npz", "checkpoints/.0.npz.x.part", "tensorboard/seed-0"),
)


@pytest.fixture
def treasure(tmp_path: Path) -> Iterator[Path]:
    """A folder and a file that must not be touched."""
    folder = tmp_path / "treasure"
    folder.mkdir()
    (folder / "0").mkdir()
    (folder / "file").write_text("gold")
    yield folder
    assert (folder / "file").read_text() == "gold"
    assert sorted(path.name for path in folder.rglob("*")) == ["0", "file"]


def link(path: Path, treasure: Path) -> None:
    if path.is_dir():
        path.rmdir()
    path.unlink(missing_ok=True)
    path.parent.mkdir(exist_ok=True)
    path.symlink_to(treasure if "." not in path.name else treasure / "file")


@pytest.mark.parametrize("name", RUN_PATHS)
def test_links_out_of_a_run_folder_are_not_followed(
    run: Path, treasure: Path, watch: Watch, name: str
) -> None:
    """Neither for a resumed nor for a new run: the check precedes the first write."""
    from jaxenstein.baselines.runs.folder import RunFolder
    from jaxenstein.baselines.runs.training import train
    from tests.baselines.tiny import tiny

    link(run / name, treasure)
    opened = RunFolder.open(run)
    watch.on = True
    with pytest.raises(SettingError, match="is a link out of"):
        train(opened)
    assert watch.seen == []
    (run / "config.json").unlink()
    with pytest.raises(SettingError, match="is a link out of"):
        RunFolder.create(run, tiny())
    assert watch.seen == []


@pytest.mark.parametrize(
    ("command", "name"),
    [
        ("train", "tensorboard"),
        ("train", ".probe"),
        ("sweep", "ppo"),
        ("sweep", "rnd/tensorboard"),
        ("sweep", "summary.md"),
    ],
)
def test_commands_write_only_inside_their_folder(
    tmp_path: Path, treasure: Path, capsys: pytest.CaptureFixture[str], command: str, name: str
) -> None:
    pytest.importorskip("flax")
    from jaxenstein.cli import main
    from tests.baselines.tiny import OPTIONS

    file = tmp_path / "tiny.toml"
    file.write_text("\n".join(f"{name} = {json.dumps(value)}" for name, value in OPTIONS.items()))
    out = tmp_path / "out"
    out.mkdir()
    link(out / name, treasure)
    before = sorted(out.rglob("*"))
    assert main([command, "--config", str(file), "--out", str(out)]) == 2
    assert "is a link out of" in capsys.readouterr().err
    assert sorted(out.rglob("*")) == before


def test_hard_links_and_pipes_are_refused(run: Path, treasure: Path) -> None:
    from jaxenstein.baselines.runs.folder import RunFolder
    from jaxenstein.baselines.runs.training import train

    (run / "metrics.jsonl").hardlink_to(treasure / "file")
    with pytest.raises(SettingError, match="is a link out of"):
        train(RunFolder.open(run))
    (run / "metrics.jsonl").unlink()
    os.mkfifo(run / "metrics.jsonl")
    with pytest.raises(SettingError, match="is neither a file nor a folder"):
        train(RunFolder.open(run))


def test_links_within_a_run_folder_are_followed(run: Path) -> None:
    from jaxenstein.baselines.runs.folder import RunFolder

    (run / "newest").symlink_to(run / "checkpoints")
    with RunFolder.open(run).locked():
        pass


def change(path: str, value: Any) -> Callable[[dict[str, Any]], None]:
    """Put a value at a dotted path of a configuration."""

    def run(table: dict[str, Any]) -> None:
        *parents, last = path.split(".")
        for name in parents:
            table = table[name]
        table[last] = value

    return run


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("grid", {"../../evil": [1.0]}),
        ("grid", {"gamma": ["../../evil"]}),
        ("grid", {"gamma": [0.9, 7]}),
        ("seeds", ["../../evil"]),
        ("seeds", []),
        ("seeds", [0, 2**32]),
        ("hparams", {"../../evil": 1}),
        ("hparams", {"gamma": "../../evil"}),
        ("environment.id", "../../evil"),
        ("environment.settings", {"text": MAP, "floor": 3}),
        ("environment.settings", {"text": 3}),
        ("environment.params", {"../../evil": 3}),
        ("config.env", "../../evil"),
    ],
)
def test_run_config_is_checked(run: Path, path: str, value: Any) -> None:
    """Names of runs become names of folders, so they are restricted."""
    from jaxenstein.baselines.runs.folder import RunFolder

    file = run / "config.json"
    plain = json.loads(file.read_text())
    change(path, value)(plain)
    file.write_text(json.dumps(plain))
    with pytest.raises(JAXensteinError, match=r"config\.json: "):
        RunFolder.open(run)


def test_yaml_aliases_are_refused(tmp_path: Path) -> None:
    """Ten lines could expand to a billion values."""
    pytest.importorskip("yaml")
    pytest.importorskip("flax")
    from jaxenstein.baselines.runs.options import read_file

    lines = ["settings:", "  a0: &a0 [1, 1]"]
    lines += [f"  a{i + 1}: &a{i + 1} [*a{i}, *a{i}, *a{i}, *a{i}, *a{i}]" for i in range(12)]
    (tmp_path / "c.yaml").write_text("\n".join(lines))
    with pytest.raises(SettingError, match="repeat the value"):
        read_file(tmp_path / "c.yaml")


def test_yaml_creates_no_objects(tmp_path: Path) -> None:
    pytest.importorskip("yaml")
    pytest.importorskip("flax")
    from jaxenstein.baselines.runs.options import read_file

    (tmp_path / "c.yaml").write_text("env: !!python/object/apply:os.system ['touch evil']\n")
    with pytest.raises(SettingError, match="is not YAML"):
        read_file(tmp_path / "c.yaml")
    assert not Path("evil").exists()
