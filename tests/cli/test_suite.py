"""`--suite` of train, evaluate, score and list."""

from __future__ import annotations

import contextlib
import json
import re
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("flax")

from jaxenstein import suite
from jaxenstein.baselines.runs.folder import RunFolder
from jaxenstein.baselines.runs.trained import Trained
from jaxenstein.cli import main
from jaxenstein.results import Results, read_results

pytestmark = pytest.mark.usefixtures("plain_frames")

# 1 / 16,000 of the decisions is 187.5.
SHORT_TRAINING = [
    "--budget",
    "0.0000625",
    "--num-envs",
    "4",
    "--rollout",
    "32",
    "--minibatches",
    "2",
]
TINY_NETWORK = ["--features", "8", "--hidden", "8", "--head", "8", "--epochs", "1", "--seeds", "2"]


@pytest.fixture
def two_tasks(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A benchmark of two tasks, and an empty folder to work in."""
    tasks = tuple(suite.task_of(name) for name in ("t-maze", "simple"))
    monkeypatch.setattr(suite, "TASKS", tasks)
    monkeypatch.chdir(tmp_path)


@pytest.mark.usefixtures("two_tasks")
def test_train_evaluate_score(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    train = ["train", "--suite", "--out", "rnd", "--algo", "ppo", *SHORT_TRAINING, *TINY_NETWORK]
    assert main([*train, "--resume"]) == 2
    assert "no folder in rnd has a run to continue; leave out --resume" in capsys.readouterr().err
    assert main([*train, "--budget", "1e-5"]) == 2
    assert "--budget 1e-05: total_steps must be at least" in capsys.readouterr().err
    assert main([*train, "--tasks", "simple"]) == 0
    assert [path.name for path in Path("rnd").iterdir()] == ["simple"]
    assert main([*train, "--resume"]) == 0
    for task in ("t-maze", "simple"):
        about = RunFolder.open(f"rnd/{task}").experiment
        assert about.environment == suite.SUITES["small"].spec(suite.task_of(task))
        assert (about.config.algo, about.recipe, about.config.total_steps) == ("ppo", "long", 188)
    assert main(train) == 2
    assert "rnd/t-maze already has a run: --resume" in capsys.readouterr().err

    monkeypatch.setattr(Trained, "finite", lambda trained, run: run == 0)
    # The agents have the name of the folder.
    with contextlib.chdir("rnd"):
        assert main(["evaluate", ".", "--suite", "--episodes", "2", "--json", "../rnd.json"]) == 0
    out, err = capsys.readouterr()
    assert "fewer than the benchmark's 3,000,000 decisions: t-maze, simple\n" in err
    assert "warning: t-maze: the parameters of seed-1 are not finite" in err
    shown = [line.split() for line in out.splitlines()]
    assert [line[0] for line in shown[-3:-1]] == ["t-maze", "simple"]
    results = read_results("rnd.json")
    assert [(one.policy, one.actions, one.returns.shape) for one in results] == [
        ("rnd", "sampled", (2, 2))
    ] * 2

    other = [
        "evaluate",
        "--policy",
        "expert",
        "--suite",
        "--episodes",
        "2",
        "--json",
        "expert.json",
    ]
    assert main(other) == 0
    assert main(["score", "rnd.json", "expert.json", "--suite", "--json", "scores.json"]) == 0
    scored = json.loads(Path("scores.json").read_text())
    assert [*scored["policies"]] == ["rnd", "expert"]
    shown = capsys.readouterr().out
    assert "IQM" in shown
    for policy, runs in (("rnd", 2), ("expert", 1)):
        told = f"{runs} of 5 training seeds, 2 of 100 test episodes"
        assert f"{policy} departs from the protocol: {told}\n" in shown
    # The expert's score of a task is 1 by definition; its IQM over two tasks as well.
    aggregates = shown[shown.index("IQM") :]
    (expert,) = [line.split() for line in aggregates.splitlines() if line.startswith("expert ")]
    assert float(expert[1]) == 1


@pytest.mark.usefixtures("two_tasks")
@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--frame-skip", "2"], "--suite does not accept --frame-skip"),
        (["--env", "simple"], "--suite does not accept --env"),
        (["--set", "look=plain"], "--suite does not accept --set"),
        (["--grid", "clip=0.1,0.2"], "--suite does not accept --grid"),
        (["--rnd-loss", "2"], "rnd_loss has no effect on ppo, only on rnd"),
        (
            ["--total-steps", "100"],
            "--suite does not accept --total-steps, as a flag or in a config; --budget X",
        ),
        (["--budget", "0.00001"], "rollout = 8192, one update, not 30"),
        (["--budget", "-1"], "--budget"),
        (["--tasks", "simple", "t-mase"], "no task 't-mase', did you mean 't-maze'"),
    ],
)
def test_flags_fixed_by_the_suite_are_refused(
    words: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["train", "--suite", "--out", "new", *words]) == 2
    assert told in capsys.readouterr().err
    assert not Path("new").exists()


@pytest.mark.usefixtures("two_tasks")
def test_evaluate_refuses_conflicting_arguments(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for words, told in (
        (["evaluate", "none", "--suite"], "none is not a folder of 'jaxenstein train --suite'"),
        (["evaluate", "none", "--suite", "--env", "simple"], "--suite does not accept --env"),
        (["evaluate", "none", "--suite", "--param", "a=1"], "--suite does not accept --param"),
        (["evaluate", "none", "--suite", "--gif", "a.gif"], "--suite does not accept --gif"),
        (["evaluate", "--policy", "exprt", "--suite"], "no player 'exprt', did you mean 'expert'"),
        (
            ["evaluate", "--policy", "a/b", "--env", "simple"],
            "--policy must be MODULE:FUNCTION or",
        ),
        (["train", "--budget", "0.1", "--out", "new"], "--budget needs --suite"),
        (["train", "--tasks", "simple", "--out", "new"], "--tasks needs --suite"),
        (["evaluate", "--policy", "idle", "--tasks", "simple"], "--tasks needs --suite"),
        (["score", "--suite", "r.json"], "must be small or large, not 'r.json'; files and folders"),
        (["score", "r.json", "--suite", "--reference", "f"], "either --suite or --reference"),
    ):
        assert main(words) == 2, words
        assert told in capsys.readouterr().err, words


@pytest.mark.usefixtures("two_tasks")
def test_seeds_of_an_own_policy_are_scored_together(capsys: pytest.CaptureFixture[str]) -> None:
    Path("my_seeds.py").write_text(
        "import jax\n"
        "def agent(env, params):\n"
        "    return lambda obs, key: jax.random.randint(key, (), 0, env.num_actions), None\n"
    )
    play = ["evaluate", "--policy", "my_seeds:agent", "--suite", "--episodes", "2"]
    score = ["score", "--suite", "--label", "mine", "0.json", "1.json"]
    for seed in (0, 1):
        assert main([*play, "--json", f"{seed}.json"]) == 0
    assert main(score) == 2
    assert "give each seed of a policy its own name" in capsys.readouterr().err
    for seed in (0, 1):
        assert main([*play, "--name", f"seed {seed}", "--json", f"{seed}.json"]) == 0
    capsys.readouterr()
    assert main(score) == 0
    assert re.search(r"simple +mine +2 +2 ", capsys.readouterr().out)
    for words, told in (
        (["evaluate", "--policy", "expert", "--suite", "--name", "a"], "--name needs --policy MOD"),
        (["evaluate", "runs", "--name", "a"], "--name needs --policy MODULE:FUNCTION"),
        ([*play, "--name", "a\nb"], "--name must be one line of text"),
    ):
        assert main(words) == 2, words
        assert told in capsys.readouterr().err, words


@pytest.mark.usefixtures("two_tasks")
def test_an_interrupted_evaluation_keeps_the_finished_tasks(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from jaxenstein.evaluation import evaluate_player

    def play(env: Any, *arguments: Any) -> Results:
        if env.name == "simple":
            raise KeyboardInterrupt
        return evaluate_player(env, *arguments)

    monkeypatch.setattr("jaxenstein.cli.suite.evaluate_player", play)
    words = ["evaluate", "--policy", "idle", "--suite", "--episodes", "2", "--json", "idle.json"]
    assert main(words) == 130
    assert "idle.json has 1 of 2 tasks" in capsys.readouterr().err
    (found,) = read_results("idle.json")
    assert found.environment.id == "t-maze"


@pytest.mark.usefixtures("two_tasks")
def test_evaluate_plays_only_the_named_tasks(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["evaluate", "--policy", "idle", "--suite", "--episodes", "2", "--json", "idle.json"]
    assert main([*words, "--tasks", "simple"]) == 0
    assert "warning" not in capsys.readouterr().err
    (found,) = read_results("idle.json")
    assert found.environment.id == "simple"


@pytest.mark.usefixtures("two_tasks")
def test_policy_is_checked_on_all_tasks_first(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def play(*_: object, **__: object) -> None:
        raise AssertionError("played")

    monkeypatch.setattr("jaxenstein.cli.suite.evaluate", play)
    Path("some_agent.py").write_text(
        "def agent(env, params):\n"
        "    return lambda obs, key: 0 if env.name == 't-maze' else 0.5, None\n"
    )
    assert main(["evaluate", "--policy", "some_agent:agent", "--suite"]) == 2
    assert "policy(obs, key) must be one whole number" in capsys.readouterr().err


def test_list_shows_every_task(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "--suite", "large"]) == 0
    shown = capsys.readouterr().out
    assert all(f"\n{task.id} " in f"\n{shown}" for task in suite.TASKS)
    assert "64x64" in shown
    assert "30,000,000 decisions" in shown
