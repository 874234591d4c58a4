"""Recurrent PPO with exploration bonuses, from environment to update in one compiled program.

    env, params = jaxenstein.make("simple")
    learner = Learner(env, params, Config(algo="rnd", total_steps=3_000_000))
    state = learner.init(jax.random.key(0))
    state, metrics = learner.train_chunk(state, HParams(), updates=10)

or, in a run directory with metrics and checkpoints, from which an agent can be loaded:

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

from .bonuses.e3b import E3B, E3BNumbers, E3BSettings
from .bonuses.icm import ICM, ICMNumbers, ICMSettings
from .bonuses.none import NoBonus
from .bonuses.rnd import RND, RNDNumbers, RNDSettings
from .bonuses.table import register_bonus
from .learning.algorithms import BonusNumbers, BonusSettings
from .learning.axes import PER_ENVIRONMENT
from .learning.bonus import Bonus, Experience
from .learning.config import Config
from .learning.evaluation import Evaluation
from .learning.hparams import HParams
from .learning.learner import Learner, PolicyCarry
from .learning.many import ManyRuns
from .learning.state import TrainState
from .runs.agents import export_policy, load_policy
from .runs.experiment import Experiment
from .runs.folder import RunFolder
from .runs.options import resolve
from .runs.training import train

__all__ = [
    "E3B",
    "ICM",
    "PER_ENVIRONMENT",
    "RND",
    "Bonus",
    "BonusNumbers",
    "BonusSettings",
    "Config",
    "E3BNumbers",
    "E3BSettings",
    "Evaluation",
    "Experience",
    "Experiment",
    "HParams",
    "ICMNumbers",
    "ICMSettings",
    "Learner",
    "ManyRuns",
    "NoBonus",
    "PolicyCarry",
    "RNDNumbers",
    "RNDSettings",
    "RunFolder",
    "TrainState",
    "export_policy",
    "load_policy",
    "register_bonus",
    "resolve",
    "train",
]
