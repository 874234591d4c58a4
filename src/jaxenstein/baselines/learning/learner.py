"""The training loop: one update, chunks of updates in one compiled program, many runs at once."""

from __future__ import annotations

import functools
from typing import Any

import jax
import jax.numpy as jnp

from ...environment import Environment
from ...errors import SettingError
from ...pytree import PyTreeNode
from ..bonuses.icm import ICM
from ..bonuses.rnd import RND
from . import optimiser
from .bonus import Bonus, NoBonus
from .config import Config, HParams
from .evaluation import Evaluation, evaluate
from .loop import Loop
from .many import ManyRuns
from .networks import ActorCritic, layers_for
from .observations import ObservationSpec, observation_spec
from .rollout import start
from .simulator import GymnaxSimulator, make_simulator, most_truncations
from .state import Metrics, TrainState, key_data, wrap_key


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


def make_bonus(config: Config, spec: ObservationSpec, actions: int) -> Bonus:
    """The exploration bonus of an algorithm."""
    if config.algo == "rnd":
        return RND(spec, config)
    if config.algo == "icm":
        return ICM(spec, actions, config)
    return NoBonus()


def make_learner(env: Any, env_params: Any, config: Config, bonus: Bonus | None = None) -> Learner:
    """Build the training loop of an environment.

    Args:
        env: an environment of `jaxenstein.make` with any `autoreset`, or one of gymnax' contract
            of six values whose `info` has `final_observation`.
        env_params: its params; fixed into the program.
        config: the static settings.
        bonus: an exploration bonus of one's own, in the place of the algorithm's.

    Raises:
        SettingError: the environment and the config do not fit.
    """
    return Learner(env, env_params, config, bonus)


class Learner:
    """Trains on one environment with one config; see `make_learner`.

    All functions are pure and compiled on their first call for each shape. `many` has the same
    functions for many runs at once.

    Attributes:
        env: the environment.
        env_params: its params.
        config: the static settings.
        network: the recurrent network; `network.unroll` for whole sequences.
        bonus: the exploration bonus.
    """

    def __init__(
        self, env: Any, env_params: Any, config: Config, bonus: Bonus | None = None
    ) -> None:
        """Build; see `make_learner`."""
        self.env, self.env_params, self.config = env, env_params, config
        self.simulator = make_simulator(env, env_params)
        self.spec = observation_spec(env, env_params)
        for shape in self.spec.images:
            layers_for(shape, config.convolutions)
        actions = self.simulator.num_actions
        self.bonus = bonus or make_bonus(config, self.spec, actions)
        self.network = ActorCritic(
            self.spec, actions, self.bonus.value_heads, config, config.compute_dtype
        )
        self._check()
        self._frame_skip = env.frame_skip if isinstance(env, Environment) else 1
        slots = 0
        if config.bootstrap_truncation:
            slots = most_truncations(env_params, config.rollout, self._frame_skip)
        self.loop = Loop(config, self.simulator, self.network, self.bonus, slots)
        self._init = jax.jit(self._start)
        self._train = jax.jit(self._chunk, static_argnames="updates")
        self._evaluate = jax.jit(self._play, static_argnames=("episodes", "greedy"))
        self._policy = jax.jit(self._act)

    def init(self, key: jax.Array, hparams: HParams | None = None) -> TrainState:
        """Begin a run.

        Args:
            key: a random key, typed or old: the run's seed.
            hparams: its numbers; None for the defaults. They are only checked here, and passed
                to every `train_chunk`.

        Raises:
            SettingError: a number is out of range.
        """
        (hparams or HParams()).check()
        return self._init(key_data(key))

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
        return self._train(state, (hparams or HParams()).check(), updates=updates)

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
        return self._evaluate(params, key_data(key), episodes=episodes, greedy=greedy)

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

    @functools.cached_property
    def many(self) -> ManyRuns:
        """The same functions for many runs at once, along a leading axis of everything."""
        return ManyRuns(self)

    def discount(self, hparams: HParams) -> jax.Array:
        """The discount of the rewards: `hparams.gamma`, or the environment's own."""
        gamma = hparams.gamma
        if gamma is None:
            gamma = getattr(self.env_params, "discount", 0.99)
        return jnp.asarray(gamma, jnp.float32)

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

    def _start(self, data: jax.Array) -> TrainState:
        params_key, bonus_key, env_key, key = jax.random.split(wrap_key(data), 4)
        params, bonus = self.network.init(params_key), self.bonus.init(bonus_key)
        clocks = None
        if self.config.random_clocks:
            clocks = self.env.most_steps(self.env_params), self._frame_skip
        number = self.config.num_envs
        return TrainState(
            key=jax.random.key_data(key),
            update=jnp.int32(0),
            params=params,
            optimiser=optimiser.init(params),
            bonus=bonus,
            actors=start(self.simulator, self.network, env_key, number, clocks),
        )

    def _chunk(
        self, state: TrainState, hparams: HParams, updates: int
    ) -> tuple[TrainState, Metrics]:
        gamma = self.discount(hparams)
        bonus_gamma = gamma if hparams.bonus_gamma is None else hparams.bonus_gamma
        hparams = hparams.replace(gamma=gamma, bonus_gamma=bonus_gamma)
        return jax.lax.scan(lambda s, _: self.loop.update(s, hparams), state, length=updates)

    def _play(self, params: Any, data: jax.Array, episodes: int, greedy: bool) -> Evaluation:
        return evaluate(self.simulator, self.network, params, wrap_key(data), episodes, greedy)

    def _act(
        self, params: Any, obs: Any, carry: PolicyCarry, data: jax.Array | None
    ) -> tuple[jax.Array, PolicyCarry]:
        batch = jax.tree.map(lambda leaf: jnp.asarray(leaf)[None], (obs, carry))
        obs, carry = batch
        logits, _, memory = self.network.step(
            params, obs, carry.previous, carry.first, carry.memory
        )
        if data is None:
            action = jnp.argmax(logits[0]).astype(jnp.int32)
        else:
            action = jax.random.categorical(wrap_key(data), logits[0]).astype(jnp.int32)
        return action, PolicyCarry(memory[0], action, jnp.bool_(False))
