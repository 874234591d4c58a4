"""Recurrent PPO with exploration bonuses, from environment to update in one compiled program.

    env, params = jaxenstein.make("simple")
    learner = Learner(env, params, Config(algo="rnd", total_steps=3_000_000))
    state = learner.init(jax.random.key(0))
    state, metrics = learner.train_chunk(state, HParams(), updates=10)

Or train in a run directory, with metrics and checkpoints, and load an agent from it:

    folder = RunFolder.create("runs/simple", resolve({"env": "simple", "algo": "rnd", "seeds": 5}))
    train(folder)
    policy = load_policy("runs/simple", run=2)

Needs the extra `baselines`.
"""

try:
    import flax.linen as _flax  # noqa: F401
    import optax as _optax  # noqa: F401
except ImportError as error:
    raise ImportError(
        f"jaxenstein.baselines needs flax and optax ({error}): pip install 'jaxenstein[baselines]'"
    ) from error

from ..evaluation import Evaluation
from .bonus import PER_ENVIRONMENT, Bonus, Experience
from .bonuses import E3B, ICM, RND, NoBonus
from .config import Config, HParams, register_bonus
from .convolution import PatchConvolution
from .learner import Learner, ManyRuns, PolicyCarry
from .runs.agents import export_policy, load_policy
from .runs.experiment import Experiment
from .runs.folder import RunFolder
from .runs.options import resolve
from .runs.training import train
from .state import TrainState

__all__ = [
    "E3B",
    "ICM",
    "PER_ENVIRONMENT",
    "RND",
    "Bonus",
    "Config",
    "Evaluation",
    "Experience",
    "Experiment",
    "HParams",
    "Learner",
    "ManyRuns",
    "NoBonus",
    "PatchConvolution",
    "PolicyCarry",
    "RunFolder",
    "TrainState",
    "export_policy",
    "load_policy",
    "register_bonus",
    "resolve",
    "train",
]
