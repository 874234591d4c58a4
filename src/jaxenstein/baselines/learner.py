"""Trains on an environment in one compiled program; evaluates agents and acts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..environment import Environment
from ..errors import SettingError
from ..evaluation import Evaluation, Playing, play_out
from ..params import split_ranges
from ..pytree import PyTreeNode
from .bonus import Metrics
from .config import Config, HParams
from .evaluation import advance, begin
from .loop import Loop
from .networks import ActorCritic, layers_for
from .observations import observation_spec
from .simulator import GymnaxSimulator, make_simulator, most_truncations
from .state import TrainState, key_data, wrap_key


class PolicyCarry(PyTreeNode):
    """The memory of a policy between two steps of an episode.

    Attributes:
        memory: float32[hidden].
        previous: int32[], the last action.
        first: bool[], whether the next step is the first of an episode.
    """

    memory: jax.Array
    previous: jax.Array
    first: jax.Array


class Learner:
    """Trains on one environment with one config.

    All functions are pure, and compiled on their first call for each shape.

    Attributes:
        env: the environment.
        env_params: its params.
        config: the static settings.
        network: the recurrent network; `network.unroll` processes whole sequences.
        bonus: the exploration bonus.
        many: the same functions for many runs at once, along a leading axis.
    """

    def __init__(self, env: Any, env_params: Any, config: Config) -> None:
        """Build the training loop of an environment.

        Args:
            env: an environment from `jaxenstein.make` with any `autoreset`, or a gymnax
                environment whose `step` returns six values, with `final_observation` in `info`.
            env_params: its params, which become constants of the program; None for the default
                params of an environment of this package. Each episode draws its own value for a
                param that is a range.
            config: the static settings.

        Raises:
            SettingError: the config does not suit the environment.
        """
        if env_params is None and isinstance(env, Environment):
            env_params = env.default_params
        self.env: Any = env
        self.env_params: Any = env_params
        self.config = config
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
            if isinstance(env, Environment) and type(env).time_is_up is not Environment.time_is_up:
                slots = config.rollout
        if config.random_clocks:
            clocks = env.most_steps(split_ranges(env_params)[0]), skip
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
        self.many = ManyRuns(self.loop)

    def init(self, key: jax.Array, hparams: HParams | None = None) -> TrainState:
        """Begin a run.

        Args:
            key: a random key, typed or raw.
            hparams: the hyperparameters; None for the defaults. They are only checked here; pass
                them to every `train_chunk`.

        Raises:
            SettingError: a number is out of range.
        """
        self.loop.numbers(hparams)
        return self._start(key_data(key))

    def train_chunk(
        self, state: TrainState, hparams: HParams | None, updates: int
    ) -> tuple[TrainState, Metrics]:
        """Train for some updates in one compiled program.

        Two chunks of one update give the same result as one chunk of two, bit for bit on a CPU.

        Args:
            state: the state after the last update.
            hparams: the hyperparameters; None for the defaults.
            updates: number of updates; each number compiles another program.

        Returns:
            The new state, and metrics [updates]; `loop.Loop.update` lists them.
        """
        return self._train(state, self.loop.numbers(hparams), number=updates)

    def evaluate(
        self, params: Any, key: jax.Array, episodes: int, greedy: bool = False
    ) -> Evaluation:
        """Play whole episodes in parallel, each in its own environment.

        Args:
            params: `TrainState.params`.
            key: a random key.
            episodes: number of episodes.
            greedy: take the most likely action instead of sampling one.
        """
        several = jax.tree.map(lambda leaf: leaf[None], params)
        played = self.many.evaluate(several, key, episodes, greedy)
        return jax.tree.map(lambda leaf: leaf[0], played)

    def initial_carry(self) -> PolicyCarry:
        """The policy's memory at the start of an episode."""
        memory = self.network.initial_memory(1)[0]
        return PolicyCarry(memory, jnp.int32(-1), jnp.bool_(True))

    def policy(
        self, params: Any, obs: Any, carry: PolicyCarry, key: jax.Array | None = None
    ) -> tuple[jax.Array, PolicyCarry]:
        """Act in one environment.

        Args:
            params: `TrainState.params`.
            obs: one observation.
            carry: `initial_carry()` at the start of an episode, then the carry returned before.
            key: samples the action; None takes the most likely one.

        Returns:
            int32[] action, and the next carry.
        """
        return self._policy(params, obs, carry, None if key is None else key_data(key))

    def act(
        self, params: Any, obs: Any, carry: PolicyCarry, key: jax.Array | None = None
    ) -> tuple[jax.Array, PolicyCarry]:
        """Like `policy`, in `N` environments at once, along a leading axis of `obs` and `carry`.

        Returns:
            int32[N] actions, and the next carry.
        """
        return self._actions(params, obs, carry, None if key is None else key_data(key))

    def _check(self) -> None:
        if not isinstance(self.simulator, GymnaxSimulator):
            return
        if self.config.bootstrap_truncation and not self.simulator.has_final:
            raise SettingError(
                "step of this environment returns no info['final_observation'], which "
                "bootstrap_truncation needs; use another environment, or set "
                "bootstrap_truncation=False"
            )
        if self.config.random_clocks:
            raise SettingError(
                "random_clocks needs an environment of this package, since it sets state.time"
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


class ManyRuns:
    """Parallel runs in one program: every argument and result has a leading axis [R].

    A run gives the same result as when it is trained alone, up to rounding.
    """

    def __init__(self, loop: Loop) -> None:
        """Build from the loop of one run."""

        def train(state: TrainState, hparams: HParams, updates: int) -> tuple[TrainState, Metrics]:
            return jax.vmap(lambda s, h: loop.updates(s, h, updates))(state, hparams)

        def first(data: jax.Array, runs: int, episodes: int) -> Playing:
            return begin(loop.simulator, loop.network, wrap_key(data), runs, episodes)

        def play(params: Any, data: jax.Array, *rest: Any) -> Playing:
            return advance(loop.simulator, loop.network, params, wrap_key(data), *rest)

        self._loop = loop
        self._start = jax.jit(loop.start)
        self._train = jax.jit(train, static_argnames="updates")
        self._begin = jax.jit(first, static_argnames=("runs", "episodes"))
        self._advance = jax.jit(play)

    def init(self, keys: jax.Array, hparams: HParams | None = None) -> TrainState:
        """Begin a run for each of keys[R]; `hparams` as in `train_chunk`."""
        _spread(self._loop.numbers(hparams), keys.shape[0])
        # One run after another: with JAX 0.10.2, a vmapped program of four runs hangs on two CPU
        # cores.
        states = [self._start(key) for key in key_data(keys)]
        return jax.tree.map(lambda *leaves: jnp.stack(leaves), *states)

    def train_chunk(
        self, state: TrainState, hparams: HParams | None, updates: int
    ) -> tuple[TrainState, Metrics]:
        """Train all runs; metrics are [R, updates].

        Each of `hparams` is a scalar for all runs, or has shape [R].

        Raises:
            SettingError: a number is out of range or has a wrong shape.
        """
        hparams = _spread(self._loop.numbers(hparams), state.update.shape[0])
        return self._train(state, hparams, updates=updates)

    def evaluate(
        self,
        params: Any,
        key: jax.Array,
        episodes: int,
        greedy: bool = False,
        notify: Callable[[np.ndarray, np.ndarray], object] = lambda running, length: None,
    ) -> Evaluation:
        """Evaluate all runs with the same random numbers; results [R, episodes].

        `notify` is called from time to time with the unfinished episodes, bool[R, episodes], and
        all lengths so far, int32[R, episodes].
        """
        data, runs = key_data(key), len(jax.tree.leaves(params)[0])
        return play_out(
            lambda playing, until: self._advance(params, data, playing, until, np.bool_(greedy)),
            self._begin(data, runs=runs, episodes=episodes),
            notify,
        )


def _spread(hparams: HParams, runs: int) -> HParams:
    """Every number as float32[runs]."""

    def spread(number: jax.Array) -> jax.Array:
        if number.shape not in ((), (runs,)):
            raise SettingError(
                f"hparams must be scalars or have shape [{runs}], one value per run, not "
                f"{list(number.shape)}"
            )
        return jnp.broadcast_to(number, (runs,))

    return jax.tree.map(spread, hparams)
