"""Studies: when a run has learned, and the rows of the table."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("flax")

from experiments import study
from jaxenstein.baselines.runs.configs import find_config
from jaxenstein.baselines.runs.options import read_file, resolve
from jaxenstein.errors import SettingError

STUDIES = Path(__file__).parents[2] / "experiments" / "studies"


def row(successes: int, episodes: int) -> dict[str, Any]:
    return {"successes": successes, "episodes": episodes}


def test_solved_at_looks_at_three_updates_together() -> None:
    lucky = [row(0, 10), row(10, 10), row(0, 10), row(1, 10)]
    assert study.solved_at(lucky, 0.9) == float("inf")
    assert study.solved_at([*lucky, row(9, 10), row(10, 10), row(8, 10)], 0.9) == 7
    assert study.solved_at([row(0, 0)] * 4, 0.9) == float("inf")
    # Only the successful ones have ended yet.
    assert study.solved_at([row(1, 1), row(2, 2), row(0, 0), row(1, 64)], 0.9) == float("inf")
    assert study.solved_at(lucky[:2], 0.9) == float("inf")


@pytest.mark.parametrize("file", sorted(STUDIES.glob("*.toml")), ids=lambda path: path.stem)
def test_the_variants_are_experiments(file: Path) -> None:
    told = study.read(file)
    base = read_file(find_config(told["base"], file.parent)) | told.get("shared", {})
    for differs in told["variants"].values():
        assert resolve({**base, **differs}).config
    assert len(set(map(study.folder_name, told["variants"]))) == len(told["variants"])


GOOD = 'base = "simple"\nreach = 0.9\n[variants]\n"wide clip" = {}\n'


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (GOOD.replace("reach", "reached"), "reach must be a finite number from 0 to 1, not None"),
        (GOOD + "wide-clip = {}\n", "'wide clip' and 'wide-clip' would have one folder"),
        ("base = ", "cannot read .*: invalid value"),
        (None, "cannot read .*: no such file"),
    ],
)
def test_wrong_studies_are_told_before_a_training(
    text: str | None, told: str, tmp_path: Path
) -> None:
    if text is not None:
        (tmp_path / "study.toml").write_text(text)
    with pytest.raises(SettingError, match=told):
        study.main([str(tmp_path / "study.toml"), "--out", str(tmp_path / "runs")])
    assert not (tmp_path / "runs").exists()


@pytest.mark.usefixtures("plain_frames")
def test_study_trains_resumes_and_reports(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    (tmp_path / "base.toml").write_text(
        'map = """\n####\n#SG#\n####\n"""\nheading = 0\nheight = 8\nwidth = 8\nhorizon = 8\n'
        'recipe = "tuned"\nnum_envs = 8\nrollout = 8\nseeds = 2\ntotal_steps = 256\n'
        "features = 8\nhidden = 8\nhead = 8\nconvolutions = [[4, 4, 4]]\n"
    )
    (tmp_path / "study.toml").write_text(
        'base = "base.toml"\nreach = 0.0\n'
        '[variants]\n"as it is" = {}\n"wide clip" = { clip = 0.3 }\n'
    )
    options = [str(tmp_path / "study.toml"), "--out", str(tmp_path / "runs")]
    study.main([*options, "--only", "wide clip"])
    some = capsys.readouterr().out.splitlines()
    assert [path.name for path in (tmp_path / "runs").iterdir()] == ["wide-clip"]
    for _ in range(2):
        study.main(options)
    lines = capsys.readouterr().out.splitlines()
    assert lines[:4] == lines[4:]
    assert some == [*lines[:2], lines[3]]
    with pytest.raises(SystemExit):
        study.main([*options, "--only", "wider clip"])
    assert "no variant 'wider clip'; it has 'as it is', 'wide clip'" in capsys.readouterr().err
    # Any rate is reached after the three updates that are pooled: 3 times 64 decisions.
    for line, name in ((lines[2], "as it is"), (lines[3], "wide clip")):
        cells = [cell.strip() for cell in line.split("|")]
        assert cells[1:3] == [name, "2 of 2"]
        assert cells[4] == "192, 192"
    config = json.loads((tmp_path / "runs" / "wide-clip" / "config.json").read_text())
    assert config["hparams"]["clip"] == 0.3
    text = (tmp_path / "study.toml").read_text().replace("clip = 0.3", "clip = 0.4")
    (tmp_path / "study.toml").write_text(text)
    with pytest.raises(SettingError, match="clip"):
        study.main(options)
