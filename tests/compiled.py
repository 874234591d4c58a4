"""Compiled programs of tests, cached in the virtual environment for the next run.

JAX writes its cache in place, so that another process may read half a program. Each process
therefore has a folder of its own, and puts what is whole into the shared one, which all read.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from pathlib import Path

import jax
import jaxlib.version
from jax._src.compilation_cache import decompress_executable

from jaxenstein.cli.compile_cache import make_room, programs_folder

# The size in bytes to which the cache is cut when tests start; `make test` needs 150 MB.
LIMIT = 3 * 2**30


class Programs:
    """The compiled programs of a process and its children.

    Attributes:
        own: the folder that JAX reads and writes; it has links to what is in `shared`.
        shared: the folder that outlives the process.
    """

    def __init__(self) -> None:
        versions = jax.__version__, jaxlib.version.__version__, sys.implementation.cache_tag
        # Machines that share a virtual environment must not run each other's code.
        kind = "-".join(["jax", *map(str, versions), programs_folder().name])
        self.shared = Path(sys.prefix) / "compiled" / kind
        self.shared.mkdir(parents=True, exist_ok=True)
        make_room(self.shared.parent, LIMIT)
        self.own = Path(tempfile.mkdtemp(prefix="jaxenstein-tests-"))
        os.environ |= {
            "JAX_COMPILATION_CACHE_DIR": str(self.own),
            "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
            # These have a folder within the cache, whose path would be part of each program's key.
            "JAX_PERSISTENT_CACHE_ENABLE_XLA_CACHES": "none",
        }
        jax.config.update("jax_compilation_cache_dir", str(self.own))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
        jax.config.update("jax_persistent_cache_enable_xla_caches", "none")
        self.exchange()

    def exchange(self) -> None:
        """Share new complete programs, and link the programs that others have shared."""
        here = {entry.name for entry in os.scandir(self.own)}
        there = {entry.name for entry in os.scandir(self.shared)}
        for name in here - there:
            self._share(self.own / name)
        for name in there - here:
            if name.endswith("-cache"):
                (self.own / name).symlink_to(self.shared / name)

    def _share(self, path: Path) -> None:
        """Copy a program, unless the process that wrote it was killed or is still writing."""
        data = path.read_bytes()
        try:
            decompress_executable(data)
        except Exception:  # of zlib or of zstd, whichever JAX has found
            return
        temporary = self.shared / f"{path.name}.{os.getpid()}"
        temporary.write_bytes(data)
        temporary.replace(self.shared / path.name)

    def close(self) -> None:
        """Remove the folder of this process."""
        shutil.rmtree(self.own, ignore_errors=True)
