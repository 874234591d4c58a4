"""The options of a training from flags and files together; the modules of the baselines."""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Sequence
from typing import Any

from .arguments import Parser, UsageError, add_options
from .opening import given_options, with_map


def baselines(module: str) -> Any:
    """A module of `jaxenstein.baselines.runs`.

    Raises:
        UsageError: the extra is not installed.
    """
    hint = "pip install 'jaxenstein[baselines]'"
    try:
        return importlib.import_module(f"jaxenstein.baselines.runs.{module}")
    except ImportError as error:
        text = str(error)
        if hint not in text and not isinstance(error, ModuleNotFoundError):
            raise
        raise UsageError(f"jaxenstein: {text if hint in text else f'{text}: {hint}'}") from error


def add_training_options(parser: Parser, without: Sequence[str] = ()) -> None:
    """Add a flag for every option of a training, but for those named."""
    add_options(parser, baselines("options").all_options(), without)


def named(given: dict[str, Any], command: str) -> dict[str, Any]:
    """The options of a new training, which must say where.

    Raises:
        UsageError: they name neither an environment nor a map.
    """
    if not {"env", "map"} & set(given):
        raise UsageError(
            f"jaxenstein {command}: give an environment, --env ID ('jaxenstein list' shows them), "
            "or a map, --map-file FILE"
        )
    return given


def given_training(options: argparse.Namespace) -> dict[str, Any]:
    """The options of the file and of the flags together."""
    from ..settings import checked, merge

    parsing = baselines("options")
    file: dict[str, Any] = {}
    if options.config is not None:
        file = with_map(parsing.read_file(options.config), options.config.parent)
    flags = checked(given_options(options), parsing.all_options())
    return merge(file, with_map(flags))
