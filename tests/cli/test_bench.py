"""`jaxenstein bench` and its measurements."""

from __future__ import annotations

import json
import os
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from jaxenstein.cli import bench, main
from jaxenstein.settings import spec_from
from jaxenstein.spec import Spec
from jaxenstein.speed.measuring import BenchmarkError, Settings, measure_in_process, summarise


def fake(settings: Settings) -> dict[str, object]:
    seen, rates = settings.spec["settings"], np.array([1e3, 2e3, 3e3])
    return {
        "id": settings.name,
        "width": seen["width"],
        "height": seen["height"],
        "batch": settings.batch,
        "steps_per_second": summarise(rates),
        "world_steps_per_second": summarise(seen["frame_skip"] * rates),
        "compile_seconds": {"reset": 1.0, "step": 1.0},
        "peak_memory_bytes": None,
    }


def test_table_and_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bench, "measure_in_process", fake)
    path = tmp_path / "b.json"
    arguments = ["simple", "key-door", "--batch", "4,8", "--size", "20x10", "--json", str(path)]
    arguments += ["--frame-skip", "3"]
    assert main(["bench", *arguments]) == 0
    out, err = capsys.readouterr()
    assert [line.split()[:3] for line in out.splitlines()[1:5]] == [
        [name, "20x10", batch] for name in ("simple", "key-door") for batch in ("4", "8")
    ]
    assert "100%" in err
    assert all(line.split()[3:8:4] == ["2.00k", "6.00k"] for line in out.splitlines()[1:5])
    report = json.loads(path.read_text())
    assert set(report["versions"]) == {"python", "jax", "jaxlib", "numpy", "jaxenstein"}
    assert report["hardware"]["cores"] == os.cpu_count()
    assert [result["batch"] for result in report["results"]] == [4, 8, 4, 8]


def test_summary_is_median_and_quartiles() -> None:
    rates = [5.0, 1.0, 2.0, 4.0, 3.0]
    assert summarise(np.array(rates)) == {
        "median": 3.0, "lower_quartile": 2.0, "upper_quartile": 4.0, "repeats": rates
    }  # fmt: skip


@pytest.mark.slow
def test_measures_in_a_separate_process() -> None:
    core = min(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None
    small = spec_from({"env": "simple", "height": 8, "width": 8, "frame_skip": 3})
    settings = Settings("small", asdict(small), batch=2, steps=4, repeats=3, core=core)
    result = measure_in_process(settings)
    rates = result["steps_per_second"]
    assert len(result["seconds"]) == len(rates["repeats"]) == 3
    assert rates["lower_quartile"] <= rates["median"] <= rates["upper_quartile"]
    assert rates["repeats"] == pytest.approx([8 / seconds for seconds in result["seconds"]])
    world = result["world_steps_per_second"]["repeats"]
    # The last step of an episode may have fewer world steps.
    assert all(
        2 * one < other <= 3.001 * one for one, other in zip(rates["repeats"], world, strict=True)
    )
    assert set(result["compile_seconds"]) == {"reset", "step", "rollout"}
    # Bounds on the memory of a process with JAX and this tiny setup.
    assert 50e6 < result["peak_memory_bytes"] < 2e9
    assert result["core"] == core
    assert (result["id"], result["height"], result["frame_skip"]) == ("small", 8, 3)


def test_failing_process_gives_a_one_line_error(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    nowhere = Settings("x", asdict(Spec("nowhere", 0, {}, {})), batch=2, steps=4, repeats=3)
    with pytest.raises(BenchmarkError, match=r"^measuring x with batch 2 failed: .*nowhere"):
        measure_in_process(nowhere)

    def fail(settings: Settings) -> None:
        raise BenchmarkError("measuring failed: Killed")

    monkeypatch.setattr(bench, "measure_in_process", fail)
    assert main(["bench", "simple"]) == 1
    assert capsys.readouterr().err.splitlines()[-1] == "jaxenstein: measuring failed: Killed"
