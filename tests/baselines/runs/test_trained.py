"""Agents in files: writing, reading, and the pretrained agents."""

from __future__ import annotations

import dataclasses
import io
import json
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest

pytest.importorskip("flax")

import jaxenstein
from jaxenstein import SettingError
from jaxenstein.baselines import export_policy, load_policy
from jaxenstein.baselines.runs import trained as files
from jaxenstein.baselines.runs.agents import evaluate
from jaxenstein.baselines.runs.folder import RunFolder
from jaxenstein.baselines.runs.trained import load_trained, pretrained, read_config
from jaxenstein.cli import main

LARGEST = 300_000


@pytest.fixture(scope="module")
def file(folder: RunFolder) -> Path:
    """The second run of the folder, by the command."""
    path = folder.path.parent / "exported" / "tiny.npz"
    path.parent.mkdir()
    command = ["export", str(folder.path), "--out", str(path), "--run", "1", "--episodes", "12"]
    assert main(command) == 0
    return path


@pytest.fixture
def packaged(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As if the file were one of the package's."""
    monkeypatch.setattr(files, "HERE", file.parent)


def test_file_holds_one_rounded_run_with_its_score(folder: RunFolder, file: Path) -> None:
    restored = folder.restore()
    assert restored is not None
    ours = jax.tree.leaves(jax.tree.map(lambda leaf: leaf[1], restored.state.params))
    trained = load_trained(file)
    for one, other in zip(ours, jax.tree.leaves(trained.params), strict=True):
        np.testing.assert_array_equal(np.asarray(one).astype(np.float16)[None], other)
        assert other.dtype == np.float32
    experiment = trained.experiment
    assert experiment.runs == ({"seed": 1},)
    assert (experiment.config, experiment.environment) == (
        folder.experiment.config, folder.experiment.environment
    )  # fmt: skip
    score = read_config(file)["agent"]["score"]
    for greedy, name in ((True, "greedy"), (False, "sampled")):
        result = evaluate(trained, episodes=12, greedy=greedy)
        assert score[name]["return"]["mean"] == pytest.approx(result.returns.mean())
        assert score[name]["episodes"] == 12
    exact = file.with_name("exact.npz")
    export_policy(folder.path, exact, 1, weights="float32", episodes=12)
    for one, other in zip(ours, jax.tree.leaves(load_trained(exact).params), strict=True):
        np.testing.assert_array_equal(np.asarray(one)[None], other)
    exact.unlink()


def test_grid_point_becomes_hparams_of_the_run(folder: RunFolder) -> None:
    grid = (("clip", (0.1, 0.3)), ("entropy", (0.0, 0.5)))
    experiment = dataclasses.replace(folder.experiment, grid=grid)
    assert experiment.runs[3] == {"clip": 0.1, "entropy": 0.5, "seed": 1}
    trained = files.Trained("x", experiment, {"a": np.arange(8)}, 0)
    one = trained.one(3)
    assert (one.experiment.hparams["clip"], one.experiment.hparams["entropy"]) == (0.1, 0.5)
    assert (one.experiment.grid, one.experiment.seeds) == ((), (1,))
    assert one.params["a"].tolist() == [3]


@pytest.mark.usefixtures("packaged")
def test_pretrained_agents_are_found_by_name(
    folder: RunFolder, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert load_policy("pretrained/tiny", greedy=True).name == "tiny seed-1"
    with pytest.raises(SettingError, match="tiny has runs 0 to 0, not 1"):
        load_policy("pretrained/tiny", 1)
    with pytest.raises(SettingError, match="no pretrained agent 'tinny', did you mean 'tiny'"):
        load_policy("pretrained/tinny")
    assert main(["record", "--policy", "pretrained/tiny", "--out", "tiny.gif"]) == 0
    assert "tiny seed-1: " in capsys.readouterr().out
    assert main(["evaluate", "pretrained/tiny", "--episodes", "12"]) == 0
    shown = capsys.readouterr().out
    assert "pretrained/tiny: update 0 of 6, 1 run, 12 episodes each" in shown
    assert main(["play", "--policy", "pretrained/tinny"]) == 2
    assert "did you mean 'tiny'" in capsys.readouterr().err
    assert main(["list", "--pretrained"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split()[:6] == ["tiny", "a", "map", "1", "ppo", "0"]
    counted = "the return of tiny is with max_steps_in_episode=10, as in training"
    assert counted in lines
    # A run directory of that path is meant where there is one.
    (tmp_path / "pretrained").mkdir()
    (tmp_path / "pretrained" / "tiny").symlink_to(folder.path)
    assert load_policy("pretrained/tiny", 0).name == "tiny seed-0"


def changed(file: Path, change: Callable[[dict[str, bytes]], object]) -> Path:
    """A copy of the file with other entries."""
    with zipfile.ZipFile(file) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    change(entries)
    path = file.with_name("changed.npz")
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in entries.items():
            archive.writestr(name, data)
    return path


def edited(**changes: Any) -> Callable[[dict[str, bytes]], None]:
    def edit(entries: dict[str, bytes]) -> None:
        plain = json.loads(entries["config.json"])
        plain |= {name: value for name, value in changes.items() if name in plain}
        plain["agent"] |= {name: value for name, value in changes.items() if name not in plain}
        entries["config.json"] = json.dumps(plain).encode()

    return edit


def spoilt(entries: dict[str, bytes]) -> None:
    """A number of an array becomes NaN."""
    name = next(name for name in entries if name.endswith("bias'].npy"))
    array = np.load(io.BytesIO(entries[name]))
    array.flat[0] = np.nan
    file = io.BytesIO()
    np.save(file, array)
    entries[name] = file.getvalue()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda entries: entries.pop("config.json"), "no item named 'config.json'"),
        (lambda entries: entries.update({"config.json": b"{"}), "not an agent from"),
        (lambda entries: entries.update({"config.json": b"{}"}), "does not describe an agent"),
        (lambda entries: entries.popitem(), "is missing"),
        (lambda entries: entries.update({"more.npy": b""}), "more is unexpected"),
        (edited(weights="float32"), "is float16.*, not float32"),
        (edited(weights="int8"), "weights must be float16 or float32, not 'int8'"),
        (edited(seeds=[0, 1]), "must have one run, not 2"),
        (edited(format=7), "format 7, not 1"),
        (edited(config={"algo": "rdn"}), "did you mean 'rnd'"),
        (edited(hparams={"learning_rate": True}), "learning_rate must be a finite number"),
        (edited(hparams={"clip": [0.1, 0.2]}), "clip must be a number or an array of them"),
        (edited(hparams={"value": 1e308}), "value must be .*, which is inf in float32"),
        (edited(update=True), "agent.update must be a whole number >= 0, not True"),
        (edited(update=-1), "agent.update must be a whole number >= 0, not -1"),
        (spoilt, "its parameters are not finite"),
    ],
)
def test_error_says_why_path_is_no_agent(file: Path, change: Any, message: str) -> None:
    path = changed(file, change)
    with pytest.raises(SettingError, match=message) as told:
        load_policy(path)
    assert str(path) in str(told.value)


@pytest.mark.parametrize("spoilt", ["config.json", "bias'].npy"])
def test_zip_bomb_is_refused(file: Path, tmp_path: Path, spoilt: str) -> None:
    """An entry that Python would unpack as a whole, even to read a few bytes."""
    path = tmp_path / "swollen.npz"
    with zipfile.ZipFile(file) as archive, zipfile.ZipFile(path, "w") as other:
        for name in archive.namelist():
            method = zipfile.ZIP_BZIP2 if name.endswith(spoilt) else zipfile.ZIP_DEFLATED
            other.writestr(name, archive.read(name), method)
    with pytest.raises(SettingError, match=f"{spoilt[-9:-1]}.*must be stored or deflated"):
        load_policy(path)


def test_damaged_and_missing_files_are_refused(
    folder: RunFolder, file: Path, tmp_path: Path
) -> None:
    cut = tmp_path / "cut.npz"
    cut.write_bytes(file.read_bytes()[:-200])
    with pytest.raises(SettingError, match=r"cut\.npz is not an agent from 'jaxenstein export'"):
        load_policy(cut)
    with pytest.raises(SettingError, match=r"there is no file .*none\.npz"):
        load_policy(tmp_path / "none.npz")
    with pytest.raises(SettingError, match=r"agent\.zip should end in \.npz"):
        export_policy(folder.path, tmp_path / "agent.zip")
    with pytest.raises(SettingError, match=r"a\.npz would overwrite .*a\.npz"):
        export_policy(tmp_path / "a.npz", tmp_path / "a.npz")
    wrong: Any
    for wrong, told in (
        ({"weights": "float64"}, "weights must be one of 'float16', 'float32', not 'float64'"),
        ({"episodes": 0}, "episodes must be a whole number >= 1, not 0"),
        ({"seed": -1}, "a seed must be a whole number from 0"),
    ):
        with pytest.raises(SettingError, match=told):
            export_policy(folder.path, tmp_path / "agent.npz", **wrong)
    assert not (tmp_path / "agent.npz").exists()


@pytest.mark.parametrize("name", list(pretrained()))
def test_packaged_agents_are_small_and_complete(name: str) -> None:
    path = pretrained()[name]
    assert path.stat().st_size <= LARGEST
    config = read_config(path)
    score = config["agent"]["score"]
    assert score["sampled"]["episodes"] == score["greedy"]["episodes"] >= 100
    if config["environment"]["settings"].get("look") == "game":
        pytest.importorskip("vizdoom")
    assert load_policy(f"pretrained/{name}").env.num_actions >= 2


def test_packaged_agent_fetches_the_key() -> None:
    policy = load_policy("pretrained/key-door")
    episode = jaxenstein.record(policy.env, policy.params, policy, seed=0)
    assert (episode.ending, episode.returns[-1], episode.steps) == ("terminated", 1, 10)


def test_packaged_agent_finds_the_armour() -> None:
    policy = load_policy("pretrained/doom-my-way-home", greedy=True)
    for seed in (0, 1, 2):
        episode = jaxenstein.record(policy.env, policy.params, policy, seed=seed)
        assert (episode.ending, episode.steps < 200) == ("terminated", True)
        assert episode.returns[-1] > 0.9


def test_numbers_beyond_float16_are_refused(folder: RunFolder, tmp_path: Path) -> None:
    shutil.copytree(folder.path, tmp_path / "run")
    copied = RunFolder.open(tmp_path / "run")
    restored = copied.restore()
    assert restored is not None
    large = jax.tree.map(lambda leaf: leaf + np.float32(1e5), restored.state.params)
    copied.checkpoints.save(1, restored.state.replace(params=large))
    out = tmp_path / "agent.npz"
    with pytest.raises(SettingError, match="not finite in float16; weights='float32' can"):
        export_policy(copied.path, out, 0, episodes=1)
    export_policy(copied.path, out, 0, weights="float32", episodes=1)
    assert load_trained(out).finite(0)
