"""The buttons of ViZDoom's scenarios, and its way of numbering actions."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from ...pytree import PyTreeNode

TURN_LEFT, TURN_RIGHT = "turn left", "turn right"
FORWARD, BACKWARD = "forward", "backward"
MOVE_LEFT, MOVE_RIGHT = "move left", "move right"
ATTACK = "attack"
NOTHING = "nothing"


class Buttons(PyTreeNode):
    """The buttons held in a tic.

    Attributes:
        turn_left: bool[].
        turn_right: bool[].
        ahead: int32[], 1 forward, -1 backward, 0 neither or both.
        aside: int32[], 1 to the right, -1 to the left, 0 neither or both.
        attack: bool[].
    """

    turn_left: jax.Array
    turn_right: jax.Array
    ahead: jax.Array
    aside: jax.Array
    attack: jax.Array | bool = False


def hold(names: Sequence[str], held: jax.Array) -> Buttons:
    """The buttons that a number stands for.

    Args:
        names: the scenario's buttons, in the order of its configuration.
        held: int32[], whose bit i says whether button i is held.
    """

    def is_down(name: str) -> jax.Array:
        if name not in names:
            return jnp.zeros_like(held)
        return (held >> names.index(name)) & 1

    return Buttons(
        turn_left=is_down(TURN_LEFT) == 1,
        turn_right=is_down(TURN_RIGHT) == 1,
        ahead=is_down(FORWARD) - is_down(BACKWARD),
        aside=is_down(MOVE_RIGHT) - is_down(MOVE_LEFT),
        attack=is_down(ATTACK) == 1,
    )


def numbered(count: int, at_most: int) -> np.ndarray:
    """int32[actions]: the buttons of each action, as bits for `hold`.

    As ViZDoom's Gymnasium wrapper numbers them: all choices of at most so many of `count`
    buttons in the order of binary numbers whose first digit is the first button. With one button
    at a time, that is none, then the buttons from the last to the first.
    """
    choices = itertools.product((0, 1), repeat=count)
    bits = [
        sum(d << i for i, d in enumerate(digits)) for digits in choices if sum(digits) <= at_most
    ]
    return np.array(bits, np.int32)


def action_name(names: Sequence[str], held: int) -> str:
    """What an action is called that holds these buttons, such as `"turn left + forward"`."""
    return " + ".join(name for i, name in enumerate(names) if held >> i & 1) or NOTHING
