"""Options: names, kinds, files, what wins, and an experiment that is written and read."""

from __future__ import annotations

import dataclasses
import json
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("flax")

from jaxenstein import SettingError, UnknownEnvironmentError
from jaxenstein.baselines import Config, HParams
from jaxenstein.baselines.learning.algorithms import algorithms
from jaxenstein.baselines.runs.experiment import Experiment
from jaxenstein.baselines.runs.options import all_options, given_by, read_file, resolve
from jaxenstein.settings import merge, options_of
from jaxenstein.tasks.first_person import FirstPerson
from tests.baselines.tiny import OPTIONS, tiny

# Small enough for the default environment.
QUICK: dict[str, Any] = {"height": 12, "width": 16, "convolutions": [[4, 4, 4]]}


def test_every_field_is_an_option_with_its_default_and_a_help() -> None:
    options = all_options()
    own = [cls for row in algorithms().values() for cls in (row.settings, row.numbers)]
    for cls in (Config, HParams, *own):
        for field in dataclasses.fields(cls):
            if field.name != "bonus":
                assert options[field.name].default == field.default
    without = [name for name, option in options.items() if not option.help]
    assert without == []
    assert options["algo"].choices == ("ppo", "rnd", "icm", "e3b")
    assert options["dtype"].choices == ("float32", "bfloat16")
    assert options["anneal"].kind == "flag"


def test_what_is_given_reaches_the_experiment() -> None:
    experiment = resolve(
        QUICK
        | {
            "env": "key-door",
            "algo": "rnd",
            "num_envs": 8,
            "learning_rate": 1,
            "horizon": 50,
            "frame_skip": 4,
            "params": {"discount": 0.5},
            "settings": {"field_of_view": 90.0},
            "seed": 5,
            "seeds": 3,
            "grid": {"bonus_reward": [0.1, 1], "rnd_loss": [0.5]},
        }
    )
    assert (experiment.spec.id, experiment.config.algo) == ("key-door", "rnd")
    assert experiment.config.num_envs == 8
    assert experiment.hparams["learning_rate"] == 1.0
    env, params = experiment.spec.build()
    assert isinstance(env, FirstPerson)
    assert (env.height, env.width, env.field_of_view, env.frame_skip) == (12, 16, 90, 4)
    assert (int(params.max_steps_in_episode), float(params.discount)) == (50, 0.5)
    assert experiment.seeds == (5, 6, 7)
    assert experiment.runs[3] == {"bonus_reward": 1.0, "rnd_loss": 0.5, "seed": 5}
    assert [run["bonus_reward"] for run in experiment.runs] == [0.1] * 3 + [1] * 3
    numbers = experiment.numbers()
    assert numbers.bonus_reward.tolist() == pytest.approx([0.1] * 3 + [1] * 3)
    assert numbers.learning_rate == 1.0
    assert numbers.gamma is None


def test_defaults_are_those_of_the_paper() -> None:
    config, numbers = Config(), HParams()
    assert (config.rollout, config.epochs, config.hidden, config.features) == (128, 4, 256, 256)
    assert resolve({}).spec.settings == {"height": 64, "width": 64}
    given = (
        numbers.learning_rate, numbers.gae_lambda, numbers.entropy, numbers.value,
        numbers.gradient_norm,
    )  # fmt: skip
    assert given == (2.5e-4, 0.95, 0.01, 0.5, 0.5)


TUNED = {
    "num_envs": 64, "rollout": 128, "learning_rate": 1e-3, "anneal": False, "value_clip": 10.0,
    "advantage_floor": 0.01, "features": 64, "hidden": 64, "head": 64,
    "convolutions": ((4, 4, 32),), "zero_values": True, "gamma": 0.99, "epochs": 2,
    "contrast": 10.0,
}  # fmt: skip


OWN_VALUES = {
    "normalise_bonus": True,
    "bonus_values": True,
    "bonus_advantage": 0.3,
    "entropy": 0.003,
}


@pytest.mark.parametrize(
    ("algo", "own"),
    [
        ("ppo", {}),
        ("icm", OWN_VALUES),
        (
            "rnd",
            {
                "normalise_bonus": True,
                "bonus_memory": 0.9,
                "bonus_learning_rate": 1e-4,
                "bonus_advantage": 0.3,
                "entropy": 0.003,
                "contrast": 0.0,
            },
        ),
        ("e3b", {**OWN_VALUES, "e3b_lambda": 0.1, "random_clocks": True}),
    ],
)
def test_recipes_are_defaults_below_what_is_given(algo: str, own: dict[str, Any]) -> None:
    def flat(**given: Any) -> dict[str, Any]:
        experiment = resolve({"height": 16, "width": 16, "algo": algo, **given})
        return {**experiment.config.flat(), **experiment.hparams}

    paper = flat()
    assert flat(recipe="paper") == paper
    assert paper == {**Config(algo=algo).flat(), **HParams().flat(), **_own_numbers(algo)}
    assert flat(recipe="tuned") == {**paper, **TUNED, **own}
    given = {"recipe": "tuned", "network": "small", "head": 8, "anneal": True, "clip": 0.1}
    sizes = {"convolutions": ((4, 2, 16), (3, 2, 32)), "head": 8}
    assert flat(**given) == {**paper, **TUNED, **own, **sizes, "anneal": True, "clip": 0.1}
    network = {name: TUNED[name] for name in ("features", "hidden", "head", "convolutions")}
    assert flat(network="tiny") == {**paper, **network}


def _own_numbers(algo: str) -> dict[str, Any]:
    numbers = algorithms()[algo].numbers
    return {field.name: field.default for field in dataclasses.fields(numbers)}


def test_presets_are_written_down_and_runs_without_any_are_the_papers() -> None:
    experiment = tiny(recipe="tuned", num_envs=8, total_steps=1024)
    plain = json.loads(json.dumps(experiment.to_json()))
    assert plain["presets"] == {"recipe": "tuned", "network": "tiny"}
    assert plain["hparams"]["learning_rate"] == 1e-3
    assert Experiment.from_json(plain) == experiment == resolve(given_by(experiment))
    del plain["presets"]
    assert experiment.differences(Experiment.from_json(plain)) == [
        'presets.network ("tiny", not "paper")', 'presets.recipe ("tuned", not "paper")'
    ]  # fmt: skip
    plain["presets"] = {"recipe": "tunned"}
    with pytest.raises(SettingError, match="recipe must be one of 'paper', 'tuned', not 'tunned'"):
        Experiment.from_json(plain)


def test_options_of_before_are_read_where_they_did_nothing(tmp_path: Path) -> None:
    file = tmp_path / "before.toml"
    file.write_text('algo = "rnd"\nnormalise-observations = false\nrnd-fraction = 1.0\n')
    experiment = tiny(**read_file(file))
    assert experiment == tiny(algo="rnd")
    plain = experiment.to_json()
    plain["config"] |= {"rnd_deeper": 0, "normalise_advantages": "minibatch"}
    plain["hparams"] |= {"rnd_fraction": 1.0}
    assert Experiment.from_json(plain) == experiment
    plain["hparams"]["rnd_fraction"] = 0.25
    with pytest.raises(SettingError, match=r"rnd_fraction is gone.*only 1.0 can be read, not 0.25"):
        Experiment.from_json(plain)
    file.write_text("rnd_deeper = 2\n")
    with pytest.raises(SettingError, match=r"before.toml: rnd_deeper is gone"):
        read_file(file)


def test_an_experiment_survives_writing_and_reading() -> None:
    for experiment in (tiny(), tiny(grid={"clip": [0.1, 0.2]}), resolve(QUICK)):
        again = Experiment.from_json(json.loads(json.dumps(experiment.to_json())))
        assert experiment.differences(again) == []
        assert again.config == experiment.config
        assert again.runs == experiment.runs
        assert resolve(given_by(experiment)).differences(experiment) == []
    # JSON has one kind of list where configs have tuples.
    assert tiny().config.convolutions == ((4, 4, 4),)


def test_an_alias_is_the_same_experiment() -> None:
    one = resolve(QUICK | {"env": "key-corridor-s4r3"})
    assert one.differences(resolve(QUICK | {"env": "key-corridor"})) == []


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"leraning_rate": 1.0}, "unknown option 'leraning_rate', did you mean 'learning_rate'"),
        (
            {"algo": "rdn"},
            "one of 'ppo', 'rnd', 'icm', 'e3b', not 'rdn', did you mean",
        ),
        ({"dtype": "float23"}, "must be one of 'float32', 'bfloat16', not 'float23', did you mean"),
        ({"rnd_hiden": 8}, "unknown option 'rnd_hiden', did you mean 'rnd_hidden"),
        ({"num_envs": 2.5}, "num_envs must be a whole number, not 2.5"),
        ({"num_envs": True}, "num_envs must be a whole number, not True"),
        ({"num_envs": 6}, "num_envs must be a multiple of minibatches"),
        ({"clip": "big"}, "clip must be a number, not 'big'"),
        ({"clip": 0}, "clip must be a finite number above 0, not 0"),
        ({"recipe": "tunned"}, "one of 'paper', 'tuned', not 'tunned', did you mean 'tuned'"),
        ({"network": 64}, "network must be a word, not 64"),
        ({"anneal": 1}, "anneal must be true or false, not 1"),
        ({"convolutions": 3}, r"convolutions must be a list of \[kernel, stride, features\]"),
        ({"convolutions": [[1, 2]]}, "convolutions must be"),
        ({"params": 3}, "params must be a table of names with values, not 3"),
        ({"params": {"discout": 3}}, "unknown param 'discout', did you mean 'discount'"),
        ({"horizon": 0}, "horizon must be a whole number from 1, not 0"),
        ({"settings": {"fov": 90}}, "unknown setting 'fov'"),
        ({"settings": {"move_distance": 2}}, r"--param move_distance=\.\.\. in a command"),
        ({"params": {"sprite_layers": 2}}, "is a setting, not a param: --set sprite_layers=2"),
        ({"settings": {"id": "simple"}}, "unknown setting 'id'"),
        ({"height": 0}, "height"),
        ({"seeds": 0}, "seeds must be a whole number from 1, not 0"),
        ({"seed": -1}, "seed must be a whole number from 0"),
        ({"grid": {"clips": [1.0]}}, "unknown number 'clips' in grid, did you mean 'clip'"),
        ({"grid": {"clip": []}}, "grid.clip must be a list of different numbers"),
        ({"grid": {"clip": [0.1, 0.1]}}, "grid.clip must be a list of different numbers"),
        ({"grid": {"clip": [0.1, -1]}}, "clip must be a finite number above 0"),
        ({"env": "simple", "map": "S"}, "give either env or a map, not both"),
        ({"heading": 0.0}, "heading goes with a map"),
        ({"total_steps": 10}, "total_steps must be at least"),
    ],
)
def test_what_cannot_be_is_told(given: dict[str, Any], message: str) -> None:
    with pytest.raises(SettingError, match=message):
        resolve(QUICK | given)


def test_an_unknown_environment_is_told() -> None:
    with pytest.raises(UnknownEnvironmentError, match="did you mean 'simple'"):
        resolve(QUICK | {"env": "smiple"})


def test_a_file_gives_options_and_flags_win(tmp_path: Path) -> None:
    file = tmp_path / "run.toml"
    file.write_text(
        'algo = "icm"\ntotal-steps = 3e6\nlearning_rate = 1\nmap = """\n####\n#SG#\n####\n"""\n'
        "[params]\ndiscount = 0.9\nliving_reward = -0.5\n"
    )
    read = read_file(file)
    assert read["total_steps"] == 3_000_000
    assert type(read["total_steps"]) is int
    given = merge(read, {"algo": "rnd", "params": {"discount": 0.8}})
    assert given["algo"] == "rnd"
    assert given["params"] == {"discount": 0.8, "living_reward": -0.5}
    experiment = resolve(QUICK | given)
    assert experiment.spec.id is None
    assert resolve(QUICK | merge(read, {"env": "simple"})).spec.id == "simple"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("algo = ", "run.toml is not TOML"),
        ("lerning_rate = 1", "run.toml: unknown option 'lerning_rate', did you mean"),
        ('num_envs = "8"', "run.toml: num_envs must be a whole number, not '8'"),
        (f"num_envs = {10**400}", "run.toml: num_envs must be a whole number, not 1000"),
        (f"gamma = {-(10**400)}", "run.toml: gamma must be a number, not -1000"),
    ],
)
def test_a_wrong_file_is_told(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "run.toml").write_text(text)
    with pytest.raises(SettingError, match=message):
        read_file(tmp_path / "run.toml")


def test_a_missing_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match=r"cannot read .*: no such file"):
        read_file(tmp_path / "none.toml")
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(SettingError, match="cannot read"):
        read_file(tmp_path / "bytes.toml")


def test_yaml_is_read_where_there_is_pyyaml(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "run.yaml"
    file.write_text("algo: rnd\nseeds: 2\n")
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "yaml", None)
        with pytest.raises(SettingError, match="pip install pyyaml, or write TOML"):
            read_file(file)
    pytest.importorskip("yaml")
    assert read_file(file) == {"algo": "rnd", "seeds": 2}
    file.write_text("- 1\n")
    with pytest.raises(SettingError, match="must hold names with values"):
        read_file(file)
    file.write_text("{")
    with pytest.raises(SettingError, match="is not YAML"):
        read_file(file)


def test_the_tests_options_are_an_experiment_of_two_runs() -> None:
    assert len(tiny().runs) == OPTIONS["seeds"] == 2


def test_help_says_so_where_docstrings_are_stripped() -> None:
    @dataclasses.dataclass
    class Stripped:
        size: int

    assert [option.help for option in options_of(Stripped, "x")] == [
        "(python -OO strips the explanation)"
    ]
