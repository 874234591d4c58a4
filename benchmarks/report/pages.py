"""The pages of figures: Markdown in `templates/`, with places that this fills from the results."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from benchmarks.report.plots import Bars
from benchmarks.report.results import Result, Row
from benchmarks.report.tables import TABLES, column, markdown, number, ratio, table_of, whole
from benchmarks.suites.parts import NAMED, PARTS

ROOT = Path(__file__).resolve().parents[2]
TEMPLATES = Path(__file__).parent / "templates"
# More disturbed chunks than this, of all, are told at the top of the first page.
DISTURBED_SHARE = 0.05
# Of the summary: subjects of the part `peers`, and what to call them.
PEERS = {
    "vizdoom-gymnasium": "ViZDoom, resized to 64x64",
    "vizdoom-raw": "ViZDoom, raw game, 160x120",
    "envpool-8": "EnvPool's ViZDoom, resized to 64x64",
    "miniworld size=64x64 resize=none": "MiniWorld, 64x64",
    "loop": "JAXenstein, Python loop, 64x64",
}
SPEED = Bars("called", "ahead")


class Pages:
    """What the places of the templates stand for.

    Attributes:
        results: by the names of their files.
        folder: where they lie, for the commands.
        plots: names of those that were drawn.
    """

    def __init__(self, results: Mapping[str, Result], folder: Path, plots: Iterable[str]) -> None:
        """Keep what the pages are made of."""
        self.results, self.folder, self.plots = results, folder, {*plots}
        self.suite = {name: part for name, part in results.items() if name in PARTS}

    def write(self) -> dict[str, str]:
        """The text of each page, by its path below the folder of the first."""
        names = sorted(str(path.relative_to(TEMPLATES)) for path in TEMPLATES.rglob("*.md"))
        return {name: self.fill((TEMPLATES / name).read_text("utf-8"), name) for name in names}

    def fill(self, text: str, name: str) -> str:
        """A template with its places filled; parts and lines whose results are missing go."""
        parts = re.split(r"(?m)^(?=## )", text)
        files = [re.findall(r"\{\{table (\S+)\}\}", part) for part in parts]
        kept = [p for p, f in zip(parts, files, strict=True) if not {*f} - {*self.results}]
        self.images = "../" * name.count("/") + "images/benchmarks"
        lines = "".join(kept).splitlines()
        missing = r"\{\{span (?!" + "|".join(rf"{name} " for name in self.results) + ")"
        text = "\n".join(line for line in lines if not re.search(missing, line))
        text = re.sub(r"\{\{(\w+) ?(.*?)\}\}", lambda m: getattr(self, m[1])(*m[2].split()), text)
        return re.sub(r"\n{3,}", "\n\n", text).strip() + "\n"

    def table(self, file: str) -> str:
        """A file's table, what failed and why, what subjects said of themselves, the command."""
        result, lines = self.results[file], [table_of(file, self.results[file])]
        for key, start in (("failed", "Not measured, and why:\n\n"), ("notes", "")):
            told = _told(result.rows, key)
            if told:
                lines.append(
                    start + "\n".join(f"- {'; '.join(who)}: {w}" for w, who in told.items())
                )
        return "\n\n".join([*lines, f"`{command(file, result, self.folder)}`"])

    def plot(self, name: str) -> str:
        """A picture, if it was drawn."""
        return f"![Steps a second]({self.images}/{name}.png)" if name in self.plots else ""

    def span(self, file: str, label: str, only: str = "") -> str:
        """Two cells: the least and the most steps a second of a part, perhaps of one id alone."""
        rows = [row for row in TABLES[file].rows(self.results[file].rows) if "rates" in row]
        rows = [row for row in rows if only in ("", row.get("id"))]
        rows.sort(key=lambda row: row["rates"]["median"])
        told = [str(row[label]).partition(", scan")[0] for row in rows]
        ends = [(rows[end]["rates"]["median"], told[end]) for end in (0, -1)] if rows else []
        return " | ".join(f"{rate:,.0f} ({what})" for rate, what in ends)

    def headline(self) -> str:
        """The table of the summary."""
        columns = [column("on one core", "called", left=True)]
        columns += [column("steps/s", "rates", "median", form=whole)]
        columns += [ratio("x resized"), ratio("x raw")]
        rows = headline(self.results)
        return markdown(columns, rows) if rows else ""

    def verdict(self) -> str:
        """How far ahead the fastest rollout of my-way-home is of ViZDoom."""
        if not (rows := headline(self.results)):
            return ""
        best, said = rows[-1], {
            "x resized": "ViZDoom's Gymnasium environment with its frames resized to 64x64",
            "x raw": "ViZDoom's raw game at its lowest resolution, 160x120, not resized",
        }  # fmt: skip
        ratios = best["ratios"]
        ahead = [
            f"{number(ratios[key])} times {told}" for key, told in said.items() if key in ratios
        ]
        return (
            f"On one core, {plural(best['batch'], 'environment')} of `my-way-home` in a scan, at "
            f"64x64, make **{best['rates']['median']:,.0f} steps a second**"
            + (": " + ", and ".join(ahead) if ahead else "") + "."
        )  # fmt: skip

    def warnings(self) -> str:
        """That figures mean nothing, or that others used the core during more than a few chunks."""
        told = []
        if any(part.report["settings"]["quick"] for part in self.suite.values()):
            told.append(
                "**These are figures of a quick run (`--quick`), with tiny sizes and hardly any "
                "repeats. They show that the suite works, and nothing else.**"
            )
        rows = [row for part in self.suite.values() for row in part.rows if "rates" in row]
        chunks = sum(len(row["rates"]["repeats"]) for row in rows)
        disturbed = sum(len(row["disturbed"]) for row in rows)
        if disturbed > DISTURBED_SHARE * chunks:
            told.append(
                f"**Other processes used the core during {disturbed} of about {chunks} chunks: "
                "this was no quiet machine, and the figures are not to be relied upon.**"
            )
        return "\n\n".join(told)

    def machine(self) -> str:
        """Where the suite was run, and when if not all at once."""
        hardware = next(iter(self.suite.values())).report["hardware"]
        cores = plural(hardware["cores_allowed"] or hardware["cores"], "core")
        told = f"Measured on {hardware['cpu']}, {cores}, {hardware['platform']}."
        days = sorted(part.report["began"][:10] for part in self.suite.values())
        if days[0] == days[-1]:
            return told
        return (
            f"{told} Parts were measured from {days[0]} to {days[-1]}, each with the project as it "
            "was then ([dates](benchmarks/method.md))."
        )

    def missing(self) -> str:
        """The parts that were not measured."""
        names = [name for name in PARTS if name not in (*self.suite, *NAMED)]
        return f"Not measured: {', '.join(names)}." if names else ""

    def circumstances(self) -> str:
        """When and with what each part was measured, and whether the machine was quiet."""
        rows = []
        for name, part in self.suite.items():
            report, settings = part.report, part.report["settings"]
            found = _versions(row.get("versions", {}) for row in part.rows)
            rows.append({
                "part": name, "began": report["began"], "processor": report["hardware"]["cpu"],
                "versions": ", ".join(f"{package} {told}" for package, told in found.items()),
                "chunks": f"{settings['rounds']} x {settings['seconds']:g} s",
                "disturbed": sum(len(row.get("disturbed", ())) for row in part.rows),
                "load before": "" if report["load"] is None else f"{report['load']:.1f}",
            })  # fmt: skip
        left = ("part", "began", "versions", "processor")
        return markdown([column(key, left=key in left) for key in rows[0]], rows)

    def bandwidth(self) -> str:
        """Of which accelerator the figures are."""
        report = self.results["device"].report
        told = f"{report['copy_bytes_per_second'] / 1e9:,.0f} GB/s"
        return f"{report['device']}, JAX {report['versions']['jax']}: a copy moves {told}."


def headline(results: Mapping[str, Result]) -> list[Row]:
    """Rows of peers, and last this project's fastest scan of my-way-home; none without it."""
    part = results.get("peers")
    rows = {row["name"]: row for row in part.rows if "rates" in row} if part else {}
    scans = [row for row in rows.values() if row["name"].startswith("scan-") and "id" not in row]
    if not scans:
        return []
    best = max(scans, key=lambda row: row["rates"]["median"])
    called = PEERS | {best["name"]: f"JAXenstein, {plural(best['batch'], 'environment')}, 64x64"}
    times = best["ratios"].get("x resized")
    told = {best["name"]: f"{number(times)} times the first"} if times else {}
    return [{**rows[name], "called": title, "ahead": told.get(name, "")}
            for name, title in called.items() if name in rows]  # fmt: skip


def command(file: str, result: Result, folder: Path) -> str:
    """The command that makes a file of results."""
    folder = folder.resolve()
    # Without the folders of this machine.
    where = (folder.relative_to(ROOT) if ROOT in folder.parents else Path(folder.name)).as_posix()
    settings = result.report.get("settings", {})
    if file not in PARTS:
        return f"python -m benchmarks.{file} --json {where}/{file}.json"
    words = [f"python -m benchmarks {file} --json {where}", *["--quick"] * settings["quick"]]
    words += [] if settings["core"] is None else [f"--core {settings['core']}"]
    return " ".join([*words, f"--rounds {settings['rounds']} --seconds {settings['seconds']:g}"])


def plural(count: int, thing: str) -> str:
    """A number and what is counted: 1 core, 2 cores."""
    return f"{count} {thing}{'' if count == 1 else 's'}"


def _told(rows: Iterable[Row], key: str) -> dict[str, list[str]]:
    """What rows say under a key, each with the titles of those that do."""
    told: dict[str, list[str]] = {}
    for row in rows:
        title, said = row.get("title") or f"{row.get('id')}, {row.get('batch')}", row.get(key) or {}
        for line in [said] if isinstance(said, str) else [f"{n} {v}" for n, v in said.items()]:
            if title not in told.setdefault(line, []):
                told[line].append(title)
    return told


def _versions(found: Iterable[Mapping[str, str]]) -> dict[str, str]:
    together: dict[str, set[str]] = {}
    for versions in found:
        for package, version in versions.items():
            together.setdefault(package, set()).add(version)
    return {package: " and ".join(sorted(versions)) for package, versions in together.items()}
