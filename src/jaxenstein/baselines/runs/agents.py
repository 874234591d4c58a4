"""Trained agents: out of a run directory, into episodes and tables."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np

from ...errors import SettingError
from ..learning.observations import observation_spec
from .bootstrap import Interval, mean_interval
from .folder import RunFolder, final_state, run_names
from .metrics import METRICS, read_metrics

if TYPE_CHECKING:
    from ...episodes.session import Session
    from ..learning.learner import PolicyCarry


class TrainedPolicy:
    """Acts as an agent that was trained; a policy of `jaxenstein.episodes`.

    Its memory begins anew where an episode does.

    Attributes:
        env: the environment that it was trained in.
        params: its params.
        recipe: how that environment is built.
        name: which agent it is, for people.
        greedy: whether it takes the most likely action instead of drawing one.
    """

    def __init__(self, folder: RunFolder, params: Any, name: str, greedy: bool) -> None:
        """Take a run directory and the network's parameters of one run; see `load_policy`."""
        self._learner = folder.experiment.learner
        self._weights = params
        self._carry = self._learner.initial_carry()
        self.env, self.params = self._learner.env, self._learner.env_params
        self.recipe = folder.experiment.recipe
        self.name = name
        self.greedy = greedy

    def check(self, env: Any, params: Any) -> None:
        """Make sure that it can act in an environment.

        Raises:
            SettingError: there are other actions, or observations of another shape.
        """
        if env.num_actions != self.env.num_actions:
            raise SettingError(
                f"{self.name} was trained with {self.env.num_actions} actions, and "
                f"{env.name!r} has {env.num_actions}"
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

        def act(obs: Any, carry: PolicyCarry, key: Any) -> Any:
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

    def __init__(self, act: Callable[..., Any], carry: PolicyCarry, size: int, key: Any) -> None:
        """Take what acts, the memory at the beginning of an episode, and how many there are."""
        self._act, self._key, self._steps = act, key, 0
        self._fresh = jax.tree.map(lambda leaf: jnp.stack([leaf] * size), carry)
        self._carry = self._fresh

    def act(self, observations: Any, first: Any) -> np.ndarray:
        """The next actions.

        Args:
            observations: those of all environments, stacked, as arrays of NumPy or JAX.
            first: bool[N], where an observation is the first one of an episode.

        Returns:
            int32[N].
        """
        fresh = jnp.asarray(first, bool)
        carry = jax.tree.map(
            lambda new, old: jnp.where(fresh.reshape(-1, *[1] * (old.ndim - 1)), new, old),
            self._fresh,
            self._carry,
        )
        key = None if self._key is None else jax.random.fold_in(self._key, self._steps)
        actions, self._carry = self._act(observations, carry, key)
        self._steps += 1
        return np.asarray(actions)


def load_policy(path: str | Path, run: int | None = None, *, greedy: bool = False) -> TrainedPolicy:
    """The agent of a run directory, as its newest checkpoint has it.

    Args:
        path: the run directory.
        run: which of its runs, from 0, in the order of seeds and grid; None: the best one.
        greedy: take the most likely action instead of drawing one.

    Raises:
        SettingError: there is no such run, or it has no checkpoint that can be read.
    """
    folder = RunFolder.open(path)
    names = run_names(folder.experiment)
    run = best_run(folder) if run is None else run
    if not 0 <= run < len(names):
        raise SettingError(f"{path} has runs 0 to {len(names) - 1}, not {run!r}")
    _, state = final_state(folder)
    weights = jax.tree.map(lambda leaf: leaf[run], state.params)
    return TrainedPolicy(folder, weights, f"{folder.path.name} {names[run]}", greedy)


def best_run(folder: RunFolder) -> int:
    """The run with the highest mean return over the last tenth of its updates so far.

    Of equal ones it is that with the shortest episodes; the first one where there are no metrics.
    """
    if not (folder.path / METRICS).exists():
        return 0
    rows, many = read_metrics(folder.path), len(folder.experiment.runs)
    last = rows[-many * max(1, len(rows) // many // 10) :]
    sums = {
        name: np.array([sum(row.get(name) or 0 for row in last[run::many]) for run in range(many)])
        for name in ("episodes", "return_sum", "length_sum")
    }
    with np.errstate(invalid="ignore", divide="ignore"):
        returns, lengths = (sums[name] / sums["episodes"] for name in ("return_sum", "length_sum"))
    return int(np.lexsort((lengths, -np.nan_to_num(returns, nan=-np.inf)))[0])


@dataclasses.dataclass(frozen=True)
class Result:
    """How one way of acting did, over all runs of a directory.

    Attributes:
        greedy: whether the most likely actions were taken.
        returns: float32[runs, episodes], undiscounted.
        lengths: int32[runs, episodes], steps.
        successes: bool[runs, episodes].
    """

    greedy: bool
    returns: np.ndarray
    lengths: np.ndarray
    successes: np.ndarray

    @property
    def best(self) -> int:
        """The run with the highest mean return; of equal ones that with the shortest episodes."""
        order = np.lexsort((self.lengths.mean(axis=1), -self.returns.mean(axis=1)))
        return int(order[0])

    def interval(self, values: np.ndarray) -> Interval:
        """Mean of values[runs, episodes] with a 95 % bootstrap interval.

        With several runs these are drawn, and episodes within them; with one, episodes alone.
        """
        return mean_interval(np.asarray(values, np.float64))

    def to_json(self, names: Sequence[str]) -> dict[str, Any]:
        """As plain JSON values, with every run's means by its name."""
        fields = {"return": self.returns, "length": self.lengths, "success": self.successes}
        overall = {name: dataclasses.asdict(self.interval(v)) for name, v in fields.items()}
        runs = {
            run: {name: float(np.mean(values[number])) for name, values in fields.items()}
            for number, run in enumerate(names)
        }
        return {"episodes": int(self.returns.shape[1]), **overall, "runs": runs}


def evaluate(
    folder: RunFolder, *, episodes: int = 100, seed: int = 0, greedy: bool = False
) -> Result:
    """Play whole episodes with the agents of a run directory, all on the same draws.

    Args:
        folder: the run directory.
        episodes: of each run.
        seed: of the draws.
        greedy: take the most likely action instead of drawing one.

    Raises:
        SettingError: there is no checkpoint that can be read.
    """
    _, state = final_state(folder)
    key = jax.random.key(seed, impl="threefry2x32")
    played = folder.experiment.learner.many.evaluate(state.params, key, episodes, greedy)
    played = jax.device_get(played)
    return Result(greedy, played.episode_return, played.episode_length, played.success)


def evaluate_in_game(
    folder: RunFolder,
    *,
    episodes: int = 100,
    seed: int = 0,
    greedy: bool = False,
    notify: Callable[[int], object] = lambda done: None,
) -> Result:
    """As `evaluate` in the running ViZDoom, whose scenario the environment is.

    Args:
        folder: the run directory.
        episodes: of each run.
        seed: of the draws.
        greedy: take the most likely action instead of drawing one.
        notify: called with the number of episodes played so far, over all runs.

    Raises:
        SettingError: there is no checkpoint that can be read, or ViZDoom has no such scenario.
    """
    from ...adapters.vizdoom import play_game

    _, state = final_state(folder)
    games = []
    for number, name in enumerate(run_names(folder.experiment)):
        weights = jax.tree.map(lambda leaf, number=number: leaf[number], state.params)
        policy = TrainedPolicy(folder, weights, name, greedy)
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
