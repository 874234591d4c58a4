"""Named sets of defaults, below what is given: recipes of trainings, and sizes of networks."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Literal

from ...fields import check, choice
from ..learning.config import Config
from ..learning.networks import PATCHES, SMALL

Values = Mapping[str, Any]
RecipeName = Literal["paper", "tuned"]
NetworkName = Literal["paper", "small", "tiny"]


@dataclasses.dataclass(frozen=True)
class Presets:
    """Which defaults a training has.

    Attributes:
        recipe: what is meant by an option that is not given: paper, or tuned, which learns faster.
        network: its sizes if not given: paper: 256 units; small and tiny: 64, with small
            convolutions and with one layer of patches; recipe tuned has tiny.
    """

    recipe: RecipeName = choice("paper", RecipeName)
    network: NetworkName = choice("paper", NetworkName)

    def __post_init__(self) -> None:
        """Check both names."""
        check(self)


PAPER = Presets()


@dataclasses.dataclass(frozen=True)
class Recipe:
    """Options that differ from the paper's, which are the defaults of `Config` and `HParams`.

    Attributes:
        shared: those of all algorithms.
        own: further ones of an algorithm, by its name.
    """

    shared: Values = dataclasses.field(default_factory=dict)
    own: Mapping[str, Values] = dataclasses.field(default_factory=dict)


NETWORKS: Mapping[str, Values] = {
    "paper": {},
    "small": {"features": 64, "hidden": 64, "head": 64, "convolutions": SMALL},
    "tiny": {"features": 64, "hidden": 64, "head": 64, "convolutions": PATCHES},
}

_OWN_VALUES: Values = {
    "normalise_bonus": True,
    "bonus_values": True,
    "bonus_advantage": 0.3,
    "entropy": 0.003,
}

RECIPES: Mapping[str, Recipe] = {
    "paper": Recipe(),
    "tuned": Recipe(
        shared={
            # Four times as many steps a second as small, and it learns as well from as many.
            "network": "tiny",
            # As the paper's recipe has them: what was measured together with the others.
            "num_envs": 64,
            "rollout": 128,
            # A decision; with 0.99 a step of the world, the paper's, a frame skip leaves too little
            # of a goal far away.
            "gamma": 0.99,
            # Learns as much from as many steps as four do, in half the time.
            "epochs": 2,
            # Four times the paper's, up to the end: a goal that is found late is learned, too.
            "learning_rate": 1e-3,
            "anneal": False,
            # With 0.2 the value of a goal, 1 and more, takes many updates to be learned.
            "value_clip": 10.0,
            # The value head's first guesses alone make advantages ten times the floor below, and
            # the policy settles on what they seem to say.
            "zero_values": True,
            # Pixels of mean 0 and deviation 1: what is seen shapes the policy ten times as much.
            "contrast": 10.0,
            # Before the first goal the advantages are the value head's noise, which the paper's
            # 1e-8 blows up to deviation 1, and the policy settles on it.
            "advantage_floor": 0.01,
        },
        own={
            # Its bonus falls to a hundredth within 25 updates. At the default rate, 3e-4, the
            # predictor is done before a way that it led to is learned; novelty at its full weight
            # leads away again from goals that were found; 0.01 of entropy draws the policy back to
            # chance as novelty fades; and where the size that it is divided by remembers the
            # first rollouts for ever, one of five seeds lost the goal again.
            "rnd": {
                "normalise_bonus": True,
                "bonus_memory": 0.9,
                "bonus_learning_rate": 1e-4,
                "bonus_advantage": 0.3,
                "entropy": 0.003,
                # A policy that sees more stays where novelty lasts, with frame skip 3 and 1.
                "contrast": 0.0,
            },
            # With a value of its own the bonus can weigh less than the goal; added to the reward it
            # drove the entropy down and nothing was learned.
            "icm": _OWN_VALUES,
            # It counts within an episode: in lock-step every other rollout of `simple` would see
            # no start and no end.
            "e3b": {**_OWN_VALUES, "e3b_lambda": 0.1, "random_clocks": True},
        },
    ),
}


def defaults_of(given: Values) -> tuple[Presets, dict[str, Any]]:
    """The presets that options name, and the options that these stand for.

    Args:
        given: of known names and right kinds; only `recipe`, `network` and `algo` are read.
    """
    recipe = given.get("recipe", Presets.recipe)
    row = RECIPES[recipe]
    values = {**row.shared, **row.own.get(given.get("algo", Config.algo), {})}
    network = given.get("network", values.pop("network", Presets.network))
    return Presets(recipe, network), {**NETWORKS[network], **values}
