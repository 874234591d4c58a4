"""Files are written completely or not at all."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

import jaxenstein
from jaxenstein import read_results
from jaxenstein.comparison import read_reference
from jaxenstein.episodes.trajectory_file import load_trajectory
from jaxenstein.files import (
    OutputError,
    atomic,
    check_links,
    check_writable,
    make_folder,
    read_text,
)


def fail_with(number: int):
    def fail(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    return fail


def test_content_is_written_with_ordinary_permissions(tmp_path: Path) -> None:
    target = tmp_path / "file"
    plain = tmp_path / "plain"
    plain.write_text("x")
    with atomic(target) as temporary:
        temporary.write_text("new")
        assert temporary.parent == tmp_path
        assert not target.exists()
    assert target.read_text() == "new"
    assert target.stat().st_mode == plain.stat().st_mode
    assert sorted(tmp_path.iterdir()) == [target, plain]


@pytest.mark.parametrize("name", ["x" * 255, "\N{MAN}" * 63, "a\nb 'c\" \udcff"])
def test_every_name_the_system_allows_can_be_written(tmp_path: Path, name: str) -> None:
    target = tmp_path / name
    try:
        target.write_text("old")
    except OSError:
        pytest.skip("this system does not allow it")
    with atomic(target) as part:
        part.write_text("new")
    assert target.read_text() == "new"
    assert list(tmp_path.iterdir()) == [target]


def test_full_disk_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "file"
    target.write_text("old")
    monkeypatch.setattr(os, "replace", fail_with(errno.ENOSPC))
    with (
        pytest.raises(OutputError, match=r"file: no space left on device$"),
        atomic(target) as part,
    ):
        part.write_text("new")
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_error_in_the_block_leaves_nothing(tmp_path: Path) -> None:
    def write() -> None:
        with atomic(tmp_path / "file") as part:
            part.write_text("half")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        write()
    assert list(tmp_path.iterdir()) == []


def test_impossible_targets_are_reported_early(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    for target, reason in (
        (tmp_path, "it is a folder"),
        (tmp_path / "none" / "a", "there is no folder"),
        (tmp_path / "file" / "a", "is not a folder"),
    ):
        with pytest.raises(OutputError, match=reason) as caught:
            check_writable(target)
        assert str(target) in str(caught.value)
    with pytest.raises(OutputError, match="not a folder"):
        make_folder(tmp_path / "file")
    with pytest.raises(OutputError):
        make_folder(tmp_path / "file" / "below")


def test_devices_and_pipes_are_not_replaced(tmp_path: Path) -> None:
    """Otherwise a user who can write to their folder would lose `/dev/stdout`."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to(os.devnull)
    for name in ("pipe", "link"):
        with pytest.raises(OutputError, match="it is a device or a pipe"), atomic(tmp_path / name):
            pass
    assert (tmp_path / "pipe").is_fifo()
    assert (tmp_path / "link").is_char_device()


def test_permissions_stay(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("old")
    file.chmod(0o400)
    with atomic(file) as temporary:
        temporary.write_text("new")
    assert file.read_text() == "new"
    assert file.stat().st_mode & 0o777 == 0o400


def test_unwritable_folder_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "run").mkdir()
    monkeypatch.setattr(Path, "lstat", fail_with(errno.EACCES))
    with pytest.raises(OutputError, match=r"^cannot write .*run: permission denied$"):
        check_links(tmp_path)


def test_links_of_weights_and_biases_do_not_matter(tmp_path: Path) -> None:
    """It links to its cache from every run."""
    logs = tmp_path / "run" / "wandb" / "run-1" / "logs"
    logs.mkdir(parents=True)
    (logs / "debug-core.log").symlink_to(tmp_path / "cache.log")
    check_links(tmp_path / "run")
    (tmp_path / "run" / "other").symlink_to(tmp_path)
    with pytest.raises(jaxenstein.SettingError, match="is a link out of"):
        check_links(tmp_path / "run")


def test_too_long_name_is_reported_before_anything_is_created(tmp_path: Path) -> None:
    for path in (tmp_path / ("a" * 300), tmp_path / ("a" * 300) / "b.gif"):
        with pytest.raises(OutputError, match=r"^cannot write .*: file name too long$"):
            check_writable(path)
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="this system has no such device")
def test_endless_device_is_not_read(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="it has more than 1000 characters"):
        read_text("/dev/zero", 1000)
    for read in (load_trajectory, read_reference, read_results, jaxenstein.from_file):
        with pytest.raises(jaxenstein.JAXensteinError, match="it has more than"):
            read("/dev/zero")
    path = tmp_path / "text"
    path.write_text("ä" * 1000, encoding="utf-8")
    assert read_text(path, 1000) == "ä" * 1000
