import os
from pathlib import Path

import pytest

from benchmarks.suites import worker


@pytest.fixture
def fake_subjects(monkeypatch):
    """Workers run a stand-in for the subjects, which says what it measures."""
    program = (str(Path(__file__).with_name("fake_subject.py")),)
    monkeypatch.setattr(worker, "PROGRAM", program)
    # Others may use the cores meanwhile.
    monkeypatch.setattr(worker, "DISTURBED", float(os.cpu_count() or 1))
