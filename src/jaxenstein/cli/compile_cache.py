"""Compiled programs, kept between calls of the command, so that the second one begins at once."""

from __future__ import annotations

import hashlib
import os
import re
import stat
import warnings
from pathlib import Path
from typing import Any

# The most bytes that are kept when a command begins; the programs that were used last stay.
LIMIT = 2**30
# What JAX says where it cannot read or write the program of a function.
_TROUBLE = re.compile(r"Error (?:reading|writing) persistent compilation cache entry for '(.*?)'")


def keep_programs() -> None:
    """Let JAX keep what it compiles in a folder of the user's own, and find it there again.

    Nothing happens where the user has set a folder for JAX, or where other users could write to
    ours: JAX runs what it finds there.
    """
    if os.environ.get("JAX_COMPILATION_CACHE_DIR"):
        return
    try:
        folder = programs_folder()
        for path in (folder.parent, folder):
            path.mkdir(mode=0o700, parents=True, exist_ok=True)
            if not is_ours(path):
                return
        make_room(folder.parent)
    except (OSError, RuntimeError):  # the latter where there is no home
        return
    import jax

    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    show = warnings.showwarning

    def show_others(message: Any, *where: Any, **more: Any) -> None:
        if not forget(str(message)):
            show(message, *where, **more)

    warnings.showwarning = show_others


def forget(warning: str) -> bool:
    """Remove the programs that JAX says it cannot read or write, so that they are made anew.

    It would keep one that a full disk or a kill has cut off, and complain of it in every call.

    Returns:
        Whether the warning is about that.
    """
    found = _TROUBLE.match(warning)
    if found is None or os.environ.get("JAX_COMPILATION_CACHE_DIR"):
        return False
    for path in programs_folder().glob("*-cache"):
        if path.name.startswith(f"{found[1]}-"):
            path.unlink(missing_ok=True)
    return True


def programs_folder() -> Path:
    """Where programs for this processor are kept; JAX itself tells versions apart."""
    from ..machine import cpu_fact, cpu_model

    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    # Machines that share a home must not run each other's code.
    processor = f"{cpu_model()} {cpu_fact('flags', 'Features')}"
    return Path(base) / "jaxenstein" / hashlib.sha256(processor.encode()).hexdigest()[:16]


def is_ours(folder: Path) -> bool:
    """Whether this process can write to a folder, and no other user can."""
    about, above = folder.lstat(), folder.parent.stat().st_mode
    if above & stat.S_IWOTH and not above & stat.S_ISVTX:
        return False  # other users could replace it
    if not stat.S_ISDIR(about.st_mode) or not os.access(folder, os.W_OK):
        return False
    return not hasattr(os, "getuid") or (
        about.st_uid == os.getuid() and not about.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    )


def make_room(parent: Path, limit: int = LIMIT) -> None:
    """Remove the programs in the folders of `parent` that have not been used for longest."""
    found = [(path.lstat(), path) for path in parent.glob("*/*-cache")]
    total = sum(about.st_size for about, _ in found)
    for about, path in sorted(found, key=lambda pair: max(pair[0].st_atime, pair[0].st_mtime)):
        if total <= limit:
            break
        path.unlink(missing_ok=True)
        total -= about.st_size
