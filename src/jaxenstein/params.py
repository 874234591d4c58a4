"""The numbers of an environment, and which values they can have."""

from __future__ import annotations

from typing import Any, Self

import jax
import numpy as np

from .errors import SettingError, nearest, quoted
from .fields import check_numbers, is_array_like, names_of
from .fields import number as number
from .pytree import PyTreeNode

Scalar = bool | int | float | jax.Array
"""A number that may be traced, and of a batch an array of numbers."""


class Params(PyTreeNode):
    """Numbers that may differ between environments of one batch: traced, never static.

    Concrete values are checked where they come in: in `replace`, and where an environment is
    given params from outside of compiled code. Traced ones pass.

    Attributes:
        max_steps_in_episode: steps after which an episode is truncated; at least 1.
        discount: the task's discount factor, 0 to 1, for the learner; the environment does not
            use it.
    """

    max_steps_in_episode: Scalar = number(1000, 1)
    discount: Scalar = number(0.99, 0, 1)

    def replace(self, **changes: Any) -> Self:
        """Return a copy with the named fields changed.

        Raises:
            SettingError: there is no such field, or a value that it cannot have.

        Examples:
            >>> Params().replace(discount=0.9)
            Params(max_steps_in_episode=1000, discount=0.9)
            >>> Params().replace(discuont=0.9)
            Traceback (most recent call last):
            jaxenstein.errors.SettingError: Params has no 'discuont', did you mean 'discount'?...
        """
        names = names_of(self)
        for name in changes:
            if name not in names:
                raise SettingError(
                    f"{type(self).__name__} has no {quoted(name)}{nearest(name, names)}; "
                    f"it has: {', '.join(names)}"
                )
        after = super().replace(**changes)
        # The axes of `jax.vmap` and the like are trees of this class too, but no numbers.
        if all(is_array_like(getattr(self, name)) for name in names):
            check_numbers(after, skip=set(names) - set(changes))
        return after

    def check(self) -> None:
        """Look at the values that are known already.

        Raises:
            SettingError: one is not a number in its range.
        """
        check_numbers(self)


def check_single(params: Params, default: Params, owner: str) -> None:
    """Check that params, traced or not, have no batch axis.

    Args:
        params: of the class of `default`.
        default: the default params, which have the right numbers of axes.
        owner: the environment's name, for the message.

    Raises:
        SettingError: a param has more or fewer axes.
    """
    shapes = _shapes(params, default)
    wrong = [name for name, shape, right in shapes if len(shape) != len(right)]
    if not wrong:
        return
    name, shape, right = next(entry for entry in shapes if entry[0] == wrong[0])
    own = ", ".join(f"{name}=0" for name in wrong)
    axes = "0" if len(wrong) == len(shapes) else "axes"
    made = f"axes = jax.tree.map(lambda _: None, params).replace({own}) and "
    raise SettingError(
        f"params of {quoted(owner)} must not have a batch axis: {name} must have the shape "
        f"{right}, not {shape}. For params that differ between environments use jax.vmap with "
        f"in_axes: {made if axes == 'axes' else ''}jax.vmap(env.reset, in_axes=(0, {axes}))(keys, "
        "params)"
    )


def differing(params: Params, default: Params, count: int, owner: str) -> list[bool]:
    """Find the params that differ between environments, by their leading axis N.

    Args:
        params: of the class of `default`.
        default: the default params, which have the axes of one environment.
        count: N, the number of environments.
        owner: their name, for the message.

    Returns:
        A truth value for each leaf of the params, in their order.

    Raises:
        SettingError: a param has neither the shape of its default nor a leading axis N more.
    """
    found = []
    for name, shape, right in _shapes(params, default):
        more = len(shape) != len(right)
        if more and (len(shape) != len(right) + 1 or shape[0] != count):
            raise SettingError(
                f"params of {count} environments of {quoted(owner)}: {name} must have the shape "
                f"{right}, for all, or {(count, *right)}, one entry for each, not {shape}"
            )
        found.append(more)
    return found


def _shapes(params: Params, default: Params) -> list[tuple[str, tuple[int, ...], tuple[int, ...]]]:
    """The name, the shape and the default's shape of each param."""
    named, usual = jax.tree_util.tree_leaves_with_path(params), jax.tree.leaves(default)
    return [
        (jax.tree_util.keystr(path).lstrip("."), np.shape(leaf), np.shape(right))
        for (path, leaf), right in zip(named, usual, strict=True)
    ]
