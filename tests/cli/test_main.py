"""The command line as a whole: help, wrong arguments, exit codes."""

from __future__ import annotations

import io
import json
import os
import re
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import jaxenstein
from jaxenstein import registry
from jaxenstein.catalogue import MAIN_IDS
from jaxenstein.cli import build_parser, listing, main, rollout
from jaxenstein.cli.opening import handling
from jaxenstein.trajectory import FORMAT, FORMAT_VERSION

TRAIN = ["train", "--out", "run"]


def test_list_names_every_environment(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list"]) == 0
    out, err = capsys.readouterr()
    lines = out.splitlines()
    for name in MAIN_IDS:
        (line,) = [line for line in lines if line.split()[:1] == [name]]
        env, params = jaxenstein.make(name)
        columns, rows = env.map_size  # type: ignore[attr-defined]
        assert f" {columns}x{rows}" in line
        assert f" {params.max_steps_in_episode} " in line
    words = set(re.split(r"[\s,]+", out))
    assert set(jaxenstein.environment_ids()) <= words
    assert "2 forward" in out
    assert max(map(len, lines)) <= 100
    assert err == ""


def test_list_all_includes_variants(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    some = ["t-maze", "doom-basic", "doom-simpler-basic"]
    monkeypatch.setattr(registry, "environment_ids", lambda: some)
    for words, rows in (["list"], some[:2]), (["list", "--all"], some):
        assert main(words) == 0
        table, notes = capsys.readouterr().out.split("\n\n")
        assert [line.split()[0] for line in table.splitlines() if line[0] != " "] == ["ID", *rows]
        told = "variants of doom-basic (--all): doom-simpler-basic" in notes.splitlines()
        assert told == (rows != some)


def test_list_shows_number_of_levels(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "simple", "key-corridor-s3r1", "memory-maze-9x9"]) == 0
    table, notes = capsys.readouterr().out.split("\n\n")
    rows = [line.split() for line in table.splitlines() if line[0] != " "]
    assert [row[1:3] for row in rows] == [
        ["MAP", "LEVELS"],
        ["9x5", "300"],
        ["7x3*", "36"],
        ["11x11*", "10,000+"],
    ]
    assert "levels: number of different levels; + means at least this many" in notes


def test_list_shows_actions_per_environment() -> None:
    five, three = ("a", "b", "c", "d", "e"), ("a", "b", "c")
    assert listing.actions_of({"x": five, "y": five}) == ["actions of all: 0 a, 1 b, 2 c, 3 d, 4 e"]
    assert listing.actions_of({"x": three, "y": five, "z": five}) == [
        "actions of x: 0 a, 1 b, 2 c",
        "actions of all others: 0 a, 1 b, 2 c, 3 d, 4 e",
    ]


def test_tables_wrap_their_last_column() -> None:
    rows = [("ID", "N", "TEXT"), ("one", "10", "words " * 10), ("three", "2", "")]
    lines = listing.format_table(rows, right=(1,), width=40).splitlines()
    assert lines[0] == "ID      N  TEXT"
    assert lines[1] == "one    10  words words words words words"
    assert lines[2] == "           words words words words words"
    assert lines[3] == "three   2"


def test_list_explains_the_symbols(capsys: pytest.CaptureFixture[str]) -> None:
    from jaxenstein.maps.symbols import legend

    assert main(["list", "--symbols"]) == 0
    assert capsys.readouterr().out.strip() == legend().strip()


@pytest.mark.parametrize(
    "command",
    [
        *("", "list", "rollout", "play", "record", "replay", "bench", "convert", "score"),
        *("train", "sweep", "evaluate", "export", "plot"),
    ],
)
def test_help_shows_examples(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    if command in ("train", "sweep", "evaluate", "export", "plot"):
        pytest.importorskip("flax")
    with pytest.raises(SystemExit) as caught:
        main([*command.split(), "--help"])
    assert caught.value.code == 0
    out = capsys.readouterr().out
    assert f"examples:\n  jaxenstein {command}" in out
    assert max(len(line) for line in out.splitlines()) <= 100


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("list simple --symbols", "give either --symbols or simple"),
        ("list --samples --configs", "give either --samples or --configs"),
        ("bench --size 160x120 --height 64", "give either --size or --height and --width"),
        ("play simple --native --policy a.b:c", "--native is for play by hand"),
        (
            "rollout tests.baselines.worlds:Countdown",
            "has no pictures: it is not a first-person task",
        ),
    ],
)
def test_arguments_without_effect_are_refused(
    words: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words.split()) == 2
    assert told in capsys.readouterr().err


def test_help_shows_the_form_and_default_of_seeds(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("optax")
    for command, default in (("train", 1), ("sweep", 5)):
        with pytest.raises(SystemExit):
            main([command, "--help"])
        shown = " ".join(capsys.readouterr().out.split())
        assert re.search(rf" --seeds N [^(]*\([^)]*default {default}\)", shown)


def test_help_without_a_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0
    out = capsys.readouterr().out
    assert out == build_parser().format_help()
    assert "  record " in out


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["--version"])
    assert caught.value.code == 0
    assert capsys.readouterr().out == f"jaxenstein {jaxenstein.__version__}\n"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["fly"], "fly"),
        (["rollout"], "ID"),
        (["rollout", "simple", "--map-file", "x"], "either"),
        (["rollout", "my-way-hom"], "my-way-home"),
        (["rollout", "..tasks:mine"], "'..tasks' is not the name of a module"),
        (["rollout", ":simple"], "'' is not the name of a module"),
        (["rollout", "simple", "--import", ""], "'' is not the name of a module"),
        (["rollout", "simple", "--envs", "0"], ">= 1"),
        (["rollout", "simple", "--envs", "many"], "'many'"),
        (["rollout", "simple", "--fov", "200"], "30 to 120"),
        (["rollout", "simple", "--observation", "smell"], "smell"),
        (["rollout", "simple", "--sed", "1"], "--sed"),
        (["rollout", "--map-file", "no/such/file"], "no/such/file"),
        (["rollout", "simple", "--heading", "90"], "--map-file"),
        (["rollout", "--map-file", "x", "--heading", "north"], "'north'"),
        (["record", "--map-file", "x", "--out", "a.gif", "--heading", "90,45"], "and highest"),
        (["record", "simple"], "at least one of --out"),
        (["record", "simple", "--out", "a.avi"], ".gif, .mp4 or .png"),
        (["record", "simple", "--out", "a.gif", "--save", "a.txt"], ".json"),
        (["record", "simple", "--out", "a.gif", "--policy", "greedy_medkits"], "shortest_path"),
        (["replay", "no/such.json"], "no/such.json: cannot be read"),
        (["replay"], "FILE"),
        (["record", "simple", "--out", "a.gif", "--sheet", "a.jpg"], ".png"),
        (["record", "simple", "--out", "a.png", "--sheet", "b.png"], "as --sheet does; give one"),
        (["record", "simple", "--out", "a.gif", "--actions", "2,fly"], "'fly'"),
        (["record", "simple", "--out", "a.gif", "--actions", "2,7"], "'7'"),
        (["record", "simple", "--out", "a.gif", "--actions", "2*x"], "2*x"),
        (["record", "simple", "--out", "a.gif", "--fps", "nan"], "1 to 50"),
        (["bench", "simpel"], "simple"),
        (["bench", "--batch", "1,,2"], "--batch"),
        (["bench", "--size", "64"], "WIDTHxHEIGHT"),
        (["bench", "--core", "100000"], "100000"),
        (["play"], "give either the ID of an environment or --map-file"),
        (["play", "simpel"], "did you mean 'simple'"),
        (["play", "simple", "--record", "a.png"], "a.png"),
        (["play", "simple", "--save", "a.txt"], "should end in .json"),
        (["play", "simple", "--native", "--width", "32"], "either --native or --height and --wid"),
        (["play", "simple", "--fps", "0"], "must be a finite number from 1 to 60"),
        (["list", "--json"], "jaxenstein: unrecognized arguments: --json (see"),
        ([*TRAIN, "--leraning-rate=1"], "argument: --leraning-rate=1, did you mean '--learning-r"),
        ([*TRAIN, "--algo=rdn"], "must be one of 'ppo', 'rnd', 'icm', 'e3b', not 'rdn', did you"),
        ([*TRAIN, "--num-envs=many"], "argument --num-envs: must be a whole number >= 1, not"),
        ([*TRAIN, "--clip=0"], "argument --clip: must be a finite number above 0, not 0"),
        ([*TRAIN, "--set=fov"], "--set must be NAME=VALUE, not 'fov'"),
        ([*TRAIN, "--env=simple", "--num-envs=6"], "num_envs must be a multiple of minibatches"),
        ([*TRAIN, "--env=simple", "--persistence=1", "--no-recurrent"], "persistence needs recurr"),
        ([*TRAIN, "--config=none.toml"], "cannot read none.toml: no such file"),
        ([*TRAIN, "--map-file=none.txt"], "cannot read the map none.txt: no such file"),
        ([*TRAIN, "--resume"], "there is no run in"),
        ([*TRAIN, "--seeds=2"], "jaxenstein train: give an environment with --env ID"),
        ([*TRAIN, "simple"], "argument: simple; an environment is given as --env ID"),
        ([*TRAIN, "--save-every=-1"], "must be a finite number from 0"),
    ],
)  # fmt: skip
def test_wrong_arguments_get_one_line_and_code_2(
    arguments: list[str],
    words: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if arguments[0] == "train":
        pytest.importorskip("flax")
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("jaxenstein")
    assert words in err
    assert list(tmp_path.iterdir()) == []


def test_error_in_map_file_names_the_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bad.txt"
    path.write_text("#####\n#S~G#\n#####\n")
    assert main(["rollout", "--map-file", str(path)]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "line 2" in err
    path.write_bytes(b"\xff\xfe\x00")
    assert main(["rollout", "--map-file", str(path)]) == 2
    assert "not text" in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments",
    [
        ["record", "simple", "--out", "{}/none/a.gif"],
        ["record", "simple", "--out", "{}/file/a.gif"],
        ["record", "simple", "--out", "{}/folder.gif"],
        ["record", "simple", "--out", "{}/a.gif", "--sheet", "{}/none/a.png"],
        ["record", "simple", "--out", "{}/a.gif", "--save", "{}/none/a.json"],
        ["replay", "a.json", "--out", "{}/none/a.gif"],
        ["play", "simple", "--record", "{}/none/a.gif"],
        ["play", "simple", "--save", "{}/none/a.json"],
        ["rollout", "simple", "--out", "{}/file"],
        ["bench", "--json", "{}/none/a.json"],
    ],
)
def test_unwritable_outputs_get_one_line_and_code_1_at_once(
    arguments: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("x")
    (tmp_path / "folder.gif").mkdir()
    assert main([part.format(tmp_path) for part in arguments]) == 1
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert f"cannot write {tmp_path}" in err


LONG = "a" * 300


@pytest.mark.parametrize(
    "arguments",
    [
        ["evaluate", LONG],
        ["evaluate", f"{LONG}.npz"],
        ["evaluate", f"pretrained/{LONG}"],
        ["export", LONG, "--out", "a.npz"],
        ["plot", LONG, "--out", "a.png"],
        ["record", "--policy", f"a/{LONG}", "--out", "a.gif"],
        ["record", "--map-file", f"samples/{LONG}", "--out", "a.gif"],
        ["record", "--map-file", f"{LONG}.txt", "--out", "a.gif"],
        ["replay", LONG],
        ["score", LONG],
        ["train", "--config", LONG, "--out", "new"],
        ["train", "--resume", "--out", LONG],
    ],
)
def test_impossible_file_names_get_one_line_and_code_2(
    arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """`Path.exists` raises for such names, and in folders of other users."""
    if arguments[0] not in ("record", "replay", "score"):
        pytest.importorskip("flax")
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    assert LONG[:40] in capsys.readouterr().err.splitlines()[-1]
    assert not list(tmp_path.iterdir())


def interrupt(_: object) -> None:
    raise KeyboardInterrupt


def test_interrupt(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(listing, "run", interrupt)
    assert main(["list"]) == 130
    assert capsys.readouterr().err == "interrupted\n"


@pytest.mark.skipif(sys.platform == "win32", reason="has no such signals")
def test_signal_ends_a_command_cleanly(monkeypatch: pytest.MonkeyPatch) -> None:
    """No partial file is left."""
    ended = []

    def work(_: object) -> None:
        try:
            os.kill(os.getpid(), signal.SIGTERM)
        finally:
            ended.append(True)

    before = signal.getsignal(signal.SIGTERM)
    monkeypatch.setattr(listing, "run", work)
    with pytest.raises(SystemExit) as ending:
        main(["list"])
    assert ending.value.code == 143
    assert ended
    assert signal.getsignal(signal.SIGTERM) == before


@pytest.mark.skipif(sys.platform == "win32", reason="has no such signal")
def test_ignored_signals_stay_ignored() -> None:
    """`nohup jaxenstein train` must outlive its terminal."""

    def answer(number: int, frame: object) -> None:
        raise AssertionError(number, frame)

    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with handling(["SIGHUP"], answer):
            os.kill(os.getpid(), signal.SIGHUP)
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_commands_run_in_any_thread(capsys: pytest.CaptureFixture[str]) -> None:
    with ThreadPoolExecutor() as pool:
        assert pool.submit(main, ["list"]).result() == 0
    assert "key-door" in capsys.readouterr().out


def test_jax_errors_get_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run_out(_: object) -> None:
        raise RuntimeError("RESOURCE_EXHAUSTED:\n  Out of memory")

    monkeypatch.setattr(rollout, "run", run_out)
    assert main(["rollout", "simple"]) == 1
    assert capsys.readouterr().err == "jaxenstein: RESOURCE_EXHAUSTED: Out of memory\n"


def test_broken_pipe_is_quiet() -> None:
    source = Path(jaxenstein.__file__).parents[1]
    process = subprocess.Popen(
        [sys.executable, "-m", "jaxenstein", "list"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": str(source)},
    )
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    with process.stderr as stream:
        assert stream.read() == b""
    assert process.wait() == 141


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs Linux")
def test_full_disk_for_printed_text_is_told() -> None:
    source = Path(jaxenstein.__file__).parents[1]
    with open("/dev/full", "w") as full:
        ended = subprocess.run(
            [sys.executable, "-m", "jaxenstein", "list", "--symbols"],
            stdout=full,
            stderr=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": str(source)},
            check=False,
            text=True,
        )
    assert (ended.returncode, ended.stderr) == (1, "jaxenstein: no space left on device\n")


def test_warnings_about_a_map_are_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = Path("walled.txt")
    path.write_text("#######\n#S#.#G#\n#######\n")
    # The map is read before the output turns out to be impossible.
    assert main(["record", "--map-file", str(path), "--out", "none/a.gif"]) == 1
    first, second = capsys.readouterr().err.splitlines()
    assert first.startswith("jaxenstein: warning: ")
    assert "none" in second


def test_errors_escape_control_characters(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Control characters in a file must not reach the terminal."""
    table = {"format": FORMAT, "format_version": FORMAT_VERSION, "made_by": {}, "\x1b[2J\u202e": 1}
    (tmp_path / "a.json").write_text(json.dumps(table))
    assert main(["replay", str(tmp_path / "a.json")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith(r"unknown entry '\x1b[2J\u202e'")


def test_output_can_be_a_plain_stream(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stdout", stream)
    assert main(["list"]) == 0
    assert "key-door" in stream.getvalue()
