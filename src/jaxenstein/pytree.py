"""Records: frozen dataclasses that JAX treats as pytrees."""

from __future__ import annotations

import dataclasses
from typing import Any, Self, TypeVar, dataclass_transform

import jax

_T = TypeVar("_T", bound=type)


def static(**kwargs: Any) -> Any:
    """A record field that is part of the tree structure (hashable, never traced)."""
    return dataclasses.field(metadata={"static": True}, **kwargs)


@dataclass_transform(frozen_default=True, field_specifiers=(static, dataclasses.field))
def record(cls: _T) -> _T:
    """Make `cls` a frozen dataclass and register it as a pytree.

    Fields are children unless declared with `static`. Subclasses must be decorated too.
    """
    return jax.tree_util.register_dataclass(dataclasses.dataclass(frozen=True)(cls))


class Record:
    """Base of all records: adds `replace`."""

    def replace(self, **changes: Any) -> Self:
        """Return a copy with the named fields changed; an unknown name is a `TypeError`.

        Examples:
            >>> from jaxenstein import Params
            >>> Params().replace(discount=0.9)
            Params(max_steps_in_episode=1000, discount=0.9)
        """
        return dataclasses.replace(self, **changes)  # type: ignore[type-var]
