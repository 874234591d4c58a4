"""The page of the command line, written from its own help each time the site is built."""

from __future__ import annotations

import argparse
import os
import re
from unittest import mock

from jaxenstein.cli import build_parser

INTRODUCTION = """\
# Command line

`jaxenstein COMMAND --help` prints what stands here. Wrong arguments are answered with what would
be right, and exit status 2; 1 means that something could not be written or run, or that a replay
was not the same.

Commands keep the programs that JAX compiles in `~/.cache/jaxenstein` (or below `XDG_CACHE_HOME`),
at most about 1 GiB, so that a second call begins at once. `--no-cache` leaves the folder alone, and
`JAX_COMPILATION_CACHE_DIR` names another one."""


def commands_page() -> str:
    """The commands with what they do and all of their options."""
    # As in a terminal of this width, without colours.
    with mock.patch.dict(os.environ, {"COLUMNS": "100", "NO_COLOR": "1"}):
        (commands,) = (
            action for action in build_parser()._actions
            if isinstance(action, argparse._SubParsersAction)
        )  # fmt: skip
        parts = [_command(name, parser) for name, parser in commands.choices.items()]
    return "\n\n".join([INTRODUCTION, *parts]) + "\n"


def _command(name: str, parser: argparse.ArgumentParser) -> str:
    text = re.sub(r"\x1b\[[0-9;]*m", "", parser.format_help()).rstrip()
    return f"## `jaxenstein {name}`\n\n```text\n{text}\n```"


if __name__ == "__main__":
    print(commands_page())
