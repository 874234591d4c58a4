"""Which leaves of a state begin with the axis of the environments."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax

from ...pytree import PyTreeNode

PER_ENVIRONMENT = {"per_environment": True}
"""Metadata of a record's field all of whose leaves begin with that axis, [N]."""


def per_environment(tree: Any) -> Any:
    """Whether each leaf begins with the axis of the environments, as the fields of records say.

    Args:
        tree: a pytree with records at any depth.

    Returns:
        The tree with True or False for every leaf.
    """
    if not isinstance(tree, PyTreeNode):
        return jax.tree.map(
            lambda node: isinstance(node, PyTreeNode) and per_environment(node),
            tree,
            is_leaf=lambda node: isinstance(node, PyTreeNode),
        )
    parts = {}
    for field in dataclasses.fields(tree):  # type: ignore[arg-type]
        part = getattr(tree, field.name)
        if "per_environment" in field.metadata:
            parts[field.name] = jax.tree.map(lambda _: True, part)
        elif "static" not in field.metadata:
            parts[field.name] = per_environment(part)
    return tree.replace(**parts)
