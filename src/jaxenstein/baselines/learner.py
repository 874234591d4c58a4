"""Training on an environment: chunks of updates in one compiled program, evaluation, acting."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

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
        many: the same functions for many runs at once, along a leading axis of everything.
    """

    def __init__(self, env: Any, env_params: Any, config: Config) -> None:
        """Build the training loop of an environment.

        Args:
            env: an environment of `jaxenstein.make` with any `autoreset`, or one of gymnax'
                contract of six values whose `info` has `final_observation`.
            env_params: its params; fixed into the program. Each episode draws a number of its own
                from a range among them.
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
            key: a random key, typed or old: the run's seed.
            hparams: its numbers; None for the defaults. They are only checked here; pass them to
                every `train_chunk`.

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
            state: of the last update.
            hparams: the run's numbers; None for the defaults.
            updates: how many updates; each number compiles another program.

        Returns:
            The state, and metrics [updates], which `loop.Loop.update` lists.
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
            greedy: take the most likely action instead of sampling one.
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
            key: to sample the action with; None for the most likely one.

        Returns:
            int32[] action, and the next carry.
        """
        return self._policy(params, obs, carry, None if key is None else key_data(key))

    def act(
        self, params: Any, obs: Any, carry: PolicyCarry, key: jax.Array | None = None
    ) -> tuple[jax.Array, PolicyCarry]:
        """As `policy`, in `N` environments at once, along a leading axis of `obs` and `carry`.

        Returns:
            int32[N] actions, and the next carry.
        """
        return self._actions(params, obs, carry, None if key is None else key_data(key))

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


class ManyRuns:
    """Parallel runs in one program: every argument and result has a leading axis [R].

    A run among others is the same as alone up to rounding.
    """

    def __init__(self, loop: Loop) -> None:
        """Take the loop of one run."""

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
        # One after another, in one small program: a vmapped program of four runs never ended on
        # two CPU cores with JAX 0.10.2.
        states = [self._start(key) for key in key_data(keys)]
        return jax.tree.map(lambda *leaves: jnp.stack(leaves), *states)

    def train_chunk(
        self, state: TrainState, hparams: HParams | None, updates: int
    ) -> tuple[TrainState, Metrics]:
        """Train all runs; numbers of `hparams` are scalars, for all, or [R]. Metrics [R, updates].

        Raises:
            SettingError: a number is out of range or of another shape.
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

        `notify` is called now and then with the unfinished episodes, bool[R, episodes], and the
        lengths so far, int32[R, episodes].
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
                f"numbers of hparams must be scalars or [{runs}], one for each run, not of shape "
                f"{list(number.shape)}"
            )
        return jnp.broadcast_to(number, (runs,))

    return jax.tree.map(spread, hparams)
