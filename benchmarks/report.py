"""Fill the tables of `docs/benchmarks.md` and the pages below it from results.

    python -m benchmarks.report DIR [--out FOLDER]

Every table and plot between `<!-- WHAT -->` and `<!-- end -->` in a page comes from the files of
DIR, which `python -m benchmarks --json DIR` writes. The rest of a page is that of `docs/`. The
pages are written to `build/benchmarks/pages`; `--out docs` replaces those of `docs/`.
"""

from __future__ import annotations

import argparse
import json
import re
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.measure import FORMAT, ROOT
from benchmarks.parts import PARTS
from benchmarks.plots import bars
from benchmarks.tables import COLUMNS, WHOLE, Row, column, markdown, number, ratio, rows_of, shown
from fidelity.commands import run_command
from jaxenstein.errors import SettingError
from jaxenstein.files import atomic, check_writable, make_folder

DOCS, OUT = ROOT / "docs", ROOT / "build" / "benchmarks" / "pages"
IMAGES = "images/benchmarks"
BLOCK = re.compile(r"(<!-- (\w+)(?: (\S+))? -->\n).*?(<!-- end -->)", re.DOTALL)
# Subjects of the part `peers` in the summary, and their names.
PEERS = {
    "vizdoom-gymnasium": "ViZDoom, resized to 64x64",
    "vizdoom-raw": "ViZDoom, raw game, 160x120",
    "envpool-8": "EnvPool's ViZDoom, resized to 64x64",
    "miniworld size=64x64 resize=none": "MiniWorld, 64x64",
    "loop": "JAXenstein, Python loop, 64x64",
}


class Result(NamedTuple):
    """A file of results, and its rows."""

    report: Mapping[str, Any]
    rows: Sequence[Row]


Results = Mapping[str, Result]
# Plots by name: the part, and a function that draws its rows.
PLOTS: Mapping[str, tuple[str, Callable[[Sequence[Row]], Any]]] = {
    "speed": ("peers", lambda rows: bars(headline(rows), "called", "ahead")),
    "cores": ("cores", lambda rows: bars(rows, "title")),
    "environments": ("environments", lambda rows: bars(rows, "id")),
}  # fmt: skip


def read_results(folder: Path) -> dict[str, Result]:
    """Read the results in a folder, by part.

    Raises:
        SettingError: there are no results, or a file is not a result of its part.
    """
    found = {}
    for name in PARTS:
        file = folder / f"{name}.json"
        if not file.exists():
            continue
        try:
            report = json.loads(file.read_text())
            same = (report["part"], report["format"]) == (name, FORMAT)
            found[name] = Result(report, rows_of(report) if same else [])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise SettingError(f"{file} is not a result of this suite: {error}") from error
        if not found[name].rows:
            raise SettingError(f"{file} is not a result of part {name}")
    if not found:
        raise SettingError(f"{folder} has no results: python -m benchmarks --json {folder}")
    return found


def pages(results: Results, folder: Path) -> dict[str, str]:
    """The text of each page with its numbers, by its path below `docs/`.

    Args:
        results: the results to fill in.
        folder: their folder, for the commands.
    """
    makers: Mapping[str, Callable[..., str]] = {
        "table": lambda name: table(name, results.get(name), folder),
        "machine": lambda _: machine(results),
        "headline": lambda _: summary(results),
        "circumstances": lambda _: circumstances(results),
    }
    names = ["benchmarks.md", *(f"benchmarks/{page.name}" for page in DOCS.glob("benchmarks/*.md"))]
    return {
        name: BLOCK.sub(
            lambda found: f"{found[1]}\n{makers[found[2]](found[3])}\n\n{found[4]}",
            (DOCS / name).read_text("utf-8"),
        )
        for name in names
    }


def table(name: str, result: Result | None, folder: Path) -> str:
    """The table of a part, its failures, the notes of its subjects, and the command."""
    if result is None:
        return f"Not measured here: `python -m benchmarks {name}`."
    texts = [markdown(COLUMNS[name], shown(name, result.rows))]
    for key, start in (("failed", "Failed:\n\n"), ("notes", "")):
        if told := _told(result.rows, key):
            texts.append(start + "\n".join(f"- {'; '.join(w)}: {s}" for s, w in told.items()))
    # Without a load, an older program measured them.
    told = [] if result.report["load"] is None else [f"`{command(name, result, folder)}`"]
    return "\n\n".join([*texts, *told])


def command(name: str, result: Result, folder: Path) -> str:
    """The command that writes a file of results."""
    folder, settings = folder.resolve(), result.report["settings"]
    # Without paths of this machine.
    where = (folder.relative_to(ROOT) if ROOT in folder.parents else Path(folder.name)).as_posix()
    words = [f"python -m benchmarks {name} --json {where}", *["--quick"] * settings["quick"]]
    words += [] if settings["core"] is None else [f"--core {settings['core']}"]
    words += [f"--rounds {settings['rounds']} --seconds {settings['seconds']:g}"]
    only = settings.get("only")
    return " ".join([*words, f"--only {shlex.join(only)}"] if only else words)


def headline(rows: Sequence[Row]) -> list[Row]:
    """The rows of the summary, and last this project's fastest scan."""
    named = {row["name"]: row for row in rows if "rates" in row}
    scans = [row for row in named.values() if row["name"].startswith("scan-") and "id" not in row]
    if not scans:
        return []
    best = max(scans, key=lambda row: row["rates"]["median"])
    called = PEERS | {best["name"]: f"JAXenstein, {best['batch']} environments, 64x64"}
    times = best["ratios"].get("x resized")
    told = {best["name"]: f"{number(times)} times the first"} if times else {}
    return [{**named[name], "called": title, "ahead": told.get(name, "")}
            for name, title in called.items() if name in named]  # fmt: skip


def summary(results: Results) -> str:
    """The speed of the fastest rollout of my-way-home compared with ViZDoom, and a table."""
    rows = headline(results["peers"].rows) if "peers" in results else []
    if not rows:
        return "Not measured here: `python -m benchmarks peers`."
    best, said = rows[-1], {
        "x resized": "ViZDoom's Gymnasium environment with its frames resized to 64x64",
        "x raw": "ViZDoom's raw game at its lowest resolution, 160x120, not resized",
    }  # fmt: skip
    ahead = [
        f"{number(best['ratios'][key])} times {told}"
        for key, told in said.items() if key in best["ratios"]
    ]  # fmt: skip
    columns = [
        column("on one core", "called", left=True),
        column("steps/s", "rates", "median", form=WHOLE), ratio("x resized"), ratio("x raw"),
    ]  # fmt: skip
    return (
        f"On one core, a scan of {best['batch']} environments of `my-way-home` at 64x64 makes "
        f"**{best['rates']['median']:,.0f} steps per second**"
        + (": " + ", and ".join(ahead) if ahead else "")
        + f".\n\n![Steps per second]({IMAGES}/speed.png)\n\n{markdown(columns, rows)}"
    )


def machine(results: Results) -> str:
    """The machine and the dates of the results."""
    reports = [result.report for result in results.values()]
    hardware = reports[0]["hardware"]
    days = sorted(report["began"][:10] for report in reports)
    quick = any(report["settings"]["quick"] for report in reports)
    return (
        f"Measured on {hardware['cpu']}, {hardware['cores_allowed'] or hardware['cores']} cores, "
        f"{hardware['platform']}, from {days[0]} to {days[-1]}, each part with the current version "
        "at that time ([dates](benchmarks/method.md))."
        + " **These are results of a quick run (`--quick`): they mean nothing.**"
        * quick
    )


def circumstances(results: Results) -> str:
    """The date, versions and settings of each part."""
    rows = []
    for name, (report, measured) in results.items():
        settings, found = report["settings"], {}
        for row in measured:
            for package, version in row.get("versions", {}).items():
                found.setdefault(package, set()).add(version)
        rows.append({
            "part": name, "began": report["began"], "processor": report["hardware"]["cpu"],
            "versions": ", ".join(f"{p} {' and '.join(sorted(v))}" for p, v in found.items()),
            "chunks": f"{settings['rounds']} x {settings['seconds']:g} s",
            "load before": "" if report["load"] is None else f"{report['load']:.1f}",
        })  # fmt: skip
    left = ("part", "began", "versions", "processor")
    return markdown([column(key, left=key in left) for key in rows[0]], rows)


def _told(rows: Iterable[Row], key: str) -> dict[str, list[str]]:
    """The texts that rows have under a key, each with the titles of its rows."""
    told: dict[str, list[str]] = {}
    for row in rows:
        said = row.get(key) or {}
        for line in [said] if isinstance(said, str) else [f"{n} {v}" for n, v in said.items()]:
            if row["title"] not in told.setdefault(line, []):
                told[line].append(row["title"])
    return told


def main(argv: Sequence[str] | None = None) -> None:
    """Write the pages and their plots."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.report", description="Write the benchmark pages from results."
    )
    parser.add_argument("folder", type=Path, metavar="DIR", help="the folder given as --json DIR")
    told = "folder for the pages (default build/benchmarks/pages)"
    parser.add_argument("--out", type=Path, default=OUT, metavar="FOLDER", help=told)
    options = parser.parse_args(argv)
    results, out = read_results(options.folder), options.out
    quick = [name for name, result in results.items() if result.report["settings"]["quick"]]
    if quick and out.resolve() == DOCS:
        raise SettingError(
            f"{', '.join(quick)} are results of a quick run, which mean nothing, so they cannot "
            "go into docs; choose another --out"
        )
    for name, text in pages(results, options.folder).items():
        make_folder((out / name).parent)
        check_writable(out / name)
        with atomic(out / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    images = make_folder(out / IMAGES)
    for name, (part, draw) in PLOTS.items():
        if part in results:
            figure = draw(shown(part, results[part].rows))
            with atomic(images / f"{name}.png") as path:
                # No date and versions, so that equal plots give equal files.
                figure.savefig(path, format="png", dpi=150, metadata={"Software": None})
    print(f"wrote {out / 'benchmarks.md'}, the pages below it and the plots")


if __name__ == "__main__":
    run_command(main)
