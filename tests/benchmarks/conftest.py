import os
from pathlib import Path

import pytest

from benchmarks import interleave


@pytest.fixture
def fake_subjects(monkeypatch):
    """Workers run a stand-in for the subjects, which says what it measures."""
    monkeypatch.setattr(interleave, "SCRIPT", Path(__file__).with_name("fake_subject.py"))
    # Others may use the cores meanwhile.
    monkeypatch.setattr(interleave, "DISTURBED", float(os.cpu_count() or 1))
