"""Writes `docs/benchmarks.md`, the pages below it and their plots from results alone.

    python -m benchmarks.report DIR [--out FILE.md]

No figure is typed by hand: every number comes from the files of DIR, which `python -m benchmarks`
writes; files of the other commands are taken in where DIR has them.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from benchmarks.report.pages import ROOT, SPEED, Pages, headline
from benchmarks.report.plots import save
from benchmarks.report.results import read_results
from benchmarks.report.tables import TABLES
from benchmarks.suites.parts import PARTS
from jaxenstein.errors import JAXensteinError, SettingError
from jaxenstein.files import atomic, check_writable, make_folder

OUT = ROOT / "docs" / "benchmarks.md"
IMAGES = "images/benchmarks"


def main(argv: Sequence[str] | None = None) -> None:
    """Write the pages and their plots."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.report", description="Write the pages of figures from results."
    )
    parser.add_argument("folder", type=Path, metavar="DIR", help="what --json DIR was")
    told = "the first page; the others go into a folder beside it (default docs/benchmarks.md)"
    parser.add_argument("--out", type=Path, default=OUT, metavar="FILE", help=told)
    options = parser.parse_args(argv)
    results, out = read_results(options.folder), options.out
    quick = [
        name for name in PARTS if name in results and results[name].report["settings"]["quick"]
    ]
    if quick and out.resolve() == OUT:
        raise SettingError(
            f"{', '.join(quick)} are of a quick run, whose figures mean nothing: they do not go "
            "into docs/benchmarks.md; --out FILE writes them elsewhere"
        )
    check_writable(out)
    images = make_folder(out.parent / IMAGES)
    plots = [
        (name, plot, TABLES[file].rows(result.rows))
        for file, result in results.items()
        for name, plot in TABLES[file].plots.items()
    ]
    plots.append(("speed", SPEED, headline(results)))
    drawn = [name for name, plot, rows in plots if save(plot, rows, images / f"{name}.png")]
    texts = Pages(results, options.folder, drawn).write()
    texts[out.name] = texts.pop(OUT.name)
    make_folder(out.parent / "benchmarks")
    for name, text in texts.items():
        with atomic(out.parent / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    print(f"wrote {out}, {len(texts) - 1} pages below it, and {len(drawn)} plots")


if __name__ == "__main__":
    try:
        main()
    except JAXensteinError as error:
        raise SystemExit(f"benchmarks.report: {error}") from error
