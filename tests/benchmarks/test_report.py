"""The pages: their tables come from the files of results."""

import json

import numpy as np
import pytest

from benchmarks import report
from benchmarks.measure import ROOT
from benchmarks.parts import PARTS, QUICK
from benchmarks.report import Result, pages, read_results
from benchmarks.tables import column, markdown, number
from jaxenstein.errors import SettingError
from jaxenstein.speed.measuring import summarise

HARDWARE = {"cpu": "A Processor", "cores": 4, "cores_allowed": 2, "platform": "Linux"}


def results(folder):
    """Files of all parts with random rates; returns the rates by part and subject."""
    rng, sampled = np.random.default_rng(0), {}
    for name, part in PARTS.items():
        groups = []
        for group in part(QUICK):
            rows = []
            for subject in group:
                row = {"name": subject.name, "title": subject.title, "axes": subject.axes,
                       "references": subject.references}  # fmt: skip
                if "miniworld" in subject.name:
                    rows.append(row | {"failed": "no display | none"})
                    continue
                rates = sampled[name, subject.name] = np.exp(rng.normal(9, 2, 3))
                told = {"versions": {"jaxenstein": "0.1.0"}, "notes": {}, "ready_seconds": 1.0}
                rows.append(row | told | {"steps_per_second": summarise(rates)})
            groups.append(rows)
        settings = {"core": 1, "rounds": 3, "seconds": 0.5, "quick": True}
        whole = {
            "part": name, "format": 1, "began": "2026-01-01T00:00:00+00:00", "load": 0.1,
            "hardware": HARDWARE, "settings": settings, "groups": groups,
        }  # fmt: skip
        (folder / f"{name}.json").write_text(json.dumps(whole))
    return sampled


def cells(text, title):
    """The cells of the first row of a table that begins with a title."""
    row = next(line for line in text.splitlines() if line.startswith(f"| {title} |"))
    return [cell.strip() for cell in row.strip("|").split("|")]


def test_command_fills_pages_from_result_files(tmp_path):
    pytest.importorskip("matplotlib")
    sampled, out = results(tmp_path), tmp_path / "pages"
    with pytest.raises(SettingError, match="are results of a quick run"):
        report.main([str(tmp_path), "--out", str(report.DOCS)])
    report.main([str(tmp_path), "--out", str(out)])
    texts = {path.stem: path.read_text() for path in out.rglob("*.md")}
    ours = sampled["peers", "scan-16"]
    row = cells(texts["peers"], "JAXenstein my-way-home, scan, 16 environments")
    low, middle, high = (f"{np.quantile(ours, q):,.0f}" for q in (0.25, 0.5, 0.75))
    assert row[1:3] == [middle, f"{low} - {high}"]
    assert row[4] == number(np.median(ours / sampled["peers", "vizdoom-gymnasium"]))
    best = max(np.median(sampled["peers", name]) for name in ("scan-1", "scan-16"))
    assert f"**{best:,.0f} steps per second**" in texts["benchmarks"]
    assert "MiniWorld Hallway, 64x64: no display | none" in texts["peers"]
    row = cells(texts["adapters"], "Gymnasium vector, same-step")
    native = sampled["adapters", "adapter-loop-16"]
    mine = sampled["adapters", "adapter-gymnasium-same-step-16"]
    assert row[5:] == [number(np.median(mine / native))]
    pictures = {path.stem for path in (out / "images/benchmarks").glob("*.png")}
    assert pictures == set(report.PLOTS)


def test_pages_in_docs_match_committed_results():
    """Every text between two comments is what the results give."""
    folder, docs = ROOT / "benchmarks" / "results" / "epyc-2core", ROOT / "docs"
    for name, text in pages(read_results(folder), folder).items():
        assert (docs / name).read_text("utf-8") == text, name


def test_command_of_a_part_of_a_part():
    settings = {"core": None, "rounds": 2, "seconds": 1, "quick": False, "only": ["a b=1", "c"]}
    told = report.command("peers", Result({"settings": settings}, []), ROOT / "runs")
    start = "python -m benchmarks peers --json runs --rounds 2 --seconds 1"
    assert told == f"{start} --only 'a b=1' c"


def test_no_results(tmp_path):
    with pytest.raises(SettingError, match="no results"):
        read_results(tmp_path)
    (tmp_path / "peers.json").write_text("{}")
    with pytest.raises(SettingError, match="is not a result of this suite"):
        read_results(tmp_path)


def test_tables():
    columns = [column("a", left=True), column("b", "c", "d")]
    rows = [{"a": "x|y", "c": {"d": 1}}, {"a": ""}]
    assert markdown(columns, rows) == "| a | b |\n| --- | ---: |\n| x/y | 1 |\n|  |  |"
    values = (0.01234, 0.5, 9.94, 12.34, 1234.5)
    assert [number(each) for each in values] == ["0.012", "0.50", "9.94", "12.3", "1,234"]
