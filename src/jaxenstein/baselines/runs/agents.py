"""Trained agents: out of a run directory, into episodes and tables."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from ...errors import SettingError
from ...files import check_writable
from ..learning.observations import observation_spec
from .folder import RunFolder, run_names
from .metrics import METRICS, read_metrics, rows_by_run
from .result import Result
from .trained import SUFFIX, Trained, Weights, load_trained, write_trained

if TYPE_CHECKING:
    from ...environment import AnyEnvironment
    from ...episodes.session import Session
    from ..learning.learner import PolicyCarry

    Act = Callable[[Any, PolicyCarry, jax.Array | None], tuple[jax.Array, PolicyCarry]]

WAYS = {"greedy": True, "sampled": False}
"""Ways of acting, and whether they take the most likely action."""


class TrainedPolicy:
    """Acts as an agent that was trained; a policy of `jaxenstein.episodes`.

    Its memory begins anew where an episode does.

    Attributes:
        env: the environment that it was trained in.
        params: its params.
        spec: how that environment is built.
        name: which agent it is, for people.
        greedy: whether it takes the most likely action instead of drawing one.
    """

    def __init__(self, trained: Trained, run: int, greedy: bool) -> None:
        """Take the networks and which of them acts; see `load_policy`."""
        self._learner = trained.experiment.learner
        one = jax.tree.map(lambda leaf: np.asarray(leaf)[run], trained.params)
        self._weights = jax.device_put(one)
        self._carry = self._learner.initial_carry()
        self.env, self.params = self._learner.env, self._learner.env_params
        self.spec = trained.experiment.spec
        self.name = f"{trained.name} {run_names(trained.experiment)[run]}"
        self.greedy = greedy

    def check(self, env: AnyEnvironment, params: Any) -> None:
        """Make sure that it can act in an environment.

        Raises:
            SettingError: there are other actions, or observations of another shape.
        """
        acts, acted = (", ".join(one.action_names) for one in (env, self.env))
        if acts != acted:
            raise SettingError(
                f"{self.name} was trained with the actions {acted}, and {env.name!r} has {acts}"
            )
        here, there = observation_spec(env, params), self._learner.spec
        if here != there:
            shapes = [[list(part.shape) for part in spec.parts] for spec in (there, here)]
            raise SettingError(
                f"{self.name} was trained on observations {shapes[0]}, and those of "
                f"{env.name!r} are {shapes[1]}; take the same size and kind of image"
            )

    def batch(self, size: int, *, seed: int = 0) -> BatchPolicy:
        """The same agent for several environments at once, each with a memory of its own.

        Args:
            size: how many.
            seed: of the actions, if they are drawn.
        """

        def act(
            obs: Any, carry: PolicyCarry, key: jax.Array | None
        ) -> tuple[jax.Array, PolicyCarry]:
            return self._learner.act(self._weights, obs, carry, key)

        key = None if self.greedy else jax.random.key(seed, impl="threefry2x32")
        return BatchPolicy(act, self._learner.initial_carry(), size, key)

    def __call__(self, session: Session) -> int:
        """The next action."""
        if not session.actions:
            self._carry = self._learner.initial_carry()
        key = None if self.greedy else session.policy_key()
        action, self._carry = self._learner.policy(
            self._weights, session.observation, self._carry, key
        )
        return int(action)


class BatchPolicy:
    """Acts as a trained agent in several environments at once; see `TrainedPolicy.batch`."""

    def __init__(self, act: Act, carry: PolicyCarry, size: int, key: jax.Array | None) -> None:
        """Take what acts, the memory at the beginning of an episode, and how many there are."""
        self._act, self._key, self._steps = act, key, 0
        self._carry = jax.tree.map(lambda leaf: jnp.stack([leaf] * size), carry)

    def act(self, observations: Any, first: ArrayLike) -> np.ndarray:
        """The next actions.

        Args:
            observations: those of all environments, stacked, as arrays of NumPy or JAX.
            first: bool[N], where an observation is the first one of an episode.

        Returns:
            int32[N].
        """
        carry = self._carry.replace(first=self._carry.first | jnp.asarray(first, bool))
        key = None if self._key is None else jax.random.fold_in(self._key, self._steps)
        actions, self._carry = self._act(observations, carry, key)
        self._steps += 1
        return np.asarray(actions)


def load_policy(path: str | Path, run: int | None = None, *, greedy: bool = False) -> TrainedPolicy:
    """The agent of a run directory, as its newest checkpoint has it, or of a file.

    Args:
        path: the run directory, a file of `export_policy`, or `pretrained/NAME`, an agent that
            comes with this package; `jaxenstein list --pretrained` names them.
        run: which of its runs, from 0, in the order of seeds and grid; None: the best one.
        greedy: take the most likely action instead of drawing one.

    Raises:
        SettingError: there is no such run or agent, or it cannot be read.
    """
    trained = load_trained(path)
    return TrainedPolicy(trained, chosen_run(trained, run), greedy)


def export_policy(
    path: str | Path,
    out: str | Path,
    run: int | None = None,
    *,
    weights: Weights = "float16",
    episodes: int = 100,
    seed: int = 0,
    notify: Callable[[float], object] = lambda done: None,
) -> dict[str, Result]:
    """Write one agent of a run directory into a file of its own, with what it achieves.

    Args:
        path: as of `load_policy`.
        out: the file, which ends in `.npz`.
        run: as of `load_policy`.
        weights: precision of its numbers; the agent of the file is the one that is evaluated.
        episodes: to evaluate it by, greedy and sampled.
        seed: of their draws.
        notify: called with the number of episodes played so far, of `2 * episodes`.

    Returns:
        How it did, by `"greedy"` and `"sampled"`.

    Raises:
        SettingError: as of `load_policy`, or the file is called otherwise.
        OutputError: it cannot be written.
    """
    out = Path(out)
    if out.suffix != SUFFIX:
        raise SettingError(f"{out} should end in {SUFFIX}")
    check_writable(out)
    trained = load_trained(path)
    agent = trained.one(chosen_run(trained, run))
    rounded = lambda leaf: leaf.astype(weights).astype(np.float32)  # noqa: E731
    agent = dataclasses.replace(agent, params=jax.tree.map(rounded, agent.params))
    results = evaluate_both(agent, episodes=episodes, seed=seed, notify=notify)
    names = run_names(agent.experiment)
    score = {name: result.to_json(names) for name, result in results.items()}
    write_trained(out, agent, weights, score)
    return results


def chosen_run(trained: Trained, run: int | None) -> int:
    """The run of that number, by default the best one.

    Raises:
        SettingError: there is none.
    """
    if run is None:
        return best_run(trained.folder) if trained.folder else 0
    many = len(trained.experiment.runs)
    if not 0 <= run < many:
        raise SettingError(f"{trained.name} has runs 0 to {many - 1}, not {run!r}")
    return run


def best_run(folder: RunFolder) -> int:
    """The run with the highest mean return over the last tenth of its updates so far.

    Of equal ones it is that with the shortest episodes; the first one where there are no metrics.
    """
    if not (folder.path / METRICS).exists():
        return 0
    by_run = rows_by_run(read_metrics(folder.path), len(folder.experiment.runs))
    last = max(1, len(by_run[0]) // 10)
    sums = {
        name: np.array([sum(row.get(name) or 0 for row in rows[-last:]) for rows in by_run])
        for name in ("episodes", "return_sum", "length_sum")
    }
    with np.errstate(invalid="ignore", divide="ignore"):
        returns, lengths = (sums[name] / sums["episodes"] for name in ("return_sum", "length_sum"))
    return int(np.lexsort((lengths, -np.nan_to_num(returns, nan=-np.inf)))[0])


def evaluate_both(
    trained: Trained,
    *,
    episodes: int = 100,
    seed: int = 0,
    notify: Callable[[float], object] = lambda done: None,
) -> dict[str, Result]:
    """As `evaluate`, `"greedy"` and then `"sampled"`."""
    results = {}
    for name, greedy in WAYS.items():
        before = len(results) * episodes * len(trained.experiment.runs)
        results[name] = evaluate(
            trained,
            episodes=episodes,
            seed=seed,
            greedy=greedy,
            notify=lambda done, before=before: notify(before + done),
        )
    return results


def evaluate(
    trained: Trained,
    *,
    episodes: int = 100,
    seed: int = 0,
    greedy: bool = False,
    notify: Callable[[float], object] = lambda done: None,
) -> Result:
    """Play whole episodes with all agents, on the same draws.

    Args:
        trained: their networks.
        episodes: of each run.
        seed: of the draws.
        greedy: take the most likely action instead of drawing one.
        notify: called with the number of episodes played so far, over all runs; one that goes on
            counts as its part of the time limit.
    """
    key = jax.random.key(seed, impl="threefry2x32")
    learner = trained.experiment.learner
    longest = np.asarray(learner.env.most_steps(learner.env_params))
    played = learner.many.evaluate(
        trained.params,
        key,
        episodes,
        greedy,
        lambda running, length: notify(float(np.where(running, length / longest, 1).sum())),
    )
    played = jax.device_get(played)
    return Result(greedy, played.episode_return, played.episode_length, played.success)


def evaluate_in_game(
    trained: Trained,
    *,
    episodes: int = 100,
    seed: int = 0,
    greedy: bool = False,
    notify: Callable[[int], object] = lambda done: None,
) -> Result:
    """As `evaluate` in the running ViZDoom, whose scenario the environment is.

    Args:
        trained: their networks.
        episodes: of each run.
        seed: of the draws.
        greedy: take the most likely action instead of drawing one.
        notify: called with the number of episodes played so far, over all runs.

    Raises:
        SettingError: ViZDoom has no such scenario.
    """
    from ...adapters.vizdoom import play_game

    games = []
    for number in range(len(trained.experiment.runs)):
        policy = TrainedPolicy(trained, number, greedy)
        before = number * episodes
        games.append(
            play_game(
                policy.env,
                policy.params,
                policy,
                episodes=episodes,
                seed=seed,
                notify=lambda done, before=before: notify(before + done),
            )
        )
    returns, lengths, successes = (
        np.stack([getattr(game, field) for game in games])
        for field in ("returns", "lengths", "successes")
    )
    return Result(greedy, returns, lengths, successes)
