"""Frozen dataclasses that JAX treats as pytrees."""

from __future__ import annotations

import dataclasses
from typing import Any, Self, dataclass_transform

import jax


def static(**kwargs: Any) -> Any:
    """A static field: part of the tree structure, hashable, never traced."""
    return dataclasses.field(metadata={"static": True}, **kwargs)


@dataclass_transform(frozen_default=True, field_specifiers=(static, dataclasses.field))
class PyTreeNode:
    """Base of all pytrees: each subclass becomes a frozen dataclass that JAX can flatten.

    Fields are children of the node unless declared with `static`.
    """

    def __init_subclass__(cls, **kwargs: Any) -> None:
        """Make the subclass a dataclass and register it."""
        super().__init_subclass__(**kwargs)
        jax.tree_util.register_dataclass(dataclasses.dataclass(frozen=True)(cls))

    def replace(self, **changes: Any) -> Self:
        """Return a copy with the named fields changed; an unknown name raises `TypeError`.

        Examples:
            >>> from jaxenstein import Params
            >>> Params().replace(discount=0.9)
            Params(max_steps_in_episode=1000, discount=0.9)
        """
        return dataclasses.replace(self, **changes)  # type: ignore[type-var]
