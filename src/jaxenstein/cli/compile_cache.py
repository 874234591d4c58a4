"""A cache of compiled programs, so that later calls of a command start at once."""

from __future__ import annotations

import hashlib
import os
import re
import stat
import warnings
from pathlib import Path
from typing import Any

import jax

from ..machine import cpu_fact, cpu_model

# Bytes of programs to keep; those used least recently are removed.
LIMIT = 2**30
# JAX's warning if it cannot read or write the program of a function.
_TROUBLE = re.compile(r"Error (?:reading|writing) persistent compilation cache entry for '(.*?)'")


def keep_programs() -> None:
    """Make JAX cache compiled programs in a folder of the user.

    Does nothing if the user has set a cache folder for JAX. Does nothing either if other users
    could write to the folder, since JAX runs the programs that it finds there.
    """
    if os.environ.get("JAX_COMPILATION_CACHE_DIR"):
        return
    try:
        folder = programs_folder()
        for path in (folder.parent, folder):
            path.mkdir(mode=0o700, parents=True, exist_ok=True)
            if not is_private(path):
                return
        make_room(folder.parent)
    except (OSError, RuntimeError):  # RuntimeError: there is no home folder
        return
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    show = warnings.showwarning

    def show_others(message: Any, *where: Any, **more: Any) -> None:
        if not forget(str(message)):
            show(message, *where, **more)

    warnings.showwarning = show_others


def forget(warning: str) -> bool:
    """Remove the programs that JAX could not read or write, so that they are compiled again.

    JAX would otherwise keep a file cut off by a full disk or a kill, and warn in every call.

    Returns:
        Whether the warning is about such a program.
    """
    found = _TROUBLE.match(warning)
    if found is None or os.environ.get("JAX_COMPILATION_CACHE_DIR"):
        return False
    for path in programs_folder().glob("*-cache"):
        if path.name.startswith(f"{found[1]}-"):
            path.unlink(missing_ok=True)
    return True


def programs_folder() -> Path:
    """The folder for programs of this processor; JAX itself distinguishes versions."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    # Machines that share a home folder must not run each other's programs.
    processor = f"{cpu_model()} {cpu_fact('flags', 'Features')}"
    return Path(base) / "jaxenstein" / hashlib.sha256(processor.encode()).hexdigest()[:16]


def is_private(folder: Path) -> bool:
    """Whether only this user can write to a folder."""
    about, above = folder.lstat(), folder.parent.stat().st_mode
    if above & stat.S_IWOTH and not above & stat.S_ISVTX:
        return False  # other users could replace it
    if not stat.S_ISDIR(about.st_mode) or not os.access(folder, os.W_OK):
        return False
    return not hasattr(os, "getuid") or (
        about.st_uid == os.getuid() and not about.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    )


def make_room(parent: Path, limit: int = LIMIT) -> None:
    """Remove the least recently used programs below `parent` until at most `limit` bytes remain."""
    found = [(path.lstat(), path) for path in parent.glob("*/*-cache")]
    total = sum(about.st_size for about, _ in found)
    for about, path in sorted(found, key=lambda pair: max(pair[0].st_atime, pair[0].st_mtime)):
        if total <= limit:
            break
        path.unlink(missing_ok=True)
        total -= about.st_size
