"""The page: every number from the files, and nothing of a quick run in docs/."""

import json
import re

import numpy as np
import pytest

import benchmarks.report.__main__ as report
from benchmarks.report.pages import ROOT, Pages
from benchmarks.report.results import read_results
from benchmarks.report.tables import column, markdown, number
from benchmarks.suites.parts import PARTS
from benchmarks.suites.plan import QUICK
from jaxenstein.errors import SettingError
from jaxenstein.speed.measuring import summarise

HARDWARE = {"cpu": "A Processor", "cores": 4, "cores_allowed": 2, "platform": "Linux"}
VERSIONS = {"python": "3.11.7", "jax": "0.10.2", "numpy": "2.4.6", "jaxenstein": "0.1.0"}


def results(folder, quick=False, parts=tuple(PARTS), disturbed=(0.2,)):
    """Files of parts with rates drawn at random; returns the rates by part and subject."""
    rng, drawn = np.random.default_rng(0), {}
    for name in parts:
        groups = []
        for group in PARTS[name](QUICK):
            rows = []
            for subject in group:
                row = {
                    "name": subject.name, "title": subject.title, "axes": dict(subject.axes),
                    "references": dict(subject.references), "pinned": subject.pinned,
                }  # fmt: skip
                if "miniworld" in subject.name:
                    rows.append(row | {"failed": "no display | none"})
                    continue
                rates = np.exp(rng.normal(9, 2, 3))
                drawn[name, subject.name] = rates
                notes = {"renderer": "llvmpipe"} if "envpool" in subject.name else {}
                rows.append(row | {
                    "versions": VERSIONS, "notes": notes, "ready_seconds": 1.0,
                    "disturbed": list(disturbed),
                    "steps_per_second": summarise(rates),
                })  # fmt: skip
            groups.append(rows)
        settings = {"core": 1, "rounds": 3, "seconds": 0.5, "quick": quick}
        whole = {
            "part": name, "format": 1, "began": "2026-01-01T00:00:00+00:00", "load": 0.1,
            "versions": VERSIONS, "hardware": HARDWARE, "settings": settings, "groups": groups,
        }  # fmt: skip
        (folder / f"{name}.json").write_text(json.dumps(whole))
    return drawn


def cells(text, title):
    """The cells of the first row of a table that begins with a title."""
    row = next(line for line in text.splitlines() if line.startswith(f"| {title} |"))
    return [cell.strip() for cell in row.strip("|").split("|")]


def written(folder, out):
    """The pages that the command writes, by name, and the first one."""
    out.parent.mkdir(exist_ok=True)
    report.main([str(folder), "--out", str(out)])
    return {path.stem: path.read_text() for path in out.parent.rglob("*.md")}


def test_the_pages_say_what_the_files_say(tmp_path):
    pytest.importorskip("matplotlib")
    drawn = results(tmp_path, disturbed=())
    out = tmp_path / "pages" / "page.md"
    pages = written(tmp_path, out)
    ours = drawn["peers", "scan-16"]
    row = cells(pages["peers"], "JAXenstein my-way-home, scan, 16 environments")
    low, middle, high = (f"{np.quantile(ours, q):,.0f}" for q in (0.25, 0.5, 0.75))
    assert row[1:3] == [middle, f"{low} - {high}"]
    assert row[3] == number(1e6 / np.median(ours))
    assert row[4] == number(np.median(ours / drawn["peers", "vizdoom-gymnasium"]))
    assert row[5] == number(np.median(ours / drawn["peers", "vizdoom-raw"]))
    assert "no quiet machine" not in pages["page"]
    # The summary has the machine, the fastest scan, and of each part the least and the most.
    assert "A Processor" in pages["page"]
    scans = ("scan-1", "scan-16")
    best = max(np.median(drawn["peers", name]) for name in scans)
    assert f"**{best:,.0f} steps a second**" in pages["page"]
    rates = [np.median(drawn["environments", f"scan-16 id={name}"]) for name in QUICK.ids]
    least, most = (choose(zip(rates, QUICK.ids, strict=True)) for choose in (min, max))
    row = cells(pages["page"], "[Every environment](benchmarks/environments.md)")
    assert row[1:] == [f"{rate:,.0f} ({name})" for rate, name in (least, most)]
    # Told in words, and each part has its command and its plots.
    text = "\n".join(pages.values())
    assert "- MiniWorld Hallway, 80x60 to 64x64 by area; MiniWorld Hallway, 64x64: no disp" in text
    assert "EnvPool MyWayHome, 8 envs, 64x64 by area: renderer llvmpipe" in text
    for name in (name for name in PARTS if name != "compare"):
        assert f"`python -m benchmarks {name} --json {tmp_path.name} --core 1" in text
    pictures = [(stem, picture) for stem, page in pages.items()
                for picture in re.findall(r"!\[[^]]+\]\(([^)]+)\)", page)]  # fmt: skip
    assert len(pictures) == 8
    for stem, picture in pictures:
        folder = out.parent if stem == "page" else out.parent / "benchmarks"
        assert (folder / picture).read_bytes().startswith(b"\x89PNG")
    for table in re.findall(r"(?:^\|.*\n)+", text, re.M):
        assert len({line.count("|") for line in table.splitlines()}) == 1
    assert "{{" not in text


def test_adapters_stand_beside_the_native_figure_of_their_kind(tmp_path):
    drawn = results(tmp_path, parts=["adapters"])
    text = Pages(read_results(tmp_path), tmp_path, []).write()["benchmarks/adapters.md"]
    row = cells(text, "Gymnasium vector, same-step")
    mine = drawn["adapters", "adapter-gymnasium-same-step-16"]
    native = drawn["adapters", "adapter-loop-16"]
    assert row[5:] == [f"{np.median(native):,.0f}", number(np.median(mine / native))]
    assert "| native," not in text


def test_equal_results_are_equal_files(tmp_path):
    pytest.importorskip("matplotlib")
    results(tmp_path, parts=["batches"])
    for name in ("one", "two"):
        written(tmp_path, tmp_path / name / "page.md")
    pictures = [tmp_path / name / "images/benchmarks/batches.png" for name in ("one", "two")]
    assert pictures[0].read_bytes() == pictures[1].read_bytes()


def test_the_pages_in_docs_are_those_of_the_committed_results():
    """No figure is typed by hand; after a change of a template: `python -m benchmarks.report`."""
    folder, docs = ROOT / "benchmarks" / "results" / "epyc-2core", ROOT / "docs"
    drawn = [path.stem for path in (docs / "images" / "benchmarks").glob("*.png")]
    for name, text in Pages(read_results(folder), folder, drawn).write().items():
        assert (docs / name).read_text("utf-8") == text, name


def test_quick_figures_stay_out_of_docs(tmp_path, monkeypatch):
    results(tmp_path, quick=True, parts=["batches"])
    monkeypatch.setattr(report, "OUT", tmp_path / "docs.md")
    with pytest.raises(SettingError, match="batches are of a quick run"):
        report.main([str(tmp_path), "--out", str(tmp_path / "docs.md")])
    assert not (tmp_path / "docs.md").exists()
    text = Pages(read_results(tmp_path), tmp_path, []).write()["benchmarks.md"]
    assert "figures of a quick run" in text


def test_a_part_alone_names_the_others(tmp_path):
    results(tmp_path, parts=["observations"])
    pages = Pages(read_results(tmp_path), tmp_path, []).write()
    assert "Not measured: peers, cores, frame-skip, scenarios, batches" in pages["benchmarks.md"]
    assert "no quiet machine" in pages["benchmarks.md"]
    assert "steps a second**" not in pages["benchmarks.md"]
    assert "## Kinds of observations" in pages["benchmarks/environments.md"]
    assert "## Image sizes" not in pages["benchmarks/environments.md"]


def test_other_commands_are_taken_in(tmp_path):
    results(tmp_path, parts=["observations"])
    rates = summarise(np.array([1000.0, 2000.0, 3000.0]))
    device = {"versions": VERSIONS, "device": "gpu: X", "copy_bytes_per_second": 192e6, "rows": [
        {"id": "simple", "batch": 64, "width": 8, "height": 4, "steps_per_second": rates,
         "frames_per_second": rates, "frame_bytes": 96, "compile_seconds": 2.0,
         "program_bytes": 2**20, "kernels_a_step": {"count": 12.0, "seconds": 1e-5}},
        {"id": "simple", "batch": 128, "width": 8, "height": 4, "failed": "out of memory"},
    ]}  # fmt: skip
    spread = {"device": "gpu: X", "processes": 2, "settings": {"id": "simple"}, "rows": [
        {"devices": 1, "batch": 64, "steps_per_second": rates},
        {"devices": 4, "batch": 256, "steps_per_second": summarise(np.array([7000.0]))},
    ]}  # fmt: skip
    training = {"rows": [
        {"algo": "ppo", "num_envs": 16, "dtype": "float32", "steps_per_second": 1234.0,
         "first_call_seconds": 9.0},
    ]}  # fmt: skip
    for name, content in (("device", device), ("spread", spread), ("training", training)):
        (tmp_path / f"{name}.json").write_text(json.dumps(content))
    text = Pages(read_results(tmp_path), tmp_path, []).write()["benchmarks/training.md"]
    # 2000 frames of 96 bytes are a thousandth of 192 MB.
    assert "| simple | 8x4 | 64 | 2,000 | 2,000 | 0.1% | 2.0 | 1 | 12 |" in text
    assert "| simple | 8x4 | 128 | not measured |" in text
    assert "- simple, 128: out of memory" in text
    assert "| 4 | 256 | 7,000 | 3.50 |" in text
    assert "| ppo | float32 | 16 | 1,234 | 9 |" in text


def test_no_results(tmp_path):
    with pytest.raises(SettingError, match="no results"):
        read_results(tmp_path)
    (tmp_path / "peers.json").write_text("{")
    with pytest.raises(SettingError, match=r"peers\.json cannot be read"):
        read_results(tmp_path)
    (tmp_path / "peers.json").write_text("{}")
    with pytest.raises(SettingError, match="no result of"):
        read_results(tmp_path)


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.01234, "0.012"), (0.5, "0.50"), (9.94, "9.94"), (12.34, "12.3"), (1234.5, "1,234")],
)
def test_numbers(value, text):
    assert number(value) == text


def test_tables():
    columns = [column("a", left=True), column("b", "c", "d")]
    rows = [{"a": "x|y", "c": {"d": 1}}, {"a": ""}]
    assert markdown(columns, rows) == "| a | b |\n| --- | ---: |\n| x/y | 1 |\n|  |  |"
