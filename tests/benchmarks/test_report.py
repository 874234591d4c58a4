"""The page: every number from the files, and nothing of a quick run in docs/."""

import json
import re

import numpy as np
import pytest

from benchmarks import report
from benchmarks.parts import PARTS, quick_plan
from benchmarks.peers import Found
from benchmarks.plots import save_plots
from benchmarks.results import read_parts
from benchmarks.tables import markdown, number
from jaxenstein.errors import SettingError
from jaxenstein.speed.measuring import summarise

HARDWARE = {"cpu": "A Processor", "cores": 4, "cores_allowed": 2, "platform": "Linux"}
VERSIONS = {"python": "3.11.7", "jax": "0.10.2", "numpy": "2.4.6", "jaxenstein": "0.1.0"}


def results(folder, quick=False, parts=tuple(PARTS), disturbed=(0.2,)):
    """Files of parts with rates drawn at random; returns the rates by part and subject."""
    rng, drawn = np.random.default_rng(0), {}
    plan = quick_plan()
    for name in parts:
        groups = []
        for group in PARTS[name](plan):
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


@pytest.fixture
def found(monkeypatch):
    """Plans are made as if every peer were installed."""
    monkeypatch.setattr("benchmarks.parts.Plan.find", lambda *_: Found("python"), raising=False)


def cells(text, title):
    """The cells of the first row of a table that begins with a title."""
    row = next(line for line in text.splitlines() if line.startswith(f"| {title} |"))
    return [cell.strip() for cell in row.strip("|").split("|")]


def test_the_page_says_what_the_files_say(tmp_path):
    pytest.importorskip("matplotlib")
    drawn = results(tmp_path, disturbed=())
    out = tmp_path / "pages" / "page.md"
    out.parent.mkdir()
    report.main([str(tmp_path), "--out", str(out)])
    text = out.read_text()
    ours = drawn["peers", "scan-16"]
    row = cells(text, "JAXenstein my-way-home, scan, 16 environments")
    low, middle, high = (f"{np.quantile(ours, q):,.0f}" for q in (0.25, 0.5, 0.75))
    assert row[1:3] == [middle, f"{low} - {high}"]
    assert row[3] == number(1e6 / np.median(ours))
    assert row[4] == number(np.median(ours / drawn["peers", "vizdoom-gymnasium"]))
    assert row[5] == number(np.median(ours / drawn["peers", "vizdoom-raw"]))
    assert "no quiet machine" not in text
    # Told in words, and each part has its command and its plots.
    assert "A Processor" in text
    assert "no display / none" in text or "no display | none" in text
    for name in PARTS:
        assert f"`python -m benchmarks {name} --json {tmp_path.name} --core 1" in text
    pictures = re.findall(r"!\[[^]]+\]\(([^)]+)\)", text)
    assert len(pictures) == 7
    for picture in pictures:
        assert (out.parent / picture).read_bytes().startswith(b"\x89PNG")
    for table in re.findall(r"(?:^\|.*\n)+", text, re.M):
        assert len({line.count("|") for line in table.splitlines()}) == 1


def test_equal_results_are_equal_files(tmp_path):
    pytest.importorskip("matplotlib")
    results(tmp_path, parts=["batches"])
    parts = read_parts(tmp_path)
    pictures = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        save_plots(parts, tmp_path / name)
        pictures.append((tmp_path / name / "batches.png").read_bytes())
    assert pictures[0] == pictures[1]


def test_quick_figures_stay_out_of_docs(tmp_path, monkeypatch):
    results(tmp_path, quick=True, parts=["batches"])
    monkeypatch.setattr(report, "OUT", tmp_path / "docs.md")
    with pytest.raises(SettingError, match="batches are of a quick run"):
        report.main([str(tmp_path), "--out", str(tmp_path / "docs.md")])
    assert not (tmp_path / "docs.md").exists()
    parts = read_parts(tmp_path)
    assert "figures of a quick run" in report.page(tmp_path, parts, {}, {})


def test_a_part_alone_names_the_others(tmp_path):
    results(tmp_path, parts=["observations"])
    text = report.page(tmp_path, read_parts(tmp_path), {}, {})
    assert "Not measured: peers, cores, batches, limits" in text
    assert "no quiet machine" in text
    assert "steps a second**" not in text


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
    training = {"matrix_rate": 2e9, "rows": [
        {"algo": "ppo", "num_envs": 16, "dtype": "float32", "steps_per_second": 1234.0,
         "matrix_flops_per_step": 3e6, "flops_per_second": 5e8},
    ]}  # fmt: skip
    others = {"device": device, "spread": spread, "training": training}
    text = report.page(tmp_path, read_parts(tmp_path), others, {})
    # 2000 frames of 96 bytes are a thousandth of 192 MB.
    assert "| simple | 8x4 | 64 | 2,000 | 2,000 | 0.1% | 2.0 | 1 | 12 |" in text
    assert "| simple | 8x4 | 128 | out of memory |" in text
    assert "| 4 | 256 | 7,000 | 3.50 |" in text
    assert "| ppo | float32 | 16 | 1,234 | 3 | 25% |" in text


def test_no_results(tmp_path):
    with pytest.raises(SettingError, match="no results"):
        read_parts(tmp_path)
    (tmp_path / "peers.json").write_text("{")
    with pytest.raises(SettingError, match=r"peers\.json cannot be read"):
        read_parts(tmp_path)
    (tmp_path / "peers.json").write_text("{}")
    with pytest.raises(SettingError, match="no result of"):
        read_parts(tmp_path)


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.01234, "0.012"), (0.5, "0.50"), (9.94, "9.94"), (12.34, "12.3"), (1234.5, "1,234")],
)
def test_numbers(value, text):
    assert number(value) == text


def test_tables():
    assert markdown(["a", "b"], [["x|y", "1"]]) == "| a | b |\n| --- | ---: |\n| x/y | 1 |"
