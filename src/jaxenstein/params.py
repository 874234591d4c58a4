"""Params: the numbers of an environment, and their valid values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Self, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from .errors import SettingError, nearest, quoted
from .fields import (
    Domain,
    check_numbers,
    check_seed,
    check_value,
    domain_of,
    is_array_like,
    is_number,
    is_whole,
    names_of,
    values_of,
)
from .fields import number as number
from .pytree import PyTreeNode
from .seeds import key_of

Scalar = bool | int | float | jax.Array
"""A number, which may be traced; for a batch, an array of numbers."""
# Params that a learner reads once for all episodes.
_OF_ALL_EPISODES = ("discount",)


class Range(NamedTuple):
    """A range in place of a param; each episode draws a number from it.

    Attributes:
        low: the lower end.
        high: the upper end.
    """

    low: float
    high: float

    def __str__(self) -> str:
        """As in `--param NAME=LOW:HIGH`."""
        # Traced ends have no digits.
        return ":".join(f"{end:.10g}" if isinstance(end, int | float) else str(end) for end in self)


class Params(PyTreeNode):
    """Numbers that may differ between the environments of a batch: traced, never static.

    `replace` checks concrete values, and so does an environment that gets params from outside
    compiled code. Traced values are not checked.

    Attributes:
        max_steps_in_episode: world steps after which an episode is truncated; at least 1.
        discount: the task's discount factor for the learner, 0 to 1; the environment does not
            use it.
    """

    max_steps_in_episode: Scalar = number(1000, 1)
    discount: Scalar = number(0.99, 0, 1)

    def replace(self, **changes: Any) -> Self:
        """Return a copy with the named fields changed.

        A tuple of two numbers is a range: each episode of training, evaluation or an adapter draws
        a number from it. For other uses, `drawn` replaces ranges by numbers.

        Raises:
            SettingError: a field does not exist, or its value is out of range.

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
                    f"the fields are: {', '.join(names)}"
                )
        ranges = {
            name: _checked_range(name, domain_of(type(self), name), value)
            for name, value in changes.items()
            if isinstance(value, tuple)
        }
        after = super().replace(**{**changes, **ranges})
        # The `in_axes` of `jax.vmap` are trees of this class too, but hold no numbers.
        if all(is_array_like(getattr(self, name)) for name in set(names) - set(ranges_of(self))):
            check_numbers(after, skip=set(names) - set(changes) | set(ranges))
        # JAX would compile again for a Python number in place of an array.
        typed = {
            name: (jnp if isinstance(before, jax.Array) else np).asarray(value, before.dtype)
            for name, value in changes.items()
            if is_number(value) and hasattr(before := getattr(self, name), "dtype")
        }
        return super(Params, after).replace(**typed)

    def check(self) -> None:
        """Check the values that are already known.

        Raises:
            SettingError: a value is a range, or is not a number in its valid range.
        """
        for name, range in ranges_of(self).items():
            raise SettingError(
                f"{name} must be one number here, not the range {range}: "
                "use jaxenstein.params.drawn(params, seed) to draw one"
            )
        check_numbers(self)


T = TypeVar("T")


def drawn(params: T, seed: int | jax.Array, count: int | None = None) -> T:
    """Params with each range replaced by a number drawn uniformly from it.

    Training, `jaxenstein.evaluate` and the adapters draw new numbers for each episode. All other
    code that takes params needs the result of this function.

    Args:
        params: params, which may hold ranges; params without ranges are returned unchanged.
        seed: a whole number from 0 to 2**32 - 1, or a random key.
        count: None to draw one number per range, or N to draw float32[N] for N environments.

    Raises:
        SettingError: the seed is a whole number outside its range.

    Examples:
        >>> params = Params().replace(discount=0.9)
        >>> drawn(params, 0) is params
        True
    """
    key: Any = seed
    if is_whole(seed):
        key = key_of(check_seed(seed))
    plain, ranges = split_ranges(params)
    shape = () if count is None else (count,)
    return with_numbers(plain, draw_numbers(ranges, key, shape)[0]) if ranges else params


def ranges_of(params: Any) -> dict[str, Range]:
    """The ranges among params by name; {} for other objects."""
    if not isinstance(params, Params):
        return {}
    values = values_of(params).items()
    return {name: value for name, value in values if isinstance(value, Range)}


def split_ranges(params: T) -> tuple[T, dict[str, Range]]:
    """The params with each range replaced by its middle, and the ranges."""
    ranges = ranges_of(params)
    return with_numbers(params, {name: (r.low + r.high) / 2 for name, r in ranges.items()}), ranges


def draw_numbers(
    ranges: Mapping[str, Range], key: jax.Array, shape: tuple[int, ...] = ()
) -> tuple[dict[str, jax.Array], jax.Array]:
    """Draw a float32 for each range; returns them and the next key (the same without ranges)."""
    if not ranges:
        return {}, key
    key, *keys = jax.random.split(key, len(ranges) + 1)
    numbers = {
        name: jax.random.uniform(own, shape, jnp.float32, *ranges[name])
        for own, name in zip(keys, sorted(ranges), strict=True)
    }
    return numbers, key


def with_numbers(params: T, numbers: Mapping[str, Any]) -> T:
    """The params with some numbers changed, unchecked."""
    return PyTreeNode.replace(params, **numbers) if numbers else params  # type: ignore[type-var]


def _checked_range(name: str, domain: Domain, given: tuple[Any, ...]) -> Range:
    if domain.form != "number" or name in _OF_ALL_EPISODES:
        kind = "the same in all episodes" if domain.form == "number" else f"{domain.words}"
        raise SettingError(f"{name} must be {kind}, not the range {quoted(given)}")
    if len(given) != 2:
        raise SettingError(
            f"{name} must be one number, or a range (low, high), not {quoted(given)}"
        )
    range = Range(*(check_value(name, domain, end) for end in given))
    if range.low >= range.high:
        raise SettingError(f"{name} must be a range from a lower to a higher number, not {range}")
    return range


def check_single(params: Params, default: Params, owner: str) -> None:
    """Check that params, traced or not, have no batch axis.

    Args:
        params: params of the class of `default`.
        default: the default params, which have the right number of axes.
        owner: the name of the environment, for the message.

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
        params: params of the class of `default`.
        default: the default params, which have the axes of one environment.
        count: N, the number of environments.
        owner: the name of the environment, for the message.

    Returns:
        A bool for each leaf of the params, in order.

    Raises:
        SettingError: a param has neither the shape of its default nor that shape with a leading
            axis N.
    """
    found = []
    for name, shape, right in _shapes(params, default):
        more = len(shape) != len(right)
        if more and (len(shape) != len(right) + 1 or shape[0] != count):
            raise SettingError(
                f"params of {count} environments of {quoted(owner)}: {name} must have the shape "
                f"{right} (one value for all) or {(count, *right)} (one for each), not {shape}"
            )
        found.append(more)
    return found


def _shapes(params: Params, default: Params) -> list[tuple[str, tuple[int, ...], tuple[int, ...]]]:
    """The name, the shape, and the shape of the default of each param."""
    named, usual = jax.tree_util.tree_leaves_with_path(params), jax.tree.leaves(default)
    return [
        (jax.tree_util.keystr(path).lstrip("."), np.shape(leaf), np.shape(right))
        for (path, leaf), right in zip(named, usual, strict=True)
    ]
