"""Policies of one's own, which MODULE:FUNCTION names on the command line."""

from __future__ import annotations

import re
import sys
from typing import TYPE_CHECKING, Any

from ..episodes.policies import Own
from ..errors import nearest, quoted
from .arguments import UsageError
from .opening import import_modules

if TYPE_CHECKING:
    from ..environment import AnyEnvironment

CONVENTION = """\
MODULE:FUNCTION names a function of your own, in a module that can be imported from here. It takes
(env, params) and returns (policy, carry): policy(carry, obs, key) returns the next carry and the
action, and carry is the memory at the start of an episode. Without a memory carry is None, and
policy(obs, key) returns the action. docs/training.md, 'Agents of your own', has an example.
"""
_NAMED = re.compile(r"\w+(\.\w+)*:\w+")


def is_own(text: object) -> bool:
    """Whether a text is of the form MODULE:FUNCTION."""
    return isinstance(text, str) and _NAMED.fullmatch(text) is not None


def load_own(text: str, env: AnyEnvironment, params: Any) -> Own:
    """The policy that MODULE:FUNCTION makes for an environment.

    Raises:
        UsageError: there is no such module or function, or it returns no pair.
        SettingError: the policy takes or returns something else than `jaxenstein.evaluate` says.
    """
    module, _, name = text.partition(":")
    import_modules([module])
    there = vars(sys.modules[module])
    function = there.get(name)
    if not callable(function):
        close = nearest(name, (name for name, value in there.items() if callable(value)))
        raise UsageError(f"jaxenstein: --policy: {module} has no function {quoted(name)}{close}")
    made = function(env, params)
    if not isinstance(made, tuple) or len(made) != 2 or not callable(made[0]):
        shown = quoted(made)
        raise UsageError(
            f"jaxenstein: --policy: {text} must take (env, params) and return (policy, carry), "
            f"where carry is None for a policy without a memory; it returned {shown}"
        )
    return Own(*made, env, params, text)
