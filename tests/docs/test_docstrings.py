"""The examples in docstrings print their stated output."""

import doctest
import importlib
from pathlib import Path

import pytest

import jaxenstein

PACKAGE = Path(jaxenstein.__file__).parent
WITH_EXAMPLES = sorted(
    path.relative_to(PACKAGE.parent).with_suffix("")
    for path in PACKAGE.rglob("*.py")
    if ">>> " in path.read_text(encoding="utf-8")
)


@pytest.mark.parametrize("path", WITH_EXAMPLES, ids=str)
@pytest.mark.usefixtures("plain_frames")
def test_examples(path: Path) -> None:
    if "baselines" in path.parts:
        pytest.importorskip("flax")
    module = importlib.import_module(".".join(path.parts))
    result = doctest.testmod(module, optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert result.attempted > 0
    assert result.failed == 0
