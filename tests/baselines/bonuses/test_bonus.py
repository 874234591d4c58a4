"""The loop around a bonus: its scale, its returns, and a bonus of a user's own."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")

from jaxenstein.baselines import PER_ENVIRONMENT, Config, Experience, HParams, register_bonus
from jaxenstein.baselines import config as table
from jaxenstein.baselines.bonus import RunningScale, RunningStats
from jaxenstein.baselines.state import per_environment
from jaxenstein.cli import main
from jaxenstein.errors import SettingError
from jaxenstein.fields import choice, number
from jaxenstein.pytree import PyTreeNode
from tests.baselines.bonuses.rollouts import BATCH, KEY, STEPS, experience, loop_of, numbers_of

Counted = Literal["steps", "turns"]


@dataclasses.dataclass(frozen=True, kw_only=True)
class VisitsOptions:
    """Options.

    Attributes:
        visits_power: what the second part of the bonus is raised to.
        visits_kind: what is counted.
        visits_size: factor.
    """

    visits_power: int = number(2, 1)
    visits_kind: Counted = choice("steps", Counted)
    visits_size: Any = number(1.0, 0)


class VisitsState(PyTreeNode):
    steps: jax.Array = dataclasses.field(metadata=PER_ENVIRONMENT)
    updates: jax.Array


class Visits:
    """A bonus of two parts: the number of steps in an environment, and a power of it."""

    value_heads = 3

    def __init__(self, spec: Any, actions: int, config: Config) -> None:
        self._batch, self._power = config.num_envs, config.bonus["visits_power"]

    def init(self, key: jax.Array) -> VisitsState:
        return VisitsState(jnp.zeros(self._batch, jnp.float32), jnp.int32(0))

    def reward(self, state: VisitsState, hparams: HParams, experience: Experience) -> Any:
        length = experience.ended.shape[0]
        steps = jnp.arange(1, length + 1, dtype=jnp.float32)[:, None] + state.steps[None]
        steps = steps * hparams.bonus["visits_size"]
        both = jnp.stack([steps, steps**self._power], axis=-1)
        return both, state.replace(steps=state.steps + length), {}

    def update(self, key: Any, state: VisitsState, hparams: Any, experience: Any, rate: Any) -> Any:
        return state.replace(updates=state.updates + 1), {}


@dataclasses.dataclass(frozen=True)
class Clashing:
    """A bonus `value` whose option is one of PPO's.

    Attributes:
        value_clip: a clip.
    """

    value_clip: Any = number(1.0, 0)


class Loud(Visits):
    """Has a metric of PPO's name."""

    def __init__(self, spec: Any, actions: int, config: Config) -> None:
        self._batch = config.num_envs

    def reward(self, state: VisitsState, hparams: HParams, experience: Experience) -> Any:
        return jnp.zeros((*experience.ended.shape, 2)), state, {}

    def update(self, key: Any, state: VisitsState, hparams: Any, experience: Any, rate: Any) -> Any:
        return state, {"loss": jnp.float32(0)}


@pytest.fixture
def visits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table, "_ALGORITHMS", dict(table.algorithms()))
    register_bonus("visits", Visits, VisitsOptions, grid={"visits_size": (1.0, 2.0)})


@pytest.mark.usefixtures("visits", "plain_frames")
def test_custom_bonus_trains_stops_and_resumes(tmp_path: Path) -> None:
    from jaxenstein.baselines.runs.folder import RunFolder
    from jaxenstein.baselines.runs.options import all_options, given_by, read_file, resolve
    from jaxenstein.baselines.runs.sweeps import plan, swept
    from jaxenstein.baselines.runs.training import train
    from tests.baselines.tiny import OPTIONS, tiny

    assert "visits" in all_options()["algo"].domain.choices
    assert all_options()["visits_kind"].domain.choices == ("steps", "turns")
    assert all_options()["visits_power"].help == "what the second part of the bonus is raised to."
    (tmp_path / "own.toml").write_text('algo = "visits"\nvisits_power = 3\nvisits_size = 0.5\n')
    own = read_file(tmp_path / "own.toml")
    experiment = tiny(**own, seeds=1, total_steps=2 * 4 * 8)
    assert experiment.config.bonus == {"visits_power": 3, "visits_kind": "steps"}
    assert experiment.hparams["visits_size"] == 0.5
    assert resolve(given_by(experiment)) == experiment
    folder = RunFolder.create(tmp_path / "run", experiment)
    done: list[int] = []
    train(folder, notify=lambda update, _: done.append(update), stop=lambda: done[-1] >= 1)
    assert done[-1] == 1
    again = RunFolder.open(tmp_path / "run")
    assert again.experiment == experiment
    assert train(again) == 2
    state = again.restore().state  # type: ignore[union-attr]
    assert state.bonus.steps.tolist() == [[16.0] * 4]
    assert state.bonus.updates.tolist() == [2]
    assert swept() == ("ppo", "rnd", "icm", "visits")
    planned = plan({**OPTIONS, "seeds": 1}, ["visits"])["visits"]
    assert [run["visits_size"] for run in planned.runs] == [1.0, 2.0]


@pytest.mark.usefixtures("visits")
def test_each_part_of_a_bonus_has_its_own_returns() -> None:
    rng = np.random.default_rng(0)
    value = rng.normal(size=(STEPS + 1, BATCH, 3)).astype(np.float32)
    reward = rng.normal(size=(STEPS, BATCH)).astype(np.float32)
    bonus = rng.normal(size=(STEPS, BATCH, 2)).astype(np.float32)
    ended = rng.random((STEPS, BATCH)) < 0.3
    steps: Any = SimpleNamespace(
        value=jnp.asarray(value[:-1]), reward=jnp.asarray(reward), ended=jnp.asarray(ended),
        terminated=jnp.asarray(ended), truncated=jnp.zeros_like(ended),
    )  # fmt: skip
    network: Any = SimpleNamespace(step=lambda *_: (None, jnp.asarray(value[-1]), None))
    actors: Any = SimpleNamespace(obs=None, previous=None, first=None, memory=None)
    loop = dataclasses.replace(loop_of("visits"), network=network)
    numbers = numbers_of("visits", gamma=0.8, gae_lambda=0.7)
    nothing: Any = None
    result = loop.advantages(nothing, numbers, actors, steps, nothing, jnp.asarray(bonus))
    for head, (gains, gamma, go_on) in enumerate(
        [(reward, 0.8, ~ended), *((bonus[..., part], 0.9, np.ones_like(ended)) for part in (0, 1))]
    ):
        expected, following = np.zeros((STEPS, BATCH)), np.zeros(BATCH)
        for t in reversed(range(STEPS)):
            after = np.where(go_on[t], value[t + 1, :, head], 0)
            delta = gains[t] + gamma * after - value[t, :, head]
            following = delta + gamma * 0.7 * go_on[t] * following
            expected[t] = following
        np.testing.assert_allclose(result[..., head], expected, rtol=1e-4, atol=1e-5)


@pytest.mark.usefixtures("visits")
@pytest.mark.parametrize(
    ("algo", "own", "parts"),
    [
        ("rnd", False, (1,)),
        ("icm", False, ()),
        ("icm", True, (1,)),
        ("e3b", False, ()),
        ("e3b", True, (1,)),
        ("visits", False, (2,)),
    ],
)
def test_loop_zeroes_scales_and_weighs_a_bonus(
    algo: str, own: bool, parts: tuple[int, ...]
) -> None:
    loop = loop_of(algo, normalise_bonus=True, bonus_values=own)
    assert loop.parts == parts
    numbers, data = numbers_of(algo, bonus_reward=2.0), experience()
    state: Any = initial_train_state(loop)
    totals, total = [], np.zeros((BATCH, *loop.parts))
    for _ in range(2):
        raw, _, _ = loop.bonus.reward(state.bonus, numbers, data)
        ended = np.asarray(data.ended).reshape(STEPS, BATCH, *(1 for _ in loop.parts))
        raw = np.asarray(raw).reshape(STEPS, BATCH, *loop.parts) * ~ended
        result, state, _ = loop.bonuses(state, numbers, data)
        for row in raw:
            total = 0.9 * total + row
            totals.append(total)
        np.testing.assert_allclose(result, 2 * raw / np.std(totals, axis=(0, 1)), rtol=1e-3)
    inside = per_environment(state)
    pairs = zip(jax.tree.leaves(state), jax.tree.leaves(inside), strict=True)
    assert all(leaf.shape[0] == BATCH for leaf, where in pairs if where)
    assert (inside.scale.total, inside.scale.stats.mean) == (True, False)
    assert any(jax.tree.leaves(inside.bonus)) == (algo in ("e3b", "visits"))


def initial_train_state(loop: Any) -> Any:
    """A state before the first update that has only the parts of the bonus."""
    from jaxenstein.baselines.state import TrainState

    nothing: Any = None
    scale = RunningScale.empty(BATCH, *loop.parts)
    return TrainState(
        nothing, nothing, nothing, nothing, loop.bonus.init(KEY), scale, None, None, nothing
    )


@pytest.mark.usefixtures("visits")
@pytest.mark.parametrize(
    ("name", "options", "grid", "message"),
    [
        ("Own-One", (), None, "lower-case letters, digits and underscores, not 'Own-One'"),
        ("visits", (), None, "there already is an algorithm 'visits'"),
        ("own", (VisitsOptions,), None, "must begin with 'own_', not 'visits_power'"),
        ("value", (Clashing,), None, "there already is an option 'value_clip'"),
        ("own", (), {"bonus_rewrad": (1.0,)}, "hyperparameter in a grid: 'bonus_rewrad', did you"),
    ],
)
def test_invalid_registrations_are_refused(
    name: str, options: Any, grid: Any, message: str
) -> None:
    with pytest.raises(SettingError, match=message):
        register_bonus(name, Visits, *options, grid=grid)


@pytest.mark.usefixtures("visits")
def test_metrics_with_the_names_of_others_are_refused() -> None:
    """Such as a loss, which would hide that of PPO from the check for divergence."""
    from tests.baselines.tiny import tiny

    register_bonus("loud", Loud)
    learner = tiny(algo="loud").learner
    with pytest.raises(SettingError, match="names that the training uses: loss"):
        learner.train_chunk(learner.init(KEY), None, 1)


@pytest.mark.usefixtures("visits")
def test_bonus_options_are_checked() -> None:
    with pytest.raises(SettingError, match="visits_power must be a whole number"):
        Config(algo="visits", bonus={"visits_power": 2.5})
    with pytest.raises(SettingError, match="must be one of 'steps', 'turns', not 'turn', did you"):
        Config(algo="visits", bonus={"visits_kind": "turn"})
    with pytest.raises(SettingError, match="visits_size must be a "):
        HParams(bonus={"visits_size": "large"}).check("visits")
    with pytest.raises(SettingError, match="unknown setting 'visits_power'"):
        Config(algo="rnd", bonus={"visits_power": 2})
    with pytest.raises(SettingError, match="unknown setting 'rnd_hiden', did you mean 'rnd_hidd"):
        Config.of({"algo": "rnd", "rnd_hiden": 3})
    with pytest.raises(SettingError, match=r"not 'visit'.*import its module first"):
        Config(algo="visit")


def test_options_of_other_bonuses_are_left_out() -> None:
    config = Config.of({"algo": "rnd", "rnd_hidden": 3, "icm_hidden": 5})
    assert config.bonus == {"rnd_hidden": 3, "rnd_output": 128, "rnd_layers": 2}
    assert config.replace(rnd_layers=4).bonus["rnd_layers"] == 4
    assert config.replace(algo="icm").flat()["icm_hidden"] == 256
    assert "rnd_hidden" not in config.replace(algo="icm").flat()
    numbers = HParams.of("rnd", {"rnd_loss": 2, "icm_forward": 3})
    assert numbers.bonus == {"rnd_loss": 2}
    assert numbers.flat()["rnd_loss"] == 2


def test_commands_find_a_bonus_in_an_imported_module(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Even if the flag that names the module comes after the flags of the bonus."""
    monkeypatch.setattr(table, "_ALGORITHMS", dict(table.algorithms()))
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "my_visits.py").write_text(
        "from jaxenstein.baselines import register_bonus\n"
        "from tests.baselines.bonuses.test_bonus import Visits, VisitsOptions\n"
        "register_bonus('visits', Visits, VisitsOptions)\n"
    )
    train = ["train", "--algo", "visits", "--visits-size", "1", "--out", str(tmp_path / "run")]
    assert main(train) == 2
    assert "'e3b', not 'visits'" in capsys.readouterr().err
    assert main([*train, "--visits-power=0.5", "--import=my_visits"]) == 2
    assert "--visits-power: must be a whole number" in capsys.readouterr().err


@pytest.mark.parametrize("cuts", [[], [1], [3, 4, 90]])
def test_merged_chunks_give_the_statistics_of_all_values(cuts: list[int]) -> None:
    values = np.random.default_rng(0).normal(50, 3, (100, 2, 5)).astype(np.float32)
    stats = RunningStats.empty((5,))
    for part in np.split(values, cuts):
        stats = stats.merge(jnp.asarray(part))
    np.testing.assert_allclose(stats.mean, values.mean((0, 1), np.float64), rtol=1e-6)
    np.testing.assert_allclose(stats.variance, values.var((0, 1), np.float64), rtol=1e-4)
    assert float(stats.count) == 200


def test_empty_statistics_are_harmless() -> None:
    stats = RunningStats.empty((3,))
    np.testing.assert_array_equal(stats.deviation, np.ones(3))
    stats = stats.merge(jnp.ones((4, 3)))
    np.testing.assert_array_equal(stats.variance, np.zeros(3))


def test_decaying_bonus_scale_weighs_rollouts_by_age() -> None:
    rng = np.random.default_rng(2)
    scale, rollouts = RunningScale.empty(3), []
    for size in (100.0, 1.0, 1.0, 1.0):
        values = rng.exponential(size, (5, 3)).astype(np.float32)
        result, scale = scale.divide(jnp.asarray(values), 0.0, memory=0.5)
        rollouts.append(values)
        weights = np.repeat(0.5 ** np.arange(len(rollouts))[::-1], values.size)
        every = np.concatenate([rollout.ravel() for rollout in rollouts])
        mean = np.average(every, weights=weights)
        deviation = np.sqrt(np.average((every - mean) ** 2, weights=weights))
        np.testing.assert_allclose(result, values / deviation, rtol=1e-4)


@pytest.mark.parametrize("size", [0.01, 50.0])
def test_only_rewards_with_large_discounted_sums_are_divided(size: float) -> None:
    rng = np.random.default_rng(3)
    scale, total, totals = RunningScale.empty(2), np.zeros(2), []
    for _ in range(3):
        rewards = (size * rng.normal(1, 1, (20, 2))).astype(np.float32)
        ended = rng.random((20, 2)) < 0.1
        result, scale = scale.divide(
            jnp.asarray(rewards), jnp.float32(0.9), ended=jnp.asarray(ended), least=1.0
        )
        for reward, end in zip(rewards, ended, strict=True):
            total = 0.9 * total + reward
            totals.append(total)
            total = np.where(end, 0, total)
        np.testing.assert_allclose(result, rewards / max(np.std(totals), 1), rtol=1e-4)
    np.testing.assert_allclose(scale.total, total, rtol=1e-5)
