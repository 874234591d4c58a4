"""Trained agents that act: as pure functions, in episodes, or in many environments."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from ...errors import SettingError, quoted
from ...seeds import key_of
from ..learner import PolicyCarry
from ..observations import observation_spec
from .description import described
from .folder import run_names
from .trained import Trained

if TYPE_CHECKING:
    from ...environment import AnyEnvironment
    from ...episodes.session import Session


class TrainedPolicy:
    """A trained agent.

    `apply` and `initial_carry` are the agent as a pure function, for `jaxenstein.evaluate` and your
    own loops. The agent itself is a policy for `jaxenstein.record`. `batch` acts in environments
    outside JAX.

    Attributes:
        env: the environment that the agent was trained in.
        params: the params of that environment.
        environment: the spec of that environment.
        name: name of the agent, for display.
        greedy: whether it takes the most likely action instead of sampling one.
    """

    def __init__(self, trained: Trained, run: int, greedy: bool) -> None:
        """Use the network of one run; call `load_policy` instead."""
        self._learner = trained.experiment.learner
        one = jax.tree.map(lambda leaf: np.asarray(leaf)[run], trained.params)
        self._weights = jax.device_put(one)
        self.env, self.params = self._learner.env, self._learner.env_params
        self.environment = trained.experiment.environment
        self.name = f"{trained.name} {run_names(trained.experiment)[run]}"
        self.greedy = greedy

    @functools.cached_property
    def apply(self) -> Callable[[PolicyCarry, Any, jax.Array], tuple[PolicyCarry, jax.Array]]:
        """The agent as a pure function of (carry, obs, key), for `jit`, `vmap` and `scan`.

        The arguments are those of a policy for `jaxenstein.evaluate`:

        - carry: `initial_carry()` at the start of an episode, then the carry returned before;
        - obs: one observation of `env`;
        - key: a random key, typed or uint32[2], to sample the action; a greedy agent ignores it.

        It returns the next carry and the action, int32[]. It is a `jax.tree_util.Partial` that
        holds the weights, so compiled programs take them as arguments, not as constants.
        """
        policy, greedy = self._learner.policy, self.greedy

        def apply(weights: Any, carry: PolicyCarry, obs: Any, key: jax.Array) -> tuple[Any, Any]:
            action, carry = policy(weights, obs, carry, None if greedy else key)
            return carry, action

        return jax.tree_util.Partial(apply, self._weights)

    def initial_carry(self) -> PolicyCarry:
        """The memory at the start of an episode, a tree of arrays; see `apply`."""
        return self._learner.initial_carry()

    @property
    def network(self) -> dict[str, Any]:
        """A description of the network, layer by layer, as plain JSON values; see `described`."""
        return described(self._learner)

    def check(self, env: AnyEnvironment, params: Any) -> None:
        """Check that the agent can act in an environment.

        Raises:
            SettingError: the actions or the shapes of observations differ.
        """
        acts, acted = (", ".join(one.action_names) for one in (env, self.env))
        if acts != acted:
            raise SettingError(
                f"{self.name} was trained with the actions {acted}, but "
                f"{quoted(env.name)} has {acts}"
            )
        here, there = observation_spec(env, params), self._learner.spec
        if here != there:
            shapes = [[list(part.shape) for part in spec.parts] for spec in (there, here)]
            raise SettingError(
                f"{self.name} was trained on observations {shapes[0]}, but those of "
                f"{quoted(env.name)} are {shapes[1]}; use the same size and kind of image"
            )

    def batch(self, size: int, *, seed: int = 0) -> BatchPolicy:
        """The agent for several environments at once, with a separate memory for each.

        Args:
            size: number of environments.
            seed: seed for sampled actions.
        """
        key = None if self.greedy else key_of(seed)
        carry = jax.tree.map(lambda leaf: jnp.stack([leaf] * size), self._learner.initial_carry())
        return BatchPolicy(functools.partial(self._learner.act, self._weights), carry, key)

    def __call__(self, session: Session) -> int:
        """The next action."""
        carry = self._carry if session.actions else self.initial_carry()
        self._carry, action = self.apply(carry, session.observation, session.policy_key())
        return int(action)


class BatchPolicy:
    """A trained agent in several environments at once; see `TrainedPolicy.batch`."""

    def __init__(self, act: Callable[..., Any], carry: Any, key: jax.Array | None) -> None:
        """Build from `Learner.act` with its weights, the initial carry, and a key for sampling."""
        self._act, self._carry, self._key, self._steps = act, carry, key, 0

    def act(self, observations: Any, first: ArrayLike) -> np.ndarray:
        """The next actions.

        Args:
            observations: stacked observations of all environments, as NumPy or JAX arrays.
            first: bool[N], whether each observation is the first of an episode.

        Returns:
            int32[N].
        """
        carry = self._carry.replace(first=self._carry.first | jnp.asarray(first, bool))
        key = None if self._key is None else jax.random.fold_in(self._key, self._steps)
        actions, self._carry = self._act(observations, carry, key)
        self._steps += 1
        return np.asarray(actions)
