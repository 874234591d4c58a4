"""Which small changes of the sources are tried on the tests."""

from pathlib import Path
from types import SimpleNamespace

import pytest

import jaxenstein
from reliability import mutants

# Beside the tests, or where a wheel was installed.
PACKAGE = Path(jaxenstein.__file__).parent


def test_groups_name_files_that_are_there() -> None:
    for group in mutants.GROUPS.values():
        for module in group.modules:
            assert (PACKAGE / module).is_file()
        for test in group.tests:
            assert (mutants.ROOT / "tests" / test).is_file()


def test_the_whole_engine_is_in_a_group() -> None:
    named = {module for group in mutants.GROUPS.values() for module in group.modules}
    # Data alone.
    engine = {f"engine/{path.name}" for path in (PACKAGE / "engine").glob("*.py")}
    assert engine - named == {"engine/scene.py"}


SOURCE = """
@cached(size=1)
def half(x: int | None, *, y=2) -> int | str:
    if x is None:
        raise ValueError("at most %d" % (3 - 1))
    return x // 4
"""


@pytest.mark.parametrize(
    ("text", "behaves"),
    [
        ("size=1", False),
        ("int | None", False),
        ("int | str", False),
        ("3 - 1", False),
        ("2)", True),
        ("is None", True),
        ("x // 4", True),
    ],
)
def test_annotations_decorators_and_messages_are_left_out(
    tmp_path: Path, text: str, behaves: bool
) -> None:
    file = tmp_path / "half.py"
    file.write_text(SOURCE)
    lines = [number for number, line in enumerate(SOURCE.splitlines(), 1) if text in line]
    assert len(lines) == 1
    start = SOURCE.splitlines()[lines[0] - 1].index(text)
    mutation = SimpleNamespace(
        module_path=file,
        operator_name="core/NumberReplacer",
        start_pos=(lines[0], start),
        end_pos=(lines[0], start + len(text)),
    )
    assert mutants.behaves(mutation) is behaves
