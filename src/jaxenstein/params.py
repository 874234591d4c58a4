"""The numbers of an environment, and which values they can have."""

from __future__ import annotations

from typing import Any, Self

import jax

from .errors import SettingError, nearest
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
                    f"{type(self).__name__} has no {name!r}{nearest(name, names)}; "
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
