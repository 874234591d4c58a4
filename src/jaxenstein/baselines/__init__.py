"""Recurrent PPO with exploration bonuses, from environment to update in one compiled program.

    config = Config(env="simple", algo="rnd", total_steps=3_000_000)
    env, params = config.make_env()
    learner = make_learner(env, params, config)
    state = learner.init(jax.random.key(0))
    state, metrics = learner.train_chunk(state, HParams(), updates=10)

Needs the extra `baselines`.
"""

try:
    import flax.linen as _flax  # noqa: F401
    import optax as _optax  # noqa: F401
except ImportError as error:
    raise ImportError(
        f"jaxenstein.baselines needs flax and optax ({error}): pip install 'jaxenstein[baselines]'"
    ) from error

from .bonus import Bonus, Experience, NoBonus
from .config import Config, HParams
from .evaluation import Evaluation
from .icm import ICM
from .learner import Learner, PolicyCarry, make_learner
from .many import ManyRuns
from .rnd import RND
from .state import TrainState

__all__ = [
    "ICM",
    "RND",
    "Bonus",
    "Config",
    "Evaluation",
    "Experience",
    "HParams",
    "Learner",
    "ManyRuns",
    "NoBonus",
    "PolicyCarry",
    "TrainState",
    "make_learner",
]
