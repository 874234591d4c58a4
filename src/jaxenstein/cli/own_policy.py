"""Users' own policies, given on the command line as MODULE:FUNCTION."""

from __future__ import annotations

import contextlib
import inspect
import re
import sys
from typing import Any

from ..environment import AnyEnvironment
from ..episodes.policies import Own
from ..errors import nearest, quoted
from .arguments import UsageError
from .opening import import_modules

CONVENTION = """\
MODULE:FUNCTION is your own function, in a module that Python can import from the current folder. It
takes (env, params) and returns (policy, carry). policy(carry, obs, key) returns the next carry and
the action; carry is the memory at the start of an episode. For a policy without memory, carry is
None and policy(obs, key) returns the action. If params are ranges, the function gets one set of
drawn numbers, and each episode draws its own. See 'Agents of your own' in docs/training.md.
"""
_NAMED = re.compile(r"\w+(\.\w+)*:\w+")


def is_own(text: object) -> bool:
    """Whether a text has the form MODULE:FUNCTION."""
    return isinstance(text, str) and _NAMED.fullmatch(text) is not None


def load_own(text: str, env: AnyEnvironment, params: Any, name: str | None = None) -> Own:
    """Call MODULE:FUNCTION to get its policy for an environment; the policy's name is `name`.

    Raises:
        UsageError: the module or function does not exist, or it takes or returns the wrong values.
        SettingError: the policy does not take or return what `jaxenstein.evaluate` documents.
    """
    module, _, called = text.partition(":")
    import_modules([module])
    there = vars(sys.modules[module])
    function = there.get(called)
    if not callable(function):
        close = nearest(called, (name for name, value in there.items() if callable(value)))
        raise UsageError(f"jaxenstein: --policy: {module} has no function {quoted(called)}{close}")
    wanted = (
        f"jaxenstein: --policy: {text} must take (env, params) and return (policy, carry), "
        "with carry None for a policy without memory; it "
    )
    # Some callables have no signature.
    with contextlib.suppress(ValueError):
        signature = inspect.signature(function)
        try:
            signature.bind(env, params)
        except TypeError as error:
            raise UsageError(f"{wanted}takes {signature}") from error
    made = function(env, params)
    if not isinstance(made, tuple) or len(made) != 2 or not callable(made[0]):
        raise UsageError(f"{wanted}returned {quoted(made)}")
    return Own(*made, env, params, text if name is None else name)
