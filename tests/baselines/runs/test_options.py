"""Options: names, defaults, files, recipes, and experiments as JSON."""

from __future__ import annotations

import dataclasses
import json
import sys
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")

from jaxenstein import SettingError, UnknownEnvironmentError
from jaxenstein.baselines import Config, HParams
from jaxenstein.baselines.config import algorithms
from jaxenstein.baselines.runs.experiment import Experiment
from jaxenstein.baselines.runs.options import (
    NETWORKS,
    RECIPES,
    all_options,
    check_effect,
    given_by,
    read_file,
    resolve,
)
from jaxenstein.settings import changed, merge
from jaxenstein.tasks.first_person import FirstPerson
from tests.baselines.tiny import tiny

# Small enough for the default environment.
QUICK: dict[str, Any] = {"height": 12, "width": 16, "convolutions": [[4, 4, 4]]}


def test_every_field_is_an_option_with_default_and_help() -> None:
    options = all_options()
    for cls in (Config, HParams, *(row.options for row in algorithms().values())):
        for field in dataclasses.fields(cls):
            if field.name != "bonus":
                assert options[field.name].default == field.default
    assert [name for name, option in options.items() if not option.help] == []
    assert options["algo"].domain.choices == ("ppo", "rnd", "icm", "e3b")


def test_configs_are_hashable_and_count_updates() -> None:
    config = Config(num_envs=4, rollout=10, total_steps=99)
    assert config == Config(num_envs=4, rollout=10, total_steps=99)
    assert len({config, config.replace(num_envs=8), config.replace(algo="rnd", rnd_hidden=8)}) == 3
    assert config.updates == 2
    with pytest.raises(SettingError, match="unknown setting 'num_env', did you mean 'num_envs'"):
        config.replace(num_env=3)
    with pytest.raises(SettingError, match="times shards = 4"):
        config.replace(num_envs=8, shards=4)
    most = 40 * (2**31 - 1)
    assert config.replace(total_steps=most).updates == 2**31 - 1
    with pytest.raises(SettingError, match=rf"must be at most .* = {most}, not {most + 40}, since"):
        config.replace(total_steps=most + 40)


def test_hparams_can_be_traced() -> None:
    numbers = HParams(learning_rate=jnp.array([1e-3, 1e-4])).check()
    assert numbers.learning_rate.shape == (2,)
    doubled = jax.jit(lambda h: h.check().replace(clip=h.clip * 2))(HParams().check())
    assert float(doubled.clip) == pytest.approx(0.4)
    assert doubled.gamma is None


def test_given_options_reach_the_experiment() -> None:
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
    assert (experiment.environment.id, experiment.config.algo) == ("key-door", "rnd")
    assert experiment.config.num_envs == 8
    assert experiment.hparams["learning_rate"] == 1.0
    env, params = experiment.environment.build()
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


def test_defaults_match_the_paper() -> None:
    config, numbers = Config(), HParams()
    assert (config.rollout, config.epochs, config.hidden, config.features) == (128, 4, 256, 256)
    assert resolve({}).environment.settings == {"height": 64, "width": 64}
    assert (numbers.learning_rate, numbers.gae_lambda, numbers.entropy) == (2.5e-4, 0.95, 0.01)
    assert (numbers.value, numbers.gradient_norm, numbers.gamma) == (0.5, 0.5, None)
    rnd, icm = Config(algo="rnd").bonus, Config(algo="icm").bonus
    assert rnd == {"rnd_hidden": 128, "rnd_output": 128, "rnd_layers": 2}
    assert (icm["icm_latent"], icm["icm_hidden"], config.bonus_epochs) == (128, 256, 1)


@pytest.mark.parametrize("recipe", ["tuned", "long"])
@pytest.mark.parametrize("algo", ["ppo", "icm", "rnd", "e3b"])
def test_given_options_override_recipes(algo: str, recipe: str) -> None:
    def flat(**given: Any) -> dict[str, Any]:
        experiment = resolve({"height": 16, "width": 16, "algo": algo, **given})
        return {**experiment.config.flat(), **experiment.hparams}

    paper = flat()
    assert flat(recipe="paper") == paper
    assert paper == {**Config(algo=algo).flat(), **HParams.of(algo, {}).flat()}
    values = {**RECIPES[recipe]["*"], **RECIPES[recipe].get(algo, {})}
    network = values.pop("network")
    assert flat(recipe=recipe) == {**paper, **NETWORKS[network], **values}
    given = {"recipe": recipe, "network": "small", "head": 8, "anneal": True, "clip": 0.1}
    sizes = {**NETWORKS["small"], "head": 8}
    assert flat(**given) == {**paper, **values, **sizes, "anneal": True, "clip": 0.1}
    assert flat(network="tiny") == {**paper, **NETWORKS["tiny"]}


def test_recipe_and_network_are_saved() -> None:
    experiment = tiny(recipe="tuned", num_envs=8, total_steps=1024)
    plain = json.loads(json.dumps(experiment.to_json()))
    assert plain["presets"] == {"recipe": "tuned", "network": "tiny"}
    assert plain["hparams"]["learning_rate"] == 1e-3
    assert Experiment.from_json(plain) == experiment == resolve(given_by(experiment))
    plain["presets"] = {"recipe": "tunned"}
    with pytest.raises(
        SettingError, match="recipe must be one of 'paper', 'tuned', 'long', not 'tunned'"
    ):
        Experiment.from_json(plain)


def test_experiment_round_trips_through_json() -> None:
    for experiment in (tiny(), tiny(grid={"clip": [0.1, 0.2]}), resolve(QUICK)):
        again = Experiment.from_json(json.loads(json.dumps(experiment.to_json())))
        assert experiment.differences(again) == []
        assert again.config == experiment.config
        assert again.runs == experiment.runs
        assert resolve(given_by(experiment)).differences(experiment) == []
    # JSON has one kind of list where configs have tuples.
    assert tiny().config.convolutions == ((4, 4, 4),)


def test_none_is_an_option_that_is_kept() -> None:
    """The recipe sets another value for each of these."""
    given = QUICK | {"recipe": "long", "gamma": None, "bonus_gamma": None, "algo": "rnd"}
    experiment = resolve(given)
    assert experiment.hparams["gamma"] is None
    assert resolve(given_by(experiment)).differences(experiment) == []


def test_alias_gives_the_same_experiment() -> None:
    one = resolve(QUICK | {"env": "key-corridor-s4r3"})
    assert one.differences(resolve(QUICK | {"env": "key-corridor"})) == []


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"leraning_rate": 1.0}, "unknown option 'leraning_rate', did you mean 'learning_rate'"),
        ({"algo": "rdn"}, "one of 'ppo', 'rnd', 'icm', 'e3b', not 'rdn', did you mean"),
        ({"rnd_hiden": 8}, "unknown option 'rnd_hiden', did you mean 'rnd_hidden"),
        ({"num_envs": 6}, "num_envs must be a multiple of minibatches"),
        ({"total_steps": 10**12, "rollout": 1}, r"total_steps must be at most 2147483647 \* "),
        ({"clip": 0}, "clip must be a finite number above 0, not 0"),
        (
            {"recipe": "tunned"},
            "one of 'paper', 'tuned', 'long', not 'tunned', did you mean 'tuned'",
        ),
        ({"params": 3}, "params must be a table of names and values, not 3"),
        ({"params": {"discout": 3}}, "unknown param 'discout', did you mean 'discount'"),
        ({"horizon": 0}, "horizon must be a whole number >= 1, not 0"),
        ({"settings": {"fov": 90}}, "unknown setting 'fov'"),
        ({"settings": {"move_distance": 2}}, r"--param move_distance=\.\.\. in a command"),
        ({"params": {"sprite_layers": 2}}, "is a setting, not a param: use --set sprite_layers=2"),
        ({"settings": {"id": "simple"}}, "unknown setting 'id'"),
        ({"height": 0}, "height"),
        ({"seeds": 0}, "seeds must be a whole number >= 1, not 0"),
        ({"seed": -1}, "seed must be a whole number from 0"),
        (
            {"grid": {"clips": [1.0]}},
            "unknown hyperparameter in a grid: 'clips', did you mean 'clip'",
        ),
        ({"grid": {"bonus_reward": [1.0]}}, "bonus_reward has no effect on ppo, only on rnd, icm"),
        (
            {"grid": {"rnd_loss": [1.0]}, "algo": "icm"},
            "rnd_loss has no effect on icm, only on rnd",
        ),
        ({"grid": {"clip": []}}, "grid.clip must be a list of different numbers"),
        ({"grid": {"clip": [0.1, 0.1]}}, "grid.clip must be a list of different numbers"),
        ({"grid": {"clip": [0.1, -1]}}, "clip must be a finite number above 0"),
        ({"env": "simple", "map": "S"}, "give exactly one of env and map"),
        ({"heading": 0.0}, "heading needs a map"),
        ({"total_steps": 10}, "total_steps must be at least"),
    ],
)
def test_impossible_options_are_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(SettingError, match=message):
        resolve(QUICK | given)


def test_unknown_environment_is_refused() -> None:
    with pytest.raises(UnknownEnvironmentError, match="did you mean 'simple'"):
        resolve(QUICK | {"env": "smiple"})


def test_flags_override_config_file(tmp_path: Path) -> None:
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
    assert experiment.environment.id is None
    # Params, like those of the file, belong to its environment.
    replaced = resolve(QUICK | merge(read | {"horizon": 9}, {"env": "simple"})).environment
    assert replaced == resolve(QUICK | {"env": "simple"}).environment
    # A heading belongs to the map of the file.
    turned = resolve(QUICK | merge(given, {"heading": 0.5})).environment
    assert turned == changed(experiment.environment, {"heading": 0.5})
    assert (turned.settings["text"], turned.settings["heading"]) == (read["map"], 0.5)


@pytest.mark.parametrize(
    ("below", "above"),
    [
        ({"settings": {"frame_skip": 4}}, {"frame_skip": 6}),
        ({"frame_skip": 4}, {"settings": {"frame_skip": 6}}),
        ({"horizon": 4}, {"params": {"max_steps_in_episode": 6}}),
        ({"params": {"max_steps_in_episode": 4}}, {"horizon": 6}),
    ],
)
def test_flags_override_options_that_stand_elsewhere_in_the_file(
    below: dict[str, Any], above: dict[str, Any]
) -> None:
    spec = resolve(QUICK | merge({"env": "simple", **below}, above)).environment
    assert 6 in (spec.settings.get("frame_skip"), spec.params.get("max_steps_in_episode"))


def test_options_without_effect_are_refused() -> None:
    for name, algo in (
        ("normalise_bonus", "ppo"),
        ("bonus_values", "ppo"),
        ("bonus_values", "rnd"),
    ):
        with pytest.raises(SettingError, match=f"{name} has no effect on {algo}, only on"):
            check_effect([name], [algo])
    check_effect(["normalise_bonus", "bonus_values"], ["icm"])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("algo = ", "run.toml is not TOML"),
        ("lerning_rate = 1", "run.toml: unknown option 'lerning_rate', did you mean"),
        ('num_envs = "8"', "run.toml: num_envs must be a whole number >= 1, not '8'"),
        (f"gamma = {10**400}", "run.toml: gamma must be None or a finite number from 0 to 1"),
        (
            "settings." + "a . " * 10**5 + "a = 1",
            "run.toml is not TOML: a key has more than 20 parts",
        ),
        (f"[{'a.' * 20}a]", "run.toml is not TOML: a key has more than 20 parts"),
        ('"a b".' * 20 + "'c' = 1", "run.toml is not TOML: a key has more than 20 parts"),
        ("#" * 2**20 + "\n", "run.toml: it has more than 1048576 characters"),
    ],
)
def test_wrong_config_file_is_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "run.toml").write_text(text)
    with pytest.raises(SettingError, match=message):
        read_file(tmp_path / "run.toml")


def test_missing_config_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match=r"cannot read .*: no such file"):
        read_file(tmp_path / "none.toml")
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(SettingError, match="cannot read"):
        read_file(tmp_path / "bytes.toml")


def test_yaml_config_needs_pyyaml(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "run.yaml"
    file.write_text("algo: rnd\nseeds: 2\n")
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "yaml", None)
        with pytest.raises(SettingError, match="pip install pyyaml, or write TOML"):
            read_file(file)
    pytest.importorskip("yaml")
    assert read_file(file) == {"algo": "rnd", "seeds": 2}
    file.write_text("- 1\n")
    with pytest.raises(SettingError, match="must be a table of names with values"):
        read_file(file)
    file.write_text("{")
    with pytest.raises(SettingError, match="is not YAML"):
        read_file(file)
    file.write_text(f"settings: {{a: {'[' * 18 + ']' * 18}}}")
    assert list(read_file(file)) == ["settings"]
    file.write_text(f"params: {'[' * 100_000}")
    with pytest.raises(SettingError, match="is not YAML: lists and tables are nested more than"):
        read_file(file)


def test_yaml_numbers_and_repeated_names(tmp_path: Path) -> None:
    pytest.importorskip("yaml")
    file = tmp_path / "run.yaml"
    # YAML 1.1 reads numbers without a point, or with an exponent without a sign, as text.
    file.write_text("learning_rate: 3e-4\ntotal_steps: 1.5e6\nparams: {discount: 1e-1}\n")
    assert read_file(file) == {
        "learning_rate": 3e-4, "total_steps": 1_500_000, "params": {"discount": 0.1}
    }  # fmt: skip
    # 1 and 1.0 are the same key of a dictionary, but different names in the file.
    file.write_text("1: 2\n1.0: 3\n")
    with pytest.raises(SettingError, match="unknown option '1'"):
        read_file(file)
    for text in ("seeds: 2\nalgo: rnd\nseeds: 3\n", "params: {seeds: 1, seeds: 2}"):
        file.write_text(text)
        with pytest.raises(
            SettingError, match=r"run.yaml is not YAML: two entries have .* 'seeds'"
        ):
            read_file(file)


def test_one_option_in_two_spellings_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "run.toml"
    file.write_text("num-envs = 8\nnum_envs = 64\n")
    with pytest.raises(SettingError, match=r"run.toml: two entries have the name 'num_envs'"):
        read_file(file)


def test_dots_in_strings_and_comments_are_no_keys(tmp_path: Path) -> None:
    dots = ".".join("S" * 40)
    for quote in ('"', "'", '"""', "'''"):
        (tmp_path / "run.toml").write_text(f"# {dots} '\nmap = {quote}{dots}{quote}  # {dots}\n")
        assert read_file(tmp_path / "run.toml") == {"map": dots}


def test_numpy_numbers_are_saved_as_python_numbers() -> None:
    ours = {
        **QUICK, "num_envs": 4, "total_steps": 640, "anneal": True, "learning_rate": 0.5,
        "seeds": 2, "params": {"discount": 0.5}, "settings": {"sprite_layers": 2}, "horizon": 9,
    }  # fmt: skip
    numpys = {
        name: {key: np.asarray(one)[()] for key, one in value.items()}
        if isinstance(value, dict)
        else value
        if isinstance(value, list)
        else np.asarray(value)[()]
        for name, value in ours.items()
    }
    grid = {"grid": {"clip": [np.float32(0.25), np.float64(0.5)]}}
    written = resolve({**numpys, **grid}).to_json()
    assert written == resolve({**ours, "grid": {"clip": [0.25, 0.5]}}).to_json()
