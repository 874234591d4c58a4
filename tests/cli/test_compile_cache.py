"""The cache of compiled programs."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from jaxenstein.cli import compile_cache

ROLLOUT = ["rollout", "simple", "--height", "8", "--width", "8", "--envs", "2", "--steps", "3"]


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty home folder, with no cache folder set for JAX."""
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home" / "cache"))
    monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR", raising=False)
    monkeypatch.delenv("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", raising=False)
    return tmp_path / "home"


def rollout(*arguments: str) -> tuple[list[str], str]:
    """Its output without times, and its error output."""
    command = [sys.executable, "-m", "jaxenstein", *ROLLOUT, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return [line for line in done.stdout.splitlines() if "steps/s" not in line], done.stderr


def kept(folder: Path) -> dict[str, int]:
    return {path.name: path.stat().st_mtime_ns for path in folder.rglob("*-cache")}


@pytest.mark.slow
def test_second_call_reuses_compiled_programs(home: Path) -> None:
    shown, _ = rollout("--no-cache")
    assert not home.exists()
    assert rollout()[0] == shown
    before = kept(home)
    assert before
    (folder,) = (home / "cache" / "jaxenstein").iterdir()
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    again, said = rollout()
    assert again == shown
    assert kept(home) == before
    assert "warning" not in said.lower()


ADD = """
import resource, sys
from jaxenstein.cli.opening import printing_warnings
from jaxenstein.cli.compile_cache import keep_programs
if len(sys.argv) > 1:
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), resource.RLIM_INFINITY))
keep_programs()
import jax
print(jax.jit(lambda x: x * 3)(2))
with printing_warnings():
    print(jax.jit(lambda x: x * 5)(2))
"""


def add(*arguments: str) -> None:
    command = [sys.executable, "-W", "error::DeprecationWarning", "-c", ADD, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "6\n10\n", "")


def test_truncated_programs_are_silently_recompiled(home: Path) -> None:
    """Truncated by a kill during writing, or by a full disk, which a limit simulates."""
    add("100")
    assert not kept(home)
    add()
    before = {*home.rglob("*-cache")}
    assert before
    for path in before:
        path.write_bytes(path.read_bytes()[:100])
    add()
    # A program reported later is compiled again in the next call.
    add()
    assert {*home.rglob("*-cache")} == before
    # Some versions of JAX compile a program to files of slightly different sizes.
    assert all(path.stat().st_size > 100 for path in before)


def test_folder_is_set_in_jax_unless_already_set(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: dict[str, object] = {}
    monkeypatch.setattr("jax.config.update", told.__setitem__)
    compile_cache.keep_programs()
    assert told["jax_compilation_cache_dir"] == str(compile_cache.programs_folder())
    assert compile_cache.programs_folder().is_dir()
    told.clear()
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", "elsewhere")
    compile_cache.keep_programs()
    monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR")
    compile_cache.programs_folder().chmod(0o777)
    compile_cache.keep_programs()
    monkeypatch.setenv("XDG_CACHE_HOME", str(home / "file"))
    (home / "file").write_text("no folder")
    compile_cache.keep_programs()
    assert told == {}


def test_least_recently_used_programs_are_removed(home: Path) -> None:
    folder = home / "cache" / "jaxenstein" / "x"
    folder.mkdir(parents=True)
    (folder / "note").write_bytes(bytes(1000))
    for age, name in enumerate(("new", "middle", "old")):
        (folder / f"{name}-cache").write_bytes(bytes(10))
        os.utime(folder / f"{name}-cache", (1e9 - age, 1e9 - age))
    compile_cache.make_room(folder.parent, limit=30)
    assert len(kept(folder)) == 3
    compile_cache.make_room(folder.parent, limit=19)
    assert list(kept(folder)) == ["new-cache"]
    assert (folder / "note").exists()


def test_folder_of_another_user_is_not_used(home: Path) -> None:
    (home / "folder").mkdir(parents=True)
    (home / "folder").chmod(0o700)
    (home / "link").symlink_to(home / "folder")
    assert compile_cache.is_private(home / "folder")
    assert not compile_cache.is_private(home / "link")
    for mode, safe in ((0o777, False), (0o1777, True)):
        home.chmod(mode)
        assert compile_cache.is_private(home / "folder") == safe
    (home / "folder").chmod(0o770)
    assert not compile_cache.is_private(home / "folder")


def test_each_processor_type_has_its_own_folder(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = compile_cache.programs_folder()
    assert folder == compile_cache.programs_folder()
    monkeypatch.setattr("jaxenstein.cli.compile_cache.cpu_fact", lambda *names: "another")
    assert compile_cache.programs_folder() != folder
