"""Training on an environment: chunks of updates in one compiled program, evaluation, acting."""

from __future__ import annotations

import functools
from typing import Any

import jax
import jax.numpy as jnp

from ...errors import SettingError
from ...pytree import PyTreeNode
from .bonus import Metrics
from .config import Config
from .evaluation import Evaluation
from .hparams import HParams
from .loop import Loop
from .many import ManyRuns
from .networks import ActorCritic, layers_for
from .observations import observation_spec
from .simulator import GymnaxSimulator, make_simulator, most_truncations
from .state import TrainState, key_data, wrap_key


class PolicyCarry(PyTreeNode):
    """What a policy remembers between two steps of one episode.

    Attributes:
        memory: float32[hidden].
        previous: int32[], the last action.
        first: bool[], whether the episode begins.
    """

    memory: jax.Array
    previous: jax.Array
    first: jax.Array


class Learner:
    """Trains on one environment with one config.

    All functions are pure and compiled on their first call for each shape. `many` has the same
    functions for many runs at once.

    Attributes:
        env: the environment.
        env_params: its params.
        config: the static settings.
        network: the recurrent network; `network.unroll` for whole sequences.
        bonus: the exploration bonus.
    """

    def __init__(self, env: Any, env_params: Any, config: Config) -> None:
        """Build the training loop of an environment.

        Args:
            env: an environment of `jaxenstein.make` with any `autoreset`, or one of gymnax'
                contract of six values whose `info` has `final_observation`.
            env_params: its params; fixed into the program.
            config: the static settings.

        Raises:
            SettingError: the environment and the config do not fit.
        """
        self.env, self.env_params, self.config = env, env_params, config
        self.simulator = make_simulator(env, env_params)
        self.spec = observation_spec(env, env_params)
        for shape in self.spec.images:
            layers_for(shape, config.convolutions)
        actions = self.simulator.num_actions
        self.bonus = config.algorithm.bonus(self.spec, actions, config)
        self.network = ActorCritic(
            self.spec, actions, self.bonus.value_heads, config, config.compute_dtype
        )
        self._check()
        skip = self.simulator.frame_skip
        slots, clocks = 0, None
        if config.bootstrap_truncation:
            slots = most_truncations(env_params, config.rollout, skip)
        if config.random_clocks:
            clocks = env.most_steps(env_params), skip
        self.loop = Loop(
            config=config,
            simulator=self.simulator,
            network=self.network,
            bonus=self.bonus,
            slots=slots,
            discount=getattr(env_params, "discount", 0.99),
            clocks=clocks,
        )
        self._start = jax.jit(self.loop.start)
        self._train = jax.jit(self.loop.updates, static_argnames="number")
        self._policy = jax.jit(self._act_one)
        self._actions = jax.jit(self._act)

    def init(self, key: jax.Array, hparams: HParams | None = None) -> TrainState:
        """Begin a run.

        Args:
            key: a random key, typed or old: the run's seed.
            hparams: its numbers; None for the defaults. They are only checked here, and passed
                to every `train_chunk`.

        Raises:
            SettingError: a number is out of range.
        """
        self.loop.numbers(hparams)
        return self._start(key_data(key))

    def train_chunk(
        self, state: TrainState, hparams: HParams | None, updates: int
    ) -> tuple[TrainState, Metrics]:
        """Train for some updates in one compiled program.

        Two chunks of one update are the same as one chunk of two, bit for bit on a CPU.

        Args:
            state: where to go on.
            hparams: the run's numbers; None for the defaults.
            updates: how many updates; each number compiles anew.

        Returns:
            The state, and metrics [updates]: sums over the episodes that ended (`episodes`,
            `return_sum`, `return_square_sum`, `length_sum`, `successes`), the losses, and what
            explains a run that fails; all are listed at `loop.Loop.update`.
        """
        return self._train(state, self.loop.numbers(hparams), number=updates)

    def evaluate(
        self, params: Any, key: jax.Array, episodes: int, greedy: bool = False
    ) -> Evaluation:
        """Play whole episodes, all at once, each in an environment of its own.

        Args:
            params: `TrainState.params`.
            key: a random key.
            episodes: how many.
            greedy: take the most likely action instead of drawing one.
        """
        several = jax.tree.map(lambda leaf: leaf[None], params)
        played = self.many.evaluate(several, key, episodes, greedy)
        return jax.tree.map(lambda leaf: leaf[0], played)

    def initial_carry(self) -> PolicyCarry:
        """The policy's memory at the beginning of an episode."""
        memory = self.network.initial_memory(1)[0]
        return PolicyCarry(memory, jnp.int32(-1), jnp.bool_(True))

    def policy(
        self, params: Any, obs: Any, carry: PolicyCarry, key: jax.Array | None = None
    ) -> tuple[jax.Array, PolicyCarry]:
        """Act in one environment.

        Args:
            params: `TrainState.params`.
            obs: one observation.
            carry: `initial_carry()` at the beginning of an episode, then what was returned.
            key: to draw the action with; None for the most likely one.

        Returns:
            int32[] action, and the next carry.
        """
        return self._policy(params, obs, carry, None if key is None else key_data(key))

    def act(
        self, params: Any, obs: Any, carry: PolicyCarry, key: jax.Array | None = None
    ) -> tuple[jax.Array, PolicyCarry]:
        """As `policy` in `N` environments at once, along a leading axis of `obs` and `carry`.

        Returns:
            int32[N] actions, and the next carry.
        """
        return self._actions(params, obs, carry, None if key is None else key_data(key))

    @functools.cached_property
    def many(self) -> ManyRuns:
        """The same functions for many runs at once, along a leading axis of everything."""
        return ManyRuns(self.loop)

    def _check(self) -> None:
        if not isinstance(self.simulator, GymnaxSimulator):
            return
        if self.config.bootstrap_truncation and not self.simulator.has_final:
            raise SettingError(
                "step of this environment gives no info['final_observation'], which the value at "
                "a time limit is taken from; take an environment that does, or set "
                "bootstrap_truncation=False"
            )
        if self.config.random_clocks:
            raise SettingError(
                "random_clocks needs an environment of this package: it sets the clock of states"
            )

    def _act_one(
        self, params: Any, obs: Any, carry: PolicyCarry, data: jax.Array | None
    ) -> tuple[jax.Array, PolicyCarry]:
        obs, carry = jax.tree.map(lambda leaf: jnp.asarray(leaf)[None], (obs, carry))
        return jax.tree.map(lambda leaf: leaf[0], self._act(params, obs, carry, data))

    def _act(
        self, params: Any, obs: Any, carry: PolicyCarry, data: jax.Array | None
    ) -> tuple[jax.Array, PolicyCarry]:
        logits, _, memory = self.network.step(
            params, obs, carry.previous, carry.first, carry.memory
        )
        if data is None:
            action = jnp.argmax(logits, axis=-1).astype(jnp.int32)
        else:
            action = jax.random.categorical(wrap_key(data), logits).astype(jnp.int32)
        return action, PolicyCarry(memory, action, jnp.zeros_like(carry.first))
