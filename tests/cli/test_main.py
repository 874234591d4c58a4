"""The command line as a whole: help, wrong arguments, exit codes."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path

import pytest

import jaxenstein
from jaxenstein.cli import bench, listing, main, rollout

MAP = "#####\n#S.G#\n#####\n"


def test_list_names_every_environment(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list"]) == 0
    out, err = capsys.readouterr()
    lines = out.splitlines()
    for name in jaxenstein.environment_ids():
        (line,) = [line for line in lines if line.split()[:1] == [name]]
        env, params = jaxenstein.make(name)
        tilemap = env.tilemap  # type: ignore[attr-defined]
        assert f"{tilemap.columns}x{tilemap.rows}" in line
        assert f" {params.max_steps_in_episode} " in line
    assert "2 forward" in out
    assert err == ""


def test_list_explains_the_symbols(capsys: pytest.CaptureFixture[str]) -> None:
    from jaxenstein.maps.symbols import legend

    assert main(["list", "--symbols"]) == 0
    assert capsys.readouterr().out.strip() == legend().strip()


@pytest.mark.parametrize("command", ["", "list", "rollout", "record", "bench"])
def test_help_shows_examples(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main([*command.split(), "--help"])
    assert caught.value.code == 0
    out = capsys.readouterr().out
    assert f"examples:\n  jaxenstein {command}" in out
    assert max(len(line) for line in out.splitlines()) <= 100


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["--version"])
    assert caught.value.code == 0
    assert capsys.readouterr().out == f"jaxenstein {jaxenstein.__version__}\n"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "COMMAND"),
        (["fly"], "fly"),
        (["rollout"], "ID"),
        (["rollout", "simple", "--map-file", "x"], "either"),
        (["rollout", "my-way-hom"], "my-way-home"),
        (["rollout", "simple", "--envs", "0"], "at least 1"),
        (["rollout", "simple", "--envs", "many"], "'many'"),
        (["rollout", "simple", "--fov", "200"], "30 to 120"),
        (["rollout", "simple", "--observation", "smell"], "smell"),
        (["rollout", "simple", "--sed", "1"], "--sed"),
        (["rollout", "--map-file", "no/such/file"], "no/such/file"),
        (["record", "simple"], "--out"),
        (["record", "simple", "--out", "a.mp4"], ".gif"),
        (["record", "simple", "--out", "a.gif", "--sheet", "a.jpg"], ".png"),
        (["record", "simple", "--out", "a.gif", "--actions", "2,fly"], "'fly'"),
        (["record", "simple", "--out", "a.gif", "--actions", "2,7"], "'7'"),
        (["record", "simple", "--out", "a.gif", "--actions", "2*x"], "2*x"),
        (["record", "simple", "--out", "a.gif", "--fps", "nan"], "1 to 50"),
        (["bench", "simpel"], "simple"),
        (["bench", "--batch", "1,,2"], "--batch"),
        (["bench", "--size", "64"], "WIDTHxHEIGHT"),
        (["bench", "--core", "100000"], "100000"),
    ],
)  # fmt: skip
def test_wrong_arguments_get_one_line_and_code_2(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("jaxenstein")
    assert words in err
    assert "Traceback" not in err


def test_bad_map_file_names_the_place(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
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


def interrupt(_: object) -> None:
    raise KeyboardInterrupt


def test_interrupt(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(listing, "run", interrupt)
    assert main(["list"]) == 130
    assert capsys.readouterr().err == "interrupted\n"


def test_errors_of_jax_get_one_line(
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
        [sys.executable, "-m", "jaxenstein.cli", "list"],
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


def test_warnings_about_a_map_are_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = Path("walled.txt")
    path.write_text("#######\n#S#.#G#\n#######\n")
    # The map is read, and then the output turns out to be impossible.
    assert main(["record", "--map-file", str(path), "--out", "none/a.gif"]) == 1
    first, second = capsys.readouterr().err.splitlines()
    assert first.startswith("jaxenstein: warning: ")
    assert "none" in second


def test_bench_table_lines_up() -> None:
    rates = {"median": 99960.0, "lower_quartile": 1e5, "upper_quartile": 217_400.0}
    result = {
        "id": "simple", "width": 64, "height": 48, "batch": 256, "steps_per_second": rates,
        "compile_seconds": {"reset": 1.0, "step": 2.25}, "peak_memory_bytes": 300 * 2**20,
    }  # fmt: skip
    header, line = bench.table([result]).splitlines()
    assert " ".join(line.split()) == "simple 64x48 256 100k 100k - 217k 3.2 s 300 MiB"
    assert header.index("BATCH") + len("BATCH") == line.index("256") + len("256")


def test_output_can_be_a_plain_stream(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stdout", stream)
    assert main(["list"]) == 0
    assert "key-door" in stream.getvalue()
