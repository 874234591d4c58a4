"""Where peers are looked for, and what is kept of an attempt to install one."""

import json
import sys

import pytest

from benchmarks.suites import peers
from benchmarks.suites.peers import PEERS, Found, Peer, find, install


@pytest.fixture
def two(monkeypatch):
    table = {"here": Peer(("a>=1",), ("json",)), "gone": Peer(("b>=1",), ("no_such_module",))}
    monkeypatch.setattr(peers, "PEERS", table)
    monkeypatch.setattr(peers, "interpreters", lambda: iter(["old", "new"]))


def test_a_peer_is_in_its_environment_or_here(two, tmp_path):
    assert find("here", tmp_path) == Found(sys.executable)
    assert "not installed" in find("gone", tmp_path).problem
    (tmp_path / "gone").mkdir()
    (tmp_path / "gone" / "outcome.json").write_text('{"python": "p", "problem": ""}')
    assert find("gone", tmp_path) == Found("p")
    (tmp_path / "gone" / "outcome.json").write_text("half")
    assert "not installed" in find("gone", tmp_path).problem


def test_what_is_here_is_not_installed(two, tmp_path, monkeypatch):
    monkeypatch.setattr(peers, "_try", lambda *_: pytest.fail("installed"))
    assert install("here", tmp_path) == Found(sys.executable)
    assert not list(tmp_path.iterdir())


def test_one_interpreter_after_the_other(two, tmp_path, monkeypatch):
    tried = []

    def attempt(base, home, peer):
        tried.append(base)
        return Found("python") if base == "new" else Found(problem="no wheel")

    monkeypatch.setattr(peers, "_try", attempt)
    assert install("gone", tmp_path) == Found("python") == find("gone", tmp_path)
    assert tried == ["old", "new"]
    # Kept, as long as the requirements are the same.
    assert install("gone", tmp_path) == Found("python")
    assert tried == ["old", "new"]
    monkeypatch.setitem(peers.PEERS, "gone", Peer(("b>=2",), ("no_such_module",)))
    install("gone", tmp_path)
    assert tried == ["old", "new"] * 2


def test_failures_are_kept_and_tried_again(two, tmp_path, monkeypatch):
    monkeypatch.setattr(peers, "_try", lambda *_: Found(problem="no wheel"))
    assert install("gone", tmp_path).problem == "no wheel" == find("gone", tmp_path).problem
    assert json.loads((tmp_path / "gone" / "outcome.json").read_text())["python"] == ""
    monkeypatch.setattr(peers, "_try", lambda *_: Found("python"))
    assert install("gone", tmp_path) == Found("python")


def test_reasons_say_what_pip_said():
    text = "WARNING: slow\nERROR: Could not find b\nERROR: No match for b>=1\nnotice of pip"
    assert peers._reason(text, "/h") == "No match for b>=1"
    assert peers._reason("Traceback\nOSError: /h/bin/x", "/h") == "OSError: /bin/x"
    assert peers._reason("", "/h")


def test_a_broken_interpreter_is_a_reason(tmp_path):
    found = peers._try(str(tmp_path / "python"), tmp_path / "home", PEERS["vizdoom"])
    assert found.problem
    assert not found.python
