"""Writes `docs/benchmarks.md` and its plots from results: `python -m benchmarks.report DIR`.

No figure is typed by hand: every number of the page comes from the files of DIR, which
`python -m benchmarks` writes. `device.json`, `spread.json`, `training.json` and
`training-compare.json` of the other commands are taken in where DIR has them.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks import report_training
from benchmarks.parts import PARTS
from benchmarks.plots import save_plots, save_training_plot
from benchmarks.report_others import other_sections
from benchmarks.report_texts import INTRODUCTION, METHOD, QUICK, TEXTS
from benchmarks.results import Part, Row, read_others, read_parts
from benchmarks.tables import markdown, number, plural
from jaxenstein.errors import JAXensteinError, SettingError
from jaxenstein.files import atomic, check_writable, make_folder

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "docs" / "benchmarks.md"
IMAGES = Path("images") / "benchmarks"
# More disturbed chunks than this, of all, are told at the top of the page.
DISTURBED_SHARE = 0.05
# What a table shows of a subject besides its speed; without any, its title.
COLUMNS: Mapping[str, tuple[str, ...]] = {
    "batches": ("id", "batch"),
    "stages": ("id", "stage"),
    "environments": ("id",),
    "resolutions": ("id", "size", "batch"),
    "observations": ("id", "observation"),
    "maps-and-sprites": ("map", "sprites"),
    "adapters": ("title", "partner", "batch"),
}
LEFT = ("title", "id", "stage", "observation", "partner")
HEADINGS = {"batch": "environments", "map": "tiles a side", "title": "", "partner": "beside"}


def page(
    folder: Path, parts: Mapping[str, Part], others: Any, plots: Mapping[str, list[str]]
) -> str:
    """The whole page in Markdown."""
    sections = ["# Benchmarks", INTRODUCTION]
    if any(part.report["settings"]["quick"] for part in parts.values()):
        sections.append(QUICK)
    sections += [*_unrest(parts)]
    sections += [*_summary(parts)]
    for name, part in parts.items():
        title, text = TEXTS[name]
        sections += [f"## {title}", text]
        sections += [f"![{title}]({(IMAGES / file).as_posix()})" for file in plots.get(name, ())]
        sections += [part_table(part), *_failures(part), *_notes(part)]
        sections.append(f"`{command(part, folder)}`")
    training = [(IMAGES / file).as_posix() for file in plots.get(report_training.PART, ())]
    sections += other_sections(others, place(folder), training)
    sections += ["## How it was measured", METHOD, circumstances(parts)]
    missing = [name for name in PARTS if name not in parts]
    if missing:
        sections.append(f"Not measured: {', '.join(missing)}.")
    return "\n\n".join(sections) + "\n"


def _unrest(parts: Mapping[str, Part]) -> Iterator[str]:
    """A warning where others used the core during more than a few chunks."""
    chunks = sum(len(row.rates["repeats"]) for part in parts.values() for row in part.measured)
    disturbed = sum(row.disturbed for part in parts.values() for row in part.rows)
    if disturbed > DISTURBED_SHARE * chunks:
        yield (
            f"**Other processes used the core during {disturbed} of about {chunks} chunks: this "
            "was no quiet machine, and the figures are not to be relied upon.**"
        )


def _summary(parts: Mapping[str, Part]) -> Iterator[str]:
    """The machine, and how far ahead the fastest rollout of my-way-home is of ViZDoom."""
    hardware = next(iter(parts.values())).report["hardware"]
    cores = hardware["cores_allowed"] or hardware["cores"]
    yield f"Measured on {hardware['cpu']}, {plural(cores, 'core')}, {hardware['platform']}."
    if "peers" not in parts:
        return
    ours = [row for row in parts["peers"].measured if _is_scan(row)]
    if not ours:
        return
    best = max(ours, key=lambda row: row.median)
    ahead = [
        f"{number(best.ratios[heading])} times {what}"
        for heading, what in (
            ("x resized", "ViZDoom's Gymnasium environment with its frames resized to 64x64"),
            ("x raw", "ViZDoom's raw game at its lowest resolution, 160x120, not resized"),
        )
        if heading in best.ratios
    ]
    told = ": " + ", and ".join(ahead) if ahead else ""
    yield (
        f"On one core, {plural(best.axes['batch'], 'environment')} of `my-way-home` in a scan, at "
        f"64x64, make **{best.median:,.0f} steps a second**{told}."
    )


def _is_scan(row: Row) -> bool:
    return row.name.startswith("scan-") and row.axes.get("id", "my-way-home") == "my-way-home"


def part_table(part: Part) -> str:
    """A part's rows as a table: what they are, steps a second, quartiles, microseconds, ratios."""
    columns = COLUMNS.get(part.name, ("title",))
    # The subject that a group was measured beside has nothing of its own to show.
    rows = [row for row in part.rows if row.axes or columns == ("title",)]
    ratios = list(dict.fromkeys(heading for row in rows for heading in row.ratios))
    head = [HEADINGS.get(column, column) for column in columns]
    head += ["steps/s", "quartiles", "us a step", *ratios]
    body = []
    for row in rows:
        cells = [row.title if c == "title" else str(row.axes.get(c, "")) for c in columns]
        body.append([*cells, *_figures(row), *(_ratio(row, heading) for heading in ratios)])
    left = sum(column in LEFT for column in columns)
    return markdown(head, body, left=max(left, 1))


def _figures(row: Row) -> list[str]:
    if row.failed:
        return ["not measured", "", ""]
    low, high = row.rates["lower_quartile"], row.rates["upper_quartile"]
    return [f"{row.median:,.0f}", f"{low:,.0f} - {high:,.0f}", number(1e6 / row.median)]


def _ratio(row: Row, heading: str) -> str:
    return number(row.ratios[heading]) if heading in row.ratios else ""


def _failures(part: Part) -> Iterator[str]:
    reasons: dict[str, list[str]] = {}
    for row in part.rows:
        if row.failed:
            reasons.setdefault(row.failed, []).append(row.title)
    if reasons:
        lines = [f"- {'; '.join(titles)}: {reason}" for reason, titles in reasons.items()]
        yield "Not measured, and why:\n\n" + "\n".join(lines)


def _notes(part: Part) -> Iterator[str]:
    told: dict[str, list[str]] = {}
    for row in part.rows:
        for name, value in row.notes.items():
            told.setdefault(f"{name} {value}", []).append(row.title)
    if told:
        lines = [f"- {'; '.join(titles)}: {note}" for note, titles in told.items()]
        yield "\n".join(lines)


def command(part: Part, folder: Path) -> str:
    """The command that makes a part's file."""
    settings = part.report["settings"]
    words = ["python -m benchmarks", part.name, f"--json {place(folder)}"]
    words += ["--quick"] if settings["quick"] else []
    words += [] if settings["core"] is None else [f"--core {settings['core']}"]
    return " ".join([*words, f"--rounds {settings['rounds']} --seconds {settings['seconds']:g}"])


def place(folder: Path) -> str:
    """A folder of results without the folders of this machine above it."""
    folder = folder.resolve()
    return (folder.relative_to(ROOT) if ROOT in folder.parents else Path(folder.name)).as_posix()


def circumstances(parts: Mapping[str, Part]) -> str:
    """When and with what each part was measured, and whether the machine was quiet."""
    body = []
    for name, part in parts.items():
        report, settings = part.report, part.report["settings"]
        packages = [f"{n} {' and '.join(v)}" for n, v in part.versions().items() if n != "python"]
        python = " and ".join(part.versions().get("python", [report["versions"]["python"]]))
        load = "" if report["load"] is None else f"{report['load']:.1f}"
        chunks = f"{settings['rounds']} x {settings['seconds']:g} s"
        disturbed = str(sum(row.disturbed for row in part.rows))
        body.append([name, report["began"], f"Python {python}, {', '.join(packages)}"])
        body[-1] += [report["hardware"]["cpu"], chunks, disturbed, load]
    head = ["part", "began", "versions", "processor", "chunks", "disturbed", "load before"]
    return markdown(head, body, left=4)


def main(argv: Sequence[str] | None = None) -> None:
    """Write the page and its plots."""
    options = _parser().parse_args(argv)
    parts, others = read_parts(options.folder), read_others(options.folder)
    others |= report_training.read_comparison(options.folder)
    quick = [name for name, part in parts.items() if part.report["settings"]["quick"]]
    if quick and options.out.resolve() == OUT:
        raise SettingError(
            f"{', '.join(quick)} are of a quick run, whose figures mean nothing: they do not go "
            "into docs/benchmarks.md; --out FILE writes them elsewhere"
        )
    check_writable(options.out)
    images = make_folder(options.out.parent / IMAGES)
    plots = save_plots(parts, images)
    if report_training.PART in others:
        rows = others[report_training.PART]["rows"]
        plots |= {report_training.PART: save_training_plot(rows, images)}
    with atomic(options.out) as path:
        path.write_text(page(options.folder, parts, others, plots), encoding="utf-8")
    print(f"wrote {options.out} and {sum(map(len, plots.values()))} plots")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Write the page of figures from results.")
    parser.add_argument("folder", type=Path, metavar="DIR", help="what --json DIR was")
    parser.add_argument(
        "--out", type=Path, default=OUT, metavar="FILE", help="(default docs/benchmarks.md)"
    )
    return parser


if __name__ == "__main__":
    try:
        main()
    except JAXensteinError as error:
        raise SystemExit(f"benchmarks.report: {error}") from error
