"""The Python and the commands in the README and the pages of the site work."""

from __future__ import annotations

import re
import tomllib
from importlib.util import find_spec
from pathlib import Path

import pytest

import jaxenstein
from docs.other_pages import with_suite_tables
from jaxenstein import registry, suite
from jaxenstein.cli import build_parser
from tests.docs.samples import PAGES, ROOT, Sample, anchors, commands, links, prose, samples

SAMPLES = [sample for page in PAGES for sample in samples(page)]
WITH_PARTNERS = [sample for sample in SAMPLES if sample.partners]
# Written when the site is built.
GENERATED = ("environments/", "commands.md")
# Commands whose options come from the extra baselines.
BASELINES = ("train", "sweep")


def by_name(value: Path | Sample) -> str:
    return value.name if isinstance(value, Path) else "-".join(value.partners)


def test_there_are_samples() -> None:
    assert {"README.md", "start.md", "concepts.md", "tasks.md"} <= {s.page.name for s in SAMPLES}
    pages = {sample.page.name for sample in WITH_PARTNERS}
    assert pages == {"adapters.md", "from-vizdoom.md"}


@pytest.mark.parametrize("page", [p for p in PAGES[1:] if samples(p)], ids=by_name)
@pytest.mark.usefixtures("plain_frames")
def test_the_samples_of_a_page_run_in_order(page: Path, tmp_path, monkeypatch) -> None:
    """No sample depends on frames. tests/test_readme.py runs the README with real frames."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(ROOT / "examples")
    monkeypatch.setattr(registry, "ENTRIES", dict(registry.ENTRIES))
    names: dict = {"__name__": "sample"}
    for sample in samples(page):
        if not sample.partners:
            sample.run(names)


@pytest.mark.parametrize("sample", WITH_PARTNERS, ids=by_name)
@pytest.mark.usefixtures("plain_frames")
@pytest.mark.filterwarnings("default")  # partners and what they import warn of their own
def test_samples_that_need_partners_run(sample: Sample, tmp_path, monkeypatch) -> None:
    for name in sample.partners:
        pytest.importorskip(name)
    monkeypatch.chdir(tmp_path)
    sample.run({"__name__": "sample"})


@pytest.mark.parametrize("page", PAGES, ids=by_name)
def test_linked_files_exist(page: Path) -> None:
    found = [link for link in links(page) if not link.startswith(GENERATED)]
    assert [link for link in found if not (page.parent / link).exists()] == []


@pytest.mark.parametrize("page", PAGES, ids=by_name)
def test_linked_headings_exist(page: Path) -> None:
    found = re.findall(r"\]\(([^):#]*\.md)?#([^)]+)\)", prose(page))
    places = [((page.parent / name) if name else page, anchor) for name, anchor in found]
    assert [
        f"{place.name}#{anchor}"
        for place, anchor in places
        if place.exists() and anchor not in anchors(prose(place))
    ] == []


def test_defaults_of_settings_match_the_table() -> None:
    text = (ROOT / "docs" / "concepts.md").read_text("utf-8")
    rows = re.findall(r"^\| (`\w+`(?:, `\w+`)*) \| ([^|]+) \|", text, re.MULTILINE)
    env, _ = jaxenstein.make("simple")
    told = {
        name: default.strip().strip("`")
        for names, defaults in rows
        if all(hasattr(env, name) for name in re.findall(r"\w+", names))
        for name, default in zip(
            re.findall(r"\w+", names), _defaults(defaults, names.count("`") // 2), strict=True
        )
    }
    assert {"height", "width", "frame_skip", "observation", "look_seeds"} <= set(told)
    for name, default in told.items():
        value = getattr(env, name)
        assert default in (f"{value:g}" if isinstance(value, float) else str(value), f'"{value}"')


def _defaults(text: str, count: int) -> list[str]:
    """The default of each setting in a row of the table."""
    parts = [part for part in text.split(",") if " in " not in part]
    return parts if len(parts) == count else parts * count


def place(path: str) -> Path:
    """The path of a source file of the package, in the repository or in an installed wheel."""
    inside = path.removeprefix("src/jaxenstein/")
    return ROOT / path if inside == path else Path(jaxenstein.__file__).parent / inside


@pytest.mark.parametrize("page", PAGES, ids=by_name)
def test_paths_named_in_code_exist(page: Path) -> None:
    folders = "benchmarks|docs|examples|experiments|fidelity|reliability|src|tests"
    text = page.read_text("utf-8")
    named = re.findall(rf"`((?:{folders})/[\w./-]+)`", text)
    assert [path for path in named if not place(path).exists() and "_build" not in path] == []
    modules = re.findall(rf"python -m\s+((?:{folders})(?:\.\w+)+)", text)
    assert [module for module in modules if not find_spec(module)] == []


@pytest.mark.parametrize("page", [p for p in PAGES if commands(p)], ids=by_name)
def test_commands_parse(page: Path) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)
    for program, *arguments in commands(page):
        name = program.rpartition("/")[2]
        configs = [path for path in arguments if path.endswith(".toml") and "$" not in path]
        assert [path for path in configs if not (ROOT / path).is_file()] == []
        if name == "jaxenstein" and (arguments[0] not in BASELINES or find_spec("optax")):
            build_parser().parse_args(arguments)
        elif name == "make":
            assert arguments[0] in targets
        elif name == "python" and arguments[0] != "-m":
            assert (ROOT / arguments[0]).is_file()
        for extras in re.findall(r"^\.\[(.+)\]$", " ".join(arguments[1:])) if name == "pip" else ():
            assert set(extras.split(",")) <= set(project["optional-dependencies"])


def test_architecture_page_locates_classes() -> None:
    text = (ROOT / "docs" / "architecture.md").read_text("utf-8")
    rows = re.findall(r"^\| `(\w+)` \| `([\w/.]+)` \|", text, re.MULTILINE)
    assert len(rows) == 10
    for name, file in rows:
        source = place(f"src/jaxenstein/{file}").read_text("utf-8")
        assert re.search(rf"^class {name}\b", source, re.MULTILINE), name


def test_repository_address_appears_once() -> None:
    """It is a placeholder until the project is published."""
    pyproject = (ROOT / "pyproject.toml").read_text("utf-8")
    address = tomllib.loads(pyproject)["project"]["urls"]["Repository"]
    texts = {page: page.read_text("utf-8") for page in PAGES}
    assert pyproject.count(address) == 1
    assert not [page for page, text in texts.items() if address in text]
    assert any("](repository:)" in text for text in texts.values())


def test_benchmark_page_lists_the_tasks():
    page = (ROOT / "docs/suite.md").read_text("utf-8")
    assert with_suite_tables(page) == page
    assert f"now {suite.VERSION}, and" in page
