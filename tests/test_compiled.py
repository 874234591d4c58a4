"""The compiled programs that tests share: only complete ones, and only for the same machine."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import jax
import jaxlib.version
import pytest
from jax._src.compilation_cache import compress_executable

from tests.compiled import Programs

# A program as JAX writes it.
COMPLETE = compress_executable(bytes(range(256)) * 100)


@pytest.fixture(autouse=True)
def _temporary_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A virtual environment for this test, which JAX does not use."""
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    monkeypatch.setattr(os, "environ", dict(os.environ))
    monkeypatch.setattr(jax.config, "update", lambda *setting: None)


@pytest.fixture
def programs() -> Iterator[Programs]:
    made = Programs()
    yield made
    made.close()


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_other_processes_find_compiled_programs(programs: Programs) -> None:
    beside = Programs()
    (programs.own / "add-cache").write_bytes(COMPLETE)
    programs.exchange()
    assert names(beside.own) == set()
    beside.exchange()
    later = Programs()
    for other in (beside, later):
        assert (other.own / "add-cache").read_bytes() == COMPLETE
        other.close()
        assert not other.own.exists()
    assert (programs.shared / "add-cache").read_bytes() == COMPLETE


def test_incomplete_program_is_shared_once_complete(programs: Programs) -> None:
    path = programs.own / "add-cache"
    for length in (0, 1, len(COMPLETE) // 2, len(COMPLETE) - 1):
        path.write_bytes(COMPLETE[:length])
        programs.exchange()
        assert names(programs.shared) == set()
    path.write_bytes(COMPLETE)
    programs.exchange()
    assert names(programs.shared) == {"add-cache"}


def test_unfinished_programs_are_not_read(programs: Programs) -> None:
    """Including the unfinished files of killed processes."""
    (programs.shared / "add-cache.123").write_bytes(COMPLETE[:9])
    programs.exchange()
    assert names(programs.own) == set()


def test_other_versions_and_processors_share_nothing(
    programs: Programs, monkeypatch: pytest.MonkeyPatch
) -> None:
    (programs.own / "add-cache").write_bytes(COMPLETE)
    programs.exchange()
    version = "__version__"
    for where, name in ((jax, version), (jaxlib.version, version), (sys, "implementation")):
        with monkeypatch.context() as patch:
            other = "9.9.9" if where is not sys else type("Other", (), {"cache_tag": "other-1"})
            patch.setattr(where, name, other)
            apart = Programs()
            assert names(apart.own) == names(apart.shared) == set()
            apart.close()
    monkeypatch.setattr("jaxenstein.cli.compile_cache.cpu_fact", lambda *names: "another")
    apart = Programs()
    assert names(apart.own) == names(apart.shared) == set()
    apart.close()


ADD = """
import sys
import jax
from tests.compiled import Programs

sys.prefix = sys.argv[1]
told = []
jax.monitoring.register_event_listener(lambda event, **_: told.append(event.split("/")[-1]))
programs = Programs()
assert jax.jit(lambda x: x * 3)(2) == 6
programs.exchange()
programs.close()
print(told.count("cache_misses"), told.count("cache_hits"))
"""


def test_process_runs_programs_compiled_by_another(tmp_path: Path) -> None:
    root = Path(__file__).parents[1]
    counts = []
    for _ in range(2):
        command = [sys.executable, "-c", ADD, str(tmp_path)]
        done = subprocess.run(command, cwd=root, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        counts.append([int(word) for word in done.stdout.split()])
    (compiled, _), (again, found) = counts
    assert compiled > 0 == again
    assert found == compiled
